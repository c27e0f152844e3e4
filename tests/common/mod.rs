//! Scenes for the twins and for single kernels, and means with their standard errors.

pub mod sphere;

use glam::{DVec3, Vec3};
use rayon::prelude::*;
use translucent::Normalisation;
use translucent::reference::accumulate::accumulate;
use translucent::reference::profile::{self, Coefficients, Options};
use translucent::reference::reproject::reproject;
use translucent::reference::sample::sample;
use translucent::reference::sums::Contribution;
use translucent::reference::{Inputs, step};
use translucent::shared::*;

pub use translucent::verify::World;

/// Grey matter with the stated sigma_tr [1/length] and reduced albedo.
pub fn matter(sigma_tr: f64, albedo: f64, ior: f64, normalisation: Normalisation) -> Material {
    let (sigma_s, sigma_a) = coefficients(sigma_tr, albedo);
    standard(DVec3::splat(sigma_s), DVec3::splat(sigma_a), ior, normalisation, 1e-6)
}

/// The standard dipole of matter in three channels.
pub fn standard(sigma_s: DVec3, sigma_a: DVec3, ior: f64, normalisation: Normalisation, radius_tail: f64) -> Material {
    modelled(
        MODEL_STANDARD,
        sigma_s,
        sigma_a,
        ior,
        Options { normalisation, radius_tail, directional: Default::default(), precision: Default::default() },
    )
}

/// Matter in three channels under a model, one of MODEL_*.
pub fn modelled(model: u32, sigma_s: DVec3, sigma_a: DVec3, ior: f64, options: Options) -> Material {
    profile::material(model, &channels(sigma_s, sigma_a, ior), options)
}

/// Three channels of isotropic matter.
pub fn channels(sigma_s: DVec3, sigma_a: DVec3, ior: f64) -> [Coefficients; 3] {
    [0, 1, 2].map(|c| Coefficients {
        sigma_s_prime: sigma_s[c],
        sigma_a: sigma_a[c],
        g: 0.0,
        ior,
        rough: None,
        appearance: None,
    })
}

/// sigma_s' and sigma_a: sigma_tr = sqrt(3 (1 - albedo)) sigma_t'.
pub fn coefficients(sigma_tr: f64, albedo: f64) -> (f64, f64) {
    let sigma_t = sigma_tr / (3.0 * (1.0 - albedo)).sqrt();
    (albedo * sigma_t, (1.0 - albedo) * sigma_t)
}

/// Two triangles, counter-clockwise seen from outside.
pub fn quad([a, b, c, d]: [DVec3; 4]) -> [[DVec3; 3]; 2] {
    [[a, b, c], [a, c, d]]
}

/// The surface of an axis-parallel box.
pub fn cuboid(low: DVec3, high: DVec3) -> Vec<[DVec3; 3]> {
    let corner = |i: usize| {
        DVec3::new(
            if i & 1 == 0 { low.x } else { high.x },
            if i & 2 == 0 { low.y } else { high.y },
            if i & 4 == 0 { low.z } else { high.z },
        )
    };
    let faces = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    faces.into_iter().flat_map(|face| quad(face.map(corner))).collect()
}

/// The unit sphere's icosahedron, each edge divided in `2^level`.
pub fn icosphere(level: u32) -> Vec<[DVec3; 3]> {
    let g = (1.0 + 5f64.sqrt()) / 2.0;
    let v = |a: f64, b: f64, axis: usize| {
        let p = [0.0, a, b * g];
        DVec3::new(p[axis % 3], p[(axis + 1) % 3], p[(axis + 2) % 3]).normalize()
    };
    let vertices: Vec<DVec3> = (0..3)
        .flat_map(|axis| [(-1.0, -1.0), (-1.0, 1.0), (1.0, -1.0), (1.0, 1.0)].map(|(a, b)| v(a, b, axis)))
        .collect();
    // The faces are the triples of neighbours.
    let edge = 2.0 / (1.0 + g * g).sqrt() + 1e-9;
    let near = |a: DVec3, b: DVec3| a.distance(b) < edge;
    let mut faces = Vec::new();
    for i in 0..12 {
        for j in i + 1..12 {
            for k in j + 1..12 {
                let (a, b, c) = (vertices[i], vertices[j], vertices[k]);
                if near(a, b) && near(b, c) && near(c, a) {
                    let out = (b - a).cross(c - a).dot(a) > 0.0;
                    faces.push(if out { [a, b, c] } else { [a, c, b] });
                }
            }
        }
    }
    for _ in 0..level {
        let split = |[a, b, c]: [DVec3; 3]| {
            let [ab, bc, ca] = [(a + b).normalize(), (b + c).normalize(), (c + a).normalize()];
            [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
        };
        faces = faces.into_iter().flat_map(split).collect();
    }
    faces
}

/// A delta light that shines along `direction` with perpendicular irradiance E.
pub fn sun(direction: DVec3, irradiance: f64) -> Light {
    Light {
        direction: direction.normalize().as_vec3(),
        intensity: Vec3::splat(irradiance as f32),
        kind: LIGHT_DIRECTIONAL,
        ..Default::default()
    }
}

/// A mean and its standard error, from independently scrambled pixels.
#[derive(Clone, Copy, Debug)]
pub struct Estimate {
    pub mean: DVec3,
    pub error: DVec3,
}

impl Estimate {
    /// Of independent values.
    pub fn of(values: &[DVec3]) -> Estimate {
        let n = values.len() as f64;
        let mean = values.iter().sum::<DVec3>() / n;
        let squares = values.iter().map(|v| (v - mean) * (v - mean)).sum::<DVec3>();
        Estimate { mean, error: (squares / n / (n - 1.0)).powf(0.5) }
    }

    /// Fails if the red channel is more than 4 standard errors and `slack` of the value away. With 63 degrees of
    /// freedom, 4 standard errors happen by chance once in 6,000.
    #[track_caller]
    pub fn check(&self, expected: f64, slack: f64, what: &str) {
        let difference = (self.mean.x - expected).abs();
        let allowed = 4.0 * self.error.x + slack * expected;
        assert!(difference <= allowed, "{what}: {} +- {} for {expected}", self.mean.x, self.error.x);
    }
}

/// Mean of `value(pixel, step)` over `samples` samples in each of the view's pixels.
pub fn estimate(world: &World, samples: u32, value: impl Fn(u32, &Step) -> DVec3 + Sync) -> Estimate {
    let inputs = world.inputs();
    let pixel = |index: u32| {
        let sum: DVec3 = (0..samples).map(|s| value(index, &step(&inputs, s, 0..1, 0..samples))).sum();
        sum / f64::from(samples)
    };
    let pixels: Vec<DVec3> = (0..world.view.crop_width).into_par_iter().map(pixel).collect();
    Estimate::of(&pixels)
}

/// One sample of the light that leaves `surface` after transport, by the twins; it must be valid.
pub fn subsurface(inputs: &Inputs, step: &Step, index: u32, surface: &Surface) -> DVec3 {
    let probe = sample(inputs, step, index, surface);
    let hits = reproject(inputs, step, index, surface, &probe);
    valid(accumulate(inputs, step, index, surface, &probe, &hits))
}

/// The radiance of a contribution that must be valid.
#[track_caller]
pub fn valid(contribution: Contribution) -> DVec3 {
    assert!(!contribution.invalid);
    contribution.radiance
}

/// The xo of a plane: z = 0, off the diagonal of the quad.
pub const ON_PLANE: DVec3 = DVec3::new(0.2, -0.1, 0.0);

/// A large square z = 0, looked at so that wo has the given angle [radians] to the normal; perspective or not.
pub fn plane(material: Material, projection: u32, pixels: u32, angle: f64, perspective: bool) -> (World, Surface) {
    let mut world = World::new(material, projection, pixels);
    let (x, y) = (DVec3::X * 200.0, DVec3::Y * 200.0);
    quad([-x - y, x - y, x + y, y - x]).into_iter().for_each(|t| world.triangle(t));
    let wo = DVec3::new(angle.sin(), 0.0, angle.cos());
    if perspective {
        world.look(ON_PLANE + 300.0 * wo, ON_PLANE, 1e-3);
    } else {
        world.look_along(-wo, ON_PLANE, 300.0, 1e-3);
    }
    let surface = world.surface(0, ON_PLANE);
    assert!(surface.barycentric.min_element() > 0.0 && surface.barycentric.element_sum() < 1.0);
    (world, surface)
}
