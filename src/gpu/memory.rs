//! Where device memory comes from: gpu-allocator, or an allocator of the caller's; and how much is left of it.

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

/// The memory heap that device buffers come from.
pub(super) struct Heap {
    pub bytes: u64,
    index: usize,
    /// To be asked how much of it is left; none without VK_EXT_memory_budget.
    budget: Option<(ash::Instance, vk::PhysicalDevice)>,
}

impl Heap {
    /// The largest from which a buffer like ours can come, device-local if there is one.
    pub fn of(
        device: &ash::Device,
        heaps: &vk::PhysicalDeviceMemoryProperties,
        budget: Option<(ash::Instance, vk::PhysicalDevice)>,
    ) -> Heap {
        let create = super::buffer::create_info(4);
        let query = vk::DeviceBufferMemoryRequirements::default().create_info(&create);
        let mut needs = vk::MemoryRequirements2::default();
        // SAFETY: the device speaks Vulkan 1.3 with maintenance4; the structures outlive the call.
        unsafe { device.get_device_buffer_memory_requirements(&query, &mut needs) };
        let types = heaps.memory_types_as_slice().iter().enumerate();
        let (_, bytes, index) = types
            .filter(|(i, _)| needs.memory_requirements.memory_type_bits & (1 << i) != 0)
            .map(|(_, kind)| {
                let local = kind.property_flags.contains(vk::MemoryPropertyFlags::DEVICE_LOCAL);
                let index = kind.heap_index as usize;
                (local, heaps.memory_heaps[index].size, index)
            })
            .max()
            .unwrap_or_default();
        Heap { bytes, index, budget }
    }

    /// Bytes that this process may still take.
    pub fn left(&self) -> u64 {
        let Some((instance, physical)) = &self.budget else { return self.bytes };
        let mut budget = vk::PhysicalDeviceMemoryBudgetPropertiesEXT::default();
        let mut properties = vk::PhysicalDeviceMemoryProperties2::default().push_next(&mut budget);
        // SAFETY: the physical device is of this instance and has the extension; the structures outlive the call.
        unsafe { instance.get_physical_device_memory_properties2(*physical, &mut properties) };
        budget.heap_budget[self.index].saturating_sub(budget.heap_usage[self.index]).min(self.bytes)
    }
}
