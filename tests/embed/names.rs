//! What debuggers show: a name for every buffer and pipeline, a label around every dispatch.

use super::{
    app::App,
    record::{scene, settings},
};
use std::{
    ffi::{CStr, c_char},
    mem::transmute,
    sync::Mutex,
};
use translucent::{
    Device, Renderer,
    ash::{self, vk},
    gpu::RawDevice,
};

/// Names of objects; labels that were opened, and an empty text for each that was closed.
static NAMES: Mutex<Vec<String>> = Mutex::new(vec![]);
static LABELS: Mutex<Vec<String>> = Mutex::new(vec![]);

fn text(name: *const c_char) -> String {
    unsafe { CStr::from_ptr(name) }.to_string_lossy().into_owned()
}

unsafe extern "system" fn set_name(_: vk::Device, info: *const vk::DebugUtilsObjectNameInfoEXT) -> vk::Result {
    NAMES.lock().expect("no panic").push(text(unsafe { (*info).p_object_name }));
    vk::Result::SUCCESS
}

unsafe extern "system" fn begin_label(_: vk::CommandBuffer, label: *const vk::DebugUtilsLabelEXT) {
    LABELS.lock().expect("no panic").push(text(unsafe { (*label).p_label_name }));
}

unsafe extern "system" fn end_label(_: vk::CommandBuffer) {
    LABELS.lock().expect("no panic").push(String::new());
}

unsafe extern "system" fn device_function(_: vk::Device, name: *const c_char) -> vk::PFN_vkVoidFunction {
    type Begin = unsafe extern "system" fn(vk::CommandBuffer, *const vk::DebugUtilsLabelEXT);
    type Name = unsafe extern "system" fn(vk::Device, *const vk::DebugUtilsObjectNameInfoEXT) -> vk::Result;
    unsafe extern "system" fn other() {}
    unsafe {
        match CStr::from_ptr(name).to_bytes() {
            b"vkSetDebugUtilsObjectNameEXT" => transmute::<Name, vk::PFN_vkVoidFunction>(set_name),
            b"vkCmdBeginDebugUtilsLabelEXT" => transmute::<Begin, vk::PFN_vkVoidFunction>(begin_label),
            b"vkCmdEndDebugUtilsLabelEXT" => {
                transmute::<unsafe extern "system" fn(vk::CommandBuffer), vk::PFN_vkVoidFunction>(end_label)
            }
            _ => Some(other),
        }
    }
}

#[test]
fn every_object_has_a_name_and_every_dispatch_a_label() {
    type Get = unsafe extern "system" fn(vk::Device, *const c_char) -> vk::PFN_vkVoidFunction;
    let app = App::new();
    // An instance whose functions of VK_EXT_debug_utils are those above.
    let instance = unsafe {
        ash::Instance::load_with(
            |name| match name.to_bytes() {
                b"vkGetDeviceProcAddr" => device_function as Get as *const _,
                _ => transmute::<vk::PFN_vkVoidFunction, *const _>(app.instance_function(name)),
            },
            app.instance.handle(),
        )
    };
    let cache = app.pipeline_cache();
    let raw = RawDevice { instance, pipeline_cache: cache, allocator: Some(app.allocator()), ..app.raw() };
    let device = unsafe { Device::from_raw(raw) }.expect("the device is fit");
    let renderer = Renderer::new(&device, &scene(), &settings()).expect("a renderer");
    let names = NAMES.lock().expect("no panic").clone();
    for (slot, _) in renderer.buffers() {
        assert!(names.iter().any(|name| name == slot.name()), "{} of {names:?}", slot.name());
    }
    for stem in renderer.kernels() {
        assert!(names.iter().any(|name| name == stem), "{stem} of {names:?}");
    }
    LABELS.lock().expect("no panic").clear();
    app.run(|commands| unsafe { renderer.record(commands, 0..3).expect("it can be recorded") });
    let mut expected = vec!["translucent".to_string()];
    for stem in renderer.timestamp_layout(0..3).expect("it records") {
        expected.extend([stem.to_string(), String::new()]);
    }
    expected.push(String::new());
    assert_eq!(*LABELS.lock().expect("no panic"), expected);
    drop((renderer, device));
    app.destroy_pipeline_cache(cache);
    app.close();
}
