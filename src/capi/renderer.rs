//! Renderers: recording, results, and what changes between recordings.

use crate::{
    Failure, TranslucentResult, VkBool32, VkBuffer, VkCommandBuffer, VkDeviceSize, VkImage, VkImageLayout, VkQueryPool,
    argument, create, destroy, device::TranslucentDevice, exclusive, guard, read, reference, scene::TranslucentScene,
    slice, text,
};
use engine::{
    Renderer, Settings,
    ash::vk::{self, Handle},
    gpu::{Buffer, Timestamps},
    render::{Limits, Plan},
    shared::Slot,
};
use std::ffi::{CString, c_char};

/// Everything about a render that is not the scene. translucent_settings_default fills it in.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct TranslucentSettings {
    /// sizeof(TranslucentSettings).
    pub struct_size: usize,
    /// Size of the image (pixels).
    pub width: u32,
    pub height: u32,
    /// Key of all random numbers.
    pub seed: u32,
    /// Incoming environment directions at each position, at least 1.
    pub directions: u32,
    /// VK_TRUE keeps the sums of eight batches, from which the variance comes.
    pub variance: VkBool32,
    /// VK_TRUE adds the environment where a camera ray hits nothing.
    pub show_environment: VkBool32,
    /// "auto", "standard", "better", "directional", "burley", "table" or "lambert"; null is "auto".
    pub model: *const c_char,
    /// Name of the camera; null: the first, or one that frames the scene.
    pub camera: *const c_char,
}

/// Fills in the defaults: 512 x 512 pixels, seed 0, one direction, variance, no environment behind the scene.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn translucent_settings_default(settings: *mut TranslucentSettings) -> TranslucentResult {
    guard(|| {
        // SAFETY: the caller's pointer, as the header says.
        unsafe {
            let struct_size = read(settings, "settings")?.struct_size;
            *settings = TranslucentSettings {
                struct_size,
                width: 512,
                height: 512,
                seed: 0,
                directions: 1,
                variance: vk::TRUE,
                show_environment: vk::FALSE,
                model: std::ptr::null(),
                camera: std::ptr::null(),
            };
        }
        Ok(())
    })
}

unsafe fn settings_of(settings: *const TranslucentSettings) -> Result<Settings, Failure> {
    // SAFETY: the caller's pointers, as the header says.
    let (given, model, camera) = unsafe {
        let given = read(settings, "settings")?;
        (given, text(given.model, "settings.model")?, text(given.camera, "settings.camera")?)
    };
    Ok(Settings {
        resolution: Some((given.width, given.height)),
        seed: given.seed,
        directions: given.directions,
        variance: given.variance != vk::FALSE,
        show_environment: given.show_environment != vk::FALSE,
        model: model.unwrap_or("auto").parse().map_err(argument)?,
        camera: camera.map_or(Default::default(), |name| engine::CameraChoice::Name(name.into())),
        recording: true,
        ..Settings::default()
    })
}

/// A buffer that may be the caller's.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TranslucentSlot {
    /// The BVH.
    Nodes = 1,
    /// The triangles, in the order of its leaves.
    Triangles = 2,
    /// Normals and material of each triangle.
    Shadings = 3,
    /// The result in full: see TranslucentOutput::pixels.
    Pixels = 13,
    /// The result: see TranslucentOutput::colors.
    Colors = 25,
}

/// The slot of a number that C gave.
fn slot_of(number: u32) -> Result<Slot, Failure> {
    const KNOWN: [(TranslucentSlot, Slot); 5] = [
        (TranslucentSlot::Nodes, Slot::Nodes),
        (TranslucentSlot::Triangles, Slot::Triangles),
        (TranslucentSlot::Shadings, Slot::Shadings),
        (TranslucentSlot::Pixels, Slot::Pixels),
        (TranslucentSlot::Colors, Slot::Colors),
    ];
    let found = KNOWN.iter().find(|(known, _)| *known as u32 == number);
    found.map(|(_, slot)| *slot).ok_or_else(|| argument(format!("{number} is no TranslucentSlot")))
}

/// A caller's buffer in place of the library's, with the usages STORAGE_BUFFER, TRANSFER_SRC and TRANSFER_DST. It
/// outlives the renderer. The scene's are written by translucent_renderer_create, which needs a queue for it: the BVH
/// and the order of its triangles are made on the host.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct TranslucentBuffer {
    /// A TranslucentSlot.
    pub slot: u32,
    pub buffer: VkBuffer,
    pub size: VkDeviceSize,
}

/// Bytes that a renderer needs in a TranslucentSlot.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn translucent_buffer_size(
    scene: *const TranslucentScene,
    settings: *const TranslucentSettings,
    slot: u32,
    size: *mut VkDeviceSize,
) -> TranslucentResult {
    guard(|| {
        // SAFETY: the caller's pointers, as the header says.
        let (scene, settings, size) =
            unsafe { (reference(scene, "scene")?, settings_of(settings)?, exclusive(size, "size")?) };
        let plan = Plan::new(&scene.scene, &settings, Limits::NONE)?;
        let slot = slot_of(slot)?;
        let found = plan.buffers.iter().find(|buffer| buffer.slot == slot);
        *size = found.map_or(0, |buffer| buffer.bytes);
        Ok(())
    })
}

/// Renders one scene with one set of settings. It may move to another thread, and be used by one at a time; several may
/// be used at once.
pub struct TranslucentRenderer {
    pub(crate) renderer: Renderer,
    /// Names of the kernels, for translucent_renderer_timestamp_name.
    names: Vec<(&'static str, CString)>,
}

/// Makes the pipelines and buffers that rendering needs, and fills them from the scene; device and scene may be
/// destroyed afterwards. buffers may be null if buffer_count is 0.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn translucent_renderer_create(
    device: *const TranslucentDevice,
    scene: *const TranslucentScene,
    settings: *const TranslucentSettings,
    buffers: *const TranslucentBuffer,
    buffer_count: u32,
    out: *mut *mut TranslucentRenderer,
) -> TranslucentResult {
    let make = || {
        // SAFETY: the caller's pointers and handles, as the header says.
        let (device, scene, settings, given) = unsafe {
            let device = &reference(device, "device")?.0;
            let given = slice(buffers, buffer_count as usize, "buffers")?;
            let given = given.iter().map(|given| {
                if given.buffer.is_null() {
                    return Err(argument("a buffer is null"));
                }
                Ok((slot_of(given.slot)?, Buffer::of_caller(device, given.buffer, given.size)))
            });
            let given = given.collect::<Result<Vec<_>, _>>()?;
            (device, reference(scene, "scene")?, settings_of(settings)?, given)
        };
        let renderer = Renderer::with_buffers(device, &scene.scene, &settings, given)?;
        let named = |stem: &'static str| (stem, CString::new(stem).unwrap_or_default());
        let names = renderer.kernels().into_iter().map(named).collect();
        Ok(TranslucentRenderer { renderer, names })
    };
    // SAFETY: as above.
    unsafe { create(out, make) }
}

/// Destroys it. No execution of what it recorded may be going on. Null is ignored.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn translucent_renderer_destroy(renderer: *mut TranslucentRenderer) {
    // SAFETY: the caller's handle, as the header says.
    unsafe { destroy(renderer) }
}

/// Where the times of a recording go: the dispatch number i writes query first + 2 i before it starts and the next one
/// when it has ended.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct TranslucentTimestamps {
    /// A pool of VK_QUERY_TYPE_TIMESTAMP. The recording resets the queries that it writes.
    pub pool: VkQueryPool,
    pub first: u32,
}

/// Records the samples begin to end - 1, at most 4096, and the image they make into a command buffer in the recording
/// state, outside of a render pass. Never submits or waits. timestamps may be null.
///
/// An execution computes the samples f + begin to f + end - 1, where f is the number of
/// translucent_renderer_set_first_sample (0 at first). Where the sums hold the samples just before those, they are
/// added to them; otherwise the sums start anew. So a command buffer may be submitted again and again, and nothing is
/// counted twice. Camera, lights and matter are read from buffers when it executes.
///
/// On entry, what compute shaders and transfers earlier on the same queue wrote is waited for and visible. On exit, all
/// that was written is visible to compute shaders, transfers and the host; anything else needs a barrier of the
/// caller's from the stage COMPUTE_SHADER and the access SHADER_STORAGE_WRITE. Executions of one renderer must not
/// overlap. Compute pipeline, descriptor set 0 and push constants are other ones afterwards. The renderer outlives
/// every execution.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn translucent_renderer_record(
    renderer: *const TranslucentRenderer,
    commands: VkCommandBuffer,
    begin: u32,
    end: u32,
    timestamps: *const TranslucentTimestamps,
) -> TranslucentResult {
    guard(|| {
        // SAFETY: the caller's pointers and handles, as the header says.
        unsafe {
            let renderer = &reference(renderer, "renderer")?.renderer;
            if commands.is_null() {
                return Err(argument("commands is null"));
            }
            match timestamps.as_ref() {
                None => renderer.record(commands, begin..end)?,
                Some(&TranslucentTimestamps { pool, first }) => {
                    renderer.record_timed(commands, begin..end, Timestamps { pool, first })?;
                }
            }
        }
        Ok(())
    })
}

/// Number of dispatches of such a recording: it writes twice as many queries.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn translucent_renderer_timestamp_count(
    renderer: *const TranslucentRenderer,
    begin: u32,
    end: u32,
    count: *mut u32,
) -> TranslucentResult {
    guard(|| {
        // SAFETY: the caller's pointers, as the header says.
        let (renderer, count) = unsafe { (reference(renderer, "renderer")?, exclusive(count, "count")?) };
        *count = renderer.renderer.timestamp_layout(begin..end)?.len() as u32;
        Ok(())
    })
}

/// Name of the kernel of dispatch number index of such a recording; the text lasts as long as the renderer.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn translucent_renderer_timestamp_name(
    renderer: *const TranslucentRenderer,
    begin: u32,
    end: u32,
    index: u32,
    name: *mut *const c_char,
) -> TranslucentResult {
    guard(|| {
        // SAFETY: the caller's pointers, as the header says.
        let (renderer, name) = unsafe { (reference(renderer, "renderer")?, exclusive(name, "name")?) };
        let stems = renderer.renderer.timestamp_layout(begin..end)?;
        let found = stems.get(index as usize).and_then(|stem| renderer.names.iter().find(|(known, _)| known == stem));
        *name = found.ok_or_else(|| argument(format!("there are {} dispatches", stems.len())))?.1.as_ptr();
        Ok(())
    })
}

/// Records a copy of TranslucentOutput::colors to the upper left of an image of four floats, first level and layer,
/// which is in the layout TRANSFER_DST_OPTIMAL or GENERAL when this executes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn translucent_renderer_record_copy(
    renderer: *const TranslucentRenderer,
    commands: VkCommandBuffer,
    image: VkImage,
    layout: VkImageLayout,
) -> TranslucentResult {
    guard(|| {
        // SAFETY: the caller's pointers and handles, as the header says.
        Ok(unsafe { reference(renderer, "renderer")?.renderer.record_copy(commands, image, layout) }?)
    })
}

/// What recordings leave behind, valid as long as the renderer. Rows run from the top, width pixels each, without
/// padding.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct TranslucentOutput {
    /// sizeof(TranslucentOutput), set by the caller; the rest is filled in.
    pub struct_size: usize,
    pub width: u32,
    pub height: u32,
    /// Four floats for each pixel: linear Rec.709 light, and alpha; not premultiplied.
    pub colors: VkBuffer,
    /// Twelve words for each pixel: subsurface light (3 floats), reflected light (3 floats), variance of the mean of
    /// the former (3 floats), alpha (float), samples, samples left out (unsigned).
    pub pixels: VkBuffer,
    /// Four unsigned words: f of translucent_renderer_record, first and end of the samples in the sums (the end is
    /// 0xffffffff where they are to be forgotten), and one of the library's. A transfer of the caller's may write f.
    pub progress: VkBuffer,
}

/// Fills in the buffers with the result.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn translucent_renderer_output(
    renderer: *const TranslucentRenderer,
    output: *mut TranslucentOutput,
) -> TranslucentResult {
    guard(|| {
        // SAFETY: the caller's pointers, as the header says.
        unsafe {
            let known = read(output, "output")?;
            let made = reference(renderer, "renderer")?.renderer.output()?;
            *output = TranslucentOutput {
                width: made.width,
                height: made.height,
                colors: made.colors,
                pixels: made.pixels,
                progress: made.progress,
                ..known
            };
        }
        Ok(())
    })
}

/// Adds the next samples, submitted to the device's queue, and waits for them.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn translucent_renderer_render(
    renderer: *mut TranslucentRenderer,
    samples: u32,
) -> TranslucentResult {
    guard(|| {
        // SAFETY: the caller's pointer, as the header says.
        Ok(unsafe { exclusive(renderer, "renderer")? }.renderer.render(samples)?)
    })
}

/// Which samples the sums hold: begin to end - 1.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn translucent_renderer_samples(
    renderer: *const TranslucentRenderer,
    begin: *mut u32,
    end: *mut u32,
) -> TranslucentResult {
    guard(|| {
        // SAFETY: the caller's pointers, as the header says.
        let (renderer, begin, end) =
            unsafe { (reference(renderer, "renderer")?, exclusive(begin, "begin")?, exclusive(end, "end")?) };
        let samples = renderer.renderer.samples();
        (*begin, *end) = (samples.start, samples.end);
        Ok(())
    })
}

/// Writes the image, recorded or rendered, with every channel to an EXR file: all of it or nothing. Submits to the
/// device's queue and waits.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn translucent_renderer_write(
    renderer: *mut TranslucentRenderer,
    file: *const c_char,
) -> TranslucentResult {
    guard(|| {
        // SAFETY: the caller's pointers, as the header says.
        let (renderer, file) = unsafe { (exclusive(renderer, "renderer")?, text(file, "file")?) };
        let file = file.ok_or_else(|| argument("file is null"))?;
        Ok(renderer.renderer.image()?.write(file)?)
    })
}
