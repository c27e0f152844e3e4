//! An application of its own, built on ash, that renders a scene with translucent on its device: its own allocator, its
//! own command buffers, a timeline semaphore, four samples for each submission. The host waits for nothing but the end.
//!
//!     cargo run --example embed -- assets/spot.glb spot.exr [SIZE [SAMPLES]]

use std::{
    error::Error,
    sync::{Arc, Mutex},
};
use translucent::{
    Device, Environment, Model, Renderer, Scene, Settings,
    ash::{self, vk},
    gpu::{Allocation, Allocator, Location, MemoryRequest, RawDevice, Requirements},
};

/// One allocation of device memory for each buffer; it counts what it gave out.
struct OneForEach {
    device: ash::Device,
    types: vk::PhysicalDeviceMemoryProperties,
    held: Mutex<usize>,
}

// SAFETY: each piece is a device memory of its own, mapped where the host reaches it.
unsafe impl Allocator for OneForEach {
    fn allocate(&self, request: &MemoryRequest) -> Result<Allocation, String> {
        let wanted = match request.location {
            Location::Device | Location::Scratch => vk::MemoryPropertyFlags::DEVICE_LOCAL,
            Location::Upload | Location::Readback => {
                vk::MemoryPropertyFlags::HOST_VISIBLE | vk::MemoryPropertyFlags::HOST_COHERENT
            }
        };
        let fits = |(index, kind): &(usize, &vk::MemoryType)| {
            request.requirements.memory_type_bits >> index & 1 == 1 && kind.property_flags.contains(wanted)
        };
        let types = self.types.memory_types_as_slice().iter().enumerate();
        let (index, kind) = { types }.find(fits).ok_or("no type of memory fits")?;
        let create = vk::MemoryAllocateInfo::default()
            .allocation_size(request.requirements.size)
            .memory_type_index(index as u32);
        // SAFETY: the device outlives this allocator, which outlives what it gives out.
        let (memory, mapped) = unsafe {
            let memory = self.device.allocate_memory(&create, None).map_err(|error| error.to_string())?;
            let mapped = match kind.property_flags.contains(vk::MemoryPropertyFlags::HOST_VISIBLE) {
                true => self.device.map_memory(memory, 0, vk::WHOLE_SIZE, vk::MemoryMapFlags::empty()).ok(),
                false => None,
            };
            (memory, mapped)
        };
        *self.held.lock().map_err(|error| error.to_string())? += 1;
        let mapped = mapped.and_then(|start| std::ptr::NonNull::new(start.cast()));
        Ok(Allocation { memory, offset: 0, mapped, properties: kind.property_flags, token: None })
    }

    fn free(&self, allocation: Allocation) {
        // SAFETY: it came from `allocate`.
        unsafe { self.device.free_memory(allocation.memory, None) };
        if let Ok(mut held) = self.held.lock() {
            *held -= 1;
        }
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [input, output, numbers @ ..] = arguments.as_slice() else {
        return Err("usage: embed SCENE OUT.exr [SIZE [SAMPLES]]".into());
    };
    let number = |index: usize, otherwise| numbers.get(index).map_or(Ok(otherwise), |text| text.parse::<u32>());
    let (size, samples) = (number(0, 256)?, number(1, 64)?);

    // SAFETY: the application keeps Vulkan's rules; each call says what matters.
    unsafe {
        let entry = ash::Entry::load()?;
        let application = vk::ApplicationInfo::default().api_version(Requirements::new().api_version);
        let instance =
            entry.create_instance(&vk::InstanceCreateInfo::default().application_info(&application), None)?;
        // The first device that lacks nothing.
        let usable = |&physical: &vk::PhysicalDevice| Requirements::new().missing(&instance, physical).is_empty();
        let physical = instance.enumerate_physical_devices()?.into_iter().find(usable).ok_or("no device is fit")?;
        let families = instance.get_physical_device_queue_family_properties(physical);
        let family = families.iter().position(|family| family.queue_flags.contains(vk::QueueFlags::COMPUTE));
        let family = family.ok_or("no compute queue")? as u32;
        let priorities = [1.0];
        let queues = [vk::DeviceQueueCreateInfo::default().queue_family_index(family).queue_priorities(&priorities)];
        // What the application wants for itself, and what the library asks for.
        let mut features12 = vk::PhysicalDeviceVulkan12Features::default().timeline_semaphore(true);
        let mut features13 = vk::PhysicalDeviceVulkan13Features::default();
        Requirements::new().enable(&mut features12, &mut features13);
        let create = vk::DeviceCreateInfo::default()
            .queue_create_infos(&queues)
            .push_next(&mut features12)
            .push_next(&mut features13);
        let device = instance.create_device(physical, &create, None)?;
        let queue = device.get_device_queue(family, 0);
        let allocator = Arc::new(OneForEach {
            device: device.clone(),
            types: instance.get_physical_device_memory_properties(physical),
            held: Mutex::new(0),
        });

        // Without the queue: the library cannot submit, and the host fills its buffers in place.
        let translucent = Device::from_raw(RawDevice {
            created_with: Some(&create),
            allocator: Some(allocator.clone()),
            ..RawDevice::new(instance.clone(), physical, device.clone(), family)
        })?;
        let mut scene = Scene::load(input)?;
        scene.set_environment(Environment::constant(glam::DVec3::ONE)?)?;
        let resolution = Some((size, size));
        let settings = Settings { resolution, model: Model::Standard, recording: true, ..Settings::default() };
        let renderer = Renderer::new(&translucent, &scene, &settings)?;

        let create = vk::CommandPoolCreateInfo::default().queue_family_index(family);
        let pool = device.create_command_pool(&create, None)?;
        let mut timeline = vk::SemaphoreTypeCreateInfo::default().semaphore_type(vk::SemaphoreType::TIMELINE);
        let timeline = device.create_semaphore(&vk::SemaphoreCreateInfo::default().push_next(&mut timeline), None)?;
        let back = Back::new(&device, &allocator.types, u64::from(size) * u64::from(size) * 16)?;

        // Four samples for each submission, each of which waits for the one before on the device.
        let starts: Vec<u32> = (0..samples).step_by(4).collect();
        let allocate =
            vk::CommandBufferAllocateInfo::default().command_pool(pool).command_buffer_count(starts.len() as u32);
        let buffers = device.allocate_command_buffers(&allocate)?;
        for (number, (&commands, &start)) in (0..).zip(buffers.iter().zip(&starts)) {
            device.begin_command_buffer(commands, &vk::CommandBufferBeginInfo::default())?;
            renderer.record(commands, start..samples.min(start + 4))?;
            if number + 1 == starts.len() as u64 {
                // What was written is visible to transfers.
                let region = [vk::BufferCopy::default().size(back.bytes)];
                device.cmd_copy_buffer(commands, renderer.output()?.colors, back.buffer, &region);
                let barrier = [vk::MemoryBarrier2::default()
                    .src_stage_mask(vk::PipelineStageFlags2::ALL_TRANSFER)
                    .src_access_mask(vk::AccessFlags2::TRANSFER_WRITE)
                    .dst_stage_mask(vk::PipelineStageFlags2::HOST)
                    .dst_access_mask(vk::AccessFlags2::HOST_READ)];
                device.cmd_pipeline_barrier2(commands, &vk::DependencyInfo::default().memory_barriers(&barrier));
            }
            device.end_command_buffer(commands)?;
            let info = |value| {
                let stages = vk::PipelineStageFlags2::ALL_COMMANDS;
                [vk::SemaphoreSubmitInfo::default().semaphore(timeline).value(value).stage_mask(stages)]
            };
            let (wait, signal) = (info(number), info(number + 1));
            let commands = [vk::CommandBufferSubmitInfo::default().command_buffer(commands)];
            let submit = [vk::SubmitInfo2::default()
                .wait_semaphore_infos(&wait)
                .command_buffer_infos(&commands)
                .signal_semaphore_infos(&signal)];
            device.queue_submit2(queue, &submit, vk::Fence::null())?;
        }
        let (semaphores, values) = ([timeline], [starts.len() as u64]);
        let wait = vk::SemaphoreWaitInfo::default().semaphores(&semaphores).values(&values);
        device.wait_semaphores(&wait, u64::MAX)?;

        write(output, size, back.colors())?;
        println!("{} samples in {} submissions on {}", samples, starts.len(), translucent.info().name);

        drop((renderer, translucent));
        back.destroy();
        device.destroy_semaphore(timeline, None);
        device.destroy_command_pool(pool, None);
        assert_eq!(allocator.held.lock().map_or(0, |held| *held), 0, "everything was given back");
        device.destroy_device(None);
        instance.destroy_instance(None);
    }
    Ok(())
}

/// A buffer of the application's that the host reads.
struct Back<'a> {
    device: &'a ash::Device,
    buffer: vk::Buffer,
    memory: vk::DeviceMemory,
    bytes: u64,
    mapped: *const f32,
}

impl<'a> Back<'a> {
    fn new(
        device: &'a ash::Device,
        types: &vk::PhysicalDeviceMemoryProperties,
        bytes: u64,
    ) -> Result<Back<'a>, Box<dyn Error>> {
        let create = vk::BufferCreateInfo::default().size(bytes).usage(vk::BufferUsageFlags::TRANSFER_DST);
        let wanted = vk::MemoryPropertyFlags::HOST_VISIBLE | vk::MemoryPropertyFlags::HOST_COHERENT;
        // SAFETY: the device is alive; what is made here is destroyed in `destroy`.
        unsafe {
            let buffer = device.create_buffer(&create, None)?;
            let needs = device.get_buffer_memory_requirements(buffer);
            let types = types.memory_types_as_slice();
            let fits = |&i: &usize| needs.memory_type_bits >> i & 1 == 1 && types[i].property_flags.contains(wanted);
            let index = (0..types.len()).find(fits).ok_or("no memory that the host reads")?;
            let create = vk::MemoryAllocateInfo::default().allocation_size(needs.size).memory_type_index(index as u32);
            let memory = device.allocate_memory(&create, None)?;
            device.bind_buffer_memory(buffer, memory, 0)?;
            let mapped = device.map_memory(memory, 0, vk::WHOLE_SIZE, vk::MemoryMapFlags::empty())?;
            Ok(Back { device, buffer, memory, bytes, mapped: mapped.cast() })
        }
    }

    fn colors(&self) -> &[f32] {
        // SAFETY: it is mapped for that many bytes, and the device has finished with it.
        unsafe { std::slice::from_raw_parts(self.mapped, self.bytes as usize / 4) }
    }

    fn destroy(self) {
        // SAFETY: the device has finished with it.
        unsafe {
            self.device.destroy_buffer(self.buffer, None);
            self.device.free_memory(self.memory, None);
        }
    }
}

/// Writes four numbers a pixel as an EXR file.
fn write(file: &str, size: u32, colors: &[f32]) -> Result<(), Box<dyn Error>> {
    let channel = |(index, name): (usize, &str)| translucent::image::Channel {
        name: name.into(),
        data: colors.iter().skip(index).step_by(4).copied().collect(),
    };
    let image = translucent::Image {
        width: size,
        height: size,
        origin: (0, 0),
        full: (size, size),
        channels: ["R", "G", "B", "A"].into_iter().enumerate().map(channel).collect(),
        attributes: Default::default(),
    };
    Ok(image.write(file)?)
}
