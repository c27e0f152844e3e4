//! The C interface: include/translucent.h is made of this crate's declarations and their comments.
//!
//! Every function catches panics, checks its pointers and the sizes of structs, and leaves the reason of a failure in
//! [`translucent_last_error`].

#![deny(clippy::undocumented_unsafe_blocks)]
// What every function asks of its pointers stands once, at the top of the header.
#![allow(clippy::missing_safety_doc, non_camel_case_types, non_upper_case_globals)]

pub mod device;
pub mod meshes;
pub mod renderer;
pub mod scene;
pub mod update;

use engine::{Error, ash::vk};
use std::{
    any::Any,
    cell::RefCell,
    ffi::{CStr, CString, c_char},
    panic::{AssertUnwindSafe, catch_unwind},
};

pub type PFN_vkGetInstanceProcAddr = Option<vk::PFN_vkGetInstanceProcAddr>;
pub type VkInstance = vk::Instance;
pub type VkPhysicalDevice = vk::PhysicalDevice;
pub type VkDevice = vk::Device;
pub type VkQueue = vk::Queue;
pub type VkPipelineCache = vk::PipelineCache;
pub type VkDeviceCreateInfo = vk::DeviceCreateInfo<'static>;
pub type VkPhysicalDeviceVulkan12Features = vk::PhysicalDeviceVulkan12Features<'static>;
pub type VkPhysicalDeviceVulkan13Features = vk::PhysicalDeviceVulkan13Features<'static>;
pub type VkMemoryRequirements = vk::MemoryRequirements;
pub type VkDeviceMemory = vk::DeviceMemory;
pub type VkMemoryPropertyFlags = vk::MemoryPropertyFlags;
pub type VkResult = vk::Result;
pub type VkCommandBuffer = vk::CommandBuffer;
pub type VkQueryPool = vk::QueryPool;
pub type VkBuffer = vk::Buffer;
pub type VkImage = vk::Image;
pub type VkImageLayout = vk::ImageLayout;
pub type VkDeviceSize = vk::DeviceSize;
pub type VkBool32 = vk::Bool32;

/// What a function returns. After anything but OK, translucent_last_error says why, and nothing was made or changed.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TranslucentResult {
    Ok = 0,
    /// A null pointer, a text that is not UTF-8, or a struct_size that this version does not know.
    Argument = 1,
    /// The scene or a setting is at fault.
    Input = 2,
    /// A file could not be read or written.
    File = 3,
    /// The device lacks something, or was made without it.
    Device = 4,
    /// A Vulkan call failed.
    Vulkan = 5,
    /// Device memory could not be had.
    Memory = 6,
    /// A fault of this library.
    Panic = 7,
}

/// Version of this header; translucent_version is that of the library.
pub const TRANSLUCENT_VERSION: u32 = 1 << 12;

/// Version of the library: major << 22 | minor << 12 | patch, as VK_MAKE_API_VERSION with variant 0.
#[unsafe(no_mangle)]
pub extern "C" fn translucent_version() -> u32 {
    TRANSLUCENT_VERSION
}

thread_local! {
    static LAST: RefCell<CString> = RefCell::default();
}

/// Why the last function of this thread that failed did; empty if none has. Valid until another fails in this thread.
#[unsafe(no_mangle)]
pub extern "C" fn translucent_last_error() -> *const c_char {
    LAST.with(|last| last.borrow().as_ptr())
}

/// Why a function fails.
enum Failure {
    Argument(String),
    Engine(Error),
}

impl From<Error> for Failure {
    fn from(error: Error) -> Failure {
        Failure::Engine(error)
    }
}

fn argument(problem: impl Into<String>) -> Failure {
    Failure::Argument(problem.into())
}

/// Runs a function's work; no panic leaves it.
fn guard(work: impl FnOnce() -> Result<(), Failure>) -> TranslucentResult {
    let (result, message) = match catch_unwind(AssertUnwindSafe(work)) {
        Ok(Ok(())) => return TranslucentResult::Ok,
        Ok(Err(Failure::Argument(problem))) => (TranslucentResult::Argument, problem),
        Ok(Err(Failure::Engine(error))) => {
            let result = match &error {
                Error::Scene { .. } | Error::Setting { .. } => TranslucentResult::Input,
                Error::File { .. } => TranslucentResult::File,
                Error::Device(_) => TranslucentResult::Device,
                Error::Memory { .. } => TranslucentResult::Memory,
                _ => TranslucentResult::Vulkan,
            };
            (result, error.to_string())
        }
        Err(panic) => (TranslucentResult::Panic, format!("a fault of translucent: {}", text_of(&*panic))),
    };
    let message = CString::new(message.replace('\0', " ")).unwrap_or_default();
    LAST.with(|last| *last.borrow_mut() = message);
    result
}

fn text_of(panic: &(dyn Any + Send)) -> &str {
    panic.downcast_ref::<String>().map(String::as_str).or_else(|| panic.downcast_ref().copied()).unwrap_or("unknown")
}

/// The struct at `pointer`, whose first member is its size.
///
/// # Safety
/// `pointer` is null or points to as many bytes as that member says.
unsafe fn read<T: Copy>(pointer: *const T, name: &str) -> Result<T, Failure> {
    if pointer.is_null() {
        return Err(argument(format!("{name} is null")));
    }
    // SAFETY: every struct begins with its size.
    let size = unsafe { pointer.cast::<usize>().read() };
    if size != size_of::<T>() {
        return Err(argument(format!("{name}.struct_size is {size}; this version knows {}", size_of::<T>())));
    }
    // SAFETY: it has that many bytes.
    Ok(unsafe { pointer.read() })
}

/// What `pointer` points to.
///
/// # Safety
/// `pointer` is null or valid for as long as the reference is used.
unsafe fn reference<'a, T>(pointer: *const T, name: &str) -> Result<&'a T, Failure> {
    // SAFETY: as the caller promises.
    unsafe { pointer.as_ref() }.ok_or_else(|| argument(format!("{name} is null")))
}

/// As [`reference`], for a handle that nobody else uses.
///
/// # Safety
/// As [`reference`], and nothing else refers to it.
unsafe fn exclusive<'a, T>(pointer: *mut T, name: &str) -> Result<&'a mut T, Failure> {
    // SAFETY: as the caller promises.
    unsafe { pointer.as_mut() }.ok_or_else(|| argument(format!("{name} is null")))
}

/// The text at `pointer`, none for null.
///
/// # Safety
/// `pointer` is null or points to a C string that lives as long as the text is used.
unsafe fn text<'a>(pointer: *const c_char, name: &str) -> Result<Option<&'a str>, Failure> {
    if pointer.is_null() {
        return Ok(None);
    }
    // SAFETY: as the caller promises.
    let text = unsafe { CStr::from_ptr(pointer) };
    text.to_str().map(Some).map_err(|_| argument(format!("{name} is not UTF-8")))
}

/// `count` elements at `pointer`, which may be null if there are none.
///
/// # Safety
/// `pointer` is valid for that many elements, for as long as the slice is used.
unsafe fn slice<'a, T>(pointer: *const T, count: usize, name: &str) -> Result<&'a [T], Failure> {
    match (pointer.is_null(), count) {
        (_, 0) => Ok(&[]),
        (true, _) => Err(argument(format!("{name} is null"))),
        // SAFETY: as the caller promises.
        (false, _) => Ok(unsafe { std::slice::from_raw_parts(pointer, count) }),
    }
}

/// Puts what `make` makes into a handle at `out`.
///
/// # Safety
/// `out` is null or may be written.
unsafe fn create<T>(out: *mut *mut T, make: impl FnOnce() -> Result<T, Failure>) -> TranslucentResult {
    guard(|| {
        // SAFETY: as the caller promises.
        let out = unsafe { exclusive(out, "out") }?;
        *out = std::ptr::null_mut();
        *out = Box::into_raw(Box::new(make()?));
        Ok(())
    })
}

/// Destroys what [`create`] made.
///
/// # Safety
/// `handle` is null or from [`create`], and not used any more.
unsafe fn destroy<T>(handle: *mut T) {
    if !handle.is_null() {
        // SAFETY: as the caller promises. There is nobody to tell of a panic while destroying.
        let _ = guard(|| {
            // SAFETY: as above.
            drop(unsafe { Box::from_raw(handle) });
            Ok(())
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_becomes_an_error() {
        assert_eq!(guard(|| panic!("one {}", "two")), TranslucentResult::Panic);
        // SAFETY: the text is this thread's.
        let text = unsafe { CStr::from_ptr(translucent_last_error()) };
        assert_eq!(text, c"a fault of translucent: one two");
        assert_eq!(guard(|| Ok(())), TranslucentResult::Ok);
    }
}
