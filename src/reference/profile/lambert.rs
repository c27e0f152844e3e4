//! The opaque limit: light leaves where it entered. Its part of `accumulate.comp` has the same twin.
//!
//! # Value
//! To a picture and a surface that change little within the mean free path, every profile is its total at r = 0: Lambert's
//! law behind a boundary,
//!
//!   Lo = Ft(wo) T / (pi (1 - rho_e)) int Ft(wi) Li cos dw,
//!
//! which they approach in proportion to the mean free path. T is the total of the profile whose limit it is; of a table's,
//! `obliqueness` comes along. There is no radius to draw and no surface to look for: the exit is the entry.

use super::{COMPONENTS, Coefficients, Dipole, Matter, Options, Profile, Radial};
use crate::reference::boundary::Side;
use crate::shared::{MODEL_LAMBERT, MODEL_TABLE, Material, TRANSLUCENT};
use crate::table;
use glam::DVec3;

/// One channel of the opaque limit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lambert {
    /// Part of the light that entered which leaves, 0 to 1.
    pub total: f64,
}

impl Lambert {
    /// With the standard dipole's total.
    pub(super) fn of(matter: &Coefficients) -> Lambert {
        Lambert { total: Dipole::of(matter).total() }
    }

    pub(super) fn unpack(_matter: Matter, _c: usize) -> Lambert {
        Lambert { total: 1.0 }
    }
}

/// The BSSRDF part of a material that is the opaque limit of another model, one of MODEL_*.
pub fn limit(of: u32, matter: &[Coefficients; 3], options: Options) -> Material {
    let leaving = options.leaving(matter[0].diffuse_reflectance(Side::Outside));
    let total = |c: usize| Profile::new(of, &matter[c]).total() / leaving;
    let ior = matter[0].ior;
    let mut material = Material {
        model: MODEL_LAMBERT,
        flags: TRANSLUCENT,
        ior: ior as f32,
        strength: DVec3::new(total(0), total(1), total(2)).as_vec3(),
        ..Material::default()
    };
    if of == MODEL_TABLE {
        let slope = |c: usize| table::channel(&matter[c]).map_or(0.0, |c| c.profile(f64::INFINITY).slope());
        material.slope = DVec3::new(slope(0), slope(1), slope(2)).as_vec3();
        material.obliqueness = matter[0].mean_obliqueness() as f32;
    }
    material
}

/// The delta function of the plane.
impl Radial for Lambert {
    fn shape_shifted(&self, r: f64, _exponent: f64) -> f64 {
        if r > 0.0 { 0.0 } else { f64::INFINITY }
    }

    fn strength(&self) -> f64 {
        self.total
    }

    fn masses(&self) -> [f64; COMPONENTS] {
        [1.0, 0.0, 0.0]
    }

    fn inside(&self, _radius: f64) -> f64 {
        1.0
    }

    fn outside(&self, _radius: f64) -> f64 {
        0.0
    }

    fn response(&self, _k: f64) -> f64 {
        1.0
    }

    fn radius(&self, _component: usize, _share: f64, _u: f64) -> f64 {
        0.0
    }

    fn rate(&self) -> f64 {
        f64::INFINITY
    }

    fn pack(&self, _c: usize, _options: &Options, _material: &mut Material) {}
}
