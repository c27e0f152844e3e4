//! Vulkan's functions fail, each at each of its calls: no panic, no leak, the right error, and afterwards the same
//! renderer goes on to the same image.

use super::{
    app::App,
    leaks::{self, live},
};
use glam::DVec3;
use std::{
    collections::HashMap,
    ffi::CStr,
    mem::transmute,
    ops::ControlFlow,
    sync::{
        Arc, Mutex, MutexGuard, PoisonError,
        atomic::{AtomicUsize, Ordering::Relaxed},
    },
    time::Duration,
};
use translucent::{
    Device, Error, Goal, Image, LoadOptions, Model, Renderer, Result, Scene, Settings,
    ash::vk,
    gpu::{Allocation, Allocator, MemoryRequest, RawDevice},
    measure::scenes::{Eye, Mesh, gltf, matter},
    timeline::Timeline,
};

/// What fails, and what was called since it was set.
#[derive(Default)]
struct Faults {
    calls: HashMap<&'static str, usize>,
    /// Function, which call of it, and what it returns.
    fault: Option<(&'static str, usize, vk::Result)>,
    /// Everything that can tell of a lost device does so from the fault on.
    lost: bool,
    struck: bool,
}

static FAULTS: Mutex<Option<Faults>> = Mutex::new(None);

/// Functions that say when the device is lost.
const LOSE: [&str; 6] = [
    "vkQueueSubmit",
    "vkQueueSubmit2",
    "vkWaitForFences",
    "vkWaitSemaphores",
    "vkQueueWaitIdle",
    "vkGetQueryPoolResults",
];

/// Functions that the allocator calls.
const MEMORY: [&str; 2] = ["vkAllocateMemory", "vkMapMemory"];

/// Counts a call, and says whether it fails: with what, and whether the device is lost from then on.
fn strike(function: &'static str) -> Option<(vk::Result, bool)> {
    let mut guard = FAULTS.lock().unwrap_or_else(PoisonError::into_inner);
    let faults = guard.get_or_insert_default();
    let calls = faults.calls.entry(function).or_default();
    *calls += 1;
    let (named, number, result) = faults.fault?;
    let again = faults.lost && faults.struck && LOSE.contains(&function);
    if (named, number) == (function, *calls) || again {
        faults.struck = true;
        return Some((result, faults.lost));
    }
    None
}

/// Lets that call of `function` fail, or none; returns the calls since it was called last, by function.
fn set(fault: Option<(&'static str, usize, vk::Result)>, lost: bool) -> HashMap<&'static str, usize> {
    let mut guard = FAULTS.lock().unwrap_or_else(PoisonError::into_inner);
    guard.replace(Faults { fault, lost, ..Faults::default() }).unwrap_or_default().calls
}

/// Functions that can fail, with their arguments.
macro_rules! faulty {
    ($($function:ident($($argument:ident: $type:ty),*);)*) => {
        $(#[allow(non_snake_case)]
        mod $function {
            use super::*;

            static REAL: AtomicUsize = AtomicUsize::new(0);

            type Function = unsafe extern "system" fn($($type),*) -> vk::Result;

            unsafe extern "system" fn call($($argument: $type),*) -> vk::Result {
                let real = || unsafe { transmute::<usize, Function>(REAL.load(Relaxed))($($argument),*) };
                let Some((result, lost)) = strike(stringify!($function)) else { return real() };
                // Nothing runs on a lost device, but something may on the one that is there.
                if lost && stringify!($function).contains("Wait") {
                    let _ = real();
                }
                result
            }

            pub fn wrap(real: vk::PFN_vkVoidFunction) -> vk::PFN_vkVoidFunction {
                REAL.store(real.map_or(0, |function| function as usize), Relaxed);
                real.and(unsafe { transmute::<Function, vk::PFN_vkVoidFunction>(call) })
            }
        })*

        const FUNCTIONS: &[&str] = &[$(stringify!($function)),*];

        fn wrap(name: &CStr, function: vk::PFN_vkVoidFunction) -> vk::PFN_vkVoidFunction {
            let function = match name.to_str() {
                $(Ok(stringify!($function)) => $function::wrap(function),)*
                _ => function,
            };
            leaks::wrap(name, function)
        }
    };
}
faulty! {
    vkAllocateMemory(device: usize, info: usize, callbacks: usize, out: usize);
    vkMapMemory(device: usize, memory: u64, offset: u64, size: u64, flags: u32, out: usize);
    vkBindBufferMemory(device: usize, buffer: u64, memory: u64, offset: u64);
    vkCreateBuffer(device: usize, info: usize, callbacks: usize, out: usize);
    vkCreateDescriptorSetLayout(device: usize, info: usize, callbacks: usize, out: usize);
    vkCreatePipelineLayout(device: usize, info: usize, callbacks: usize, out: usize);
    vkCreateDescriptorPool(device: usize, info: usize, callbacks: usize, out: usize);
    vkCreateShaderModule(device: usize, info: usize, callbacks: usize, out: usize);
    vkCreateComputePipelines(device: usize, cache: u64, count: u32, infos: usize, callbacks: usize, out: usize);
    vkCreateCommandPool(device: usize, info: usize, callbacks: usize, out: usize);
    vkCreateFence(device: usize, info: usize, callbacks: usize, out: usize);
    vkCreateSemaphore(device: usize, info: usize, callbacks: usize, out: usize);
    vkCreateQueryPool(device: usize, info: usize, callbacks: usize, out: usize);
    vkAllocateDescriptorSets(device: usize, info: usize, out: usize);
    vkAllocateCommandBuffers(device: usize, info: usize, out: usize);
    vkResetCommandPool(device: usize, pool: u64, flags: u32);
    vkBeginCommandBuffer(commands: usize, info: usize);
    vkEndCommandBuffer(commands: usize);
    vkResetFences(device: usize, count: u32, fences: usize);
    vkQueueSubmit(queue: usize, count: u32, submits: usize, fence: u64);
    vkQueueSubmit2(queue: usize, count: u32, submits: usize, fence: u64);
    vkWaitForFences(device: usize, count: u32, fences: usize, all: u32, timeout: u64);
    vkWaitSemaphores(device: usize, info: usize, timeout: u64);
    vkQueueWaitIdle(queue: usize);
    vkGetQueryPoolResults(
        device: usize, pool: u64, first: u32, count: u32, size: usize, data: usize, stride: u64, flags: u32);
}

/// Results that a function may give.
fn results(function: &str) -> &'static [vk::Result] {
    let all =
        &[vk::Result::ERROR_OUT_OF_DEVICE_MEMORY, vk::Result::ERROR_OUT_OF_HOST_MEMORY, vk::Result::ERROR_DEVICE_LOST];
    if LOSE.contains(&function) { all } else { &all[..2] }
}

/// One such test at a time: faults and counts are of the process.
pub fn alone() -> MutexGuard<'static, ()> {
    static ALONE: Mutex<()> = Mutex::new(());
    ALONE.lock().unwrap_or_else(PoisonError::into_inner)
}

/// gpu-allocator, of whose memory nobody says that the host caches it: all bytes are staged.
struct Uncached(Arc<Mutex<gpu_allocator::vulkan::Allocator>>);

unsafe impl Allocator for Uncached {
    fn allocate(&self, request: &MemoryRequest) -> std::result::Result<Allocation, String> {
        let mut given = self.0.allocate(request)?;
        given.properties &= !vk::MemoryPropertyFlags::HOST_CACHED;
        Ok(given)
    }

    fn free(&self, allocation: Allocation) {
        self.0.free(allocation);
    }
}

fn staged(app: &App) -> Device {
    let allocator: Arc<dyn Allocator> = Arc::new(Uncached(app.allocator()));
    unsafe { Device::from_raw(RawDevice { allocator: Some(allocator), ..app.raw() }) }.expect("the device is fit")
}

fn ball() -> Scene {
    let materials = [matter([5.0; 3], [0.2; 3], 1.3)];
    let eye = Eye { eye: DVec3::Z * 3.0, at: DVec3::ZERO, lens: 0.7 };
    let sun = serde_json::json!({"type": "directional"});
    let file = gltf(&[(Mesh::sphere(1.0, 2), 0)], &materials, &[(sun, DVec3::new(1.0, 1.0, 2.0), DVec3::ZERO)], &eye);
    Scene::from_bytes("ball.gltf", file.to_string().as_bytes(), &LoadOptions::default()).expect("a scene")
}

/// A small render.
struct Job {
    scene: Scene,
    settings: Settings,
    samples: u32,
}

impl Job {
    fn new(bands: u32, samples: u32) -> Job {
        let settings = Settings {
            resolution: Some((16, 16)),
            model: Model::Standard,
            seed: 5,
            band_pixels: Some(256 / bands),
            ..Settings::default()
        };
        Job { scene: ball(), settings, samples }
    }

    fn renderer(&self, device: &Device) -> Result<Renderer> {
        Renderer::new(device, &self.scene, &self.settings)
    }

    /// Does what is not done yet.
    fn go_on(&self, device: &Device, renderer: &mut Option<Renderer>) -> Result<Image> {
        if renderer.is_none() {
            *renderer = Some(self.renderer(device)?);
        }
        let renderer = renderer.as_mut().expect("made just above");
        renderer.render_rest(0..self.samples, &mut |_| ControlFlow::Continue(()))?;
        renderer.image()
    }
}

#[track_caller]
fn check(error: &Error, function: &str, result: vk::Result) {
    let memory = MEMORY.contains(&function);
    match error {
        Error::Vulkan { step, result: told } => assert!(*told == result && !step.is_empty() && !memory, "{error}"),
        Error::Memory { step, problem } => {
            assert!(memory && step.starts_with("create buffer `") && !problem.is_empty(), "{function}: {error}");
        }
        _ => panic!("{function}: {error}"),
    }
    assert_eq!(error.is_device_lost(), result == vk::Result::ERROR_DEVICE_LOST);
}

/// Lets `functions` fail at each of their calls in the job, on a device that has done it once: with each of their
/// results, or with these in turn.
fn sweep(device: &Device, job: &Job, functions: &[&'static str], each: bool) {
    let expected = job.go_on(device, &mut None).expect("no fault is set");
    let before = live();
    set(None, false);
    assert!(job.go_on(device, &mut None).expect("no fault is set") == expected);
    let calls = set(None, false);
    let mut runs = 0;
    for function in functions {
        for number in 1..=calls.get(function).copied().unwrap_or(0) {
            let results = results(function);
            let turn = number % results.len();
            for &result in if each { results } else { &results[turn..=turn] } {
                let what = format!("{function} number {number}: {result:?}");
                set(Some((function, number, result)), false);
                let mut renderer = None;
                let error = job.go_on(device, &mut renderer).expect_err(&what);
                check(&error, function, result);
                set(None, false);
                let image = job.go_on(device, &mut renderer).expect("the fault is over");
                assert!(image == expected, "{what}: another image");
                drop(renderer);
                assert_eq!(live(), before, "{what}");
                runs += 1;
            }
        }
    }
    println!("{runs} faults; calls: {calls:?}");
}

#[test]
fn every_call_of_a_render_may_fail() {
    let _alone = alone();
    let app = App::wrapped(wrap);
    let device = app.open();
    let mut job = Job::new(1, 8);
    // So that timestamps are read as well.
    job.settings.timeline = Some(Timeline::new());
    sweep(&device, &job, FUNCTIONS, true);
    drop(device);
    app.close();
}

#[test]
fn every_transfer_of_a_render_in_bands_may_fail() {
    let _alone = alone();
    let app = App::wrapped(wrap);
    let device = staged(&app);
    // Sums go to the host and back.
    sweep(&device, &Job::new(2, 33), &["vkQueueSubmit2", "vkWaitForFences"], false);
    drop(device);
    app.close();
}

#[test]
fn every_copy_of_an_update_may_fail() {
    let _alone = alone();
    let app = App::wrapped(wrap);
    let device = staged(&app);
    let job = Job::new(1, 4);
    let mut other = job.scene.clone();
    other.materials[0].medium.as_mut().expect("it is translucent").sigma_a *= 3.0;
    other.lights[0].intensity *= 2.0;
    let expected = job.go_on(&device, &mut None).expect("no fault is set");
    let mut renderer = job.renderer(&device).expect("no fault is set");
    set(None, false);
    renderer.update(&other).expect("no fault is set");
    let calls = set(None, false);
    renderer.update(&job.scene).expect("no fault is set");
    for function in ["vkQueueSubmit2", "vkWaitForFences"] {
        assert!(calls[function] >= 2, "materials and lights: {calls:?}");
        for number in 1..=calls[function] {
            let result = results(function)[number % 3];
            set(Some((function, number, result)), false);
            check(&renderer.update(&other).expect_err(function), function, result);
            set(None, false);
            // Whatever was copied before the fault is copied again.
            renderer.update(&job.scene).expect("the fault is over");
            renderer.render(job.samples).expect("no fault is set");
            assert!(renderer.image().expect("no fault is set") == expected, "{function} number {number}");
        }
    }
    drop((renderer, device));
    app.close();
}

#[test]
fn every_step_on_a_new_device_may_fail() {
    let _alone = alone();
    let app = App::wrapped(wrap);
    let before = live();
    let device = app.open();
    let mut job = Job::new(1, 8);
    // More than the allocator takes at a time.
    job.settings = Settings { resolution: Some((512, 512)), band_pixels: None, ..job.settings };
    // One kernel after the other, or it would be open which of them a fault meets.
    let alone = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("one thread");
    let renderer = || alone.install(|| job.renderer(&device));
    let mut runs = 0;
    let mut fail = |function, number, result| {
        set(Some((function, number, result)), false);
        check(&renderer().err().expect("an error"), function, result);
        runs += 1;
    };
    for function in MEMORY {
        results(function).iter().for_each(|result| fail(function, 1, *result));
    }
    let steps =
        ["vkCreateDescriptorSetLayout", "vkCreatePipelineLayout", "vkCreateShaderModule", "vkCreateComputePipelines"];
    for kernel in 0.. {
        // Each step of the next kernel; then one is compiled, and kept, and the one after it is not.
        for function in steps {
            results(function).iter().for_each(|result| fail(function, 1, *result));
        }
        set(Some(("vkCreateComputePipelines", 2, vk::Result::ERROR_OUT_OF_HOST_MEMORY)), false);
        if renderer().is_ok() {
            assert!(kernel >= 4, "{kernel} kernels");
            break;
        }
    }
    let warm = live();
    set(None, false);
    drop(job.renderer(&device).expect("no fault is set"));
    let calls = set(None, false);
    for function in MEMORY {
        for number in 1..=calls[function] {
            for &result in results(function) {
                fail(function, number, result);
                assert_eq!(live(), warm, "{function} number {number}: {result:?}");
            }
        }
    }
    println!("{runs} faults; calls: {calls:?}");
    set(None, false);
    drop(device);
    assert_eq!(live(), before);
    app.close();
}

/// Renders with a device that is lost at each of its submissions, or while it is waited for, and goes on with another.
fn lose(job: &Job, keep: Option<Duration>, [device, other]: &[Device; 2], lost_at_most: u64) {
    let expected = job.go_on(other, &mut None).expect("no fault is set");
    set(None, false);
    let mut made = job.renderer(device).expect("no fault is set");
    let uploads = set(None, false);
    made.render_rest(0..job.samples, &mut |_| ControlFlow::Continue(())).expect("no fault is set");
    let rendering = set(None, false);
    drop((made.take_image().expect("no fault is set"), made));
    let finishing = set(None, false);
    let before = live();
    for (first, function) in [(1, "vkQueueSubmit2"), (2, "vkWaitForFences")] {
        for number in (first..=rendering[function] + finishing[function]).step_by(2) {
            let mut renderer = job.renderer(device).expect("no fault is set");
            keep.into_iter().for_each(|every| renderer.keep_every(every));
            set(Some((function, number, vk::Result::ERROR_DEVICE_LOST)), true);
            let (mut done, mut again) = (0u64, 0u64);
            let reopen = |error: &Error| {
                assert!(error.is_device_lost());
                set(None, false);
                Ok(other.clone())
            };
            let (renderer, image) = renderer
                .with_recovery(&job.scene, reopen, |renderer| {
                    renderer.render_rest(0..job.samples, &mut |progress| {
                        let pixels = 256 * u64::from(job.samples);
                        let now = pixels - progress.total + progress.done;
                        again = again.max(done.saturating_sub(now));
                        done = now;
                        ControlFlow::Continue(())
                    })?;
                    renderer.take_image()
                })
                .expect("a device is lost once");
            assert!(image == expected, "{function} number {number}: another image");
            // The sums of what is in the image are freed.
            let few = number > rendering[function] || again <= lost_at_most;
            assert!(few, "{function} number {number}: {again} samples anew");
            drop(renderer);
            assert_eq!(live(), before, "{function} number {number}");
        }
    }
    println!("submissions: {:?}", [uploads, rendering, finishing].map(|calls| calls["vkQueueSubmit2"]));
}

#[test]
fn a_render_outlives_the_loss_of_its_device() {
    let _alone = alone();
    let apps = [App::wrapped(wrap), App::wrapped(wrap)];
    let devices = apps.each_ref().map(staged);
    let one = Job::new(1, 40);
    // One band of which the host has nothing: from the start.
    lose(&one, None, &devices, 256 * 40);
    // One band whose sums are kept after each submission: only that is lost.
    lose(&one, Some(Duration::ZERO), &devices, 0);
    // Two bands that take turns after 32 samples.
    lose(&Job::new(2, 40), None, &devices, 128 * 32);
    drop(devices);
    apps.into_iter().for_each(App::close);
}

/// Pixels have different numbers of samples, which the sums alone know.
#[test]
fn a_render_to_an_error_outlives_the_loss_of_its_device() {
    let _alone = alone();
    let apps = [App::wrapped(wrap), App::wrapped(wrap)];
    let [device, other] = apps.each_ref().map(staged);
    let goal = Goal { samples: 2000, error: Some(0.1), deadline: None };
    for bands in [1, 2] {
        let mut job = Job::new(bands, 0);
        job.settings.estimate_error = true;
        let finish = |renderer: &mut Renderer| {
            renderer.render_until(&goal, &mut |_| ControlFlow::Continue(()))?;
            renderer.take_image()
        };
        let expected = finish(&mut job.renderer(&other).expect("no fault is set")).expect("no fault is set");
        let samples = expected.channel("samples.Y").expect("contract");
        assert!(samples.iter().any(|&n| n != samples[0]), "all pixels have {} samples", samples[0]);
        let mut made = job.renderer(&device).expect("no fault is set");
        set(None, false);
        finish(&mut made).expect("no fault is set");
        let calls = set(None, false)["vkQueueSubmit2"];
        drop(made);
        let before = live();
        // Some of the many at the start and between, and the last ones all.
        for number in (1..=calls).filter(|number| number % 23 == 1 || number + 6 > calls) {
            let renderer = job.renderer(&device).expect("no fault is set");
            set(Some(("vkQueueSubmit2", number, vk::Result::ERROR_DEVICE_LOST)), true);
            let reopen = |_: &Error| {
                set(None, false);
                Ok(other.clone())
            };
            let (renderer, image) = renderer.with_recovery(&job.scene, reopen, finish).expect("lost once");
            let at = format!("{bands} bands, submission {number} of {calls}");
            // A band that was done before the loss makes for another plan; a pixel with as many samples has the same ones.
            assert!(bands > 1 || image == expected, "{at}: another image");
            assert!(image.attributes["translucent.stop"] == expected.attributes["translucent.stop"], "{at}");
            let found = image.channel("samples.Y").expect("contract");
            let alike = |i: &usize| found[*i] == samples[*i];
            for (channel, expected) in image.channels.iter().zip(&expected.channels) {
                let same = |i: usize| channel.data[i] == expected.data[i];
                assert!((0..found.len()).filter(alike).all(same), "{at}: another {}", channel.name);
            }
            drop(renderer);
            assert_eq!(live(), before, "{at}");
        }
    }
    drop((device, other));
    apps.into_iter().for_each(App::close);
}

#[test]
fn a_device_that_is_lost_again_is_an_error() {
    let _alone = alone();
    let app = App::wrapped(wrap);
    let device = app.open();
    let job = Job::new(1, 8);
    drop(job.go_on(&device, &mut None).expect("no fault is set"));
    let before = live();
    let renderer = job.renderer(&device).expect("no fault is set");
    let mut other = job.scene.clone();
    other.lights[0].intensity *= 2.0;
    let lose = || set(Some(("vkWaitForFences", 1, vk::Result::ERROR_DEVICE_LOST)), true);
    lose();
    let mut opened = 0;
    let reopen = |_: &Error| {
        opened += 1;
        lose();
        Ok(device.clone())
    };
    let lost = renderer.with_recovery(&job.scene, reopen, |renderer| renderer.render(8));
    assert!(lost.is_err_and(|error| error.is_device_lost()));
    // No device to go on with, and another scene.
    let renderer = job.renderer(&device).expect("the host reaches its memory");
    lose();
    let none = |_: &Error| Err(Error::Device("none is left".into()));
    let lost = renderer.with_recovery(&job.scene, none, |renderer| renderer.render(8));
    assert!(lost.is_err_and(|error| error.to_string().contains("none is left")));
    set(None, false);
    let renderer = job.renderer(&device).expect("no fault is set");
    assert!(renderer.resume(&device, &other).is_err_and(|error| error.to_string().contains("scene")));
    assert_eq!((opened, live()), (1, before));
    drop(device);
    app.close();
}
