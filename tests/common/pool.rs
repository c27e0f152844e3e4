//! What tests share, in as many copies as small machines have cores: a software driver compiles a kernel on one.

use std::sync::{
    Mutex, MutexGuard, OnceLock,
    atomic::{AtomicUsize, Ordering},
};

pub type Pool<T> = [OnceLock<Mutex<T>>; 2];

/// The copy that belongs to the calling thread, that is to the test, for it alone as long as it is held.
pub fn own<T>(pool: &'static Pool<T>, make: impl FnOnce() -> T) -> MutexGuard<'static, T> {
    static NEXT: AtomicUsize = AtomicUsize::new(0);
    thread_local!(static MINE: usize = NEXT.fetch_add(1, Ordering::Relaxed));
    let copy = &pool[MINE.with(|mine| mine % pool.len())];
    copy.get_or_init(|| Mutex::new(make())).lock().unwrap_or_else(|poisoned| poisoned.into_inner())
}
