//! The device: chosen, opened, and what everything else of this module holds on to.

use super::{
    During,
    buffer::Staging,
    c_name,
    instance::{Candidate, DeviceInfo, Instance, ValidationLog},
    kernel::Compiled,
};
use crate::{Error, Result, shared::Slot};
use ash::{ext::debug_utils, vk};
use gpu_allocator::{AllocationSizes, vulkan as memory};
use std::{
    fmt,
    sync::{Arc, Mutex, MutexGuard, PoisonError},
};

/// Allocations up to this size share memory blocks; lavapipe's memory is all of the host's kind.
const BLOCK_BYTES: u64 = 32 << 20;

/// Which device to open, and how.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct DeviceOptions {
    /// Index in [`Device::list`], UUID, or a part of the name (upper and lower case alike). Without it the best usable
    /// device: discrete GPU, integrated, virtual, CPU.
    pub device: Option<String>,
    /// Loads the Khronos validation layer with synchronization checks; see [`Device::validation_messages`].
    pub validation: bool,
    /// Uploads and downloads through staging buffers even where memory is shared, so that this path can be tested.
    pub staging: bool,
    /// Most bytes of one buffer, where that is less than what the device binds.
    pub buffer_bytes: Option<u64>,
}

/// A handle of an open device; clones share it. What is made from a device keeps it alive.
#[derive(Clone)]
pub struct Device {
    pub(super) handles: Arc<Handles>,
    // Not in `Handles`: it holds buffers, which hold `Handles`.
    pub(super) staging: Arc<Mutex<Option<Staging>>>,
    // As above.
    pub(super) kernels: Arc<Mutex<Compiled>>,
}

impl fmt::Debug for Device {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "Device({})", self.handles.info)
    }
}

/// The Vulkan objects of an open device, destroyed when the last user drops.
pub(super) struct Handles {
    pub device: ash::Device,
    /// Submissions to a queue must not overlap.
    pub queue: Mutex<vk::Queue>,
    pub family: u32,
    pub debug_utils: Option<debug_utils::Device>,
    pub info: DeviceInfo,
    pub limits: vk::PhysicalDeviceLimits,
    /// 0 where the queue has no timestamps.
    pub timestamp_bits: u32,
    pub force_staging: bool,
    max_buffer_bytes: u64,
    heap_bytes: u64,
    // None only while opening and dropping.
    allocator: Mutex<Option<memory::Allocator>>,
    // The instance if it and the device are ours to destroy; none for a caller's device.
    owned: Option<Instance>,
    log: ValidationLog,
}

impl Device {
    /// Opens the device that `options` ask for.
    ///
    /// # Errors
    /// [`Error::Device`] if there is no loader, driver or usable device, with what each lacks; [`Error::Vulkan`] and
    /// [`Error::Memory`] if a step of the set-up fails.
    pub fn open(options: &DeviceOptions) -> Result<Device> {
        let instance = Instance::new(options.validation)?;
        let candidates = instance.candidates()?;
        let chosen = choose(&candidates, options.device.as_deref())?;
        let handles = Handles::create(instance, chosen, options)?;
        Ok(Device { handles: Arc::new(handles), staging: Arc::default(), kernels: Arc::default() })
    }

    /// Every Vulkan device of this machine, usable or not.
    ///
    /// # Errors
    /// As [`Device::open`], but never for what a device lacks.
    pub fn list() -> Result<Vec<DeviceInfo>> {
        Ok(Instance::new(false)?.candidates()?.into_iter().map(|candidate| candidate.info).collect())
    }

    /// Name, driver and so on.
    pub fn info(&self) -> &DeviceInfo {
        &self.handles.info
    }

    /// Most bytes of one buffer: the smallest of maxStorageBufferRange, maxBufferSize and maxMemoryAllocationSize.
    pub fn max_storage_buffer_range(&self) -> u64 {
        self.handles.max_buffer_bytes
    }

    /// Bytes of the largest memory heap that device buffers can use. Drivers may hand out more than there is, so
    /// keep well below it.
    pub fn heap_size(&self) -> u64 {
        self.handles.heap_bytes
    }

    /// Errors and warnings of the validation layer so far; none without `DeviceOptions::validation`.
    pub fn validation_messages(&self) -> Vec<String> {
        self.handles.log.messages()
    }

    /// The log behind [`Device::validation_messages`], which also shows what is wrong when the device is destroyed.
    pub fn validation_log(&self) -> ValidationLog {
        self.handles.log.clone()
    }
}

impl Handles {
    fn create(instance: Instance, chosen: &Candidate, options: &DeviceOptions) -> Result<Handles> {
        let physical = chosen.physical;
        let priorities = [1.0];
        let queues =
            [vk::DeviceQueueCreateInfo::default().queue_family_index(chosen.family).queue_priorities(&priorities)];
        // maintenance4, which every Vulkan 1.3 device has, lets the workgroup size be a specialization constant.
        let mut features12 = vk::PhysicalDeviceVulkan12Features::default().scalar_block_layout(true);
        let mut features13 = vk::PhysicalDeviceVulkan13Features::default().synchronization2(true).maintenance4(true);
        let create = vk::DeviceCreateInfo::default()
            .queue_create_infos(&queues)
            .push_next(&mut features12)
            .push_next(&mut features13);
        // SAFETY: the physical device is of this instance and has the features; all pointers outlive the call.
        let device = unsafe { instance.raw.create_device(physical, &create, None) }.during("create the device")?;
        // SAFETY: the device was made with one queue of this family.
        let queue = unsafe { device.get_device_queue(chosen.family, 0) };

        let mut maintenance3 = vk::PhysicalDeviceMaintenance3Properties::default();
        let mut maintenance4 = vk::PhysicalDeviceMaintenance4Properties::default();
        let mut properties =
            vk::PhysicalDeviceProperties2::default().push_next(&mut maintenance3).push_next(&mut maintenance4);
        // SAFETY: the device is of this instance and speaks Vulkan 1.3.
        let (families, heaps) = unsafe {
            instance.raw.get_physical_device_properties2(physical, &mut properties);
            (
                instance.raw.get_physical_device_queue_family_properties(physical),
                instance.raw.get_physical_device_memory_properties(physical),
            )
        };
        let limits = properties.properties.limits;
        let max_buffer_bytes = u64::from(limits.max_storage_buffer_range)
            .min(maintenance3.max_memory_allocation_size)
            .min(maintenance4.max_buffer_size)
            .min(options.buffer_bytes.unwrap_or(u64::MAX));
        let mut handles = Handles {
            queue: Mutex::new(queue),
            family: chosen.family,
            debug_utils: instance.debug_utils.then(|| debug_utils::Device::new(&instance.raw, &device)),
            info: chosen.info.clone(),
            limits,
            timestamp_bits: families[chosen.family as usize].timestamp_valid_bits,
            force_staging: options.staging,
            max_buffer_bytes,
            heap_bytes: buffer_heap(&device, &heaps),
            allocator: Mutex::new(None),
            log: instance.log.clone(),
            owned: None,
            device,
        };
        let description = memory::AllocatorCreateDesc {
            instance: instance.raw.clone(),
            device: handles.device.clone(),
            physical_device: physical,
            debug_settings: Default::default(),
            buffer_device_address: false,
            allocation_sizes: AllocationSizes::new(BLOCK_BYTES, BLOCK_BYTES),
        };
        // From here on dropping `handles` destroys the device, before the instance.
        handles.owned = Some(instance);
        let allocator = memory::Allocator::new(&description)
            .map_err(|error| Error::Memory { step: "start the allocator".into(), problem: error.to_string() })?;
        handles.allocator = Mutex::new(Some(allocator));
        Ok(handles)
    }

    /// The allocator, for one allocation or release.
    pub fn with_allocator<T>(&self, use_it: impl FnOnce(&mut memory::Allocator) -> T) -> T {
        let mut guard = lock(&self.allocator);
        use_it(guard.as_mut().expect("the allocator lives as long as the handles"))
    }

    /// Gives an object the name that debuggers and validation messages show.
    pub fn name<T: vk::Handle>(&self, object: T, name: &str) {
        if let Some(functions) = &self.debug_utils {
            let name = c_name(name);
            let info = vk::DebugUtilsObjectNameInfoEXT::default().object_handle(object).object_name(&name);
            // SAFETY: the object is of this device. A name that cannot be set is no reason to fail.
            let _ = unsafe { functions.set_debug_utils_object_name(&info) };
        }
    }
}

impl Drop for Handles {
    fn drop(&mut self) {
        // The allocator frees its memory through the device, so it goes first.
        drop(lock(&self.allocator).take());
        if self.owned.is_some() {
            // SAFETY: everything made from the device held these handles and is gone.
            unsafe { self.device.destroy_device(None) };
        }
    }
}

/// Locks; what a panicking thread left behind is whole, since every guarded change is one call.
pub(super) fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The device that `wanted` names, or the best usable one.
fn choose<'a>(candidates: &'a [Candidate], wanted: Option<&str>) -> Result<&'a Candidate> {
    let describe = |list: &[&Candidate]| list.iter().map(|c| c.info.to_string()).collect::<Vec<_>>().join("; ");
    let matching: Vec<&Candidate> = match wanted {
        None => candidates.iter().collect(),
        Some(wanted) => candidates.iter().filter(|candidate| is_named(&candidate.info, wanted)).collect(),
    };
    if matching.is_empty() {
        let all: Vec<&Candidate> = candidates.iter().collect();
        return Err(Error::setting(
            "device",
            format!("no device has the index, name or UUID {:?}; there are: {}", wanted.unwrap_or(""), describe(&all)),
        ));
    }
    let usable = matching.iter().filter(|candidate| candidate.info.lacks.is_empty());
    usable.min_by_key(|c| (c.info.kind, c.info.index)).copied().ok_or_else(|| Error::Device(describe(&matching)))
}

/// Whether `wanted` is the index, the UUID or a part of the name. A number is always an index.
fn is_named(info: &DeviceInfo, wanted: &str) -> bool {
    let wanted = wanted.trim().to_lowercase();
    if let Ok(index) = wanted.parse::<usize>() {
        return info.index == index;
    }
    let hex = |text: &str| text.replace('-', "");
    !wanted.is_empty() && (info.name.to_lowercase().contains(&wanted) || hex(&info.uuid) == hex(&wanted))
}

/// Size of the largest heap from which a buffer like ours can come, device-local if there is one.
fn buffer_heap(device: &ash::Device, heaps: &vk::PhysicalDeviceMemoryProperties) -> u64 {
    let create = super::buffer::create_info(Slot::ALL.len() as u64);
    let query = vk::DeviceBufferMemoryRequirements::default().create_info(&create);
    let mut needs = vk::MemoryRequirements2::default();
    // SAFETY: the device speaks Vulkan 1.3 with maintenance4; the structures outlive the call.
    unsafe { device.get_device_buffer_memory_requirements(&query, &mut needs) };
    let types = heaps.memory_types_as_slice().iter().enumerate();
    types
        .filter(|(i, _)| needs.memory_requirements.memory_type_bits & (1 << i) != 0)
        .map(|(_, kind)| {
            let local = kind.property_flags.contains(vk::MemoryPropertyFlags::DEVICE_LOCAL);
            (local, heaps.memory_heaps[kind.heap_index as usize].size)
        })
        .max()
        .map_or(0, |(_, size)| size)
}
