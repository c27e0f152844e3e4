//! The thin layer over Vulkan 1.3 compute: device, buffers, kernels, recordings. It knows slots and features, not
//! scenes, and it is the only place with `unsafe`.
//!
//! Everything here keeps what it uses alive, so any order of dropping is right; only [`Commands`] in a caller's command
//! buffer leave that to the caller. Nothing is global: a process may open several devices.

#![deny(clippy::undocumented_unsafe_blocks)]

mod buffer;
mod clock;
mod commands;
mod counters;
mod device;
mod executables;
mod host;
mod instance;
mod kernel;
mod memory;
mod profiling;
mod recorder;
mod requirements;

pub use buffer::{Buffer, Location, download, download_to, upload};
pub use clock::{Clock, Moment};
pub use commands::{Commands, Extent, Timestamps};
pub use counters::Counter;
pub use device::{Device, DeviceOptions, RawDevice};
pub use executables::{Executable, Statistic};
pub(crate) use host::give_back_freed;
pub use instance::{DeviceInfo, DeviceKind, ValidationLog};
pub use kernel::{Bindings, Kernel, Layout};
pub use memory::{Allocation, Allocator, MemoryRequest};
pub use recorder::{Recorder, Scope, Timing};
pub use requirements::Requirements;

use crate::{Error, Result};
use ash::vk;
use std::ffi::CString;

/// Ends the process at once, without the exit handlers: a software driver's free what its threads still work with.
pub fn leave(code: i32) -> ! {
    // SAFETY: nothing of this process runs afterwards.
    unsafe { libc::_exit(code) }
}

/// Names the step in the error of a Vulkan call.
trait During<T> {
    fn during(self, step: impl Into<String>) -> Result<T>;
}

impl<T> During<T> for std::result::Result<T, vk::Result> {
    fn during(self, step: impl Into<String>) -> Result<T> {
        self.map_err(|result| Error::Vulkan { step: step.into(), result })
    }
}

/// A name for debuggers. A NUL inside would end it early, so such a name is dropped.
fn c_name(name: &str) -> CString {
    CString::new(name).unwrap_or_default()
}
