//! Where device memory comes from: gpu-allocator, or an allocator of the caller's.

use super::{Location, device::lock};
use ash::vk;
use gpu_allocator::{AllocationError, MemoryLocation, vulkan as memory};
use std::{any::Any, ptr::NonNull, sync::Mutex};

/// A piece of device memory that is asked for, for one buffer.
#[derive(Clone, Copy, Debug)]
pub struct MemoryRequest<'a> {
    /// The buffer's name.
    pub name: &'a str,
    pub requirements: vk::MemoryRequirements,
    /// `Upload` and `Readback` must be mapped and coherent. `Device` and `Scratch` may be.
    pub location: Location,
}

/// A piece of device memory.
#[derive(Debug)]
pub struct Allocation {
    pub memory: vk::DeviceMemory,
    /// Bytes from the start of `memory`, aligned as was asked for.
    pub offset: u64,
    /// Where `offset` is mapped; none if it is not.
    pub mapped: Option<NonNull<u8>>,
    /// Of the memory's type.
    pub properties: vk::MemoryPropertyFlags,
    /// Whatever the allocator wants back in [`Allocator::free`].
    pub token: Option<Box<dyn Any + Send + Sync>>,
}

// SAFETY: the pointer is only an address; who follows it sees to its use.
unsafe impl Send for Allocation {}
// SAFETY: as above.
unsafe impl Sync for Allocation {}

/// A source of device memory, of the device that uses it. `Mutex<gpu_allocator::vulkan::Allocator>` is one, so an
/// application that has it in an `Arc` hands over a clone. It may be called from any thread.
///
/// # Safety
/// What it gives out must be as [`Allocation`] says, of the device in question, and untouched by others until it is
/// given to `free`.
pub unsafe trait Allocator: Send + Sync {
    /// Memory for one buffer.
    ///
    /// # Errors
    /// The reason in words.
    fn allocate(&self, request: &MemoryRequest) -> Result<Allocation, String>;

    /// Takes back what `allocate` gave; the buffer is gone.
    fn free(&self, allocation: Allocation);
}

// SAFETY: gpu-allocator keeps the promises, and frees what it gave out.
unsafe impl Allocator for Mutex<memory::Allocator> {
    fn allocate(&self, request: &MemoryRequest) -> Result<Allocation, String> {
        let description = memory::AllocationCreateDesc {
            name: request.name,
            requirements: request.requirements,
            location: match request.location {
                Location::Device | Location::Scratch => MemoryLocation::GpuOnly,
                Location::Upload => MemoryLocation::CpuToGpu,
                Location::Readback => MemoryLocation::GpuToCpu,
            },
            linear: true,
            allocation_scheme: memory::AllocationScheme::GpuAllocatorManaged,
        };
        let given = lock(self).allocate(&description).map_err(|error| match error {
            AllocationError::OutOfMemory => {
                format!("no device memory is left for {} bytes", request.requirements.size)
            }
            other => other.to_string(),
        })?;
        Ok(Allocation {
            // SAFETY: it is bound to one buffer and not freed or mapped by hand.
            memory: unsafe { given.memory() },
            offset: given.offset(),
            mapped: given.mapped_ptr().map(NonNull::cast),
            properties: given.memory_properties(),
            token: Some(Box::new(given)),
        })
    }

    fn free(&self, allocation: Allocation) {
        let given = allocation.token.and_then(|token| token.downcast::<memory::Allocation>().ok());
        let freed = given.map(|given| lock(self).free(*given));
        debug_assert!(matches!(freed, Some(Ok(()))), "an allocation is freed once, by its allocator");
    }
}
