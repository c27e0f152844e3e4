//! The Vulkan instance: loader, validation layer, and the devices with what each lacks.

use super::During;
use crate::{
    Error, Result,
    shared::{Slot, Step},
};
use ash::{
    ext::{debug_utils, external_memory_host, memory_budget},
    vk,
};
use std::{
    ffi::{CStr, c_void},
    fmt,
    sync::{Arc, Mutex, PoisonError},
};

const VALIDATION_LAYER: &CStr = c"VK_LAYER_KHRONOS_validation";
const NO_DRIVER: &str = "no Vulkan driver is installed: install the GPU's, or Mesa's software driver \
                         (Debian: mesa-vulkan-drivers)";

/// What kind of device it is, in the order in which [`super::Device::open`] prefers them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum DeviceKind {
    Discrete,
    Integrated,
    Virtual,
    Cpu,
    Other,
}

impl fmt::Display for DeviceKind {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.pad(match self {
            DeviceKind::Discrete => "discrete GPU",
            DeviceKind::Integrated => "integrated GPU",
            DeviceKind::Virtual => "virtual GPU",
            DeviceKind::Cpu => "CPU",
            DeviceKind::Other => "other",
        })
    }
}

/// A Vulkan device of this machine.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DeviceInfo {
    /// Position in Vulkan's list.
    pub index: usize,
    pub name: String,
    /// The driver's name and version text.
    pub driver: String,
    pub kind: DeviceKind,
    /// `VkPhysicalDeviceIDProperties::deviceUUID`, in the usual 8-4-4-4-12 form.
    pub uuid: String,
    /// Newest Vulkan version that it speaks, "1.3.230".
    pub api_version: String,
    /// What it would need and has not, in words; empty for a device that can be used.
    pub lacks: Vec<String>,
}

impl fmt::Display for DeviceInfo {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "device {} \"{}\"", self.index, self.name)?;
        if self.lacks.is_empty() { Ok(()) } else { write!(f, " lacks {}", self.lacks.join(", ")) }
    }
}

/// Errors and warnings of the validation layer. It outlives its device, so that leaks show too.
#[derive(Clone, Debug, Default)]
pub struct ValidationLog(Arc<Mutex<Vec<String>>>);

impl ValidationLog {
    /// All messages so far.
    pub fn messages(&self) -> Vec<String> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }
}

/// An instance of our own, destroyed when it drops.
pub(super) struct Instance {
    pub raw: ash::Instance,
    /// VK_EXT_debug_utils is enabled: labels and object names work.
    pub debug_utils: bool,
    pub log: ValidationLog,
    messenger: Option<(debug_utils::Instance, vk::DebugUtilsMessengerEXT)>,
    // Holds the loader's library open for as long as the instance lives.
    pub entry: ash::Entry,
}

/// A physical device, and the queue family that we would use.
pub(super) struct Candidate {
    pub physical: vk::PhysicalDevice,
    pub family: u32,
    /// It has VK_EXT_external_memory_host.
    pub host_import: bool,
    /// It has VK_EXT_memory_budget, which only queries need and nobody has to enable.
    pub memory_budget: bool,
    pub info: DeviceInfo,
}

impl Instance {
    /// Loads Vulkan and makes an instance, with the validation layer where it is asked for.
    pub fn new(validation: bool) -> Result<Instance> {
        // SAFETY: loads the system's Vulkan loader, whose initialisers have no preconditions.
        let entry = unsafe { ash::Entry::load() }.map_err(|error| {
            Error::Device(format!("the Vulkan loader is missing ({error}): install it (Debian: libvulkan1)"))
        })?;
        // SAFETY: the entry is loaded; so it is for every call below.
        let version = unsafe { entry.try_enumerate_instance_version() }.during("read the loader's version")?;
        if version.unwrap_or(vk::API_VERSION_1_0) < vk::API_VERSION_1_1 {
            return Err(Error::Device("the Vulkan loader knows Vulkan 1.0 only; 1.3 is needed".into()));
        }
        if validation && !has_validation_layer(&entry)? {
            return Err(Error::Device(
                "validation was asked for, but the layer VK_LAYER_KHRONOS_validation is missing: install it \
                 (Debian: vulkan-validationlayers)"
                    .into(),
            ));
        }
        // SAFETY: as above.
        let extensions =
            unsafe { entry.enumerate_instance_extension_properties(None) }.during("list the instance's extensions")?;
        let debug_utils = extensions.iter().any(|e| e.extension_name_as_c_str() == Ok(debug_utils::NAME));

        let application = vk::ApplicationInfo::default()
            .application_name(c"translucent")
            .engine_name(c"translucent")
            .api_version(vk::API_VERSION_1_3);
        let mut names = Vec::new();
        let mut layers = Vec::new();
        if debug_utils {
            names.push(debug_utils::NAME.as_ptr());
        }
        if validation {
            layers.push(VALIDATION_LAYER.as_ptr());
            names.push(vk::EXT_VALIDATION_FEATURES_NAME.as_ptr());
        }
        let enables = [vk::ValidationFeatureEnableEXT::SYNCHRONIZATION_VALIDATION];
        let mut features = vk::ValidationFeaturesEXT::default().enabled_validation_features(&enables);
        let mut create = vk::InstanceCreateInfo::default()
            .application_info(&application)
            .enabled_layer_names(&layers)
            .enabled_extension_names(&names);
        if validation {
            create = create.push_next(&mut features);
        }
        // SAFETY: every pointer in `create` outlives the call.
        let raw = unsafe { entry.create_instance(&create, None) }.map_err(|result| match result {
            vk::Result::ERROR_INCOMPATIBLE_DRIVER => Error::Device(NO_DRIVER.into()),
            result => Error::Vulkan { step: "create the instance".into(), result },
        })?;
        let mut instance = Instance { raw, debug_utils, log: ValidationLog::default(), messenger: None, entry };
        if validation && debug_utils {
            instance.listen()?;
        }
        Ok(instance)
    }

    /// Lets the validation layer report into the log.
    fn listen(&mut self) -> Result<()> {
        let create = vk::DebugUtilsMessengerCreateInfoEXT::default()
            .message_severity(
                vk::DebugUtilsMessageSeverityFlagsEXT::ERROR | vk::DebugUtilsMessageSeverityFlagsEXT::WARNING,
            )
            .message_type(vk::DebugUtilsMessageTypeFlagsEXT::VALIDATION)
            .pfn_user_callback(Some(report))
            .user_data(Arc::as_ptr(&self.log.0).cast_mut().cast());
        let functions = debug_utils::Instance::new(&self.entry, &self.raw);
        // SAFETY: the extension is enabled; the user data is the log's, which lives until the messenger is destroyed.
        let messenger = unsafe { functions.create_debug_utils_messenger(&create, None) }
            .during("create the validation messenger")?;
        self.messenger = Some((functions, messenger));
        Ok(())
    }

    /// Every device, usable or not.
    pub fn candidates(&self) -> Result<Vec<Candidate>> {
        // SAFETY: the instance is alive.
        let devices = unsafe { self.raw.enumerate_physical_devices() }.during("list the devices")?;
        if devices.is_empty() {
            return Err(Error::Device(NO_DRIVER.into()));
        }
        Ok(devices.into_iter().enumerate().map(|(index, physical)| describe(&self.raw, index, physical)).collect())
    }
}

/// A physical device of `instance`, with what it lacks.
pub(super) fn describe(instance: &ash::Instance, index: usize, physical: vk::PhysicalDevice) -> Candidate {
    // SAFETY: the device belongs to this instance.
    let properties = unsafe { instance.get_physical_device_properties(physical) };
    let version = properties.api_version;
    let mut lacks = Vec::new();

    let mut driver = vk::PhysicalDeviceDriverProperties::default();
    let mut id = vk::PhysicalDeviceIDProperties::default();
    if version >= vk::API_VERSION_1_2 {
        let mut chain = vk::PhysicalDeviceProperties2::default().push_next(&mut driver).push_next(&mut id);
        // SAFETY: the device is this instance's and knows the structures of Vulkan 1.2.
        unsafe { instance.get_physical_device_properties2(physical, &mut chain) };
    }
    if version >= vk::API_VERSION_1_3 {
        let mut features12 = vk::PhysicalDeviceVulkan12Features::default();
        let mut features13 = vk::PhysicalDeviceVulkan13Features::default();
        let mut chain = vk::PhysicalDeviceFeatures2::default().push_next(&mut features12).push_next(&mut features13);
        // SAFETY: the device is this instance's and knows the structures of Vulkan 1.3.
        unsafe { instance.get_physical_device_features2(physical, &mut chain) };
        for (has, name) in [
            (features12.scalar_block_layout, "scalarBlockLayout"),
            (features13.synchronization2, "synchronization2"),
            (features13.maintenance4, "maintenance4"),
        ] {
            if has == vk::FALSE {
                lacks.push(format!("the feature {name}"));
            }
        }
    } else {
        lacks.push(format!("Vulkan 1.3 (it has {})", version_text(version)));
    }
    let limits = &properties.limits;
    for (name, has, needs) in [
        ("storage buffers per stage", limits.max_per_stage_descriptor_storage_buffers, Slot::ALL.len()),
        ("storage buffers per set", limits.max_descriptor_set_storage_buffers, Slot::ALL.len()),
        ("bytes of push constants", limits.max_push_constants_size, size_of::<Step>()),
    ] {
        if (has as usize) < needs {
            lacks.push(format!("{needs} {name} (it has {has})"));
        }
    }
    // SAFETY: the device belongs to this instance; so for the next call.
    let families = unsafe { instance.get_physical_device_queue_family_properties(physical) };
    // SAFETY: as above.
    let extensions = unsafe { instance.enumerate_device_extension_properties(physical) }.unwrap_or_default();
    let named = |name| extensions.iter().any(|extension| extension.extension_name_as_c_str() == Ok(name));
    let family = families.iter().position(|f| f.queue_flags.contains(vk::QueueFlags::COMPUTE));
    if family.is_none() {
        lacks.push("a compute queue".into());
    }

    let text = |text: std::result::Result<&CStr, _>| text.map_or(String::new(), |t| t.to_string_lossy().into());
    let driver_name = text(driver.driver_name_as_c_str());
    let driver_info: String = text(driver.driver_info_as_c_str());
    let info = DeviceInfo {
        index,
        name: text(properties.device_name_as_c_str()),
        driver: format!("{driver_name} {driver_info}").trim().to_string(),
        kind: match properties.device_type {
            vk::PhysicalDeviceType::DISCRETE_GPU => DeviceKind::Discrete,
            vk::PhysicalDeviceType::INTEGRATED_GPU => DeviceKind::Integrated,
            vk::PhysicalDeviceType::VIRTUAL_GPU => DeviceKind::Virtual,
            vk::PhysicalDeviceType::CPU => DeviceKind::Cpu,
            _ => DeviceKind::Other,
        },
        uuid: uuid_text(&id.device_uuid),
        api_version: version_text(version),
        lacks,
    };
    Candidate {
        physical,
        family: family.unwrap_or(0) as u32,
        host_import: named(external_memory_host::NAME),
        memory_budget: named(memory_budget::NAME),
        info,
    }
}

impl Drop for Instance {
    fn drop(&mut self) {
        // SAFETY: the device that was made from this instance is gone: its owner drops it first.
        unsafe {
            if let Some((functions, messenger)) = self.messenger.take() {
                functions.destroy_debug_utils_messenger(messenger, None);
            }
            self.raw.destroy_instance(None);
        }
    }
}

fn has_validation_layer(entry: &ash::Entry) -> Result<bool> {
    // SAFETY: the entry is loaded.
    let layers = unsafe { entry.enumerate_instance_layer_properties() }.during("list the layers")?;
    Ok(layers.iter().any(|layer| layer.layer_name_as_c_str() == Ok(VALIDATION_LAYER)))
}

/// Called by the validation layer, perhaps from another thread.
unsafe extern "system" fn report(
    _: vk::DebugUtilsMessageSeverityFlagsEXT,
    _: vk::DebugUtilsMessageTypeFlagsEXT,
    data: *const vk::DebugUtilsMessengerCallbackDataEXT<'_>,
    log: *mut c_void,
) -> vk::Bool32 {
    // SAFETY: Vulkan passes valid data whose message is a C string, and the pointer that `listen` gave it.
    let (message, log) = unsafe { (CStr::from_ptr((*data).p_message), &*log.cast::<Mutex<Vec<String>>>()) };
    let message = message.to_string_lossy().into_owned();
    log::warn!("{message}");
    log.lock().unwrap_or_else(PoisonError::into_inner).push(message);
    vk::FALSE
}

pub(super) fn version_text(version: u32) -> String {
    format!("{}.{}.{}", vk::api_version_major(version), vk::api_version_minor(version), vk::api_version_patch(version))
}

fn uuid_text(bytes: &[u8; 16]) -> String {
    let mut text = String::new();
    for (i, byte) in bytes.iter().enumerate() {
        if matches!(i, 4 | 6 | 8 | 10) {
            text.push('-');
        }
        text.push_str(&format!("{byte:02x}"));
    }
    text
}
