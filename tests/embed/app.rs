//! Somebody else's Vulkan application: its own instance, device, queue, command buffers and timeline semaphore, under
//! the validation layer with synchronization checks.

use std::{
    ffi::{CStr, c_void},
    sync::{Arc, Mutex},
};
use translucent::{
    Device,
    ash::{self, ext, vk},
    gpu::{RawDevice, Requirements},
};

pub struct App {
    entry: ash::Entry,
    pub instance: ash::Instance,
    pub physical: vk::PhysicalDevice,
    pub device: ash::Device,
    pub family: u32,
    pub queue: vk::Queue,
    pool: vk::CommandPool,
    timeline: vk::Semaphore,
    value: Mutex<u64>,
    messenger: vk::DebugUtilsMessengerEXT,
    messages: Arc<Mutex<Vec<String>>>,
}

/// Functions of the device by name, in place of Vulkan's own.
pub type Wrap = fn(&CStr, vk::PFN_vkVoidFunction) -> vk::PFN_vkVoidFunction;

impl App {
    pub fn new() -> App {
        App::of_version(vk::API_VERSION_1_3)
    }

    /// With functions of the test's own in place of the device's, and without validation, which has handles of its own.
    pub fn wrapped(wrap: Wrap) -> App {
        App::with(vk::API_VERSION_1_3, wrap, false)
    }

    /// As [`App::wrapped`], for functions that may stand before validation.
    #[allow(dead_code)]
    pub fn validated(wrap: Wrap) -> App {
        App::with(vk::API_VERSION_1_3, wrap, true)
    }

    /// What validation has said since this was asked last.
    #[allow(dead_code)]
    pub fn take_messages(&self) -> Vec<String> {
        std::mem::take(&mut *self.messages.lock().expect("no panic"))
    }

    /// With an instance made for that version of Vulkan.
    pub fn of_version(version: u32) -> App {
        App::with(version, |_, function| function, true)
    }

    fn with(version: u32, wrap: Wrap, validated: bool) -> App {
        let messages = Arc::new(Mutex::new(vec![]));
        let entry = unsafe { ash::Entry::load() }.expect("a loader");
        let application = vk::ApplicationInfo::default().api_version(version);
        let layers = [c"VK_LAYER_KHRONOS_validation".as_ptr()];
        let extensions = [ext::debug_utils::NAME.as_ptr(), vk::EXT_VALIDATION_FEATURES_NAME.as_ptr()];
        let enables = [vk::ValidationFeatureEnableEXT::SYNCHRONIZATION_VALIDATION];
        let mut validation = vk::ValidationFeaturesEXT::default().enabled_validation_features(&enables);
        let create = vk::InstanceCreateInfo::default()
            .application_info(&application)
            .enabled_layer_names(&layers[..usize::from(validated)])
            .enabled_extension_names(&extensions[..1 + usize::from(validated)]);
        let create = if validated { create.push_next(&mut validation) } else { create };
        let instance = unsafe { entry.create_instance(&create, None) }.expect("an instance with the validation layer");
        let listen = vk::DebugUtilsMessengerCreateInfoEXT::default()
            .message_severity(
                vk::DebugUtilsMessageSeverityFlagsEXT::ERROR | vk::DebugUtilsMessageSeverityFlagsEXT::WARNING,
            )
            .message_type(vk::DebugUtilsMessageTypeFlagsEXT::VALIDATION)
            .pfn_user_callback(Some(report))
            .user_data(Arc::as_ptr(&messages).cast_mut().cast());
        let debug = ext::debug_utils::Instance::new(&entry, &instance);
        let messenger = unsafe { debug.create_debug_utils_messenger(&listen, None) }.expect("a messenger");
        let physical = unsafe { instance.enumerate_physical_devices() }.expect("devices")[0];
        let families = unsafe { instance.get_physical_device_queue_family_properties(physical) };
        let compute = |family: &vk::QueueFamilyProperties| family.queue_flags.contains(vk::QueueFlags::COMPUTE);
        let family = families.iter().position(compute).expect("a compute queue") as u32;
        let raw = created(&instance, physical, family, |create| {
            unsafe { instance.create_device(physical, create, None) }.expect("a device").handle()
        });
        let get = |name: &CStr| unsafe {
            let function = instance.get_device_proc_addr(raw, name.as_ptr());
            std::mem::transmute::<vk::PFN_vkVoidFunction, *const c_void>(wrap(name, function))
        };
        let device = unsafe { ash::Device::load_with(get, raw) };
        let queue = unsafe { device.get_device_queue(family, 0) };
        let create = vk::CommandPoolCreateInfo::default().queue_family_index(family);
        let pool = unsafe { device.create_command_pool(&create, None) }.expect("a pool");
        let mut kind = vk::SemaphoreTypeCreateInfo::default().semaphore_type(vk::SemaphoreType::TIMELINE);
        let create = vk::SemaphoreCreateInfo::default().push_next(&mut kind);
        let timeline = unsafe { device.create_semaphore(&create, None) }.unwrap_or_default();
        App {
            entry,
            instance,
            physical,
            device,
            family,
            queue,
            pool,
            timeline,
            value: Mutex::new(0),
            messenger,
            messages,
        }
    }

    /// The device as it is handed over.
    pub fn raw(&self) -> RawDevice<'static> {
        RawDevice {
            queue: Some(self.queue),
            debug_utils: true,
            ..RawDevice::new(self.instance.clone(), self.physical, self.device.clone(), self.family)
        }
    }

    pub fn open(&self) -> Device {
        unsafe { Device::from_raw(self.raw()) }.expect("the device is fit")
    }

    /// As [`App::open`], with what the device was made with.
    pub fn open_with_create_info(&self) -> Device {
        created(&self.instance, self.physical, self.family, |create| {
            unsafe { Device::from_raw(RawDevice { created_with: Some(create), ..self.raw() }) }.expect("it is complete")
        })
    }

    /// A command buffer with what `record` records.
    pub fn commands(&self, record: impl FnOnce(vk::CommandBuffer)) -> vk::CommandBuffer {
        let allocate = vk::CommandBufferAllocateInfo::default().command_pool(self.pool).command_buffer_count(1);
        let commands = unsafe { self.device.allocate_command_buffers(&allocate) }.expect("a command buffer")[0];
        // So that one submission may have it twice.
        let begin = vk::CommandBufferBeginInfo::default().flags(vk::CommandBufferUsageFlags::SIMULTANEOUS_USE);
        unsafe {
            self.device.begin_command_buffer(commands, &begin).expect("begin");
            record(commands);
            self.device.end_command_buffer(commands).expect("end");
        }
        commands
    }

    /// Submits them in order, and waits on the timeline.
    pub fn submit(&self, commands: &[vk::CommandBuffer]) {
        let mut value = self.value.lock().expect("no panic");
        *value += 1;
        let infos: Vec<_> =
            commands.iter().map(|c| vk::CommandBufferSubmitInfo::default().command_buffer(*c)).collect();
        let signal = [vk::SemaphoreSubmitInfo::default()
            .semaphore(self.timeline)
            .value(*value)
            .stage_mask(vk::PipelineStageFlags2::ALL_COMMANDS)];
        let submits = [vk::SubmitInfo2::default().command_buffer_infos(&infos).signal_semaphore_infos(&signal)];
        let (semaphores, values) = ([self.timeline], [*value]);
        let wait = vk::SemaphoreWaitInfo::default().semaphores(&semaphores).values(&values);
        unsafe {
            self.device.queue_submit2(self.queue, &submits, vk::Fence::null()).expect("submit");
            self.device.wait_semaphores(&wait, u64::MAX).expect("wait");
        }
    }

    /// Records, submits and waits.
    pub fn run(&self, record: impl FnOnce(vk::CommandBuffer)) {
        let commands = self.commands(record);
        self.submit(&[commands]);
        unsafe { self.device.free_command_buffers(self.pool, &[commands]) };
    }

    /// An image of four f32 a pixel, and its memory.
    pub fn image(&self, width: u32, height: u32) -> (vk::Image, vk::DeviceMemory) {
        let create = vk::ImageCreateInfo::default()
            .image_type(vk::ImageType::TYPE_2D)
            .format(vk::Format::R32G32B32A32_SFLOAT)
            .extent(vk::Extent3D { width, height, depth: 1 })
            .mip_levels(1)
            .array_layers(1)
            .samples(vk::SampleCountFlags::TYPE_1)
            .usage(vk::ImageUsageFlags::TRANSFER_DST | vk::ImageUsageFlags::TRANSFER_SRC);
        unsafe {
            let image = self.device.create_image(&create, None).expect("an image");
            let needs = self.device.get_image_memory_requirements(image);
            let allocate = vk::MemoryAllocateInfo::default()
                .allocation_size(needs.size)
                .memory_type_index(needs.memory_type_bits.trailing_zeros());
            let memory = self.device.allocate_memory(&allocate, None).expect("memory");
            self.device.bind_image_memory(image, memory, 0).expect("bind");
            (image, memory)
        }
    }

    pub fn destroy_image(&self, (image, memory): (vk::Image, vk::DeviceMemory)) {
        unsafe {
            self.device.destroy_image(image, None);
            self.device.free_memory(memory, None);
        }
    }

    /// The application's own barrier: transfers before and after, and another layout.
    pub fn to_layout(&self, commands: vk::CommandBuffer, image: vk::Image, old: vk::ImageLayout, new: vk::ImageLayout) {
        let range =
            vk::ImageSubresourceRange::default().aspect_mask(vk::ImageAspectFlags::COLOR).level_count(1).layer_count(1);
        let barriers = [vk::ImageMemoryBarrier2::default()
            .src_stage_mask(vk::PipelineStageFlags2::ALL_TRANSFER)
            .src_access_mask(vk::AccessFlags2::TRANSFER_WRITE)
            .dst_stage_mask(vk::PipelineStageFlags2::ALL_TRANSFER)
            .dst_access_mask(vk::AccessFlags2::TRANSFER_READ | vk::AccessFlags2::TRANSFER_WRITE)
            .old_layout(old)
            .new_layout(new)
            .image(image)
            .subresource_range(range)];
        let dependency = vk::DependencyInfo::default().image_memory_barriers(&barriers);
        unsafe { self.device.cmd_pipeline_barrier2(commands, &dependency) };
    }

    /// Copies an image in TRANSFER_SRC_OPTIMAL to a buffer for the host.
    pub fn read_image(
        &self,
        commands: vk::CommandBuffer,
        image: vk::Image,
        buffer: vk::Buffer,
        width: u32,
        height: u32,
    ) {
        let layers = vk::ImageSubresourceLayers::default().aspect_mask(vk::ImageAspectFlags::COLOR).layer_count(1);
        let region = [vk::BufferImageCopy::default().image_subresource(layers).image_extent(vk::Extent3D {
            width,
            height,
            depth: 1,
        })];
        let layout = vk::ImageLayout::TRANSFER_SRC_OPTIMAL;
        unsafe { self.device.cmd_copy_image_to_buffer(commands, image, layout, buffer, &region) };
        self.for_the_host(commands);
    }

    /// Transfers are seen by the host.
    pub fn for_the_host(&self, commands: vk::CommandBuffer) {
        let barriers = [vk::MemoryBarrier2::default()
            .src_stage_mask(vk::PipelineStageFlags2::ALL_TRANSFER)
            .src_access_mask(vk::AccessFlags2::TRANSFER_WRITE)
            .dst_stage_mask(vk::PipelineStageFlags2::HOST)
            .dst_access_mask(vk::AccessFlags2::HOST_READ)];
        let dependency = vk::DependencyInfo::default().memory_barriers(&barriers);
        unsafe { self.device.cmd_pipeline_barrier2(commands, &dependency) };
    }

    /// A function of the instance.
    pub fn instance_function(&self, name: &CStr) -> vk::PFN_vkVoidFunction {
        unsafe { self.entry.get_instance_proc_addr(self.instance.handle(), name.as_ptr()) }
    }

    /// gpu-allocator, as an application has it.
    pub fn allocator(&self) -> Arc<Mutex<gpu_allocator::vulkan::Allocator>> {
        let description = gpu_allocator::vulkan::AllocatorCreateDesc {
            instance: self.instance.clone(),
            device: self.device.clone(),
            physical_device: self.physical,
            debug_settings: Default::default(),
            buffer_device_address: false,
            allocation_sizes: Default::default(),
        };
        Arc::new(Mutex::new(gpu_allocator::vulkan::Allocator::new(&description).expect("an allocator")))
    }

    pub fn pipeline_cache(&self) -> vk::PipelineCache {
        unsafe { self.device.create_pipeline_cache(&Default::default(), None) }.expect("a cache")
    }

    pub fn destroy_pipeline_cache(&self, cache: vk::PipelineCache) {
        unsafe { self.device.destroy_pipeline_cache(cache, None) };
    }

    pub fn timestamps(&self, count: u32) -> vk::QueryPool {
        let create = vk::QueryPoolCreateInfo::default().query_type(vk::QueryType::TIMESTAMP).query_count(count);
        unsafe { self.device.create_query_pool(&create, None) }.expect("timestamps")
    }

    /// Destroys everything, whatever validation said.
    pub fn close_unchecked(self) {}

    /// Destroys everything; validation must have had nothing to say, leaks included.
    pub fn close(self) {
        let messages = self.messages.clone();
        drop(self);
        let messages = messages.lock().expect("no panic");
        assert!(messages.is_empty(), "{messages:#?}");
    }
}

impl Drop for App {
    fn drop(&mut self) {
        unsafe {
            self.device.destroy_semaphore(self.timeline, None);
            self.device.destroy_command_pool(self.pool, None);
            self.device.destroy_device(None);
            let debug = ext::debug_utils::Instance::new(&self.entry, &self.instance);
            debug.destroy_debug_utils_messenger(self.messenger, None);
            self.instance.destroy_instance(None);
        }
    }
}

/// Calls `with` with what the application makes its device with: what the library requires, host import where there is
/// any, and timeline semaphores of its own.
fn created<T>(
    instance: &ash::Instance,
    physical: vk::PhysicalDevice,
    family: u32,
    with: impl FnOnce(&vk::DeviceCreateInfo) -> T,
) -> T {
    let priorities = [1.0];
    let queues = [vk::DeviceQueueCreateInfo::default().queue_family_index(family).queue_priorities(&priorities)];
    let host = ext::external_memory_host::NAME;
    let extensions = unsafe { instance.enumerate_device_extension_properties(physical) }.expect("extensions");
    let has_host = extensions.iter().any(|extension| extension.extension_name_as_c_str() == Ok(host));
    let names = [host.as_ptr()];
    let mut features12 = vk::PhysicalDeviceVulkan12Features::default().timeline_semaphore(true);
    let mut features13 = vk::PhysicalDeviceVulkan13Features::default();
    Requirements::new().enable(&mut features12, &mut features13);
    let create = vk::DeviceCreateInfo::default()
        .queue_create_infos(&queues)
        .enabled_extension_names(&names[..usize::from(has_host)])
        .push_next(&mut features12)
        .push_next(&mut features13);
    with(&create)
}

unsafe extern "system" fn report(
    _: vk::DebugUtilsMessageSeverityFlagsEXT,
    _: vk::DebugUtilsMessageTypeFlagsEXT,
    data: *const vk::DebugUtilsMessengerCallbackDataEXT<'_>,
    log: *mut c_void,
) -> vk::Bool32 {
    let (message, log) = unsafe { (CStr::from_ptr((*data).p_message), &*log.cast::<Mutex<Vec<String>>>()) };
    log.lock().expect("no panic").push(message.to_string_lossy().into_owned());
    vk::FALSE
}
