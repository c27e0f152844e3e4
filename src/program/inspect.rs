//! `inspect`: what a scene requires, and why.

use super::{
    Failure, print,
    scene::SceneOptions,
    tables::{aligned, row, significant},
};
use glam::DVec3;
use std::{fmt::Write, process::ExitCode};
use translucent::{
    Device, DeviceOptions,
    inspect::{Inspection, MatterReport, environment, light_kind, light_unit},
    render::{Limits, value_name},
    scene::{Lens, Set},
    table::cache,
};

#[derive(clap::Args)]
pub struct Inspect {
    #[command(flatten)]
    scene: SceneOptions,
    /// The whole as JSON.
    #[arg(long)]
    json: bool,
    /// Ask a Vulkan device for its limits, by index, part of the name, or UUID; without it no device is opened and
    /// nothing is limited.
    #[arg(long, value_name = "INDEX|NAME|UUID")]
    device: Option<String>,
}

impl Inspect {
    pub fn run(self) -> Result<ExitCode, Failure> {
        let (scene, warnings) = self.scene.load(None).map_err(Failure::while_reading)?;
        let limits = match self.device {
            None => Limits::NONE,
            device => Limits::of(&Device::open(&DeviceOptions { device, ..DeviceOptions::default() })?),
        };
        let mut inspection = Inspection::new(&scene, &self.scene.settings(), limits)?;
        // The program's own come with the scene's.
        let models = inspection.plan.prepared.warnings();
        inspection.warnings = warnings.into_iter().chain(models).collect();
        let text = if self.json { format!("{:#}\n", inspection.json()) } else { text(&inspection) };
        print(&text)?;
        Ok(ExitCode::SUCCESS)
    }
}

fn text(inspection: &Inspection) -> String {
    [scene, image, materials, lights, kernels, features, buffers, warnings]
        .map(|section| section(inspection))
        .into_iter()
        .filter(|section| !section.is_empty())
        .collect::<Vec<_>>()
        .join("\n")
}

fn scene(inspection: &Inspection) -> String {
    let scene = inspection.scene;
    let text = format!("SCENE {}\n", scene.file.display());
    let translucent = inspection.materials.iter().filter(|m| m.matter.is_some()).map(|m| m.triangles).sum::<usize>();
    let mut counts = format!("{}, {translucent} of them translucent", scene.triangles.len());
    if scene.dropped_triangles > 0 {
        let _ = write!(counts, "; {} without area were left out", scene.dropped_triangles);
    }
    let sets: Vec<String> = scene.sets.iter().map(set).collect();
    text + &aligned(&[
        row(["  triangles", &counts]),
        row(["  surfaces that exchange light", &sets.join(", ")]),
        row(["  radius of the translucent part", &length(1.0 / scene.frame.scale)]),
        row(["  hash", &scene.hash]),
    ])
}

/// A set's name, and where its surface is not that of a closed body.
fn set(set: &Set) -> String {
    let edges = [("open edges", set.open_edges), ("edges of three triangles or more", set.crowded_edges)];
    let edges: Vec<String> =
        edges.iter().filter(|(_, count)| *count > 0).map(|(what, count)| format!("{count} {what}")).collect();
    if edges.is_empty() { set.name.clone() } else { format!("{} ({})", set.name, edges.join(", ")) }
}

fn image(inspection: &Inspection) -> String {
    let prepared = &inspection.plan.prepared;
    let view = &prepared.view;
    let size = format!("{}x{}", view.width, view.height);
    let [x0, y0, x1, y1] = prepared.shown;
    let crop = (x1 - x0, y1 - y0) != (view.width, view.height);
    let size = if crop { format!("{}x{} of {size}", x1 - x0, y1 - y0) } else { size };
    let lens = match prepared.camera.lens {
        Lens::Perspective { .. } => "perspective",
        Lens::Orthographic { .. } => "orthographic",
    };
    let bands = &inspection.plan.bands;
    let bands = format!("{}, the largest of {} pixels", bands.len(), bands.iter().max().unwrap_or(&0));
    "IMAGE\n".to_string()
        + &aligned(&[
            row(["  pixels", &size]),
            row(["  camera", &format!("{}, {lens}", prepared.camera.name)]),
            row(["  bands of rows", &bands]),
        ])
}

fn materials(inspection: &Inspection) -> String {
    let mut text = String::from("MATERIALS\n");
    for material in &inspection.materials {
        let _ = write!(text, "  {}: {} triangles, ior {}", material.name, material.triangles, material.ior);
        match &material.matter {
            None => text.push_str(", opaque\n"),
            Some(matter) => {
                let _ = writeln!(text, ", {}", matter.source);
                let single = if matter.single_scattering { " + single scattering" } else { "" };
                let _ = writeln!(text, "    model {}{single}: {}", matter.model, matter.why);
                if !matter.simulated.is_empty() {
                    let g = matter.simulated.iter().map(f64::to_string).collect::<Vec<_>>().join(", ");
                    let kept = match cache::folder() {
                        Some(folder) => format!("kept in {}", folder.display()),
                        None => "not kept".into(),
                    };
                    let _ =
                        writeln!(text, "    its table (g {g}) is not shipped, but simulated at first use and {kept}");
                }
                if let Some(error) = matter.error {
                    let _ = writeln!(text, "    a plane {error}");
                }
                if matter.recommended.model != matter.model {
                    let _ = writeln!(text, "    recommended {}: {}", matter.recommended.model, matter.recommended.why);
                }
                text.push_str(&coefficients(matter));
            }
        }
    }
    text
}

fn coefficients(matter: &MatterReport) -> String {
    let line = |name: &str, values: DVec3| {
        let [r, g, b] = values.to_array().map(|value| match value.is_finite() {
            true => significant(value),
            false => "infinite".into(),
        });
        row([&format!("    {name}"), &r, &g, &b])
    };
    aligned(&[
        row(["", "red", "green", "blue"]),
        line("sigma_s' [1/mm]", matter.sigma_s_prime),
        line("sigma_a [1/mm]", matter.sigma_a),
        line("g", matter.g),
        line("albedo sigma_s'/sigma_t'", matter.albedo),
        line("mean free path 1/sigma_t' [mm]", matter.mean_free_path),
        line("diffuse mean free path 1/sigma_tr [mm]", matter.diffuse_mean_free_path),
        line("total reflectance of a plane", matter.total_reflectance),
    ])
}

fn lights(inspection: &Inspection) -> String {
    let scene = inspection.scene;
    let mut rows: Vec<Vec<String>> = Vec::new();
    for light in &scene.lights {
        let [r, g, b] = light.intensity.to_array().map(significant);
        let intensity = format!("{r} {g} {b} {}", light_unit(light.kind));
        rows.push(row([&format!("  {}", light.name), light_kind(light.kind), &intensity]));
    }
    let map = &scene.environment;
    let scale = if map.scale == 1.0 { String::new() } else { format!("times {}", map.scale) };
    rows.push(row(["  environment", &environment(&map.map), &scale]));
    let rays = inspection.plan.prepared.ray_count.to_string();
    rows.push(row(["  shadow rays of a position", &rays, ""]));
    "LIGHTS\n".to_string() + &aligned(&rows)
}

fn kernels(inspection: &Inspection) -> String {
    let line = |kernel: &translucent::render::KernelUse| {
        row([&format!("  {}", kernel.stem), if kernel.used { "runs" } else { "left out" }, kernel.why])
    };
    "KERNELS\n".to_string() + &aligned(&inspection.plan.kernels.iter().map(line).collect::<Vec<_>>())
}

fn features(inspection: &Inspection) -> String {
    let features = inspection.plan.prepared.features.named();
    let rows = features.iter().map(|feature| {
        let value = value_name(feature).map_or_else(|| feature.value.to_string(), str::to_string);
        let about = feature.about.trim_end_matches('.');
        row([&format!("  {}", feature.name), &value, about])
    });
    "FEATURES (specialization constants)\n".to_string() + &aligned(&rows.collect::<Vec<_>>())
}

fn buffers(inspection: &Inspection) -> String {
    let plan = &inspection.plan;
    let mut rows = vec![row(["  name", "bytes", "elements", ""])];
    for buffer in &plan.buffers {
        let used = buffer.bytes > 0;
        let bytes = if used { buffer.bytes.to_string() } else { "left out".into() };
        let elements = if used { inspection.elements(buffer.slot).to_string() } else { String::new() };
        let why = buffer.why.trim_end_matches('.');
        rows.push(row([&format!("  {}", buffer.slot.name()), &bytes, &elements, why]));
    }
    let total = plan.device_bytes();
    rows.push(row(["  total", &total.to_string(), "", &megabytes(total)]));
    if plan.waiting_bytes() > 0 {
        let waiting = plan.waiting_bytes();
        let about = format!("{}: sums of the bands that wait, on the host, at most", megabytes(waiting));
        rows.push(row(["  waiting", &waiting.to_string(), "", &about]));
    }
    "BUFFERS on the device\n".to_string() + &aligned(&rows)
}

fn warnings(inspection: &Inspection) -> String {
    if inspection.warnings.is_empty() {
        return String::new();
    }
    let lines: Vec<String> = inspection.warnings.iter().map(|warning| format!("  {warning}\n")).collect();
    format!("WARNINGS\n{}", lines.concat())
}

fn megabytes(bytes: u64) -> String {
    format!("{} MB", significant(bytes as f64 * 1e-6))
}

/// A length of metres in the unit that suits it.
fn length(metres: f64) -> String {
    match metres {
        m if m < 1e-2 => format!("{} mm", significant(m * 1e3)),
        m if m < 1.0 => format!("{} cm", significant(m * 1e2)),
        m => format!("{} m", significant(m)),
    }
}
