//! Everything that is made is destroyed: Vulkan's objects, device memory and the host's, over a thousand cycles.

use super::{app::App, record::settings};
use glam::DVec3;
use std::{
    alloc::{GlobalAlloc, Layout as Bytes, System},
    ffi::{CStr, c_void},
    mem::transmute,
    sync::atomic::{AtomicIsize, AtomicUsize, Ordering::Relaxed},
};
use translucent::{
    LoadOptions, Renderer, Scene,
    ash::vk,
    gpu::{Buffer, Layout, Location, Recorder, download, upload},
    measure::scenes::{Eye, Mesh, gltf, matter},
    timeline::Timeline,
};

/// Counts the bytes that Rust holds.
struct Counting;

static HELD: AtomicIsize = AtomicIsize::new(0);

unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, bytes: Bytes) -> *mut u8 {
        HELD.fetch_add(bytes.size() as isize, Relaxed);
        unsafe { System.alloc(bytes) }
    }

    unsafe fn dealloc(&self, start: *mut u8, bytes: Bytes) {
        HELD.fetch_sub(bytes.size() as isize, Relaxed);
        unsafe { System.dealloc(start, bytes) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// Functions that make and destroy objects, counted. All have the same arguments but for the types of pointers and,
/// in some, more after the device.
macro_rules! counted {
    ($($kind:ident: $create:literal $(($($argument:ident: $type:ty),*))?, $destroy:literal;)*) => {
        $(mod $kind {
            use super::*;

            pub static LIVE: AtomicIsize = AtomicIsize::new(0);
            pub static MADE: AtomicUsize = AtomicUsize::new(0);
            static CREATE: AtomicUsize = AtomicUsize::new(0);
            static DESTROY: AtomicUsize = AtomicUsize::new(0);

            type Create = unsafe extern "system" fn(
                vk::Device, $($($type,)*)? *const c_void, *const c_void, *mut u64,
            ) -> vk::Result;
            type Destroy = unsafe extern "system" fn(vk::Device, u64, *const c_void);

            unsafe extern "system" fn create(
                device: vk::Device,
                $($($argument: $type,)*)?
                info: *const c_void,
                callbacks: *const c_void,
                out: *mut u64,
            ) -> vk::Result {
                let real = unsafe { transmute::<usize, Create>(CREATE.load(Relaxed)) };
                let result = unsafe { real(device, $($($argument,)*)? info, callbacks, out) };
                if result == vk::Result::SUCCESS {
                    LIVE.fetch_add(1, Relaxed);
                    MADE.fetch_add(1, Relaxed);
                }
                result
            }

            unsafe extern "system" fn destroy(device: vk::Device, handle: u64, callbacks: *const c_void) {
                if handle != 0 {
                    LIVE.fetch_sub(1, Relaxed);
                }
                unsafe { transmute::<usize, Destroy>(DESTROY.load(Relaxed))(device, handle, callbacks) };
            }

            pub fn wrap(name: &CStr, function: vk::PFN_vkVoidFunction) -> vk::PFN_vkVoidFunction {
                let real = function.map_or(0, |function| function as usize);
                if name.to_bytes() == $create.as_bytes() {
                    CREATE.store(real, Relaxed);
                    return unsafe { transmute::<Create, vk::PFN_vkVoidFunction>(create) };
                }
                if name.to_bytes() == $destroy.as_bytes() {
                    DESTROY.store(real, Relaxed);
                    return unsafe { transmute::<Destroy, vk::PFN_vkVoidFunction>(destroy) };
                }
                function
            }
        })*

        /// Objects that are alive, by kind.
        pub fn live() -> Vec<(&'static str, isize)> {
            vec![$((stringify!($kind), $kind::LIVE.load(Relaxed)),)*]
        }

        /// Objects that were made so far, by kind.
        pub fn made() -> Vec<(&'static str, usize)> {
            vec![$((stringify!($kind), $kind::MADE.load(Relaxed)),)*]
        }

        pub fn wrap(name: &CStr, mut function: vk::PFN_vkVoidFunction) -> vk::PFN_vkVoidFunction {
            $(function = $kind::wrap(name, function);)*
            function
        }
    };
}
counted! {
    memory: "vkAllocateMemory", "vkFreeMemory";
    buffer: "vkCreateBuffer", "vkDestroyBuffer";
    set_layout: "vkCreateDescriptorSetLayout", "vkDestroyDescriptorSetLayout";
    pipeline_layout: "vkCreatePipelineLayout", "vkDestroyPipelineLayout";
    descriptor_pool: "vkCreateDescriptorPool", "vkDestroyDescriptorPool";
    shader_module: "vkCreateShaderModule", "vkDestroyShaderModule";
    pipeline: "vkCreateComputePipelines"(cache: u64, count: u32), "vkDestroyPipeline";
    command_pool: "vkCreateCommandPool", "vkDestroyCommandPool";
    fence: "vkCreateFence", "vkDestroyFence";
    query_pool: "vkCreateQueryPool", "vkDestroyQueryPool";
    semaphore: "vkCreateSemaphore", "vkDestroySemaphore";
}

#[test]
fn a_thousand_cycles_leave_nothing() {
    // In a process of its own: the counts are of all threads.
    let program = std::env::current_exe().expect("this program");
    let output = std::process::Command::new(program)
        .args(["--ignored", "--exact", "leaks::cycles", "--nocapture"])
        .output()
        .expect("it starts");
    let text = String::from_utf8_lossy(&output.stdout).into_owned() + &String::from_utf8_lossy(&output.stderr);
    println!("{text}");
    assert!(output.status.success() && text.contains("1 passed"), "{text}");
}

/// Bytes of this process in memory.
fn resident() -> isize {
    let statm = std::fs::read_to_string("/proc/self/statm").unwrap_or_default();
    statm.split_whitespace().nth(1).and_then(|pages| pages.parse::<isize>().ok()).map_or(0, |pages| pages * 4096)
}

#[test]
#[ignore = "run by a_thousand_cycles_leave_nothing"]
fn cycles() {
    let app = App::wrapped(wrap);
    let materials = [matter([50.0; 3], [1.0; 3], 1.3)];
    let eye = Eye { eye: DVec3::Z * 3.0, at: DVec3::ZERO, lens: 0.7 };
    let sun = serde_json::json!({"type": "directional"});
    let file = gltf(&[(Mesh::sphere(1.0, 2), 0)], &materials, &[(sun, DVec3::Z, DVec3::NEG_Z)], &eye);
    let scene = Scene::from_bytes("ball.gltf", file.to_string().as_bytes(), &LoadOptions::default()).expect("a scene");
    // Of the application: a command pool and a semaphore.
    let before = live();
    let flat = |what: &str, cycle: &mut dyn FnMut()| {
        // What is made once, by the process or by the driver.
        (0..20).for_each(|_| cycle());
        // A pool of threads has a block more of its queue now and then; what leaks is more after every thousand.
        let thousand = || {
            let (objects, bytes, pages) = (live(), HELD.load(Relaxed), resident());
            (0..1000).for_each(|_| cycle());
            assert_eq!(live(), objects, "{what}");
            let (bytes, pages) = (HELD.load(Relaxed) - bytes, resident() - pages);
            println!("{what}: 1000 cycles, {bytes} bytes of Rust's and {pages} of the process more");
            bytes
        };
        let bytes = std::iter::repeat_with(thousand).take(3).find(|bytes| *bytes <= 0);
        assert!(bytes.is_some(), "{what}: bytes held after each thousand");
    };
    flat("devices", &mut || {
        let device = app.open();
        let buffer = Buffer::new(&device, "words", 4096, Location::Device).expect("memory");
        upload(&device, &buffer, &[1; 4096]).expect("a queue");
        assert_eq!(download(&device, &buffer, 8).expect("a queue"), [1; 8]);
        let (_recorder, _layout) = (Recorder::new(&device).expect("a queue"), Layout::new(&device).expect("layout"));
    });
    assert_eq!(live(), before);
    let device = app.open();
    let small = translucent::Settings { resolution: Some((2, 2)), ..settings() };
    flat("renderers", &mut || {
        let renderer = Renderer::new(&device, &scene, &small).expect("a renderer");
        app.run(|commands| unsafe { renderer.record(commands, 0..1).expect("it can be recorded") });
        Renderer::new(&device, &scene, &small).expect("a renderer").render(1).expect("a device that works");
    });
    assert_eq!(query_pool::MADE.load(Relaxed), 0, "nothing is timed unasked");
    flat("profiled renderers", &mut || {
        let timed = translucent::Settings { timeline: Some(Timeline::new()), ..small.clone() };
        Renderer::new(&device, &scene, &timed).expect("a renderer").render(1).expect("a device that works");
    });
    drop(device);
    assert_eq!(live(), before, "kernels go with their device");
    let made = made();
    println!("made: {made:?}");
    assert!(made.iter().all(|(_, count)| *count > 0), "every kind is counted: {made:?}");
    app.close();
}
