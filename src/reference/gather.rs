//! What the points of the cloud send to a surface: twin of `gather.comp`.
//!
//! # Quadrature
//! With the points x_i, their areas A and the flux Phi_i that enters there, the light that leaves xo is
//!
//!   Lo = Ft(wo) / (pi (1 - rho_e)) int Rd(|x - xo|) E(x) dA  ~  Ft(wo) sum_i f(|x_i - xo|) Phi_i,
//!
//! H. W. Jensen and J. Buhler's sum (ACM TOG 21 (2002)). It is wrong where f changes between neighbours: every profile has
//! the order of 1 / r at its centre. So that part is interpolated instead. With w(r) = (1 - r^2 / h^2)^2 within the reach h,
//! some spacings of the points,
//!
//!   Lo = Ft(wo) (sum_i (1 - w) f Phi_i  +  M sum_i w f Phi_i / sum_i w f A),   M = int w f dA,
//!
//! where w is 0 of what does not face the same side. Where E is even the second term is exact, however steep f is, and as h
//! goes to 0 with the spacing all of it becomes the integral. M is known at the points, where it is integrated over the
//! triangles ([`Near`]), and interpolated with the weights w f A.
//!
//! # Tree
//! Points that are small beside their distance count together ([`cluster`](super::cluster)): those of the radius s at r
//! are opened unless s < opening r. Opening 0 takes every point. Where f falls exponentially a group's error is larger, by
//! (1 + x / 2)^2 at x decay lengths, and its light smaller, by e^-x, which is more.
//!
//! With the variance V of the points about their mean, as much in each direction of the plane that they lie about, whose
//! normal makes the cosine c with the way to them, squared distances have the mean r^2 + V and, to the second order in the
//! radius, the variance 2 r^2 V (1 - c^2). The profile is the mean of its values at the two squared distances that have
//! both. What remains is that points may lie along a line, or bend away: errors of either sign.

use super::Inputs;
use super::accumulate::tint;
use super::profile::{self, Matter, Profile, shapes, table, table::Local};
use super::projection::{balance, matter_at, seen};
use super::rough::{crossing, leaving_share};
use super::sums::Contribution;
use super::texture;
use crate::shared::{Cluster, Gather, MISS, MODEL_LAMBERT, MODEL_TABLE, SEVERAL, Surface, TRANSLUCENT};
use glam::DVec3;

/// w f of the [module](self), as mass within squared distances: what [`triangle`](crate::curvature::balance::triangle)
/// integrates over a surface.
pub struct Near {
    reach: f64,
    /// At the radii (k / ([`NODES`] - 1))^2 reach.
    within: Vec<DVec3>,
}

/// Radii at which near masses are tabulated.
const NODES: usize = 65;

impl Near {
    /// The near part of a material's shape.
    pub fn new(matter: Matter, reach: f64) -> Near {
        let inside: Box<dyn Fn(f64) -> DVec3> = if matter.material.model == MODEL_TABLE {
            let local = Local::new(matter);
            Box::new(move |r| local.inside(r * r))
        } else {
            let channels = [0, 1, 2].map(|c| Profile::unpack(matter, c));
            Box::new(move |r| DVec3::from(channels.each_ref().map(|channel| channel.inside(r))))
        };
        let share = |k: f64| (k / (NODES - 1) as f64).powi(2);
        let w = |k: f64| (1.0 - share(k).powi(2)).powi(2);
        // The sum of w dM, the steps of M by those of w at their middles.
        let steps = (1..NODES).scan((DVec3::ZERO, DVec3::ZERO), |(sum, before), k| {
            let mass = inside(share(k as f64) * reach);
            *sum += w(k as f64 - 0.5) * (mass - *before);
            *before = mass;
            Some(*sum)
        });
        Near { reach, within: std::iter::once(DVec3::ZERO).chain(steps).collect() }
    }

    /// Mass within a squared distance.
    pub fn inside(&self, squared: f64) -> DVec3 {
        let x = (squared.sqrt() / self.reach).min(1.0).sqrt() * (NODES - 1) as f64;
        let k = (x as usize).min(NODES - 2);
        self.within[k].lerp(self.within[k + 1], x - k as f64)
    }
}

/// What the points below `node` send to a surface, which is of matter that light is gathered in.
fn below(inputs: &Inputs, clusters: &[Cluster], surface: &Surface, node: usize) -> [DVec3; 4] {
    let seen = seen(inputs, surface);
    let matter = matter_at(inputs, surface);
    let material = matter.material;
    let slope = if material.model == MODEL_TABLE { table::slope(matter) } else { DVec3::ZERO };
    let set = inputs.triangles[surface.triangle as usize].set;
    let [mut far, mut near, mut weight, mut mass] = [DVec3::ZERO; 4];
    let mut open = vec![node];
    while let Some(node) = open.pop() {
        let cluster = &clusters[node];
        let (r, radius) = (cluster.position.as_dvec3().distance(seen.position), f64::from(cluster.radius));
        let other = cluster.set != set && cluster.set != SEVERAL;
        if cluster.area == 0.0 || other || r - radius > f64::from(material.radius_max) {
            continue;
        }
        let leaf = 2 * node >= clusters.len();
        let small = radius < f64::from(inputs.view.opening) * r;
        let reach = f64::from(material.reach);
        if !leaf && (cluster.set == SEVERAL || !small) {
            open.extend([2 * node, 2 * node + 1]);
            continue;
        }
        let spread = f64::from(cluster.spread);
        let to = cluster.position.as_dvec3() - seen.position;
        let along = r * r - cluster.normal.as_dvec3().dot(to).powi(2);
        let apart = (2.0 * spread * along.max(0.0)).sqrt();
        let at = |side: f64| shapes(matter, (r * r + spread + side * apart).max(0.0).sqrt());
        let value = (at(1.0) + at(-1.0)) / 2.0;
        let light = value * (cluster.flux.as_dvec3() + slope * cluster.oblique.as_dvec3());
        let faces = cluster.normal.as_dvec3().dot(seen.side * seen.normal) > 0.0;
        let w = if faces && r < reach { (1.0 - (r / reach).powi(2)).powi(2) } else { 0.0 };
        far += (1.0 - w) * light;
        near += w * light;
        weight += w * f64::from(cluster.area) * value;
        mass += w * value * cluster.mass.as_dvec3();
    }
    [far, near, weight, mass]
}

/// Sums over the points below `node`, as a dispatch that is not the last leaves them for the next.
pub fn part(inputs: &Inputs, clusters: &[Cluster], surface: &Surface, node: usize) -> Gather {
    let [far, near, weight, mass] = below(inputs, clusters, surface, node).map(|sum| sum.as_vec3());
    Gather { far, near, weight, mass }
}

/// What all points send to the eye from a surface. `clusters` is the whole tree.
pub fn gather(inputs: &Inputs, clusters: &[Cluster], surface: &Surface) -> Contribution {
    if surface.triangle == MISS {
        return Contribution::default();
    }
    let matter = matter_at(inputs, surface);
    let material = matter.material;
    if material.flags & TRANSLUCENT == 0 || material.model == MODEL_LAMBERT {
        return Contribution::default();
    }
    let [far, near, weight, mass] = below(inputs, clusters, surface, 1);
    let near = DVec3::select(weight.cmpgt(DVec3::ZERO), near / weight * (mass / weight), DVec3::ZERO);
    let seen = seen(inputs, surface);
    let weights = surface.barycentric.as_dvec2();
    let share = texture::roughness_share(inputs, surface.triangle, weights);
    let cos = seen.shading_normal.dot(seen.wo);
    let leaving = tint(inputs, surface.triangle, weights)
        * crossing(inputs, material, cos, share)
        * leaving_share(inputs, material, share)
        * profile::obliqueness(matter, cos, true)
        * balance(inputs, material, surface)
        * material.strength.as_dvec3();
    Contribution::of(leaving * (far + near))
}
