//! translucent renders translucent matter (marble, skin, milk, wax) in glTF scenes with raw Vulkan compute.
//!
//! ```
//! # fn main() -> translucent::Result<()> {
//! # let folder = std::env::temp_dir().join(format!("translucent-{}", std::process::id()));
//! # std::fs::create_dir_all(&folder).map_err(|error| translucent::Error::File { file: folder.clone(), problem: error.to_string() })?;
//! # let output = folder.join("spot.exr");
//! use translucent::{Device, DeviceOptions, Renderer, Scene, Settings};
//!
//! let device = Device::open(&DeviceOptions::default())?;
//! let scene = Scene::load("assets/spot.glb")?;
//! # let mut scene = scene;
//! # scene.set_environment(translucent::Environment::constant(glam::DVec3::ONE)?)?;
//! let settings = Settings { resolution: Some((16, 16)), ..Settings::default() };
//! let mut renderer = Renderer::new(&device, &scene, &settings)?;
//! renderer.render(64)?;
//! renderer.image()?.write(&output)?;
//! # let image = translucent::Image::read(&output)?;
//! # assert_eq!((image.width, image.height), (16, 16));
//! # assert!(image.channel("subsurface.G").is_some_and(|light| light[8 * 16 + 8] > 0.1));
//! # let _ = std::fs::remove_dir_all(&folder);
//! # Ok(())
//! # }
//! ```
//!
//! # How data flows
//!
//! ```text
//! file ─ scene ─► Scene ── prepare ─► Features ──────────────────────────────► kernels, specialised
//!   (checked, f64 metres;  (f32,      Nodes Triangles Shadings Materials
//!    geometry centred and   internal  Lights Environment EnvironmentCdf ─────► buffers   per scene
//!    scaled)                units)    Emitters Boundaries
//!                                     Texels Textures Coordinates
//!                                     Profiles Balances Mixtures Lattices
//!                                     View ──────────────────────────────────► buffer    per render
//!
//!   ┌── per sub-pixel stratum ──┐ ┌──────────── per sample (Step in push constants) ───────────┐ ┌─ at the end ─┐
//!   primary                       sample         reproject       accumulate, single, reflect     resolve
//!   └► Surfaces[pixel, batch],    └► Probes      └► HitLists     └► RunningSums, BatchSums       └► Pixels ─► Image
//!      Actives                                                     reuse: hits of a tile's pixels
//!                                                                  count: how many samples
//!
//!   Integrator::Cloud, in place of sample, reproject and accumulate:
//!   ┌─── when the lights change ───┐               ┌──────── per sample ────────┐
//!   irradiance      cluster                        gather
//!   └► Clusters     └► Clusters above them         └► RunningSums, BatchSums
//!
//!   Irradiance::Cached, in place of accumulate's shadow rays:
//!   ┌─── when the lights change ───┐               ┌──────── per sample ────────┐
//!   irradiance, until fine enough                  accumulate looks it up
//!   └► Clusters, Lattices
//!
//!   Integrator::Area and Integrator::Walk, in place of sample, reproject and accumulate, on the host:
//!                                                  ┌──────── per sample ────────┐
//!                                                  Surfaces, RunningSums, BatchSums ◄─ reference::uniform,
//!                                                                            reference::walk::radiance
//! ```
//!
//! Each word with a capital is a buffer or a struct that [`shared`] defines once for Rust and GLSL. Each kernel is
//! `glsl/<stem>.comp`; its twin in f64, with the mathematics and where it comes from, is `reference::<stem>`.
//!
//! *What changes how often decides where it lives.* Per scene: buffers made and filled once. Per render: `View`, and the
//! features, which are specialization constants. Per sample: [`shared::Step`], in push constants. So a sample allocates
//! nothing and uploads nothing.
//!
//! *Loops.* On lavapipe 22.3.6 a loop that tests at its head runs its body once more when no lane is left, which takes as
//! long as any round. One that tests at its end does not; but what it leaves to a lane that ended before others is not
//! what that lane had. So where all lanes do as many rounds, or nothing is read after them,
//! the test is at the end, elsewhere at the head.
//!
//! *Bands.* An image with more pixels than [`Settings::band_pixels`] is cut into bands of rows. They take turns on the
//! device, 32 samples at a time; meanwhile the sums of the others wait on the host. Random numbers depend on pixel,
//! sample and seed alone, so the image does not depend on bands, batches of submissions or workgroups. Rows of tiles that a
//! band cuts ([`Settings::reuse`]) are rendered with it; not where the error is estimated: there noise depends on bands.
//!
//! *Tiles.* `accumulate` leaves the hit that it lit in Probes, with its light over the weights of the tile's pixels, and
//! `reuse` adds the tile's hits to each pixel ([`reference::reuse`]). Tiles lie elsewhere in each batch. Around a crop
//! the pixels are rendered, too, whose hits it shares. What was written in another sample is told by [`shared::Probe::share`].
//!
//! *Lists.* `primary` lists the pixels of a batch that see something, and the kernels after it are dispatched indirectly
//! over that list alone. Where an image is to have a certain error ([`Renderer::render_until`]), the host also lists the
//! pixels that `primary` traces: those that the estimate from the batches' sums says need more samples.
//!
//! *Recordings.* [`Renderer::record`] puts the same dispatches into a command buffer of the caller's, on a device of his
//! ([`Device::from_raw`]). There `begin` numbers the samples and `count` forgets the sums if they do not go on, so what
//! the host would decide between submissions is decided on the device: `Progresses` and `Samples` hold it. They work on
//! all pixels.
//!
//! *Changes.* Buffers stay when camera, lights, matter, environment or textures change ([`Renderer::update`], and the
//! cheaper [`Renderer::set_camera`], [`Renderer::set_lights`], [`Renderer::set_material`]): what is different is written,
//! what would need another pipeline or a larger buffer is refused. Geometry stays; a scene comes from a file or from the
//! caller's vertices ([`Scene::from_meshes`]), since the BVH is built on the host.
//!
//! *Failures.* Every Vulkan call that fails is an error that names the step ([`Error::Vulkan`]); nothing is leaked, and
//! the renderer keeps the samples whose sums are known. When the device is lost, [`Renderer::with_recovery`] goes on with
//! another from the sums on the host; the image is the same, bit for bit. Drivers and operating systems give out more
//! memory than they have, so a render is refused beforehand if it needs more than is left ([`Error::Memory`]).
//!
//! # What may use what
//!
//! | module | may use | holds |
//! | --- | --- | --- |
//! | [`shared`] | nothing | every struct, buffer, constant and feature that Rust and GLSL share |
//! | [`error`] | nothing | [`Error`]: file, item and problem, or the step |
//! | [`timeline`] | nothing | [`timeline::Timeline`]: what takes how long; traces and sums |
//! | [`settings`] | `shared`, `timeline` | [`Settings`]: what a caller may choose |
//! | [`scene`] | `shared`, `error`, `settings`, `timeline` | [`Scene`]: files or vertices, rules, geometry, BVH, presets; no Vulkan |
//! | [`mod@reference`] | `shared`, `scene`, `settings` | the kernels' twins, integrators that share nothing with them, and those on the host |
//! | [`gpu`] | `shared`, `error` | device, buffers, kernels, recorder; all unsafe code; no scenes |
//! | [`table`] | `reference` | the tabulated profile: its simulation, and tables kept between runs |
//! | [`model`] | `scene`, `settings` | which profile a material gets |
//! | [`curvature`] | `shared`, `reference` | the sphere that a body is locally like, and how much of its light the body gives back |
//! | [`prepare`] | `scene`, `settings`, `shared`, `reference`, `model`, `curvature` | [`Scene`] and [`Settings`] to what kernels read |
//! | [`image`] | `error` | [`Image`]: channels, EXR, PNG, merging, differences |
//! | [`render`] | all of these | [`Renderer`]: the order of the kernels, bands, the finished image; what they require |
//! | [`measure`] | all of these | numeric experiments: kernels beside closed forms |
//! | [`model_errors`] | `scene`, `settings`, `reference` | how far each model is from a random walk |
//! | [`mod@bench`] | all of these | fixed work, timed again and again, and compared |
//! | [`tradeoff`] | all of these | one scene rendered in many ways, each with its time and its error |
//! | [`inspect`] | all of these | what a scene requires and why, for people and machines |
//! | [`verify`] | all of these | tests of a driver: functions and kernels beside their twins |
//!
//! Unsafe code is denied outside of `gpu`, but for [`Renderer::record`], whose command buffer is the caller's. The C
//! interface is a package of its own, `src/capi`, which sees this public interface alone; its header is made of it.
//!
//! The extremes that renders survive, each with its test, are in [`extremes`].
//!
//! The program uses this public interface alone. There is no global state: devices and renderers stand side by side.

#![deny(unsafe_code)]

pub mod bench;
pub mod cache;
pub mod curvature;
pub mod error;
#[doc = include_str!("docs/extremes.md")]
pub mod extremes {}
#[allow(unsafe_code, reason = "the layer over Vulkan")]
pub mod gpu;
pub mod image;
pub mod inspect;
pub mod measure;
pub mod model;
pub mod model_errors;
pub mod prepare;
pub mod reference;
pub mod render;
pub mod scene;
pub mod settings;
pub mod shared;
pub mod table;
pub mod timeline;
pub mod tradeoff;
pub mod verify;

pub use ash;
pub use error::{Error, Result};
pub use gpu::{Device, DeviceInfo, DeviceOptions};
pub use image::Image;
pub use render::{Goal, Outcome, Progress, Renderer, Stop};
pub use scene::{Environment, LoadOptions, Scene};
pub use settings::{CameraChoice, Model, Normalisation, Projection, Settings, SingleScattering};
