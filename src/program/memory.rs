//! Out of memory ends the program with a message and status 1, where Rust would abort.

use std::{
    alloc::{GlobalAlloc, Layout, System},
    io::Write,
    process::exit,
};

/// The system's allocator; a request that it cannot meet is the program's last.
struct Last;

#[global_allocator]
static ALLOCATOR: Last = Last;

// SAFETY: every request goes to the system's allocator as it came.
unsafe impl GlobalAlloc for Last {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        // SAFETY: as the caller promises; so below.
        given(unsafe { System.alloc(layout) }, layout.size())
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        // SAFETY: as above.
        given(unsafe { System.alloc_zeroed(layout) }, layout.size())
    }

    unsafe fn realloc(&self, start: *mut u8, layout: Layout, bytes: usize) -> *mut u8 {
        // SAFETY: as above.
        given(unsafe { System.realloc(start, layout, bytes) }, bytes)
    }

    unsafe fn dealloc(&self, start: *mut u8, layout: Layout) {
        // SAFETY: as above.
        unsafe { System.dealloc(start, layout) };
    }
}

/// `start`, unless there is no memory there. Nothing here allocates.
fn given(start: *mut u8, bytes: usize) -> *mut u8 {
    if start.is_null() {
        let mut text = [0; 160];
        let mut rest = &mut text[..];
        let _ = writeln!(
            rest,
            "error: out of memory: {:.1} MB more are needed; lower the resolution or crop, or use a smaller scene",
            bytes as f64 * 1e-6
        );
        let _ = std::io::stderr().write_all(text.split(|byte| *byte == 0).next().unwrap_or_default());
        exit(1);
    }
    start
}
