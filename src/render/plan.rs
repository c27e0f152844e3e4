//! What a scene and its settings require of a device, and why. [`Renderer`](super::Renderer) makes exactly this.

use super::{bands, budget};
use crate::{
    error::Result,
    gpu::Device,
    prepare::Prepared,
    scene::Scene,
    settings::{Model, Settings},
    shared::{self, BOUNDARY_ROW, MAX_RECORDED, MODEL_LAMBERT, Slot, TABLE_NODES},
    table::block::{Block, MOST_CELLS},
};

/// What a device allows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// Most bytes of one buffer.
    pub buffer_bytes: u64,
    /// Bytes that are left of the memory that buffers come from.
    pub heap_bytes: u64,
    /// Bytes that this process may still take of the host's memory.
    pub host_bytes: u64,
    /// What sets `host_bytes`, in words.
    pub host_limit: &'static str,
    /// Whether the device's buffers are in the host's memory: on a processor.
    pub shared: bool,
}

impl Limits {
    /// A device that allows everything.
    pub const NONE: Limits = Limits {
        buffer_bytes: u64::MAX,
        heap_bytes: u64::MAX,
        host_bytes: u64::MAX,
        host_limit: "nothing",
        shared: false,
    };

    /// Those of a device, and of this process, as they are now.
    pub fn of(device: &Device) -> Limits {
        let (host_bytes, host_limit) = device.host_left();
        let shared = device.shares_host_memory();
        let (buffer_bytes, heap_bytes) = (device.max_storage_buffer_range(), device.heap_left());
        Limits { buffer_bytes, heap_bytes, host_bytes, host_limit, shared }
    }
}

/// A kernel, and whether it is made and run.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct KernelUse {
    pub stem: &'static str,
    pub used: bool,
    pub why: &'static str,
}

/// A buffer, and how large it is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BufferUse {
    pub slot: Slot,
    /// 0 for one that is left out.
    pub bytes: u64,
    /// What it holds, or what the scene lacks that it would hold.
    pub why: String,
}

/// Kernels, features, buffers and bands of a render.
#[derive(Clone, Debug)]
pub struct Plan {
    pub prepared: Prepared,
    /// Every kernel, in the order in which they run.
    pub kernels: Vec<KernelUse>,
    /// Every slot, in order of binding.
    pub buffers: Vec<BufferUse>,
    /// Pixels of each band; the buffers have room for the largest.
    pub bands: Vec<u32>,
}

impl Plan {
    /// What [`Renderer::new`](super::Renderer::new) would make on a device of these limits.
    ///
    /// # Errors
    /// As [`Renderer::new`](super::Renderer::new), but for what only a device can tell.
    pub fn new(scene: &Scene, settings: &Settings, limits: Limits) -> Result<Plan> {
        let prepared = super::prepared(scene, settings)?;
        let bands = bands::split(limits, &prepared, settings)?;
        budget::check(limits, scene, &prepared, &bands)?;
        let bands: Vec<u32> = bands.iter().map(|band| band.pixels).collect();
        let largest = bands.iter().copied().max().unwrap_or(0);
        let kernels = super::SPIRV.iter().map(|&(stem, _)| {
            let (used, why) = needs(&prepared, stem);
            KernelUse { stem, used, why }
        });
        let kernels = kernels.collect();
        let sizes = sizes(scene, &prepared, largest);
        let buffers = Slot::ALL.iter().map(|&slot| {
            let bytes = sizes.iter().find(|(s, _)| *s == slot).map_or(0, |(_, bytes)| *bytes);
            let why = if bytes > 0 { slot.about().to_string() } else { absent(slot) };
            BufferUse { slot, bytes, why }
        });
        let buffers = buffers.collect();
        Ok(Plan { prepared, kernels, buffers, bands })
    }

    /// Bytes of all buffers on the device.
    pub fn device_bytes(&self) -> u64 {
        self.buffers.iter().map(|buffer| buffer.bytes).sum()
    }

    /// Bytes of the sums that wait on the host while other bands have the device.
    pub fn waiting_bytes(&self) -> u64 {
        if self.bands.len() == 1 { 0 } else { budget::waiting_bytes(&self.prepared, self.bands.iter().copied()) }
    }
}

const ON_HOST: &str = "the host computes the light that comes out of matter";

/// Whether anything in the scene needs a kernel, and what does or would.
pub(super) fn needs(prepared: &Prepared, stem: &str) -> (bool, &'static str) {
    match stem {
        "primary" => (true, "finds the surface that each pixel sees"),
        "begin" => match prepared.features.recorded != 0 {
            true => (true, "recordings keep count of their samples on the device"),
            false => (false, "nothing is recorded into a caller's command buffer"),
        },
        "count" => (true, "counts the samples of each pixel"),
        "resolve" => (true, "makes means and variances of the sums"),
        "irradiance" if !prepared.cache.points.is_empty() => (true, "light is kept at points of the surface"),
        "irradiance" | "cluster" | "gather" => match prepared.clusters.is_empty() {
            false => (true, "light is gathered from a cloud of points"),
            true => (false, "no light is gathered from a cloud of points"),
        },
        "sample" | "reproject" => match (prepared.has_probes, prepared.has_translucent) {
            (true, _) => (true, "a surface is translucent"),
            (false, true) if !prepared.clusters.is_empty() => (false, "light is gathered from a cloud of points"),
            (false, true) if prepared.on_host => (false, ON_HOST),
            (false, true) => (false, "every translucent surface is in the opaque limit: light leaves where it entered"),
            (false, false) => (false, "no surface is translucent"),
        },
        "accumulate" => match prepared.has_translucent {
            true if prepared.clusters.is_empty() && !prepared.on_host => (true, "a surface is translucent"),
            true if prepared.on_host && prepared.features.models & (1 << MODEL_LAMBERT) == 0 => (false, ON_HOST),
            true if prepared.features.models & (1 << MODEL_LAMBERT) == 0 => {
                (false, "light is gathered from a cloud of points")
            }
            true => (true, "a translucent surface is in the opaque limit"),
            false => (false, "no surface is translucent"),
        },
        "reuse" => match prepared.features.reuse != 0 {
            true => (true, "pixels of a tile share the hits that they light"),
            false => (false, "no hits are shared between pixels"),
        },
        "single" => match prepared.has_single && prepared.ray_count > 0 {
            true => (true, "a model leaves out light that was scattered once"),
            false => (false, "no model needs light that was scattered once, or there is no light"),
        },
        "reflect" => match prepared.has_reflection {
            true => (true, "light can leave a first surface that it did not enter, or the environment is shown"),
            false => (false, "no light can leave a first surface that it did not enter: delta lights on smooth matter"),
        },
        _ => (true, "always"),
    }
}

/// The buffers that only a scene and its settings determine, as bytes. A scene without lights or environment has none
/// of theirs.
pub(super) fn scene_data<'a>(scene: &'a Scene, prepared: &'a Prepared) -> Vec<(Slot, &'a [u8])> {
    let geometry: [(Slot, &[u8]); 4] = [
        (Slot::Nodes, bytemuck::cast_slice(&scene.nodes)),
        (Slot::Triangles, bytemuck::cast_slice(&scene.triangles)),
        (Slot::Shadings, bytemuck::cast_slice(&scene.shadings)),
        (Slot::Coordinates, bytemuck::cast_slice(&scene.coordinates)),
    ];
    let geometry = geometry.into_iter().filter(|(_, data)| !data.is_empty());
    geometry.chain(prepared_data(prepared)).collect()
}

/// Those that do not hold geometry: what may change while it stays.
pub(super) fn prepared_data(prepared: &Prepared) -> Vec<(Slot, &[u8])> {
    [
        (Slot::Views, bytemuck::bytes_of(&prepared.view)),
        (Slot::Materials, bytemuck::cast_slice(&prepared.materials)),
        (Slot::Lights, bytemuck::cast_slice(&prepared.lights)),
        (Slot::Emitters, bytemuck::cast_slice(&prepared.emitters)),
        (Slot::Boundaries, bytemuck::cast_slice(&prepared.boundaries)),
        (Slot::Environment, bytemuck::cast_slice(&prepared.environment)),
        (Slot::EnvironmentCdf, bytemuck::cast_slice(&prepared.environment_cdf)),
        (Slot::Texels, bytemuck::cast_slice(&prepared.texels)),
        (Slot::Textures, bytemuck::cast_slice(&prepared.textures)),
        (Slot::Profiles, bytemuck::cast_slice(&prepared.profiles)),
        (Slot::Balances, bytemuck::cast_slice(&prepared.balances)),
        (Slot::Mixtures, bytemuck::cast_slice(&prepared.mixtures)),
        (Slot::Clusters, bytemuck::cast_slice(&prepared.clusters)),
        (Slot::Clusters, bytemuck::cast_slice(&prepared.cache.points)),
        (Slot::Lattices, bytemuck::cast_slice(&prepared.cache.lattices)),
    ]
    .into_iter()
    .filter(|(_, data)| !data.is_empty())
    .collect()
}

/// Bytes of each buffer that a renderer makes, for a band of `pixels`.
pub(super) fn sizes(scene: &Scene, prepared: &Prepared, pixels: u32) -> Vec<(Slot, u64)> {
    let of_scene = scene_data(scene, prepared).into_iter();
    let of_scene = of_scene.map(|(slot, data)| (slot, room(prepared, slot).max(data.len() as u64)));
    let of_band = bands::slots(prepared).into_iter().map(|slot| (slot, bands::bytes(slot, &prepared.features, pixels)));
    let counters = (prepared.features.counters != 0).then_some((Slot::Counters, 4));
    let recorded = [(Slot::Progresses, 1), (Slot::Samples, MAX_RECORDED)];
    let recorded = recorded.into_iter().filter(|_| prepared.features.recorded != 0);
    let recorded = recorded.map(|(slot, elements)| (slot, u64::from(elements) * slot.stride() as u64));
    of_scene.chain(of_band).chain(counters).chain(recorded).collect()
}

/// Bytes that a buffer may come to need: points that are added where light varies; and where a renderer records and
/// matter changes ([`Renderer::update`]), tables of any matter, 488 kB for each material (18 kB where profiles do not depend
/// on curvatures; half as much again in full precision), and a rough boundary of each translucent material's own.
///
/// [`Renderer::update`]: super::Renderer::update
fn room(prepared: &Prepared, slot: Slot) -> u64 {
    let choices = || prepared.advice.iter().flatten().map(|advice| &advice.choice);
    let each = match slot {
        Slot::Clusters => prepared.cache.room,
        _ if prepared.features.recorded == 0 => 0,
        Slot::Profiles => {
            let tables = choices().filter(|choice| choice.model == Model::Table).count();
            let nodes = if prepared.features.curvature == 0 { 1 } else { TABLE_NODES };
            tables * Block::size(nodes, MOST_CELLS, prepared.features.cell_vectors)
        }
        Slot::Boundaries => choices().count() * (prepared.features.rough * BOUNDARY_ROW) as usize,
        _ => 0,
    };
    (each * slot.stride()) as u64
}

/// Why a slot has no buffer.
fn absent(slot: Slot) -> String {
    let lacks = match slot {
        Slot::Lights => "no delta light",
        Slot::Environment | Slot::EnvironmentCdf => "no image as environment",
        Slot::Emitters => "no triangle emits light",
        Slot::Texels | Slot::Textures | Slot::Coordinates => "no texture",
        Slot::Profiles => "no material has the table model",
        Slot::Balances => "no profile depends on the curvature",
        Slot::Mixtures => "no set holds several materials",
        Slot::Probes | Slot::HitLists => {
            "no surface is translucent, all are in the opaque limit, or light is gathered or computed on the host"
        }
        Slot::Clusters => "no light is gathered from a cloud, or kept",
        Slot::Lattices => "no light is kept at points of the surface",
        Slot::Gathers => "one dispatch gathers all light, or none is gathered",
        Slot::BatchSums => "no variance is asked for",
        Slot::Progresses | Slot::Samples | Slot::Colors => "nothing is recorded into a caller's command buffer",
        Slot::Actives => "recordings work on every pixel",
        Slot::Counters => "steps are counted in tests and benchmarks only",
        _ => "nothing in the scene needs it",
    };
    lacks.into()
}

/// The name of a feature's value where it stands for one: `PROJECTION_MIS` for 0 of a feature that is "One of
/// PROJECTION_*.".
pub fn value_name(feature: &shared::NamedFeature) -> Option<&'static str> {
    let prefix = feature.about.strip_prefix("One of ")?.trim_end_matches('.').strip_suffix('*')?;
    let named = |(name, value): &&(&'static str, f64)| name.starts_with(prefix) && *value == f64::from(feature.value);
    shared::CONSTANTS.iter().find(named).map(|(name, _)| *name)
}
