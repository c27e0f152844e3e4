//! Light that leaves a surface, with its entry anywhere on the body: points uniform over the area of the set's triangles.
//!
//! Lo(xo, wo) = int_A int_Omega S Li cos dw dA is estimated by
//!
//!   A Ft(wo) f(|x - xo|) E(x),   f = Rd / (pi (1 - rho_e)),   E = int Ft(wi) Li cos dw,
//!
//! at one point x with the density 1 / A. There is no tangent plane, no projection, no ball around xo and no choice among
//! hits: nothing of what [`sample`](super::sample), [`reproject`](super::reproject) and
//! [`accumulate`](super::accumulate::choose) do. S and Li are those of [`accumulate`](super::accumulate). [`area`](super::area)
//! does the same with formulas of its own. The variance is that of f over the body, of the order of its area over the
//! squared mean free path; where f has a pole at its centre, of 1 / r, it is infinite, if only by a logarithm.

use super::accumulate::{barycentric, carried};
use super::profile::{Matter, shapes};
use super::projection::matter_at;
use super::sums::Contribution;
use super::walk::Random;
use super::{Inputs, mixture, texture};
use crate::shared::{MISS, MODEL_DIRECTIONAL, MODEL_LAMBERT, Step, Surface, TRANSLUCENT, Triangle};
use glam::DVec3;

/// The triangles of a set, to draw points on.
#[derive(Clone, Debug)]
pub struct Area {
    triangles: Vec<u32>,
    /// Running sums of their areas.
    sums: Vec<f64>,
}

impl Area {
    /// Of one set among `triangles`, which has at least one.
    pub fn new(triangles: &[Triangle], set: u32) -> Area {
        let own = (0u32..).zip(triangles).filter(|(_, triangle)| triangle.set == set);
        let mut sum = 0.0;
        let (triangles, sums) = own
            .map(|(index, triangle)| {
                let [_, edge1, edge2] = triangle.corner_and_edges();
                sum += edge1.cross(edge2).length() / 2.0;
                (index, sum)
            })
            .unzip();
        Area { triangles, sums }
    }

    fn whole(&self) -> f64 {
        *self.sums.last().expect("a set has triangles")
    }

    /// A triangle, and a point uniform over the area.
    fn sample(&self, inputs: &Inputs, random: &mut Random) -> (u32, DVec3) {
        let at = random.next() * self.whole();
        let place = self.sums.partition_point(|&sum| sum <= at).min(self.sums.len() - 1);
        let triangle = self.triangles[place];
        let [corner, edge1, edge2] = inputs.triangles[triangle as usize].corner_and_edges();
        let (mut u, mut v) = (random.next(), random.next());
        if u + v > 1.0 {
            (u, v) = (1.0 - u, 1.0 - v);
        }
        (triangle, corner + u * edge1 + v * edge2)
    }
}

/// One point's part of the light that leaves the surface of pixel `index`, whose set has the area `area`. Matter in the
/// opaque limit, where light leaves where it entered, is left to [`accumulate`](super::accumulate).
pub fn uniform(
    inputs: &Inputs,
    step: &Step,
    index: u32,
    surface: &Surface,
    area: &Area,
    random: &mut Random,
) -> Contribution {
    if surface.triangle == MISS {
        return Contribution::default();
    }
    let matter = matter_at(inputs, surface);
    if matter.material.flags & TRANSLUCENT == 0 || matter.material.model == MODEL_LAMBERT {
        return Contribution::default();
    }
    let (triangle, point) = area.sample(inputs, random);
    let weights = barycentric(&inputs.triangles[triangle as usize], point);
    let material = mixture::entered(inputs, matter.material, triangle);
    if material.model == MODEL_LAMBERT || !texture::solid(inputs, triangle, weights) {
        return Contribution::default();
    }
    let delta = point - surface.position.as_dvec3();
    let local = texture::medium(inputs, material, triangle, weights);
    let local = Matter { material: &local, ..matter };
    let value = match material.model {
        // Its own value comes with each ray.
        MODEL_DIRECTIONAL => DVec3::ONE,
        _ => local.material.strength.as_dvec3() * shapes(local, delta.length()),
    };
    carried(inputs, step, index, surface, (delta, triangle, value * area.whole()), 0.0)
}
