//! The kernels against the independent integrator: uniform points on triangles, no tangent plane, no projection.
//!
//! Each comparison looks at one point of a shape through a lens so long that all pixels see that point; the pixels are
//! then independent estimates of one radiance. |mean difference| < 4 standard errors in each of three channels; over all
//! comparisons here (about 100) chance fails that with probability .006, and the seeds are fixed.

use crate::{
    channel, mean_and_error, render,
    scenes::{Eye, Mesh, gltf, matter, scene},
};
use glam::DVec3;
use serde_json::{Value, json};
use translucent::{
    Model, Normalisation, Projection, Settings, SingleScattering,
    reference::area::{Corners, Lamp, Matter, Setting, leaving},
    scene::Environment,
};

const SIGMA_S_PRIME: [f64; 3] = [2.0, 4.0, 6.0];
const SIGMA_A: [f64; 3] = [0.1, 0.5, 2.0];
const IOR: f64 = 1.4;

fn corners(mesh: &Mesh) -> Vec<Corners> {
    mesh.indices.chunks_exact(3).map(|t| [0, 1, 2].map(|i| mesh.positions[t[i] as usize])).collect()
}

/// A shape and what shines on it.
struct Experiment {
    /// What is looked at, then what only casts shadows.
    meshes: Vec<Mesh>,
    lamps: Vec<Lamp>,
    surrounding: f64,
    model: Model,
}

impl Default for Experiment {
    fn default() -> Self {
        Experiment { meshes: vec![], lamps: vec![], surrounding: 0.0, model: Model::Standard }
    }
}

impl Experiment {
    fn lights(&self) -> Vec<(Value, DVec3, DVec3)> {
        let light = |lamp: &Lamp| match lamp {
            Lamp::Point { position, intensity } => {
                (json!({"type": "point", "intensity": intensity.x}), *position, DVec3::ZERO)
            }
            Lamp::Directional { direction, irradiance } => {
                (json!({"type": "directional", "intensity": irradiance.x}), DVec3::ZERO, *direction)
            }
            Lamp::Triangle { .. } => unreachable!("emitters are meshes"),
        };
        self.lamps.iter().map(light).collect()
    }

    /// Compares the radiance that leaves `point` towards `eye`; `normal` is the surface's normal there.
    fn compare(&self, name: &str, point: DVec3, normal: DVec3, eye: DVec3) {
        let eye = Eye { eye, at: point, lens: 1e-4 };
        let meshes: Vec<_> = self.meshes.iter().map(|mesh| (mesh.clone(), 0)).collect();
        let materials = [matter(SIGMA_S_PRIME, SIGMA_A, IOR)];
        let mut scene = scene(&gltf(&meshes, &materials, &self.lights(), &eye));
        if self.surrounding > 0.0 {
            let environment = Environment::constant(DVec3::splat(self.surrounding)).expect("valid");
            scene.set_environment(environment).expect("valid");
        }
        let (set, blockers) = (corners(&self.meshes[0]), self.meshes[1..].iter().flat_map(corners).collect::<Vec<_>>());
        let setting = Setting {
            set: &set,
            blockers: &blockers,
            entries: &[],
            matter: Matter {
                sigma_s_prime: SIGMA_S_PRIME.into(),
                sigma_a: SIGMA_A.into(),
                g: 0.0,
                ior: IOR,
                normalisation: Normalisation::Energy,
                model: self.model,
            },
            lamps: &self.lamps,
            surrounding: DVec3::splat(self.surrounding),
        };
        // Points uniform on the area rarely come near the pole of normalised diffusion.
        let samples = if self.model == Model::Burley { 1 << 20 } else { 1 << 18 };
        let expected = leaving(&setting, point, normal, (eye.eye - point).normalize(), samples, 11);
        for projection in [Projection::Mis, Projection::Normal] {
            // The normal axis never finds a face that it runs along.
            if projection == Projection::Normal && self.meshes.iter().any(|mesh| mesh.indices.len() < 200) {
                continue;
            }
            let settings = Settings {
                resolution: Some((8, 8)),
                seed: 17,
                projection,
                model: self.model,
                single_scattering: SingleScattering::Off,
                reuse: Some(1),
                ..Settings::default()
            };
            let image = render(&scene, &settings, 256);
            for (c, letter) in ["R", "G", "B"].into_iter().enumerate() {
                let values = channel(&image, &format!("subsurface.{letter}"));
                let values: Vec<f64> = values.iter().map(|x| f64::from(*x)).collect();
                let (mean, error) = mean_and_error(&values);
                let error = error.hypot(expected.error[c]);
                assert!(
                    (mean - expected.mean[c]).abs() < 4.0 * error,
                    "{name}, {projection:?}, {letter}: {mean} and {} differ by {:.1} standard errors of {error:.1e}",
                    expected.mean[c],
                    (mean - expected.mean[c]) / error
                );
                assert!(error < 0.1 * expected.mean[c], "{name}, {letter}: no force at {mean} +- {error}");
            }
        }
    }
}

fn sun(direction: DVec3) -> Lamp {
    Lamp::Directional { direction: direction.normalize(), irradiance: DVec3::splat(2.0) }
}

fn lamp(position: DVec3) -> Lamp {
    Lamp::Point { position, intensity: DVec3::splat(12.0) }
}

#[test]
fn sphere() {
    let experiment = Experiment {
        meshes: vec![Mesh::sphere(1.0, 24)],
        lamps: vec![sun(DVec3::new(-1.0, -0.5, -0.8))],
        ..Experiment::default()
    };
    let mesh = &experiment.meshes[0];
    // Middles of triangles: lit from the front, at the terminator, and on the dark side seen at a shallow angle.
    for (index, eye) in
        [(40, DVec3::new(3.0, 4.0, 2.0)), (700, DVec3::new(1.0, 5.0, 1.0)), (1500, DVec3::new(6.0, 1.0, 5.0))]
    {
        let [a, b, c] = corners(mesh)[index];
        let (point, normal) = ((a + b + c) / 3.0, (b - a).cross(c - a).normalize());
        let eye = if (eye - point).normalize().dot(normal) > 0.1 { eye } else { point + 4.0 * normal + eye };
        experiment.compare(&format!("sphere, triangle {index}"), point, normal, eye);
    }
}

#[test]
fn cube() {
    let mut cube = Mesh::default();
    cube.cuboid(DVec3::splat(-1.0), DVec3::splat(1.0), 1);
    let uniform = Experiment { meshes: vec![cube.clone()], surrounding: 1.0, ..Experiment::default() };
    let lit = Experiment { meshes: vec![cube], lamps: vec![lamp(DVec3::new(3.0, 1.0, 2.0))], ..Experiment::default() };
    let eye = DVec3::new(1.5, -2.0, 4.0);
    for (name, point) in [
        ("middle", DVec3::new(0.1, 0.2, 1.0)),
        ("edge", DVec3::new(0.98, 0.2, 1.0)),
        ("corner", DVec3::new(0.97, -0.96, 1.0)),
    ] {
        uniform.compare(&format!("cube, uniform, {name}"), point, DVec3::Z, eye);
        lit.compare(&format!("cube, lamp, {name}"), point, DVec3::Z, eye);
        lit.compare(&format!("cube, grazing view, {name}"), point, DVec3::Z, point + DVec3::new(-3.0, 1.0, 0.25));
    }
}

#[test]
fn thin_slab_lit_from_behind() {
    let mut slab = Mesh::default();
    slab.cuboid(DVec3::new(-1.0, -1.0, 0.0), DVec3::new(1.0, 1.0, 0.15), 1);
    let experiment =
        Experiment { meshes: vec![slab], lamps: vec![lamp(DVec3::new(0.3, 0.2, -2.0))], ..Experiment::default() };
    experiment.compare("slab, middle", DVec3::new(0.1, -0.2, 0.15), DVec3::Z, DVec3::new(0.5, 1.0, 4.0));
    experiment.compare("slab, rim", DVec3::new(0.95, 0.3, 0.15), DVec3::Z, DVec3::new(0.5, 1.0, 4.0));
    experiment.compare("slab, side", DVec3::new(1.0, 0.1, 0.07), DVec3::X, DVec3::new(4.0, 1.0, 1.0));
}

/// An L, extruded along z.
fn concave() -> Mesh {
    let outline = [(0.0, 0.0), (2.0, 0.0), (2.0, 1.0), (1.0, 1.0), (1.0, 2.0), (0.0, 2.0)];
    let mut mesh = Mesh::default();
    for i in 0..6 {
        let ((x0, y0), (x1, y1)) = (outline[i], outline[(i + 1) % 6]);
        mesh.quad(DVec3::new(x0, y0, 0.0), DVec3::new(x1 - x0, y1 - y0, 0.0), DVec3::Z);
    }
    for (x, y, w, h) in [(0.0, 0.0, 2.0, 1.0), (0.0, 1.0, 1.0, 1.0)] {
        mesh.quad(DVec3::new(x, y, 1.0), DVec3::X * w, DVec3::Y * h);
        mesh.quad(DVec3::new(x, y, 0.0), DVec3::Y * h, DVec3::X * w);
    }
    mesh
}

#[test]
fn concave_shape_shadows_itself() {
    let experiment = Experiment {
        meshes: vec![concave()],
        lamps: vec![sun(DVec3::new(0.6, -1.0, -0.3))],
        surrounding: 0.3,
        ..Experiment::default()
    };
    let eye = DVec3::new(4.0, 5.0, 3.0);
    experiment.compare("L, inner corner", DVec3::new(1.05, 1.0, 0.5), DVec3::Y, eye);
    experiment.compare("L, inner wall", DVec3::new(1.0, 1.3, 0.4), DVec3::X, eye);
    experiment.compare("L, top", DVec3::new(0.9, 0.9, 1.0), DVec3::Z, eye);
}

#[test]
fn touching_objects_exchange_no_light() {
    let cuboid = |low: DVec3, high: DVec3| {
        let mut mesh = Mesh::default();
        mesh.cuboid(low, high, 1);
        mesh
    };
    // Two boxes that share a wall, and one that stands on both.
    let meshes = vec![
        cuboid(DVec3::new(-1.0, -1.0, -1.0), DVec3::new(0.0, 1.0, 1.0)),
        cuboid(DVec3::new(0.0, -1.0, -1.0), DVec3::new(1.0, 1.0, 1.0)),
        cuboid(DVec3::new(-0.3, -0.3, 1.0), DVec3::new(0.3, 0.3, 1.5)),
    ];
    let experiment =
        Experiment { meshes, lamps: vec![lamp(DVec3::new(2.0, 1.0, 3.0))], surrounding: 0.5, ..Experiment::default() };
    let eye = DVec3::new(-3.0, -1.0, 5.0);
    experiment.compare("near the wall", DVec3::new(-0.02, 0.7, 1.0), DVec3::Z, eye);
    experiment.compare("in the shadow", DVec3::new(-0.33, -0.2, 1.0), DVec3::Z, eye);
}

#[test]
fn every_model_on_a_sphere_and_a_cube() {
    let mut cube = Mesh::default();
    cube.cuboid(DVec3::splat(-1.0), DVec3::splat(1.0), 1);
    for model in [Model::Better, Model::Burley, Model::Directional] {
        let sphere = Experiment {
            meshes: vec![Mesh::sphere(1.0, 24)],
            lamps: vec![sun(DVec3::new(-1.0, -0.5, -0.8))],
            model,
            ..Experiment::default()
        };
        let [a, b, c] = corners(&sphere.meshes[0])[40];
        let (point, normal) = ((a + b + c) / 3.0, (b - a).cross(c - a).normalize());
        sphere.compare(&format!("{model} on a sphere"), point, normal, point + 4.0 * normal + DVec3::X);
        let cube = Experiment {
            meshes: vec![cube.clone()],
            lamps: vec![lamp(DVec3::new(3.0, 1.0, 2.0))],
            surrounding: 0.4,
            model,
        };
        let eye = DVec3::new(1.5, -2.0, 4.0);
        cube.compare(&format!("{model} near an edge"), DVec3::new(0.98, 0.2, 1.0), DVec3::Z, eye);
    }
}
