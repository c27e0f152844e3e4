//! The surface of a body as a path meets it: a smooth or a rough dielectric.
//!
//! A rough surface is made of microfacets, of which those count that the path sees (E. Heitz, JCGT 7 (2018)); each reflects
//! or refracts by Fresnel's equations. Light that its neighbours would stop, a part 1 - G1 of what leaves the facet, tries
//! again with another facet: nothing is lost at the surface, but what several facets do one after the other is not
//! followed. Smooth surfaces have no such approximation.

use super::{Random, interface};
use crate::reference::boundary::{smith_g1, visible_normal};
use crate::reference::math::{basis, from_local};
use glam::DVec3;

/// A surface between matter and the outside.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Boundary {
    /// Index of refraction, inside over outside, > 0.
    pub ior: f64,
    /// GGX width; 0 is smooth.
    pub alpha: f64,
}

/// Where a path goes from a surface that it met from inside; unit vectors.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Onward {
    Back(DVec3),
    Out(DVec3),
}

impl Boundary {
    /// What becomes of light that meets the surface from inside, along `direction`. `normal` is outward.
    pub fn from_inside(&self, direction: DVec3, normal: DVec3, random: &mut Random) -> Onward {
        loop {
            let facet = if self.alpha > 0.0 { -self.facet(-direction, -normal, random) } else { normal };
            let cos = direction.dot(facet);
            let (reflectance, refracted) = interface(1.0 / self.ior, cos);
            let onward = if random.next() < reflectance {
                Onward::Back((direction - 2.0 * cos * facet).normalize())
            } else {
                Onward::Out((self.ior * (direction - cos * facet) + refracted * facet).normalize())
            };
            let (Onward::Back(leaving) | Onward::Out(leaving)) = onward;
            let side = if onward == Onward::Out(leaving) { 1.0 } else { -1.0 };
            if self.passes(side * leaving.dot(normal), random) {
                return onward;
            }
        }
    }

    /// The direction inside of light that enters from the unit vector `from` outside; none where all is reflected, which a
    /// rough surface shows by a thousand facets in a row.
    pub fn enter(&self, from: DVec3, normal: DVec3, random: &mut Random) -> Option<DVec3> {
        for _ in 0..1000 {
            let facet = if self.alpha > 0.0 { self.facet(from, normal, random) } else { normal };
            let cos = from.dot(facet);
            let (reflectance, refracted) = interface(self.ior, cos);
            let inside = ((cos * facet - from) / self.ior - refracted * facet).normalize();
            if self.alpha == 0.0 {
                return (reflectance < 1.0).then_some(inside);
            }
            if random.next() >= reflectance && self.passes(-inside.dot(normal), random) {
                return Some(inside);
            }
        }
        None
    }

    /// Normal of a microfacet that is visible from the unit vector `to`, on whose side `normal` is.
    fn facet(&self, to: DVec3, normal: DVec3, random: &mut Random) -> DVec3 {
        let (t, b) = basis(normal);
        let local = DVec3::new(to.dot(t), to.dot(b), to.dot(normal));
        from_local(normal, visible_normal(self.alpha, local, random.next(), random.next()))
    }

    /// Whether neighbouring facets let light pass that leaves at this cosine.
    fn passes(&self, cos: f64, random: &mut Random) -> bool {
        self.alpha == 0.0 || cos > 0.0 && random.next() < smith_g1(self.alpha, cos)
    }
}
