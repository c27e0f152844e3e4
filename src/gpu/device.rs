//! The device: chosen and opened, or a caller's; and what everything else of this module holds on to.

use super::{
    During,
    buffer::Staging,
    c_name,
    counters::Counter,
    host::{self, Left},
    instance::{Candidate, DeviceInfo, DeviceKind, Instance, ValidationLog, describe},
    kernel::Compiled,
    memory::{Allocation, Allocator, Heap, MemoryRequest},
    profiling::{Available, Profiling},
    requirements::{self, Requirements},
};
use crate::{Error, Result};
use ash::{
    ext::{debug_utils, external_memory_host},
    vk,
};
use gpu_allocator::{AllocationSizes, vulkan as memory};
use std::{
    ffi::CStr,
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
    /// Enables what profiles make use of, where the device has it: VK_EXT_calibrated_timestamps, which puts the
    /// device's work on the host's clock, and VK_KHR_pipeline_executable_properties
    /// ([`Kernel::executables`](super::Kernel::executables)). Timestamps themselves need nothing.
    pub profiling: bool,
    /// Counts what the hardware can count of each dispatch in one pass, where the device has VK_KHR_performance_query;
    /// the device holds the system's profiling lock as long as it lives. Written by the specification, and untested: no
    /// device at hand has it.
    pub counters: bool,
}

/// A Vulkan device that a caller made and keeps, for [`Device::from_raw`].
pub struct RawDevice<'a> {
    pub instance: ash::Instance,
    pub physical: vk::PhysicalDevice,
    pub device: ash::Device,
    /// A family with compute, whose queues run what is recorded.
    pub queue_family: u32,
    /// A queue of that family, to which [`Renderer::new`](crate::Renderer::new), `render` and `image` submit;
    /// recordings never do. Without one, buffers that the host fills are in memory that it reaches, and `render` is an
    /// error.
    pub queue: Option<vk::Queue>,
    /// What the device was made with, so that a missing feature is an error that names it and
    /// VK_EXT_external_memory_host is used where it is enabled; without it the caller is trusted and the extension not
    /// used.
    pub created_with: Option<&'a vk::DeviceCreateInfo<'a>>,
    /// VK_EXT_debug_utils is enabled in the instance: objects get names and dispatches labels.
    pub debug_utils: bool,
    /// Where device memory comes from; without it an allocator of our own.
    pub allocator: Option<Arc<dyn Allocator>>,
    /// Used for every pipeline, from several threads at once, so not VK_PIPELINE_CACHE_CREATE_EXTERNALLY_SYNCHRONIZED;
    /// may be null.
    pub pipeline_cache: vk::PipelineCache,
}

impl<'a> RawDevice<'a> {
    /// These handles, with no queue, no allocator and no pipeline cache.
    pub fn new(
        instance: ash::Instance,
        physical: vk::PhysicalDevice,
        device: ash::Device,
        queue_family: u32,
    ) -> RawDevice<'a> {
        RawDevice {
            instance,
            physical,
            device,
            queue_family,
            queue: None,
            created_with: None,
            debug_utils: false,
            allocator: None,
            pipeline_cache: vk::PipelineCache::null(),
        }
    }

    /// As [`RawDevice::new`], from Vulkan's own handles.
    ///
    /// # Safety
    /// The handles are alive and belong together, and the function is that of their loader.
    pub unsafe fn load(
        get_instance_proc_addr: vk::PFN_vkGetInstanceProcAddr,
        instance: vk::Instance,
        physical: vk::PhysicalDevice,
        device: vk::Device,
        queue_family: u32,
    ) -> RawDevice<'a> {
        // SAFETY: as the caller promises.
        unsafe {
            let instance = ash::Instance::load(&ash::StaticFn { get_instance_proc_addr }, instance);
            let device = ash::Device::load(instance.fp_v1_0(), device);
            RawDevice::new(instance, physical, device, queue_family)
        }
    }
}

/// A handle of an open device; clones share it. What is made from a device keeps it alive. It may be used from several
/// threads at once.
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

/// The Vulkan objects of an open device, destroyed when the last user drops; a caller's are left alone.
pub(super) struct Handles {
    pub device: ash::Device,
    /// Submissions to a queue must not overlap. None for a caller's device without one.
    pub queue: Option<Mutex<vk::Queue>>,
    pub family: u32,
    pub debug_utils: Option<debug_utils::Device>,
    pub host_memory: Option<HostMemory>,
    pub pipeline_cache: vk::PipelineCache,
    pub info: DeviceInfo,
    pub limits: vk::PhysicalDeviceLimits,
    pub subgroup_size: u32,
    /// 0 where the queue has no timestamps.
    pub timestamp_bits: u32,
    pub profiling: Profiling,
    pub force_staging: bool,
    max_buffer_bytes: u64,
    heap: Heap,
    // None only while opening and dropping.
    allocator: Option<Arc<dyn Allocator>>,
    // The instance if it and the device are ours to destroy; none for a caller's device.
    owned: Option<Instance>,
    log: ValidationLog,
}

/// VK_EXT_external_memory_host.
pub(super) struct HostMemory {
    pub functions: external_memory_host::Device,
    /// Alignment of address and size (bytes).
    pub alignment: u64,
    pub types: vk::PhysicalDeviceMemoryProperties,
}

/// What `Handles` are made of, but for who owns it.
struct Parts<'a> {
    instance: &'a ash::Instance,
    physical: vk::PhysicalDevice,
    device: ash::Device,
    queue: Option<vk::Queue>,
    family: u32,
    info: DeviceInfo,
    debug_utils: bool,
    host_import: bool,
    memory_budget: bool,
    pipeline_cache: vk::PipelineCache,
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
        if chosen.info.kind == DeviceKind::Cpu {
            host::check_driver()?;
        }
        let handles = Handles::create(instance, chosen, options)?;
        Ok(Device { handles: Arc::new(handles), staging: Arc::default(), kernels: Arc::default() })
    }

    /// A device that the caller made. Instance and device are not destroyed with it; they must outlive it and all that
    /// is made from it.
    ///
    /// # Errors
    /// [`Error::Device`] with what the physical device lacks, or what instance or device were made without (see
    /// [`Requirements`]); [`Error::Memory`] if the allocator cannot start.
    ///
    /// # Safety
    /// The handles are alive and belong together. Without `created_with` the features of [`Requirements`] are enabled.
    /// While a method of this crate runs that submits (those that the documentation of `RawDevice::queue` names),
    /// nobody else uses the queue.
    pub unsafe fn from_raw(raw: RawDevice) -> Result<Device> {
        requirements::check_version(&raw.instance, &raw.device, raw.physical)?;
        let Candidate { info, memory_budget, .. } = describe(&raw.instance, 0, raw.physical);
        if !info.lacks.is_empty() {
            return Err(Error::Device(info.to_string()));
        }
        // SAFETY: the caller's handles are alive and belong together.
        let families = unsafe { raw.instance.get_physical_device_queue_family_properties(raw.physical) };
        match families.get(raw.queue_family as usize) {
            Some(family) if family.queue_flags.contains(vk::QueueFlags::COMPUTE) => {}
            _ => return Err(Error::Device(format!("queue family {} has no compute", raw.queue_family))),
        }
        let host_import = match raw.created_with {
            // SAFETY: a reference to Vulkan's structure promises valid pointers.
            Some(create) => unsafe { requirements::check(create, raw.queue_family) }?.host_import,
            None => false,
        };
        let mut handles = Handles::new(Parts {
            instance: &raw.instance,
            physical: raw.physical,
            device: raw.device,
            queue: raw.queue,
            family: raw.queue_family,
            info,
            debug_utils: raw.debug_utils,
            host_import,
            memory_budget,
            pipeline_cache: raw.pipeline_cache,
            log: ValidationLog::default(),
        });
        handles.allocator = Some(match raw.allocator {
            Some(allocator) => allocator,
            None => own_allocator(&raw.instance, raw.physical, &handles.device)?,
        });
        Ok(Device { handles: Arc::new(handles), staging: Arc::default(), kernels: Arc::default() })
    }

    /// Whether there is a queue to which `render`, uploads and downloads can be submitted.
    pub fn has_queue(&self) -> bool {
        self.handles.queue.is_some()
    }

    /// Whether timestamps can be written on its queue family.
    pub fn has_timestamps(&self) -> bool {
        self.handles.timestamp_bits > 0
    }

    /// What profiled recordings count; nothing without [`DeviceOptions::counters`].
    pub fn counters(&self) -> &[Counter] {
        self.handles.profiling.counters.as_ref().map_or(&[], |counters| &counters.list)
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

    /// Vulkan's limits of the device.
    pub fn limits(&self) -> &vk::PhysicalDeviceLimits {
        &self.handles.limits
    }

    /// Invocations of a subgroup, as `VkPhysicalDeviceSubgroupProperties` has it.
    pub fn subgroup_size(&self) -> u32 {
        self.handles.subgroup_size
    }

    /// Workgroups across and down in a dispatch of so many invocations; more than 0.
    pub fn groups(&self, invocations: u32, workgroup: u32) -> [u32; 2] {
        self.handles.groups(invocations, workgroup)
    }

    /// Bytes of the largest memory heap that device buffers can use. Drivers may hand out more than there is, so
    /// keep well below it.
    pub fn heap_size(&self) -> u64 {
        self.handles.heap.bytes
    }

    /// Bytes of that heap that this process may still take: what VK_EXT_memory_budget says, else the whole heap.
    pub fn heap_left(&self) -> u64 {
        self.handles.heap.left()
    }

    /// Whether its buffers are in the host's memory: it is the processor.
    pub fn shares_host_memory(&self) -> bool {
        self.info().kind == DeviceKind::Cpu
    }

    /// Bytes that this process may still take of the host's memory, and what sets that limit, in words; beside what the
    /// driver takes where the device is the processor.
    pub fn host_left(&self) -> (u64, &'static str) {
        let Left { bytes, limit } = host::left(self.shares_host_memory());
        (bytes, limit)
    }

    /// Of which number (bytes) address and size of memory for [`Buffer::import_host`](super::Buffer::import_host) must
    /// be multiples; none where VK_EXT_external_memory_host is not enabled.
    pub fn host_import_alignment(&self) -> Option<u64> {
        self.handles.host_memory.as_ref().map(|host| host.alignment)
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
        let available = Available::of(&instance, physical, chosen.family, options);
        let mut extensions: Vec<_> = available.names().into_iter().map(CStr::as_ptr).collect();
        if chosen.host_import {
            extensions.push(external_memory_host::NAME.as_ptr());
        }
        let (mut features12, mut features13, mut extra) = Default::default();
        Requirements::new().enable(&mut features12, &mut features13);
        features12.host_query_reset = available.counters().into();
        let create = vk::DeviceCreateInfo::default().queue_create_infos(&queues).enabled_extension_names(&extensions);
        let create = available.chain(create.push_next(&mut features12).push_next(&mut features13), &mut extra);
        // SAFETY: the physical device is of this instance and has the features; all pointers outlive the call.
        let device = unsafe { instance.raw.create_device(physical, &create, None) }.during("create the device")?;
        // SAFETY: the device was made with one queue of this family.
        let queue = unsafe { device.get_device_queue(chosen.family, 0) };
        let raw = instance.raw.clone();
        let mut handles = Handles::new(Parts {
            instance: &raw,
            physical,
            device,
            queue: Some(queue),
            family: chosen.family,
            info: chosen.info.clone(),
            debug_utils: instance.debug_utils,
            host_import: chosen.host_import,
            memory_budget: chosen.memory_budget,
            pipeline_cache: vk::PipelineCache::null(),
            log: instance.log.clone(),
        });
        handles.force_staging = options.staging;
        handles.max_buffer_bytes = handles.max_buffer_bytes.min(options.buffer_bytes.unwrap_or(u64::MAX));
        // From here on dropping `handles` destroys the device, before the instance.
        handles.owned = Some(instance);
        handles.profiling = Profiling::new(available, &raw, &handles.device)?;
        handles.allocator = Some(own_allocator(&raw, physical, &handles.device)?);
        Ok(handles)
    }

    /// Handles without an allocator, which own nothing.
    fn new(parts: Parts) -> Handles {
        let Parts { instance, physical, device, queue, family, .. } = parts;
        let mut maintenance3 = vk::PhysicalDeviceMaintenance3Properties::default();
        let mut maintenance4 = vk::PhysicalDeviceMaintenance4Properties::default();
        let mut host = vk::PhysicalDeviceExternalMemoryHostPropertiesEXT::default();
        let mut subgroup = vk::PhysicalDeviceSubgroupProperties::default();
        let mut properties = vk::PhysicalDeviceProperties2::default()
            .push_next(&mut maintenance3)
            .push_next(&mut maintenance4)
            .push_next(&mut subgroup);
        if parts.host_import {
            properties = properties.push_next(&mut host);
        }
        // SAFETY: the device is of this instance and speaks Vulkan 1.3.
        let (families, heaps) = unsafe {
            instance.get_physical_device_properties2(physical, &mut properties);
            (
                instance.get_physical_device_queue_family_properties(physical),
                instance.get_physical_device_memory_properties(physical),
            )
        };
        let limits = properties.properties.limits;
        Handles {
            queue: queue.map(Mutex::new),
            family,
            debug_utils: parts.debug_utils.then(|| debug_utils::Device::new(instance, &device)),
            host_memory: parts.host_import.then(|| HostMemory {
                functions: external_memory_host::Device::new(instance, &device),
                alignment: host.min_imported_host_pointer_alignment,
                types: heaps,
            }),
            pipeline_cache: parts.pipeline_cache,
            info: parts.info,
            limits,
            subgroup_size: subgroup.subgroup_size,
            timestamp_bits: families[family as usize].timestamp_valid_bits,
            profiling: Profiling::default(),
            force_staging: false,
            max_buffer_bytes: u64::from(limits.max_storage_buffer_range)
                .min(maintenance3.max_memory_allocation_size)
                .min(maintenance4.max_buffer_size),
            heap: Heap::of(&device, &heaps, parts.memory_budget.then(|| (instance.clone(), physical))),
            allocator: None,
            log: parts.log,
            owned: None,
            device,
        }
    }

    /// As [`Device::groups`].
    pub fn groups(&self, invocations: u32, workgroup: u32) -> [u32; 2] {
        let groups = invocations.div_ceil(workgroup);
        let rows = groups.div_ceil(self.limits.max_compute_work_group_count[0]).max(1);
        [groups.div_ceil(rows), rows]
    }

    /// Memory for one buffer.
    pub fn allocate(&self, request: &MemoryRequest) -> std::result::Result<Allocation, String> {
        self.allocator().allocate(request)
    }

    /// Gives back what [`Handles::allocate`] gave.
    pub fn free(&self, allocation: Allocation) {
        self.allocator().free(allocation);
    }

    fn allocator(&self) -> &dyn Allocator {
        self.allocator.as_deref().expect("the allocator lives as long as the handles")
    }

    /// The queue, for one submission.
    pub fn queue(&self) -> Result<MutexGuard<'_, vk::Queue>> {
        let none = || Error::Device("the caller's device was given without a queue, which this needs".into());
        self.queue.as_ref().map(lock).ok_or_else(none)
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
        drop(self.allocator.take());
        if let Some(counters) = &self.profiling.counters {
            counters.release();
        }
        if self.owned.is_some() {
            // SAFETY: everything made from the device held these handles and is gone.
            unsafe { self.device.destroy_device(None) };
        }
    }
}

/// An allocator for a device that has none.
fn own_allocator(
    instance: &ash::Instance,
    physical: vk::PhysicalDevice,
    device: &ash::Device,
) -> Result<Arc<dyn Allocator>> {
    let description = memory::AllocatorCreateDesc {
        instance: instance.clone(),
        device: device.clone(),
        physical_device: physical,
        debug_settings: Default::default(),
        buffer_device_address: false,
        allocation_sizes: AllocationSizes::new(BLOCK_BYTES, BLOCK_BYTES),
    };
    let allocator = memory::Allocator::new(&description)
        .map_err(|error| Error::Memory { step: "start the allocator".into(), problem: error.to_string() })?;
    Ok(Arc::new(Mutex::new(allocator)))
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
