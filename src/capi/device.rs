//! Requirements, a caller's device, and his allocator.

use crate::{
    Failure, PFN_vkGetInstanceProcAddr, TranslucentResult, VkBool32, VkDevice, VkDeviceCreateInfo, VkDeviceMemory,
    VkDeviceSize, VkInstance, VkMemoryPropertyFlags, VkMemoryRequirements, VkPhysicalDevice,
    VkPhysicalDeviceVulkan12Features, VkPhysicalDeviceVulkan13Features, VkPipelineCache, VkQueue, VkResult, argument,
    create, destroy, exclusive, guard, read,
};
use engine::{
    Device, Error,
    ash::{
        self,
        vk::{self, Handle},
    },
    gpu::{Allocation, Allocator, Location, MemoryRequest, RawDevice, Requirements},
};
use std::{
    ffi::{CString, c_char, c_void},
    ptr::NonNull,
    sync::Arc,
};

/// What an instance and a device must have been made with, or may be. Known before there are any.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct TranslucentRequirements {
    /// sizeof(TranslucentRequirements), set by the caller; the rest is filled in.
    pub struct_size: usize,
    /// VkApplicationInfo::apiVersion and the device's must be at least this.
    pub api_version: u32,
    /// Device extensions that must be enabled.
    pub extension_count: u32,
    pub extensions: *const *const c_char,
    /// Device extensions of which use is made if they are enabled.
    pub optional_extension_count: u32,
    pub optional_extensions: *const *const c_char,
    /// Instance extensions of which use is made if they are enabled.
    pub optional_instance_extension_count: u32,
    pub optional_instance_extensions: *const *const c_char,
    /// Names of the device features that must be enabled; translucent_enable_features sets them.
    pub feature_count: u32,
    pub features: *const *const c_char,
}

/// C strings that last as long as the library.
struct Names([*const c_char; 3]);

// SAFETY: constant text.
unsafe impl Sync for Names {}

static HOST_MEMORY: Names = Names([c"VK_EXT_external_memory_host".as_ptr(), std::ptr::null(), std::ptr::null()]);
static DEBUG_UTILS: Names = Names([c"VK_EXT_debug_utils".as_ptr(), std::ptr::null(), std::ptr::null()]);
static FEATURES: Names = Names([c"scalarBlockLayout".as_ptr(), c"synchronization2".as_ptr(), c"maintenance4".as_ptr()]);

/// Fills in what is required. The texts last as long as the library.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn translucent_requirements(requirements: *mut TranslucentRequirements) -> TranslucentResult {
    guard(|| {
        // SAFETY: the caller's pointer, as the header says.
        unsafe {
            let known = read(requirements, "requirements")?;
            let required = Requirements::new();
            let counts = (required.extensions.len(), required.optional_extensions.len(), required.features.len());
            assert_eq!(counts, (0, 1, 3), "the lists above are those of the engine");
            *requirements = TranslucentRequirements {
                api_version: required.api_version,
                extension_count: 0,
                extensions: HOST_MEMORY.0.as_ptr(),
                optional_extension_count: 1,
                optional_extensions: HOST_MEMORY.0.as_ptr(),
                optional_instance_extension_count: 1,
                optional_instance_extensions: DEBUG_UTILS.0.as_ptr(),
                feature_count: 3,
                features: FEATURES.0.as_ptr(),
                ..known
            };
        }
        Ok(())
    })
}

/// Sets the required features in structures that the caller chains into his VkDeviceCreateInfo, and leaves the others.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn translucent_enable_features(
    features12: *mut VkPhysicalDeviceVulkan12Features,
    features13: *mut VkPhysicalDeviceVulkan13Features,
) -> TranslucentResult {
    guard(|| {
        // SAFETY: the caller's pointers, as the header says.
        let (features12, features13) =
            unsafe { (exclusive(features12, "features12")?, exclusive(features13, "features13")?) };
        Requirements::new().enable(features12, features13);
        Ok(())
    })
}

/// OK for a physical device that can be used; DEVICE for one that lacks something, which translucent_last_error lists.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn translucent_check_physical_device(
    get_instance_proc_addr: PFN_vkGetInstanceProcAddr,
    instance: VkInstance,
    physical_device: VkPhysicalDevice,
) -> TranslucentResult {
    guard(|| {
        let get_instance_proc_addr =
            get_instance_proc_addr.ok_or_else(|| argument("get_instance_proc_addr is null"))?;
        if instance.is_null() || physical_device.is_null() {
            return Err(argument("a handle is null"));
        }
        // SAFETY: the caller's handles, as the header says.
        let missing = unsafe {
            let instance = ash::Instance::load(&ash::StaticFn { get_instance_proc_addr }, instance);
            Requirements::new().missing(&instance, physical_device)
        };
        if missing.is_empty() { Ok(()) } else { Err(Error::Device(format!("it lacks {}", missing.join(", "))).into()) }
    })
}

/// Where a buffer's memory has to be.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TranslucentLocation {
    /// On the device; the host need not reach it.
    Device = 0,
    /// Where the host can write it: mapped and coherent.
    Upload = 1,
    /// Where the host can read it: mapped and coherent.
    Readback = 2,
}

/// A piece of device memory.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct TranslucentAllocation {
    pub memory: VkDeviceMemory,
    /// Bytes from the start of memory, aligned as was asked for.
    pub offset: VkDeviceSize,
    /// Where offset is mapped; null if it is not.
    pub mapped: *mut c_void,
    /// Of the memory's type.
    pub properties: VkMemoryPropertyFlags,
    /// Whatever the allocator wants back.
    pub token: *mut c_void,
}

/// A caller's allocator of device memory. Its functions may be called from any thread that uses the library.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct TranslucentAllocator {
    /// sizeof(TranslucentAllocator).
    pub struct_size: usize,
    /// First argument of both functions.
    pub user: *mut c_void,
    /// Fills in memory for one buffer; VK_SUCCESS or why not.
    pub allocate: Option<
        unsafe extern "C" fn(
            user: *mut c_void,
            requirements: *const VkMemoryRequirements,
            location: TranslucentLocation,
            name: *const c_char,
            allocation: *mut TranslucentAllocation,
        ) -> VkResult,
    >,
    /// Takes it back; the buffer is gone.
    pub free: Option<unsafe extern "C" fn(user: *mut c_void, allocation: *const TranslucentAllocation)>,
}

// SAFETY: the caller promises that his functions may be called from any thread.
unsafe impl Send for TranslucentAllocator {}
// SAFETY: as above.
unsafe impl Sync for TranslucentAllocator {}

/// The token of an allocation, which is only carried.
struct Token(*mut c_void);

// SAFETY: nobody follows it but the caller's allocator.
unsafe impl Send for Token {}
// SAFETY: as above.
unsafe impl Sync for Token {}

// SAFETY: as the caller promises of his functions.
unsafe impl Allocator for TranslucentAllocator {
    fn allocate(&self, request: &MemoryRequest) -> Result<Allocation, String> {
        let location = match request.location {
            Location::Device | Location::Scratch => TranslucentLocation::Device,
            Location::Upload => TranslucentLocation::Upload,
            Location::Readback => TranslucentLocation::Readback,
        };
        let mut given = TranslucentAllocation {
            memory: vk::DeviceMemory::null(),
            offset: 0,
            mapped: std::ptr::null_mut(),
            properties: vk::MemoryPropertyFlags::empty(),
            token: std::ptr::null_mut(),
        };
        let name = CString::new(request.name).unwrap_or_default();
        let allocate = self.allocate.ok_or("no function")?;
        // SAFETY: all pointers outlive the call.
        match unsafe { allocate(self.user, &request.requirements, location, name.as_ptr(), &mut given) } {
            vk::Result::SUCCESS => Ok(Allocation {
                memory: given.memory,
                offset: given.offset,
                mapped: NonNull::new(given.mapped.cast()),
                properties: given.properties,
                token: Some(Box::new(Token(given.token))),
            }),
            why => Err(format!("the caller's allocator: {why}")),
        }
    }

    fn free(&self, allocation: Allocation) {
        let token = allocation.token.and_then(|token| token.downcast::<Token>().ok());
        let given = TranslucentAllocation {
            memory: allocation.memory,
            offset: allocation.offset,
            mapped: allocation.mapped.map_or(std::ptr::null_mut(), |start| start.as_ptr().cast()),
            properties: allocation.properties,
            token: token.map_or(std::ptr::null_mut(), |token| token.0),
        };
        if let Some(free) = self.free {
            // SAFETY: the pointer outlives the call.
            unsafe { free(self.user, &given) };
        }
    }
}

/// A Vulkan device that the caller made and keeps. It, its instance and their loader must outlive the TranslucentDevice
/// and all that is made from it.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct TranslucentDeviceInfo {
    /// sizeof(TranslucentDeviceInfo).
    pub struct_size: usize,
    /// The loader's function. This library links to no Vulkan.
    pub get_instance_proc_addr: PFN_vkGetInstanceProcAddr,
    pub instance: VkInstance,
    pub physical_device: VkPhysicalDevice,
    pub device: VkDevice,
    /// A family with compute, whose queues run what is recorded.
    pub queue_family: u32,
    /// A queue of that family, or null. translucent_renderer_create, _render and _write submit to it and wait, and
    /// nobody else may use it meanwhile; recording never does. Without one, buffers that the host fills are in memory
    /// that it reaches, and _render and _write fail.
    pub queue: VkQueue,
    /// What the device was made with, so that a missing feature is named and VK_EXT_external_memory_host used where it
    /// is enabled; null: the caller is trusted.
    pub created_with: *const VkDeviceCreateInfo,
    /// Used for every pipeline, from several threads at once, so not VK_PIPELINE_CACHE_CREATE_EXTERNALLY_SYNCHRONIZED;
    /// may be null.
    pub pipeline_cache: VkPipelineCache,
    /// VK_TRUE if VK_EXT_debug_utils is enabled in the instance: objects get names and dispatches labels.
    pub debug_utils: VkBool32,
    /// Where device memory comes from; null: an allocator of the library's. The struct is copied.
    pub allocator: *const TranslucentAllocator,
}

/// A device. May be used from several threads at once.
pub struct TranslucentDevice(pub(crate) Device);

/// Makes a TranslucentDevice of the caller's handles.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn translucent_device_create(
    info: *const TranslucentDeviceInfo,
    out: *mut *mut TranslucentDevice,
) -> TranslucentResult {
    // SAFETY: the caller's pointers and handles, as the header says.
    unsafe { create(out, || device(info).map(TranslucentDevice)) }
}

unsafe fn device(info: *const TranslucentDeviceInfo) -> Result<Device, Failure> {
    // SAFETY: the caller's pointers and handles, as the header says.
    unsafe {
        let info = read(info, "info")?;
        let get = info.get_instance_proc_addr.ok_or_else(|| argument("info.get_instance_proc_addr is null"))?;
        if info.instance.is_null() || info.physical_device.is_null() || info.device.is_null() {
            return Err(argument("a handle of info is null"));
        }
        let allocator: Option<Arc<dyn Allocator>> = match info.allocator.is_null() {
            true => None,
            false => match read(info.allocator, "info.allocator")? {
                given if given.allocate.is_some() && given.free.is_some() => Some(Arc::new(given)),
                _ => return Err(argument("a function of info.allocator is null")),
            },
        };
        let raw = RawDevice::load(get, info.instance, info.physical_device, info.device, info.queue_family);
        Ok(Device::from_raw(RawDevice {
            queue: Some(info.queue).filter(|queue| !queue.is_null()),
            created_with: info.created_with.as_ref(),
            debug_utils: info.debug_utils != vk::FALSE,
            allocator,
            pipeline_cache: info.pipeline_cache,
            ..raw
        })?)
    }
}

/// Destroys it; scenes and renderers live on. Null is ignored.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn translucent_device_destroy(device: *mut TranslucentDevice) {
    // SAFETY: the caller's handle, as the header says.
    unsafe { destroy(device) }
}
