//! What is asked of a caller's device, and what is not done to it.

use super::app::App;
use std::sync::{
    Arc, Mutex,
    atomic::{AtomicUsize, Ordering},
};
use translucent::{
    Device, Error, Renderer, Scene, Settings,
    ash::vk,
    gpu::{Allocation, Allocator, Buffer, Location, MemoryRequest, RawDevice, Requirements, download, upload},
};

#[test]
fn what_crosses_threads() {
    fn send<T: Send>() {}
    fn sync<T: Sync>() {}
    send::<Renderer>();
    send::<Device>();
    sync::<Device>();
    send::<Scene>();
    sync::<Scene>();
    send::<Settings>();
    sync::<Settings>();
    send::<Requirements>();
    sync::<Requirements>();
    send::<Buffer>();
    send::<RawDevice>();
}

#[test]
fn requirements_are_known_before_a_device_is_and_chain_into_its_creation() {
    let app = App::new();
    let mut requirements = Requirements::new();
    assert_eq!(unsafe { requirements.missing(&app.instance, app.physical) }, Vec::<String>::new());
    let queues = [vk::DeviceQueueCreateInfo::default().queue_family_index(app.family).queue_priorities(&[1.0])];
    let create = requirements.chain(vk::DeviceCreateInfo::default().queue_create_infos(&queues));
    let device = unsafe { app.instance.create_device(app.physical, &create, None) }.expect("it is complete");
    let raw = RawDevice {
        created_with: Some(&create),
        ..RawDevice::new(app.instance.clone(), app.physical, device.clone(), app.family)
    };
    let ours = unsafe { Device::from_raw(raw) }.expect("all is there");
    assert!(!ours.has_queue() && ours.host_import_alignment().is_none());
    drop(ours);
    unsafe { device.destroy_device(None) };
    app.close();
}

/// The error of a device that is handed over with a `VkDeviceCreateInfo`.
fn refused(app: &App, create: &vk::DeviceCreateInfo) -> String {
    let error = unsafe { Device::from_raw(RawDevice { created_with: Some(create), ..app.raw() }) };
    let error = error.expect_err("something is missing");
    assert!(matches!(error, Error::Device(_)), "{error}");
    error.to_string()
}

#[test]
fn what_a_device_was_made_without_is_named() {
    let app = App::new();
    let queues = [vk::DeviceQueueCreateInfo::default().queue_family_index(app.family).queue_priorities(&[1.0])];
    for (index, name) in Requirements::new().features.into_iter().enumerate() {
        let mut features12 = vk::PhysicalDeviceVulkan12Features::default().scalar_block_layout(index != 0);
        let mut features13 =
            vk::PhysicalDeviceVulkan13Features::default().synchronization2(index != 1).maintenance4(index != 2);
        let create = vk::DeviceCreateInfo::default()
            .queue_create_infos(&queues)
            .push_next(&mut features12)
            .push_next(&mut features13);
        let text = refused(&app, &create);
        assert!(text.ends_with(&format!("without the feature {name}")), "{text}");
    }
    // Each feature may also come in the structure of the extension that brought it.
    let mut scalar = vk::PhysicalDeviceScalarBlockLayoutFeatures::default().scalar_block_layout(true);
    let mut synchronization = vk::PhysicalDeviceSynchronization2Features::default().synchronization2(true);
    let mut maintenance = vk::PhysicalDeviceMaintenance4Features::default().maintenance4(true);
    let create = vk::DeviceCreateInfo::default()
        .push_next(&mut scalar)
        .push_next(&mut synchronization)
        .push_next(&mut maintenance);
    let text = refused(&app, &create);
    assert!(text.contains(&format!("without a queue of family {}", app.family)), "{text}");
    let error = unsafe { Device::from_raw(RawDevice { queue_family: 99, ..app.raw() }) };
    assert!(error.is_err_and(|error| error.to_string().contains("queue family 99 has no compute")));
    app.close();
}

#[test]
fn an_instance_for_less_than_vulkan_1_3_is_refused() {
    let app = App::of_version(vk::API_VERSION_1_2);
    let error = unsafe { Device::from_raw(app.raw()) }.expect_err("there are no functions of 1.3");
    assert!(error.to_string().contains("less than Vulkan 1.3"), "{error}");
    // Validation has long said so.
    app.close_unchecked();
}

#[test]
fn a_caller_keeps_his_device_and_several_stand_side_by_side() {
    let (one, two) = (App::new(), App::new());
    let ours = Device::open(&Default::default()).expect("a device");
    let devices = [one.open(), one.open(), two.open(), ours];
    let buffers = devices.each_ref().map(|device| Buffer::new(device, "words", 40, Location::Device).expect("memory"));
    for (i, (device, buffer)) in devices.iter().zip(&buffers).enumerate() {
        upload(device, buffer, &[i as u8; 40]).expect("a queue");
    }
    drop(devices.map(|device| device.info().name.clone()));
    drop(buffers);
    // Still usable.
    one.run(|_| ());
    one.close();
    two.close();
}

#[test]
fn without_a_queue_the_host_fills_buffers_and_staging_is_an_error() {
    let app = App::new();
    let device = unsafe { Device::from_raw(RawDevice { queue: None, ..app.raw() }) }.expect("the device is fit");
    let buffer = Buffer::new(&device, "words", 40, Location::Device).expect("memory");
    upload(&device, &buffer, &[7; 40]).expect("it is mapped");
    assert_eq!(download(&device, &buffer, 40).expect("it is mapped"), [7; 40]);
    let theirs = Buffer::new(&device, "theirs", 40, Location::Scratch).expect("memory");
    let foreign = unsafe { Buffer::of_caller(&device, theirs.raw(), 40) };
    let error = upload(&device, &foreign, &[7; 40]).expect_err("it is not mapped");
    assert!(error.to_string().contains("without a queue"), "{error}");
    drop((buffer, foreign, theirs, device));
    app.close();
}

/// gpu-allocator behind a count.
struct Counting {
    inner: Arc<Mutex<gpu_allocator::vulkan::Allocator>>,
    given: AtomicUsize,
    held: AtomicUsize,
}

unsafe impl Allocator for Counting {
    fn allocate(&self, request: &MemoryRequest) -> Result<Allocation, String> {
        self.given.fetch_add(1, Ordering::Relaxed);
        self.held.fetch_add(1, Ordering::Relaxed);
        self.inner.allocate(request)
    }

    fn free(&self, allocation: Allocation) {
        self.held.fetch_sub(1, Ordering::Relaxed);
        self.inner.free(allocation);
    }
}

#[test]
fn memory_comes_from_the_callers_allocator_and_goes_back() {
    let app = App::new();
    let counting = Arc::new(Counting { inner: app.allocator(), given: AtomicUsize::new(0), held: AtomicUsize::new(0) });
    let raw = RawDevice { allocator: Some(counting.clone()), ..app.raw() };
    let device = unsafe { Device::from_raw(raw) }.expect("the device is fit");
    let buffers = [Location::Device, Location::Scratch, Location::Upload, Location::Readback]
        .map(|location| Buffer::new(&device, "words", 1000, location).expect("memory"));
    assert_eq!(counting.held.load(Ordering::Relaxed), 4);
    upload(&device, &buffers[0], &[3; 1000]).expect("a queue");
    assert_eq!(download(&device, &buffers[0], 1000).expect("a queue"), [3; 1000]);
    drop((buffers, device));
    assert!(counting.given.load(Ordering::Relaxed) >= 4);
    assert_eq!(counting.held.load(Ordering::Relaxed), 0);
    drop(counting);
    app.close();
}

#[test]
fn an_allocator_without_memory_is_an_error_that_names_the_buffer() {
    struct Empty;
    unsafe impl Allocator for Empty {
        fn allocate(&self, _: &MemoryRequest) -> Result<Allocation, String> {
            Err("nothing left".into())
        }
        fn free(&self, _: Allocation) {}
    }
    let app = App::new();
    let device = unsafe { Device::from_raw(RawDevice { allocator: Some(Arc::new(Empty)), ..app.raw() }) };
    let device = device.expect("the device is fit");
    let error = Buffer::new(&device, "sums", 1000, Location::Device).err().expect("no memory");
    assert!(error.to_string().contains("sums") && error.to_string().contains("nothing left"), "{error}");
    drop(device);
    app.close();
}

/// Bytes at an address that is a multiple of a page.
pub struct Pages(*mut u8, std::alloc::Layout);

impl Pages {
    pub fn start(&self) -> *mut u8 {
        self.0
    }

    pub fn new(bytes: usize) -> Pages {
        let layout = std::alloc::Layout::from_size_align(bytes, 4096).expect("a layout");
        Pages(unsafe { std::alloc::alloc_zeroed(layout) }, layout)
    }
}

impl Drop for Pages {
    fn drop(&mut self) {
        unsafe { std::alloc::dealloc(self.0, self.1) };
    }
}

#[test]
fn host_memory_is_used_in_place() {
    let app = App::new();
    let device = app.open_with_create_info();
    let Some(alignment) = device.host_import_alignment() else {
        println!("skipped: the device has no VK_EXT_external_memory_host");
        return;
    };
    let bytes = 4 * alignment as usize;
    let pages = Pages::new(bytes + alignment as usize);
    let start = std::ptr::NonNull::new(pages.0).expect("memory");
    let imported = unsafe { Buffer::import_host(&device, "pages", start, bytes as u64) }.expect("it is aligned");
    let source = Buffer::new(&device, "source", bytes as u64, Location::Upload).expect("memory");
    source.write(&vec![9u8; bytes]);
    // The device writes them, and the host sees it without a copy.
    let mut recorder = translucent::gpu::Recorder::new(&device).expect("a queue");
    recorder.begin().expect("a device that works");
    recorder.copy(&source, &imported, bytes as u64 - 4);
    recorder.submit_and_wait().expect("a device that works");
    let seen = unsafe { std::slice::from_raw_parts(pages.0, bytes) };
    assert!(seen[..bytes - 4].iter().all(|&byte| byte == 9) && seen[bytes - 4..] == [0; 4]);
    for (offset, bytes) in [(4, bytes), (0, bytes - 4), (0, 0)] {
        let error = unsafe { Buffer::import_host(&device, "odd", start.add(offset), bytes as u64) }.err();
        assert!(error.is_some_and(|error| error.to_string().contains("multiple of")));
    }
    drop((recorder, imported, source, device));
    app.close();
}
