//! An independent integrator of the BSSRDF: it shares no code with the kernels' twins, so that an error of thought shows.
//!
//! Lo(xo, wo) = int_A int_Omega S Li cos dw dA with points x_i uniform over the area of all triangles of the set: no
//! tangent plane, no projection, no density but 1 / A; triangles' own normals everywhere; pseudo-random numbers. Slow
//! where the profile is narrow, unbiased always. The models' formulas are written down once more here, from their papers,
//! and with the moments of Fresnel's equations by quadrature.

use crate::settings::{Model, Normalisation};
use crate::shared::Triangle;
use glam::DVec3;
use rayon::prelude::*;
use std::f64::consts::PI;

/// Three vertices, counter-clockwise seen from outside.
pub type Corners = [DVec3; 3];

/// The triangles of one set, and all others.
pub fn corners(triangles: &[Triangle], set: u32) -> (Vec<Corners>, Vec<Corners>) {
    let corners = |t: &&Triangle| t.vertices.map(|vertex| vertex.as_dvec3());
    let (own, others): (Vec<&Triangle>, Vec<&Triangle>) = triangles.iter().partition(|t| t.set == set);
    (own.iter().map(corners).collect(), others.iter().map(corners).collect())
}

/// Homogeneous matter; coefficients in 1/length of the geometry.
#[derive(Clone, Copy, Debug)]
pub struct Matter {
    pub sigma_s_prime: DVec3,
    pub sigma_a: DVec3,
    /// Mean cosine of the phase function.
    pub g: f64,
    /// Inside over outside.
    pub ior: f64,
    pub normalisation: Normalisation,
    /// Any but `Auto` and `Table`.
    pub model: Model,
}

impl Matter {
    /// Albedo, extinction and absorption of a channel, reduced.
    fn coefficients(&self, c: usize) -> (f64, f64, f64) {
        let Matter { sigma_s_prime, sigma_a, .. } = self;
        let extinction = sigma_s_prime[c] + sigma_a[c];
        (sigma_s_prime[c] / extinction, extinction, sigma_a[c])
    }
}

/// A light.
#[derive(Clone, Copy, Debug)]
pub enum Lamp {
    /// Intensity [W/sr].
    Point { position: DVec3, intensity: DVec3 },
    /// Direction of travel (unit), perpendicular irradiance [W/m^2].
    Directional { direction: DVec3, irradiance: DVec3 },
    /// The side from which the corners run counter-clockwise shines, or both [W/(m^2 sr)]. It stops light only if it is
    /// among the blockers.
    Triangle { corners: Corners, radiance: DVec3, two_sided: bool },
}

/// What is integrated.
#[derive(Clone, Copy, Debug)]
pub struct Setting<'a> {
    /// The surfaces that exchange light; they also cast shadows.
    pub set: &'a [Corners],
    /// Other surfaces that cast shadows.
    pub blockers: &'a [Corners],
    pub matter: Matter,
    /// Matter behind each triangle of the set, by whose profile its light travels; none where it is `matter` everywhere.
    /// Index of refraction and normalisation are those of `matter`.
    pub entries: &'a [Matter],
    pub lamps: &'a [Lamp],
    /// Radiance from every direction.
    pub surrounding: DVec3,
}

/// Mean and standard error of the mean, per channel.
#[derive(Clone, Copy, Debug)]
pub struct Estimate {
    pub mean: DVec3,
    pub error: DVec3,
}

/// Distance along the normal from a surface to its shadow rays; geometry is meant to have about the size 1.
const SHADOW_OFFSET: f64 = 1e-6;

/// Independent streams into which the samples are divided; the result does not depend on threads.
const STREAMS: u64 = 64;

/// Light leaving `point` towards the unit vector `wo`, where `normal` is the surface's normal on wo's side.
pub fn leaving(setting: &Setting, point: DVec3, normal: DVec3, wo: DVec3, samples: u64, seed: u64) -> Estimate {
    let surface = Surface::new(setting);
    let exit = 1.0 - reflectance(setting.matter.ior, normal.dot(wo));
    let moments = moments(samples, seed, |rng| {
        let (x, n, index) = surface.sample(rng);
        let matter = setting.entries.get(index).unwrap_or(&setting.matter);
        let profile = |wi: DVec3| surface.profile(matter, point - x, n, wi, normal);
        exit * surface.area * surface.entering(x, n, rng, profile)
    });
    moments.estimate()
}

/// Flux that enters the whole set.
pub fn entering_flux(setting: &Setting, samples: u64, seed: u64) -> Estimate {
    let surface = Surface::new(setting);
    let sample = |rng: &mut Random| {
        let (x, n, _) = surface.sample(rng);
        surface.area * surface.entering(x, n, rng, |_| DVec3::ONE)
    };
    moments(samples, seed, sample).estimate()
}

#[derive(Clone, Copy, Default)]
struct Moments {
    count: f64,
    sum: DVec3,
    squares: DVec3,
}

impl Moments {
    fn estimate(&self) -> Estimate {
        let mean = self.sum / self.count;
        let variance = (self.squares / self.count - mean * mean).max(DVec3::ZERO);
        Estimate { mean, error: (variance / (self.count - 1.0)).powf(0.5) }
    }
}

fn moments(samples: u64, seed: u64, sample: impl Fn(&mut Random) -> DVec3 + Sync) -> Moments {
    let stream = |stream: u64| {
        let mut rng = Random(seed.wrapping_mul(0x9e37_79b9).wrapping_add(stream) << 32);
        (0..samples.div_ceil(STREAMS)).fold(Moments::default(), |m, _| {
            let x = sample(&mut rng);
            Moments { count: m.count + 1.0, sum: m.sum + x, squares: m.squares + x * x }
        })
    };
    let parts: Vec<Moments> = (0..STREAMS).into_par_iter().map(stream).collect();
    parts.iter().fold(Moments::default(), |a, b| Moments {
        count: a.count + b.count,
        sum: a.sum + b.sum,
        squares: a.squares + b.squares,
    })
}

/// SplitMix64 (G. L. Steele, D. Lea, C. H. Flood, OOPSLA 2014).
struct Random(u64);

impl Random {
    /// In [0, 1).
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }
}

/// Unpolarised Fresnel reflectance from Snell's angles; `n` is the index beyond over the index before.
fn reflectance(n: f64, cos: f64) -> f64 {
    if n == 1.0 {
        return 0.0;
    }
    let sin_t = (1.0 - cos * cos).sqrt() / n;
    if sin_t >= 1.0 {
        return 1.0;
    }
    let cos_t = (1.0 - sin_t * sin_t).sqrt();
    let perpendicular = ((cos - n * cos_t) / (cos + n * cos_t)).powi(2);
    let parallel = ((cos_t - n * cos) / (cos_t + n * cos)).powi(2);
    0.5 * (perpendicular + parallel)
}

/// Reflectance of diffuse light from outside, by the midpoint rule in cos^2.
fn diffuse_reflectance(n: f64) -> f64 {
    let steps = 200_000;
    (0..steps).map(|i| reflectance(n, ((f64::from(i) + 0.5) / f64::from(steps)).sqrt())).sum::<f64>() / f64::from(steps)
}

/// int F c^2 dc over the cosines of one side, by the midpoint rule in c^3.
fn second_moment(n: f64) -> f64 {
    let steps = 200_000;
    let sum: f64 = (0..steps).map(|i| reflectance(n, ((f64::from(i) + 0.5) / f64::from(steps)).cbrt())).sum();
    sum / f64::from(3 * steps)
}

/// The set, prepared: areas for sampling, profiles, a tree for shadows.
struct Surface<'a> {
    setting: &'a Setting<'a>,
    /// Running sums of the areas of the triangles.
    areas: Vec<f64>,
    area: f64,
    /// Internal and external moments of the reflectance: int F c dc, int F c^2 dc inside; 2 int F c dc outside.
    moments: [f64; 3],
    /// 1 / (pi (1 - rho_e)), or 1 / pi.
    scale: f64,
    shadows: Node,
}

impl<'a> Surface<'a> {
    fn new(setting: &'a Setting<'a>) -> Surface<'a> {
        let mut area = 0.0;
        let mut add = |[a, b, c]: &Corners| {
            area += (b - a).cross(c - a).length() / 2.0;
            area
        };
        let areas: Vec<f64> = setting.set.iter().map(&mut add).collect();
        let Matter { ior, normalisation, .. } = setting.matter;
        let outside = diffuse_reflectance(ior);
        // Light that crosses is the same from both sides: n^2 (1 - rho_i) = 1 - rho_e.
        let inside = 1.0 - (1.0 - outside) / (ior * ior);
        let moments = [inside / 2.0, second_moment(1.0 / ior), outside];
        let scale = match normalisation {
            Normalisation::Energy => 1.0 / (PI * (1.0 - outside)),
            Normalisation::Jensen2001 => 1.0 / PI,
        };
        let all = setting.set.iter().chain(setting.blockers).copied().collect();
        Surface { setting, areas, area, moments, scale, shadows: Node::build(all) }
    }

    /// S without the Fresnel factors, of light from `wi` that enters with the normal `ni` and leaves at the distance `x`
    /// from there with the normal `no`.
    fn profile(&self, matter: &Matter, x: DVec3, ni: DVec3, wi: DVec3, no: DVec3) -> DVec3 {
        DVec3::from([0, 1, 2].map(|c| {
            if matter.sigma_s_prime[c] == 0.0 {
                return 0.0;
            }
            let coefficients = matter.coefficients(c);
            match matter.model {
                Model::Better => self.scale * self.better(coefficients, x.length()),
                Model::Burley => self.scale * self.burley(coefficients, x.length()),
                Model::Directional => self.scale * self.directional(coefficients, matter.g, x, ni, wi, no),
                _ => self.scale * self.standard(coefficients, x.length()),
            }
        }))
    }

    /// Jensen et al. 2001.
    fn standard(&self, (albedo, extinction, absorption): (f64, f64, f64), r: f64) -> f64 {
        let diffusion = 1.0 / (3.0 * extinction);
        let sigma = (absorption / diffusion).sqrt();
        let depth = 1.0 / extinction;
        let inside = 2.0 * self.moments[0];
        let height = depth + 4.0 * (1.0 + inside) / (1.0 - inside) * diffusion;
        let source = |z: f64| {
            let d = (r * r + z * z).sqrt();
            z * (1.0 + sigma * d) * (-sigma * d).exp() / d.powi(3)
        };
        albedo / (4.0 * PI) * (source(depth) + source(height))
    }

    /// C_phi, C_E and A of d'Eon 2012.
    fn boundary(&self) -> (f64, f64, f64) {
        let (c1, c2) = (self.moments[0], self.moments[1]);
        ((1.0 - 2.0 * c1) / 4.0, (1.0 - 3.0 * c2) / 2.0, (1.0 + 3.0 * c2) / (1.0 - 2.0 * c1))
    }

    /// d'Eon 2012, with a signed height as there.
    fn better(&self, (albedo, extinction, absorption): (f64, f64, f64), r: f64) -> f64 {
        let (c_phi, c_e, a) = self.boundary();
        let diffusion = (extinction + absorption) / (3.0 * extinction * extinction);
        let sigma = (absorption / diffusion).sqrt();
        let depth = 1.0 / extinction;
        let term = |z: f64| {
            let d = (r * r + z * z).sqrt();
            (c_e * z * (1.0 + sigma * d) / (d * d) + c_phi / diffusion) * (-sigma * d).exp() / d
        };
        albedo * albedo / (4.0 * PI) * (term(depth) - term(-(depth + 4.0 * a * diffusion)))
    }

    /// Christensen and Burley 2015 with the standard dipole's total (Jensen and Buhler 2002) and the diffuse mean free
    /// path.
    fn burley(&self, (albedo, extinction, absorption): (f64, f64, f64), r: f64) -> f64 {
        let inside = 2.0 * self.moments[0];
        let e = (3.0 * (1.0 - albedo)).sqrt();
        let total = albedo / 2.0 * (1.0 + (-4.0 / 3.0 * (1.0 + inside) / (1.0 - inside) * e).exp()) * (-e).exp();
        let length = 1.0 / (3.0 * absorption * extinction).sqrt();
        let s = 3.5 + 100.0 * (total - 0.33).powi(4);
        let x = s * r / length;
        total * s / (8.0 * PI * length * r) * ((-x).exp() + (-x / 3.0).exp())
    }

    /// Frisvad et al. 2014, times pi (1 - rho_e) like a radial profile; the real source kept at 1 / (3 sigma_t).
    fn directional(
        &self,
        (albedo, extinction, absorption): (f64, f64, f64),
        g: f64,
        x: DVec3,
        ni: DVec3,
        wi: DVec3,
        no: DVec3,
    ) -> f64 {
        let (c_phi, c_e, a) = self.boundary();
        let diffusion = 1.0 / (3.0 * extinction);
        let sigma = (absorption / diffusion).sqrt();
        let extrapolated = 2.131 * diffusion / albedo.sqrt();
        let n = self.setting.matter.ior;
        let cos = wi.dot(ni);
        let w = (cos * ni - wi) / n - ni * (1.0 - (1.0 - cos * cos) / (n * n)).sqrt();
        let r = x.length();
        let term = |x: DVec3, w: DVec3, d: f64| {
            let sd = sigma * d;
            let first = c_phi * (d * d / diffusion + 3.0 * (1.0 + sd) * x.dot(w));
            let inner = 1.0 + sd + 3.0 * diffusion * (3.0 * (1.0 + sd) + sd * sd) / (d * d) * x.dot(w);
            let second = c_e * (3.0 * diffusion * (1.0 + sd) * w.dot(no) - inner * x.dot(no));
            (-sd).exp() / d.powi(3) * (first - second)
        };
        let unreduced = albedo * extinction / (1.0 - g) + absorption;
        let least = 1.0 / (3.0 * unreduced).powi(2);
        let mu = -no.dot(w);
        let beta = -((r * r - x.dot(w).powi(2)).max(0.0) / (r * r + extrapolated * extrapolated)).sqrt();
        let front = diffusion * mu * (diffusion * mu - 2.0 * extrapolated * beta);
        let near = (r * r + if mu > 0.0 { front.max(least) } else { least }).sqrt();
        // BAC - CAB written out, as the paper has it.
        let across = x.normalize().cross(ni.cross(x).normalize());
        let place = x - 2.0 * a * extrapolated * across;
        let mirrored = w - 2.0 * w.dot(across) * across;
        (term(x, w, near) - term(place, mirrored, place.length())).max(0.0) / (4.0 * PI)
    }

    /// A point uniform over the area, the normal there, and its triangle.
    fn sample(&self, rng: &mut Random) -> (DVec3, DVec3, usize) {
        let pick = rng.next() * self.area;
        let index = self.areas.partition_point(|&sum| sum <= pick).min(self.areas.len() - 1);
        let [a, b, c] = self.setting.set[index];
        let (s, t) = inside(rng);
        (a + (b - a) * s + (c - a) * t, (b - a).cross(c - a).normalize(), index)
    }

    /// Irradiance at `x` that passes the surface, each direction times `weight`; the surrounding by one cosine-weighted
    /// direction.
    fn entering(&self, x: DVec3, normal: DVec3, rng: &mut Random, weight: impl Fn(DVec3) -> DVec3) -> DVec3 {
        let start = x + normal * SHADOW_OFFSET;
        let lit = |wi: DVec3, distance: f64| -> DVec3 {
            let cos = normal.dot(wi);
            if cos <= 0.0 || self.shadows.blocks(start, wi, distance) {
                DVec3::ZERO
            } else {
                (1.0 - reflectance(self.setting.matter.ior, cos)) * cos * weight(wi)
            }
        };
        let mut sum = DVec3::ZERO;
        for lamp in self.setting.lamps {
            sum += match *lamp {
                Lamp::Directional { direction, irradiance } => irradiance * lit(-direction, f64::INFINITY),
                Lamp::Point { position, intensity } => {
                    let to = position - x;
                    intensity * lit(to.normalize(), to.length()) / to.length_squared()
                }
                Lamp::Triangle { corners: [a, b, c], radiance, two_sided } => {
                    let (s, t) = inside(rng);
                    // From where the ray starts: at a grazing angle a lamp would hide a point of its own from elsewhere.
                    let to = a + (b - a) * s + (c - a) * t - start;
                    let wi = to.normalize();
                    // The area as it is seen from there.
                    let seen = -(b - a).cross(c - a).dot(wi) / 2.0;
                    let seen = if two_sided { seen.abs() } else { seen.max(0.0) };
                    radiance * (seen / to.length_squared() * lit(wi, to.length() - 10.0 * SHADOW_OFFSET))
                }
            };
        }
        if self.setting.surrounding != DVec3::ZERO {
            // A unit vector on the sphere around the tip of the normal is cosine-weighted once normalised.
            let z = 2.0 * rng.next() - 1.0;
            let phi = 2.0 * PI * rng.next();
            let r = (1.0 - z * z).sqrt();
            let wi = (normal + DVec3::new(r * phi.cos(), r * phi.sin(), z)).normalize_or(normal);
            let cos = normal.dot(wi);
            if cos > 0.0 {
                sum += self.setting.surrounding * PI / cos * lit(wi, f64::INFINITY);
            }
        }
        sum
    }
}

/// Weights of the second and third corner of a point uniform over a triangle.
fn inside(rng: &mut Random) -> (f64, f64) {
    let (s, t) = (rng.next(), rng.next());
    if s + t > 1.0 { (1.0 - s, 1.0 - t) } else { (s, t) }
}

/// A tree of boxes, split at the median of the longest side.
struct Node {
    low: DVec3,
    high: DVec3,
    content: Content,
}

enum Content {
    Triangles(Vec<Corners>),
    Halves(Box<[Node; 2]>),
}

impl Node {
    fn build(mut triangles: Vec<Corners>) -> Node {
        let corners = || triangles.iter().flatten();
        let low = corners().fold(DVec3::INFINITY, |low, &c| low.min(c));
        let high = corners().fold(DVec3::NEG_INFINITY, |high, &c| high.max(c));
        if triangles.len() <= 4 {
            return Node { low, high, content: Content::Triangles(triangles) };
        }
        let axis = (high - low).max_position();
        let middle = |t: &Corners| t[0][axis] + t[1][axis] + t[2][axis];
        triangles.sort_by(|a, b| middle(a).total_cmp(&middle(b)));
        let rest = triangles.split_off(triangles.len() / 2);
        Node { low, high, content: Content::Halves(Box::new([Node::build(triangles), Node::build(rest)])) }
    }

    fn blocks(&self, origin: DVec3, direction: DVec3, distance: f64) -> bool {
        let slope = DVec3::select(direction.cmpeq(DVec3::ZERO), DVec3::splat(1e-300), direction);
        let (a, b) = ((self.low - origin) / slope, (self.high - origin) / slope);
        // A margin, because a flat box may lose its rays to rounding.
        let near = a.min(b).max_element() - 1e-9;
        let far = a.max(b).min_element() + 1e-9;
        if near > far || far < 0.0 || near > distance {
            return false;
        }
        match &self.content {
            Content::Halves(halves) => halves.iter().any(|half| half.blocks(origin, direction, distance)),
            Content::Triangles(triangles) => triangles.iter().any(|t| crosses(t, origin, direction, distance)),
        }
    }
}

/// Whether the ray passes through a triangle: on the same side of the three edges, the plane at 0 < t < distance.
fn crosses([a, b, c]: &Corners, origin: DVec3, direction: DVec3, distance: f64) -> bool {
    let (a, b, c) = (a - origin, b - origin, c - origin);
    let (x, y, z) = (a.cross(b).dot(direction), b.cross(c).dot(direction), c.cross(a).dot(direction));
    if !((x >= 0.0 && y >= 0.0 && z >= 0.0) || (x <= 0.0 && y <= 0.0 && z <= 0.0)) {
        return false;
    }
    let normal = (b - a).cross(c - a);
    let t = a.dot(normal) / direction.dot(normal);
    t > 0.0 && t < distance
}
