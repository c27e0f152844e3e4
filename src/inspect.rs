//! What a scene requires: matter, models, lights, kernels, features, buffers, and why. The numbers come from the functions
//! that the renderer itself uses ([`Plan`]).

use crate::{
    error::Result,
    model::{self, Advice, Choice},
    reference::profile::{self, Coefficients, Profile},
    render::{Limits, Plan, value_name},
    scene::{EnvironmentMap, Lens, LightKind, Material, Medium, Scene},
    settings::{Model, Settings},
    shared::Slot,
    table,
};
use glam::DVec3;
use serde_json::{Value, json};

/// A scene, the settings of a render, and what they require of a device.
#[derive(Clone, Debug)]
pub struct Inspection<'a> {
    pub scene: &'a Scene,
    pub plan: Plan,
    /// One for each material of the scene.
    pub materials: Vec<MaterialReport>,
    /// What a user should know.
    pub warnings: Vec<String>,
}

/// A material as it is rendered.
#[derive(Clone, Debug, PartialEq)]
pub struct MaterialReport {
    pub name: String,
    /// Triangles that have it.
    pub triangles: usize,
    /// Index of refraction.
    pub ior: f64,
    /// None for an opaque material.
    pub matter: Option<MatterReport>,
}

/// Scattering matter, per channel, lengths in mm.
#[derive(Clone, Debug, PartialEq)]
pub struct MatterReport {
    /// Where the numbers came from.
    pub source: String,
    /// The model of the profile, and why it.
    pub model: Model,
    pub why: String,
    /// Of a Lambert surface, the model whose total it has; else the model.
    pub limit_of: Model,
    /// What would be recommended.
    pub recommended: Choice,
    /// Mean cosines whose tables at the material's index are not shipped, but simulated when first needed.
    pub simulated: Vec<f64>,
    /// Error of the model on a plane, in the channel where it is largest.
    pub error: Option<model::errors::Error>,
    /// Whether light that was scattered once is added to the model's.
    pub single_scattering: bool,
    /// [1/mm].
    pub sigma_s_prime: DVec3,
    /// [1/mm].
    pub sigma_a: DVec3,
    pub g: DVec3,
    /// alpha' = sigma_s' / sigma_t'.
    pub albedo: DVec3,
    /// 1 / sigma_t' (mm).
    pub mean_free_path: DVec3,
    /// 1 / sigma_tr (mm); infinite without absorption.
    pub diffuse_mean_free_path: DVec3,
    /// Of a plane, per unit flux that entered, by the model.
    pub total_reflectance: DVec3,
}

impl MatterReport {
    fn new(medium: &Medium, ior: f64, settings: &Settings, advice: &Advice) -> MatterReport {
        let (sigma_s_prime, sigma_a) = (medium.sigma_s_prime * 1e-3, medium.sigma_a * 1e-3);
        let extinction = sigma_s_prime + sigma_a;
        let choice = advice.choice.clone();
        let total = |c: usize| {
            let constant = profile::constant(choice.limit_of)?;
            Some(Profile::new(constant, &Coefficients::of(medium, ior, c)).total())
        };
        let mut simulated = vec![];
        if choice.limit_of == Model::Table {
            let scattering = (0..3).filter(|&c| sigma_s_prime[c] > 0.0 && !table::is_shipped(ior, medium.g[c]));
            simulated.extend(scattering.map(|c| medium.g[c]));
            simulated.sort_by(f64::total_cmp);
            simulated.dedup();
        }
        MatterReport {
            source: medium.source.clone(),
            model: choice.model,
            why: choice.why,
            limit_of: choice.limit_of,
            recommended: advice.recommended.clone(),
            simulated,
            error: advice.error,
            single_scattering: model::adds_single_scattering(settings, medium, choice.model),
            sigma_s_prime,
            sigma_a,
            g: medium.g,
            albedo: DVec3::from(
                [0, 1, 2].map(|c| if extinction[c] > 0.0 { sigma_s_prime[c] / extinction[c] } else { 0.0 }),
            ),
            mean_free_path: 1.0 / extinction,
            diffuse_mean_free_path: 1.0 / (3.0 * sigma_a * extinction).map(f64::sqrt),
            total_reflectance: DVec3::from([0, 1, 2].map(|c| total(c).unwrap_or(f64::NAN))),
        }
    }
}

impl<'a> Inspection<'a> {
    /// What a render of `scene` with `settings` requires of a device with these limits. No device is asked.
    ///
    /// # Errors
    /// As [`Renderer::new`](crate::Renderer::new), but for what only a device can tell.
    pub fn new(scene: &'a Scene, settings: &Settings, limits: Limits) -> Result<Inspection<'a>> {
        let plan = Plan::new(scene, settings, limits)?;
        let report = |(index, material): (usize, &Material)| MaterialReport {
            name: material.name.clone(),
            triangles: scene.shadings.iter().filter(|shading| shading.material as usize == index).count(),
            ior: material.ior,
            matter: material
                .medium
                .as_ref()
                .zip(plan.prepared.advice[index].as_ref())
                .map(|(medium, advice)| MatterReport::new(medium, material.ior, settings, advice)),
        };
        let materials = scene.materials.iter().enumerate().map(report).collect();
        let warnings = scene.warnings.iter().cloned().chain(plan.prepared.warnings()).collect();
        Ok(Inspection { scene, plan, materials, warnings })
    }

    /// Everything, for machines. Lengths are in mm where a name says so, else in metres.
    pub fn json(&self) -> Value {
        let Inspection { scene, plan, .. } = self;
        let view = &plan.prepared.view;
        json!({
            "scene": {
                "file": scene.file,
                "hash": scene.hash,
                "triangles": scene.triangles.len(),
                "droppedTriangles": scene.dropped_triangles,
                "centre": scene.frame.centre.to_array(),
                "radius": 1.0 / scene.frame.scale,
            },
            "image": {
                "width": view.width,
                "height": view.height,
                "rows": [plan.prepared.shown[1], plan.prepared.shown[3]],
                "columns": [plan.prepared.shown[0], plan.prepared.shown[2]],
                "bands": plan.bands,
                "camera": plan.prepared.camera.name,
                "lens": match plan.prepared.camera.lens {
                    Lens::Perspective { .. } => "perspective",
                    Lens::Orthographic { .. } => "orthographic",
                },
            },
            "materials": self.materials.iter().map(material).collect::<Vec<_>>(),
            "sets": scene.sets.iter().map(|set| json!({
                "name": set.name,
                "materials": set.materials,
                "openEdges": set.open_edges,
                "crowdedEdges": set.crowded_edges,
            })).collect::<Vec<_>>(),
            "lights": scene.lights.iter().map(|light| json!({
                "name": light.name,
                "kind": light_kind(light.kind),
                "intensity": light.intensity.to_array(),
                "unit": light_unit(light.kind),
            })).collect::<Vec<_>>(),
            "environment": environment(&scene.environment.map),
            "shadowRays": plan.prepared.ray_count,
            "kernels": plan.kernels.iter().map(|kernel| json!({
                "kernel": kernel.stem, "used": kernel.used, "why": kernel.why,
            })).collect::<Vec<_>>(),
            "features": plan.prepared.features.named().iter().map(|feature| json!({
                "feature": feature.name, "id": feature.id, "value": feature.value, "name": value_name(feature),
                "about": feature.about,
            })).collect::<Vec<_>>(),
            "buffers": plan.buffers.iter().map(|buffer| json!({
                "buffer": buffer.slot.name(), "binding": buffer.slot as u32, "bytes": buffer.bytes, "why": buffer.why,
            })).collect::<Vec<_>>(),
            "deviceBytes": plan.device_bytes(),
            "waitingBytes": plan.waiting_bytes(),
            "warnings": self.warnings,
        })
    }

    /// Elements of a buffer.
    pub fn elements(&self, slot: Slot) -> u64 {
        let bytes = self.plan.buffers.iter().find(|buffer| buffer.slot == slot).map_or(0, |buffer| buffer.bytes);
        bytes / slot.stride() as u64
    }
}

fn material(report: &MaterialReport) -> Value {
    let mut value = json!({"name": report.name, "triangles": report.triangles, "ior": report.ior});
    value["matter"] = report.matter.as_ref().map_or(Value::Null, |matter| {
        json!({
            "source": matter.source,
            "model": matter.model.to_string(),
            "why": matter.why,
            "limitOf": matter.limit_of.to_string(),
            "simulatedG": matter.simulated,
            "recommended": {"model": matter.recommended.model.to_string(), "why": matter.recommended.why},
            "error": matter.error.map(|error| json!({"total": error.total, "l1": error.l1})),
            "singleScattering": matter.single_scattering,
            "sigmaSPrimePerMm": matter.sigma_s_prime.to_array(),
            "sigmaAPerMm": matter.sigma_a.to_array(),
            "g": matter.g.to_array(),
            "albedo": matter.albedo.to_array(),
            "meanFreePathMm": matter.mean_free_path.to_array(),
            // Infinite without absorption, which JSON cannot say: null.
            "diffuseMeanFreePathMm": matter.diffuse_mean_free_path.to_array(),
            "totalReflectance": matter.total_reflectance.to_array(),
        })
    });
    value
}

/// Point, spot or directional.
pub fn light_kind(kind: LightKind) -> &'static str {
    match kind {
        LightKind::Point => "point",
        LightKind::Spot { .. } => "spot",
        LightKind::Directional => "directional",
    }
}

/// The unit of a light's intensity.
pub fn light_unit(kind: LightKind) -> &'static str {
    if kind == LightKind::Directional { "W/m^2" } else { "W/sr" }
}

/// One word or size for an environment.
pub fn environment(map: &EnvironmentMap) -> String {
    match map {
        EnvironmentMap::None => "none".into(),
        EnvironmentMap::Constant(radiance) => format!("constant {radiance}"),
        EnvironmentMap::Image { width, height, .. } => format!("image of {width}x{height}"),
    }
}
