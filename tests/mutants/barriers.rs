//! Dropped barriers. A software driver runs dispatches in order, so its results do not show them; synchronization
//! validation does, and names the kernel that reads or overwrites too early.

use crate::app::App;
use std::{
    ffi::CStr,
    mem::transmute,
    sync::{
        OnceLock,
        atomic::{AtomicUsize, Ordering},
    },
};
use translucent::{Projection, Renderer, ash::vk, verify::cases::portrait};

/// Number of the barrier that is dropped, and how many there were.
static DROPPED: AtomicUsize = AtomicUsize::new(usize::MAX);
static COUNT: AtomicUsize = AtomicUsize::new(0);
static ORIGINAL: OnceLock<vk::PFN_vkCmdPipelineBarrier2> = OnceLock::new();

unsafe extern "system" fn barrier(commands: vk::CommandBuffer, dependency: *const vk::DependencyInfo<'_>) {
    if COUNT.fetch_add(1, Ordering::Relaxed) != DROPPED.load(Ordering::Relaxed) {
        let original = ORIGINAL.get().expect("it was wrapped");
        unsafe { original(commands, dependency) };
    }
}

fn wrap(name: &CStr, function: vk::PFN_vkVoidFunction) -> vk::PFN_vkVoidFunction {
    if name != c"vkCmdPipelineBarrier2" {
        return function;
    }
    let original = function.expect("Vulkan 1.3 has it");
    // Both are of the type that the name says.
    ORIGINAL
        .get_or_init(|| unsafe { transmute::<unsafe extern "system" fn(), vk::PFN_vkCmdPipelineBarrier2>(original) });
    Some(unsafe { transmute::<vk::PFN_vkCmdPipelineBarrier2, unsafe extern "system" fn()>(barrier) })
}

#[test]
fn dropped_barriers_are_named() {
    let app = App::validated(wrap);
    let device = app.open();
    let (scene, settings) = portrait(Projection::Mis).expect("a valid scene");
    let mut renderer = Renderer::new(&device, &scene, &settings).expect("the renderer is made");
    let mut image = |dropped: usize| {
        COUNT.store(0, Ordering::Relaxed);
        DROPPED.store(dropped, Ordering::Relaxed);
        renderer.reset();
        renderer.render(1).expect("renders");
        let image = renderer.image().expect("the image is there");
        (image, COUNT.load(Ordering::Relaxed), app.take_messages())
    };
    let (sound, barriers, messages) = image(usize::MAX);
    assert!(messages.is_empty() && barriers > 6, "{barriers} barriers: {messages:#?}");

    // Who reads what another has written is named; of kernels that also write to it, as `reflect` to the sums and
    // `accumulate` to the probes, the validation layer (1.3.239) says nothing, and `resolve` comes in a submission of its
    // own, after a wait.
    let kernels = ["sample", "reproject", "accumulate"];
    let mut named = [false; 3];
    // From the end, since validation repeats one kind of message ten times only.
    for dropped in (0..barriers).rev() {
        let (found, _, messages) = image(dropped);
        for (name, named) in kernels.iter().zip(&mut named) {
            let hazard = |message: &&String| message.contains("SYNC-HAZARD") && message.contains(&format!("[{name}]"));
            if let Some(message) = messages.iter().find(hazard) {
                println!("barrier {dropped} of {barriers}: `{name}`: {message}");
                *named = true;
            }
        }
        // The results say nothing.
        assert!(found.channels.iter().zip(&sound.channels).all(|(a, b)| a.data == b.data), "barrier {dropped}");
    }
    let silent: Vec<_> = kernels.iter().zip(named).filter(|(_, named)| !named).collect();
    assert!(silent.is_empty(), "no hazard names {silent:?}");
    drop(renderer);
    drop(device);
    app.close_unchecked();
}
