//! The walk from the eye: what comes out of a body towards a camera.
//!
//! # Estimator
//! Light is followed backwards. Of what arrives at the eye from xo, the part T(wo) came through the surface; its path goes
//! on inside, refracted, and by reciprocity the same walk as from a light carries it. Radiance grows by n^2 where it enters
//! matter and falls by as much where it leaves, so that
//!
//!   Lo(xo, wo) = T(wo) E[ w L(xi, wi) ],
//!
//! over paths that leave the body at xi towards wi with the weight w of what was not absorbed. Each channel is walked for
//! itself unless scattering is the same, so no channel's weight depends on another's. In a furnace without absorption every
//! path brings T(wo), without noise.
//!
//! # Light
//! L of emitters and the environment is what the refracted ray meets: exact, and noisy where they are small. Light that
//! passed straight through is in it, as it is in no model. Other surfaces are black to that ray, as to all integrators.
//!
//! *Named approximation: delta lights.* No path meets one through a smooth surface. Instead each path that was scattered
//! brings, where it leaves,
//!
//!   w T(wi) / (pi (1 - rho_e)) E_i,
//!
//! E_i the irradiance there: the exitance formula of all models with eye and light exchanged. It takes light inside that
//! arrives at the surface for diffuse, so what the direction of entry does to a path is forgotten; in light that is the
//! same from everywhere it is exact. Light that was not scattered arrives from one direction alone, which no camera ray has: it brings nothing.
//!
//! # Geometry
//! The body is what its triangles enclose; other things inside it are not met. T(wo), and cosines to delta lights, take
//! shading normals, as [`accumulate`](crate::reference::accumulate) does and as what is reflected does; paths, the
//! triangles' own.

use super::boundary::Boundary;
use super::mesh::Mesh;
use super::{End, Matter, Random, walk_behind};
use crate::reference::accumulate::{Entry, entering_light, lifted, tint};
use crate::reference::light::{self, FAR};
use crate::reference::projection::{geometric_normal, seen};
use crate::reference::rough::{crossing, entering_share};
use crate::reference::sums::Contribution;
use crate::reference::tile::Place;
use crate::reference::{Inputs, emitter, intersect};
use crate::scene;
use crate::shared::{MISS, Step, Surface, Triangle};
use glam::DVec3;
use std::f64::consts::PI;

/// The shape of a closed set of triangles.
#[derive(Clone, Debug)]
pub struct Body {
    mesh: Mesh,
    /// Triangles of the scene by the mesh's places.
    triangles: Vec<u32>,
}

impl Body {
    /// Of one set among `triangles`, which has at least one.
    pub fn new(triangles: &[Triangle], set: u32) -> Body {
        let own = (0u32..).zip(triangles).filter(|(_, triangle)| triangle.set == set);
        let (triangles, corners): (_, Vec<_>) =
            own.map(|(index, triangle)| (index, triangle.vertices.map(|vertex| vertex.as_dvec3()))).unzip();
        Body { mesh: Mesh::new(&corners), triangles }
    }
}

/// What fills a body.
#[derive(Clone, Copy, Debug)]
pub struct Filling {
    /// By channel.
    pub matter: [Matter; 3],
    /// What its base colour leaves of light each time that it crosses the surface.
    pub tint: DVec3,
}

impl Filling {
    /// Of a material that has a medium, in units of which a metre has `scale`.
    pub fn of(material: &scene::Material, scale: f64) -> Option<Filling> {
        let medium = material.medium.as_ref()?;
        let matter = [0, 1, 2].map(|c| Matter {
            sigma_s: medium.sigma_s_prime[c] / (1.0 - medium.g[c]) / scale,
            sigma_a: medium.sigma_a[c] / scale,
            g: medium.g[c],
            ior: material.ior,
        });
        Some(Filling { matter, tint: if material.tinted { material.base_color } else { DVec3::ONE } })
    }

    /// Channels that one walk serves: those with the same scattering.
    fn groups(&self) -> impl Iterator<Item = Vec<usize>> {
        let like = |a: usize, b: usize| {
            let [a, b] = [a, b].map(|c| (self.matter[c].sigma_s, self.matter[c].g));
            a == b
        };
        (0..3)
            .filter(move |&c| !(0..c).any(|before| like(before, c)))
            .map(move |c| (c..3).filter(|&k| like(c, k)).collect())
    }
}

/// One path's light that leaves the surface of pixel `index` for each channel. Invalid where the surface is seen from
/// inside, and where rounding lost a path.
pub fn radiance(
    inputs: &Inputs,
    step: &Step,
    index: u32,
    surface: &Surface,
    (body, filling): (&Body, &Filling),
    random: &mut Random,
) -> Contribution {
    if surface.triangle == MISS {
        return Contribution::default();
    }
    let seen = seen(inputs, surface);
    let material = &inputs.materials[inputs.shadings[surface.triangle as usize].material as usize];
    let invalid = Contribution { radiance: DVec3::ZERO, invalid: true };
    if seen.side < 0.0 {
        return invalid;
    }
    let weights = surface.barycentric.as_dvec2();
    let out = tint(inputs, surface.triangle, weights)
        * filling.tint
        * crossing(inputs, material, seen.shading_normal.dot(seen.wo), 1.0);
    if out == DVec3::ZERO {
        return Contribution::default();
    }
    let [corner, edge1, edge2] = inputs.triangles[surface.triangle as usize].corner_and_edges();
    let start = corner + weights.x * edge1 + weights.y * edge2;
    let boundary = Boundary { ior: material.ior.into(), alpha: material.alpha.into() };
    let leaving = 1.0 / (PI * entering_share(inputs, material));
    let mut sum = DVec3::ZERO;
    for channels in filling.groups() {
        let least = channels.iter().map(|&c| filling.matter[c].sigma_a).fold(f64::INFINITY, f64::min);
        let matter = Matter { sigma_a: least, ..filling.matter[channels[0]] };
        let Some(inside) = boundary.enter(seen.wo, seen.normal, random) else { continue };
        let exit = match walk_behind(&boundary, &body.mesh, &matter, start, inside, random) {
            End::Left(exit) => exit,
            End::Absorbed => continue,
            End::Lost => return invalid,
        };
        let triangle = body.triangles[exit.place];
        let entry = Entry::new(inputs, material, 1.0, exit.position, triangle);
        let normal = geometric_normal(&inputs.triangles[triangle as usize]);
        let mut light = met(inputs, lifted(exit.position, normal), exit.direction);
        if exit.scatterings > 0 {
            let delta = Step { ray_begin: 0, ray_count: inputs.view.light_count, ..*step };
            let place = Place::of(inputs, step, index);
            light += leaving * entering_light(inputs, &delta, place, &entry, |_| DVec3::ONE);
        }
        light *= entry.tint * filling.tint;
        for c in channels {
            sum[c] = exit.weight(filling.matter[c].sigma_a) * light[c];
        }
    }
    Contribution::of(out * sum)
}

/// Radiance from the direction `wi`.
fn met(inputs: &Inputs, origin: DVec3, wi: DVec3) -> DVec3 {
    match intersect::closest(inputs, origin, wi, 0.0, FAR) {
        Some(hit) => emitter::radiance(inputs, hit.triangle, hit.barycentric, wi),
        None => light::environment(inputs, wi),
    }
}
