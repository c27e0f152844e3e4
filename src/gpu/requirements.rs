//! What a device must have: to be asked before there is one, and checked when a caller brings his own.

use super::instance::{describe, version_text};
use crate::{Error, Result};
use ash::{ext, vk};
use std::ffi::{CStr, c_void};

/// What an instance and a device must have been made with, or may be.
///
/// ```
/// use translucent::{ash::vk, gpu::Requirements};
///
/// let mut requirements = Requirements::new();
/// let queues = [vk::DeviceQueueCreateInfo::default().queue_family_index(0).queue_priorities(&[1.0])];
/// let create = requirements.chain(vk::DeviceCreateInfo::default().queue_create_infos(&queues));
/// assert!(!create.p_next.is_null());
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Requirements {
    /// Of the instance (`VkApplicationInfo::apiVersion`) and the device.
    pub api_version: u32,
    /// Device extensions that must be enabled; none today.
    pub extensions: &'static [&'static CStr],
    /// Device extensions of which use is made if they are enabled: VK_EXT_external_memory_host.
    pub optional_extensions: &'static [&'static CStr],
    /// Instance extensions of which use is made if they are enabled: VK_EXT_debug_utils.
    pub optional_instance_extensions: &'static [&'static CStr],
    /// Names of the device features that must be enabled.
    pub features: [&'static str; 3],
    features12: vk::PhysicalDeviceVulkan12Features<'static>,
    features13: vk::PhysicalDeviceVulkan13Features<'static>,
}

// SAFETY: the structures' pointers are null until `chain` borrows the value exclusively.
unsafe impl Send for Requirements {}
// SAFETY: as above.
unsafe impl Sync for Requirements {}

impl Default for Requirements {
    fn default() -> Self {
        Requirements::new()
    }
}

impl Requirements {
    /// What this version requires. No Vulkan is called.
    pub fn new() -> Requirements {
        let mut features12 = vk::PhysicalDeviceVulkan12Features::default();
        let mut features13 = vk::PhysicalDeviceVulkan13Features::default();
        enable(&mut features12, &mut features13);
        Requirements {
            api_version: vk::API_VERSION_1_3,
            extensions: &[],
            optional_extensions: &[ext::external_memory_host::NAME],
            optional_instance_extensions: &[ext::debug_utils::NAME],
            features: ["scalarBlockLayout", "synchronization2", "maintenance4"],
            features12,
            features13,
        }
    }

    /// `create` with the features chained to it. Whoever chains structures of Vulkan 1.2 and 1.3 already sets the
    /// features there instead, by [`Requirements::enable`]: a structure may stand in a chain once.
    pub fn chain<'a>(&'a mut self, create: vk::DeviceCreateInfo<'a>) -> vk::DeviceCreateInfo<'a> {
        create.push_next(&mut self.features12).push_next(&mut self.features13)
    }

    /// Sets the required features and leaves the others.
    pub fn enable(
        &self,
        features12: &mut vk::PhysicalDeviceVulkan12Features,
        features13: &mut vk::PhysicalDeviceVulkan13Features,
    ) {
        enable(features12, features13);
    }

    /// What a physical device lacks, in words; nothing for one that can be used.
    ///
    /// # Safety
    /// `physical` is of `instance`, which is alive and was made for Vulkan 1.1 or later.
    pub unsafe fn missing(&self, instance: &ash::Instance, physical: vk::PhysicalDevice) -> Vec<String> {
        describe(instance, 0, physical).info.lacks
    }
}

fn enable(features12: &mut vk::PhysicalDeviceVulkan12Features, features13: &mut vk::PhysicalDeviceVulkan13Features) {
    features12.scalar_block_layout = vk::TRUE;
    features13.synchronization2 = vk::TRUE;
    // Lets the workgroup size be a specialization constant.
    features13.maintenance4 = vk::TRUE;
}

/// What the device's `VkDeviceCreateInfo` tells.
pub(super) struct Enabled {
    pub host_import: bool,
}

/// Checks that the features were enabled and the family has a queue.
///
/// # Safety
/// Every pointer of `create` is valid.
pub(super) unsafe fn check(create: &vk::DeviceCreateInfo, family: u32) -> Result<Enabled> {
    let mut has = [false; 3];
    let mut next = create.p_next;
    while !next.is_null() {
        // SAFETY: every structure of a chain begins with its type and the pointer to the next.
        let head = unsafe { &*next.cast::<vk::BaseInStructure>() };
        // SAFETY: the type says which structure it is.
        unsafe { note(head.s_type, next, &mut has) };
        next = head.p_next.cast();
    }
    let requirements = Requirements::new();
    let missing: Vec<&str> =
        requirements.features.into_iter().zip(has).filter(|(_, has)| !has).map(|(name, _)| name).collect();
    if !missing.is_empty() {
        let list = missing.join(", ");
        return Err(Error::Device(format!("the caller's device was made without the feature {list}")));
    }
    let queues = pointed(create.p_queue_create_infos, create.queue_create_info_count);
    // SAFETY: the caller says that pointer and count are valid.
    if !unsafe { queues.as_ref() }.iter().any(|queue| queue.queue_family_index == family) {
        return Err(Error::Device(format!("the caller's device was made without a queue of family {family}")));
    }
    let names = pointed(create.pp_enabled_extension_names, create.enabled_extension_count);
    // SAFETY: as above; each name is a C string.
    let host_import = unsafe { names.as_ref() }
        .iter()
        .any(|&name| unsafe { CStr::from_ptr(name) } == ext::external_memory_host::NAME);
    Ok(Enabled { host_import })
}

/// Vulkan's pointer and count as a slice, empty where the pointer may be null.
fn pointed<T>(start: *const T, count: u32) -> std::ptr::NonNull<[T]> {
    let start = std::ptr::NonNull::new(start.cast_mut());
    std::ptr::NonNull::slice_from_raw_parts(
        start.unwrap_or(std::ptr::NonNull::dangling()),
        if start.is_some() { count as usize } else { 0 },
    )
}

/// Notes which of [`Requirements::features`] a structure of a chain enables.
///
/// # Safety
/// `structure` points to what `kind` says.
unsafe fn note(kind: vk::StructureType, structure: *const c_void, has: &mut [bool; 3]) {
    let on = |flag: vk::Bool32| flag != vk::FALSE;
    // SAFETY: the type names the structure.
    unsafe {
        match kind {
            vk::StructureType::PHYSICAL_DEVICE_VULKAN_1_2_FEATURES => {
                has[0] |= on((*structure.cast::<vk::PhysicalDeviceVulkan12Features>()).scalar_block_layout);
            }
            vk::StructureType::PHYSICAL_DEVICE_SCALAR_BLOCK_LAYOUT_FEATURES => {
                has[0] |= on((*structure.cast::<vk::PhysicalDeviceScalarBlockLayoutFeatures>()).scalar_block_layout);
            }
            vk::StructureType::PHYSICAL_DEVICE_VULKAN_1_3_FEATURES => {
                let features = &*structure.cast::<vk::PhysicalDeviceVulkan13Features>();
                has[1] |= on(features.synchronization2);
                has[2] |= on(features.maintenance4);
            }
            vk::StructureType::PHYSICAL_DEVICE_SYNCHRONIZATION_2_FEATURES => {
                has[1] |= on((*structure.cast::<vk::PhysicalDeviceSynchronization2Features>()).synchronization2);
            }
            vk::StructureType::PHYSICAL_DEVICE_MAINTENANCE_4_FEATURES => {
                has[2] |= on((*structure.cast::<vk::PhysicalDeviceMaintenance4Features>()).maintenance4);
            }
            _ => {}
        }
    }
}

/// Whether the functions of Vulkan 1.3 can be called on `device`.
///
/// # Errors
/// [`Error::Device`] where the instance or the device was made for less.
pub(super) fn check_version(
    instance: &ash::Instance,
    device: &ash::Device,
    physical: vk::PhysicalDevice,
) -> Result<()> {
    // SAFETY: the caller's handles are alive and belong together.
    let (function, version) = unsafe {
        (
            instance.get_device_proc_addr(device.handle(), c"vkCmdPipelineBarrier2".as_ptr()),
            instance.get_physical_device_properties(physical).api_version,
        )
    };
    if function.is_none() {
        let problem = "the caller's instance was made for less than Vulkan 1.3 (VkApplicationInfo::apiVersion)";
        return Err(Error::Device(format!("{problem}; the device itself knows {}", version_text(version))));
    }
    Ok(())
}
