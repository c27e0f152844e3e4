//! Profiles: how much light leaves matter at a distance from where it entered. One file per model, one interface, and
//! one line per model in the table below. Twin of `profile.glsl`; a model's mathematics is in its own file.
//!
//! # What a profile is
//! Rd(r) = strength x shape(r) is exitance per unit of flux that has entered [1/length^2]. What leaves towards wo is
//!
//!   S = Ft(wi) Ft(wo) Rd(r) / (pi (1 - rho_e)),
//!
//! whose last factor (E. d'Eon, "A better dipole", 2012) makes the light over all directions equal Rd; Jensen et al. 2001,
//! eq. 5, have 1 / pi.
//!
//! # Sampling
//! shape is a sum of up to three components, each of which its model draws exactly. A channel is picked, then one of its
//! components by its part of the integral of shape, with one number for both; the radius with another. So the density
//! per area of the plane is the shapes of the channels, each over its integral, averaged: the weight of a point on a
//! plane does not depend on r.

pub mod better;
pub mod burley;
pub mod directional;
pub mod lambert;
mod source;
pub mod standard;
pub mod table;

pub use better::BetterDipole;
pub use burley::{Burley, Fit};
pub use directional::Directional;
pub use lambert::Lambert;
pub use source::Source;
pub use standard::{Dipole, boundary_factor, invert_total};
pub use table::Tabulated;

use super::boundary::{Side, diffuse_reflectance};
use super::rough::Rough;
use crate::scene::{LengthKind, Medium};
use crate::settings::{self, Model, Normalisation, Precision};
use crate::shared::{
    self, MODEL_BETTER, MODEL_BURLEY, MODEL_DIRECTIONAL, MODEL_LAMBERT, MODEL_STANDARD, MODEL_TABLE, Material,
    RECIPROCAL, TRANSLUCENT,
};
use crate::table::{block::Block, white::mean_obliqueness};
use glam::{DVec3, Vec3};
use std::f64::consts::PI;
use std::ops::Deref;

/// Radius that stands for "no ball".
pub const UNBOUNDED: f32 = 1e30;

/// Components of one channel's sampler at most.
pub const COMPONENTS: usize = 3;

/// One channel of homogeneous matter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Coefficients {
    /// Reduced scattering [1/length], >= 0.
    pub sigma_s_prime: f64,
    /// Absorption [1/length], >= 0.
    pub sigma_a: f64,
    /// Mean cosine of the phase function, above -1 and below 1.
    pub g: f64,
    /// Index of refraction, inside over outside, > 0.
    pub ior: f64,
    /// Of a rough boundary; a smooth one's numbers are exact.
    pub rough: Option<Rough>,
    /// The total (0 to 1) and length that an author gave in place of coefficients.
    pub appearance: Option<(f64, f64, LengthKind)>,
}

impl Coefficients {
    /// Channel `c` of a medium [1/m].
    pub fn of(medium: &Medium, ior: f64, c: usize) -> Coefficients {
        Coefficients {
            sigma_s_prime: medium.sigma_s_prime[c],
            sigma_a: medium.sigma_a[c],
            g: medium.g[c],
            ior,
            rough: None,
            appearance: medium.appearance.map(|given| (given.albedo[c], given.length[c], given.kind)),
        }
    }

    /// Diffuse reflectance of the boundary for light from `side`.
    pub fn diffuse_reflectance(&self, side: Side) -> f64 {
        match (self.rough, side) {
            (None, side) => diffuse_reflectance(self.ior, side),
            (Some(rough), Side::Outside) => rough.reflectance,
            // Light in equilibrium crosses alike from both sides.
            (Some(rough), Side::Inside) => 1.0 - (1.0 - rough.reflectance) / (self.ior * self.ior),
        }
    }

    /// Mean of 1 - mu' over diffuse light that has entered, mu' the cosine of refraction.
    pub fn mean_obliqueness(&self) -> f64 {
        self.rough.map_or_else(|| mean_obliqueness(self.ior), |rough| rough.obliqueness)
    }

    /// The same matter in units of which the present one has `scale`.
    pub fn in_units(self, scale: f64) -> Coefficients {
        Coefficients {
            sigma_s_prime: self.sigma_s_prime / scale,
            sigma_a: self.sigma_a / scale,
            appearance: self.appearance.map(|(albedo, length, kind)| (albedo, length * scale, kind)),
            ..self
        }
    }
}

/// The profile of one channel, as function of the distance r on the surface.
pub trait Radial {
    /// shape(r) e^exponent [1/length^2].
    fn shape_shifted(&self, r: f64, exponent: f64) -> f64;

    /// Rd over shape; 0 for matter that does not scatter.
    fn strength(&self) -> f64;

    /// Integral of shape over the plane, by components of the sampler.
    fn masses(&self) -> [f64; COMPONENTS];

    /// Integral of shape within a radius.
    fn inside(&self, radius: f64) -> f64;

    /// Integral of shape beyond a radius.
    fn outside(&self, radius: f64) -> f64;

    /// Hankel transform of shape: int 2 pi r shape(r) J_0(k r) dr.
    fn response(&self, k: f64) -> f64;

    /// Radius of the point of a component that two numbers in [0, 1) pick.
    fn radius(&self, component: usize, share: f64, u: f64) -> f64;

    /// Rate at which the profile falls at large radii [1/length].
    fn rate(&self) -> f64;

    /// Writes what kernels read of channel `c`, but for strength, density and component_cdf.
    fn pack(&self, c: usize, options: &Options, material: &mut Material);

    /// Rd over strength [1/length^2].
    fn shape(&self, r: f64) -> f64 {
        self.shape_shifted(r, 0.0)
    }

    /// Integral of shape over the plane.
    fn mass(&self) -> f64 {
        self.masses().iter().sum()
    }

    /// Exitance per unit flux that entered at distance r [1/length^2].
    fn rd(&self, r: f64) -> f64 {
        self.strength() * self.shape(r)
    }

    /// Total of the profile.
    fn total(&self) -> f64 {
        self.strength() * self.mass()
    }

    /// Part of the total within `radius`.
    fn cdf(&self, radius: f64) -> f64 {
        self.strength() * self.inside(radius)
    }

    /// Amplitude of the exitance under the irradiance cos(k x).
    fn mtf(&self, k: f64) -> f64 {
        self.strength() * self.response(k)
    }

    /// Smallest radius beyond which at most `share` of the total lies; infinite for share <= 0.
    fn radius_beyond(&self, share: f64) -> f64 {
        if share <= 0.0 {
            return f64::INFINITY;
        }
        let allowed = share * self.mass();
        if self.outside(0.0) <= allowed {
            return 0.0;
        }
        let (mut below, mut above) = (0.0, 1.0);
        while self.outside(above) > allowed {
            below = above;
            above *= 2.0;
        }
        while above - below > 1e-14 * above {
            let middle = (below + above) / 2.0;
            *(if self.outside(middle) > allowed { &mut below } else { &mut above }) = middle;
        }
        above
    }
}

macro_rules! models {
    ($($setting:ident, $constant:ident: $type:ty;)*) => {
        /// One channel's profile, of whichever model.
        #[derive(Clone, Debug)]
        pub enum Profile { $($setting($type),)* }

        impl Deref for Profile {
            type Target = dyn Radial + 'static;

            fn deref(&self) -> &(dyn Radial + 'static) {
                match self { $(Profile::$setting(profile) => profile,)* }
            }
        }

        /// MODEL_* of a model, if it is built.
        pub fn constant(model: Model) -> Option<u32> {
            match model {
                $(Model::$setting => Some($constant),)*
                _ => None,
            }
        }

        impl Profile {
            /// The profile of matter.
            pub fn new(model: u32, matter: &Coefficients) -> Profile {
                match model {
                    $($constant => Profile::$setting(<$type>::of(matter)),)*
                    _ => unreachable!("a model of the table"),
                }
            }

            /// The profile of channel `c` as a kernel reads it; its strength is 1.
            pub fn unpack(matter: Matter, c: usize) -> Profile {
                match matter.material.model {
                    $($constant => Profile::$setting(<$type>::unpack(matter, c)),)*
                    _ => unreachable!("a model of the table"),
                }
            }
        }
    };
}
models! {
    Standard, MODEL_STANDARD: Dipole;
    Better, MODEL_BETTER: BetterDipole;
    Directional, MODEL_DIRECTIONAL: Directional;
    Burley, MODEL_BURLEY: Burley;
    Table, MODEL_TABLE: Tabulated;
    Lambert, MODEL_LAMBERT: Lambert;
}

/// A material with what else its profile reads.
#[derive(Clone, Copy, Debug)]
pub struct Matter<'a> {
    pub material: &'a Material,
    /// Tabulated profiles of all materials.
    pub tables: &'a [Vec3],
    /// 1 over the radius of the sphere that the body resembles at xo; 0 for a half-space.
    pub curvature: f64,
}

impl<'a> From<&'a Material> for Matter<'a> {
    /// A material that needs no table.
    fn from(material: &'a Material) -> Matter<'a> {
        Matter { material, tables: &[], curvature: 0.0 }
    }
}

/// shape(r) e^exponent of the three channels.
pub fn shapes_shifted(matter: Matter, r: f64, exponent: f64) -> DVec3 {
    if matter.material.model == MODEL_TABLE {
        return table::shapes(matter, r).map(|value| table::shifted(value, exponent));
    }
    DVec3::from([0, 1, 2].map(|c| Profile::unpack(matter, c).shape_shifted(r, exponent)))
}

/// shape(r) of the three channels.
pub fn shapes(matter: Matter, r: f64) -> DVec3 {
    shapes_shifted(matter, r, 0.0)
}

/// shape(r) of the three channels in the mean over u of [0, 1): of a table that of one curvature, drawn by it.
pub fn shapes_drawn(matter: Matter, r: f64, u: f64) -> DVec3 {
    if matter.material.model == MODEL_TABLE { table::drawn(matter, r, u) } else { shapes(matter, r) }
}

/// Density of the sampled radii per area of the plane.
pub fn plane_density(matter: Matter, r: f64) -> f64 {
    if matter.material.model == MODEL_TABLE {
        return table::density(matter, r);
    }
    matter.material.density.as_dvec3().dot(shapes(matter, r))
}

/// Factor of the profile on light that enters, or leaves, at a cosine outside; 1 but for the table model and its opaque
/// limit.
pub fn obliqueness(matter: Matter, cos: f64, leaving: bool) -> DVec3 {
    match matter.material.model {
        MODEL_TABLE => table::obliqueness(matter.material, table::slope(matter), cos, leaving),
        MODEL_LAMBERT => table::obliqueness(matter.material, matter.material.slope.as_dvec3(), cos, leaving),
        _ => DVec3::ONE,
    }
}

/// The radius that two numbers in [0, 1) pick.
pub fn draw_radius(matter: Matter, u_component: f64, u_radius: f64) -> f64 {
    let cdf = matter.material.component_cdf.map(f64::from);
    let component = cdf.iter().position(|&end| u_component < end).unwrap_or(cdf.len() - 1);
    let start = if component == 0 { 0.0 } else { cdf[component - 1] };
    let share = if cdf[component] > start { (u_component - start) / (cdf[component] - start) } else { 0.0 };
    if matter.material.model == MODEL_TABLE {
        return table::radius(matter, component / COMPONENTS, share, u_radius);
    }
    Profile::unpack(matter, component / COMPONENTS).radius(component % COMPONENTS, share, u_radius)
}

/// No two points of a set are farther apart: the frame gives translucent geometry the radius 1. Nothing is missed, and a
/// probe that runs within a triangle's plane meets no rounding of its distance that looks like a hit far away.
pub const SET_DIAMETER: f32 = 2.000_01;

/// Of an equal share, what each channel's probability is at least: bounds the variance of any channel at four times that of
/// equal shares.
pub const LEAST_CHANNEL: f64 = 0.25;

/// What the kernels' constants depend on besides the matter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    pub normalisation: Normalisation,
    /// Share of the energy beyond `radius_max`; 0 has no ball.
    pub radius_tail: f64,
    pub directional: settings::Directional,
    pub precision: Precision,
}

impl Options {
    /// Exitance over the radiance that leaves without its factor Ft(wo): pi (1 - rho_e), or pi.
    pub fn leaving(&self, rho_e: f64) -> f64 {
        match self.normalisation {
            Normalisation::Energy => PI * (1.0 - rho_e),
            Normalisation::Jensen2001 => PI,
        }
    }
}

/// Probabilities with which radii are drawn from the channels' profiles: in proportion to the radius that nine tenths of a
/// channel's light stay within, since light from afar is what is found least, but none beyond the farthest points of a set
/// ([`SET_DIAMETER`]); and at least [`LEAST_CHANNEL`] of an equal share. 0 for a channel that does not scatter.
pub fn chances(channels: &[Profile; 3]) -> [f64; 3] {
    let widths = channels
        .each_ref()
        .map(|c| if c.strength() > 0.0 { c.radius_beyond(0.1).min(SET_DIAMETER.into()) } else { 0.0 });
    let equal = 1.0 / channels.iter().filter(|c| c.strength() > 0.0).count().max(1) as f64;
    let sum: f64 = widths.iter().sum();
    [0, 1, 2].map(|c| match channels[c].strength() > 0.0 {
        true => LEAST_CHANNEL * equal + (1.0 - LEAST_CHANNEL) * widths[c] / sum,
        false => 0.0,
    })
}

/// The BSSRDF part of a material as kernels read it; the rest is zero, for the caller to fill. `model` is one of MODEL_*.
///
/// Coefficients in 1/internal unit. Channels have their [`chances`]; within one, a component is as probable as its part of
/// the mass.
pub fn material(model: u32, matter: &[Coefficients; 3], options: Options) -> shared::Material {
    if model == MODEL_LAMBERT {
        return lambert::limit(MODEL_STANDARD, matter, options);
    }
    let ior = matter[0].ior;
    let channels = matter.each_ref().map(|matter| Profile::new(model, matter));
    let scattering = || channels.iter().filter(|c| c.strength() > 0.0);
    let chances = chances(&channels);
    let leaving = options.leaving(matter[0].diffuse_reflectance(Side::Outside));

    let mut material = Material { model, ior: ior as f32, flags: TRANSLUCENT, ..Material::default() };
    let mut cumulative = 0.0;
    for (c, (channel, probability)) in channels.iter().zip(chances).enumerate() {
        channel.pack(c, &options, &mut material);
        if channel.strength() == 0.0 {
            continue;
        }
        material.strength[c] = (channel.strength() / leaving) as f32;
        material.density[c] = (probability / channel.mass()) as f32;
        let masses = channel.masses();
        let last = masses.iter().rposition(|&mass| mass > 0.0).unwrap_or(0);
        for (s, mass) in masses.into_iter().enumerate() {
            cumulative += probability * mass / channel.mass();
            material.component_cdf[COMPONENTS * c + s..].fill(cumulative as f32);
        }
        // The last component of the last channel that scatters ends at 1 exactly.
        if channels[c + 1..].iter().all(|later| later.strength() == 0.0) {
            material.component_cdf[COMPONENTS * c + last..].fill(1.0);
        }
    }
    let radius_max = scattering().map(|c| c.radius_beyond(options.radius_tail)).fold(0.0, f64::max);
    material.radius_max = (radius_max as f32).min(UNBOUNDED);
    material.camera_rate = scattering().map(|c| c.rate()).reduce(f64::min).unwrap_or(0.0) as f32;
    if model == MODEL_DIRECTIONAL && options.directional.reciprocal {
        material.flags |= RECIPROCAL;
    }
    material
}

/// The same for the table model: its numbers are appended to `tables`. `spheres` are the radii 2^(i/2 - 1) at which it
/// knows the profile besides the half-space, i ascending.
pub fn tabulated(
    matter: &[Coefficients; 3],
    options: Options,
    spheres: &[i32],
    tables: &mut Vec<Vec3>,
) -> shared::Material {
    let mut out = material(MODEL_TABLE, matter, options);
    let block = Block::new(&matter.each_ref().map(crate::table::channel), spheres, options.precision);
    // Of the profiles as they are stored.
    out.strength = (block.totals / options.leaving(matter[0].diffuse_reflectance(Side::Outside))).as_vec3();
    out.table = tables.len() as u32;
    (out.table_first, out.table_cells, out.table_nodes) = (block.first, block.cells, block.nodes);
    out.obliqueness = matter[0].mean_obliqueness() as f32;
    tables.extend(block.data);
    out
}
