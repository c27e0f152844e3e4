//! Bodies that are filled with matter.

use super::Random;
use glam::DVec3;
use std::f64::consts::PI;

/// What a straight piece of a path meets.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Met {
    /// It ends inside.
    Nothing,
    /// The surface, from inside; `normal` is outward and unit, `place` a part of the surface.
    Surface { distance: f64, normal: DVec3, place: usize },
    /// It does not start inside.
    Outside,
}

/// A point of a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Site {
    pub position: DVec3,
    /// Outward, unit.
    pub normal: DVec3,
    /// Part of the surface, as the shape counts them.
    pub place: usize,
}

/// A region of space.
pub trait Shape: Sync {
    /// Where the ray from a point inside (or on the surface, towards the inside) first leaves, if within `limit`.
    fn leave(&self, origin: DVec3, direction: DVec3, limit: f64) -> Met;
}

/// A shape of finite extent.
pub trait Body: Shape {
    /// Centre and radius of a ball that holds it.
    fn ball(&self) -> (DVec3, f64);

    /// Where a ray from outside first meets the surface.
    fn enter(&self, origin: DVec3, direction: DVec3) -> Option<Site>;

    /// Area of the surface.
    fn area(&self) -> f64;

    /// A point uniform over the surface.
    fn sample(&self, random: &mut Random) -> Site;

    /// Every point in which the line meets the surface, into `sites`.
    fn meetings(&self, origin: DVec3, direction: DVec3, sites: &mut Vec<Site>);
}

/// Everything below z = 0.
#[derive(Clone, Copy, Debug)]
pub struct HalfSpace;

impl Shape for HalfSpace {
    fn leave(&self, origin: DVec3, direction: DVec3, limit: f64) -> Met {
        plane(-origin.z, direction.z, limit, DVec3::Z, 0)
    }
}

/// Between z = -thickness (place 1) and z = 0 (place 0).
#[derive(Clone, Copy, Debug)]
pub struct Slab {
    pub thickness: f64,
}

impl Shape for Slab {
    fn leave(&self, origin: DVec3, direction: DVec3, limit: f64) -> Met {
        if direction.z > 0.0 {
            plane(-origin.z, direction.z, limit, DVec3::Z, 0)
        } else {
            plane(origin.z + self.thickness, -direction.z, limit, DVec3::NEG_Z, 1)
        }
    }
}

/// A plane at `height` >= 0 (but for rounding) above a point that moves towards it at `speed`.
fn plane(height: f64, speed: f64, limit: f64, normal: DVec3, place: usize) -> Met {
    if speed > 0.0 && height < limit * speed {
        Met::Surface { distance: (height / speed).max(0.0), normal, place }
    } else {
        Met::Nothing
    }
}

/// A ball around the origin.
#[derive(Clone, Copy, Debug)]
pub struct Sphere {
    pub radius: f64,
}

impl Shape for Sphere {
    fn leave(&self, origin: DVec3, direction: DVec3, limit: f64) -> Met {
        // The far root: the near one is behind a point inside, and at a point on the surface it is that point.
        let along = origin.dot(direction);
        let power = self.radius * self.radius - origin.length_squared();
        let distance = (along * along + power).max(0.0).sqrt() - along;
        if distance < limit {
            let normal = (origin + direction * distance).normalize();
            Met::Surface { distance, normal, place: 0 }
        } else {
            Met::Nothing
        }
    }
}

impl Body for Sphere {
    fn ball(&self) -> (DVec3, f64) {
        (DVec3::ZERO, self.radius)
    }

    fn enter(&self, origin: DVec3, direction: DVec3) -> Option<Site> {
        let along = origin.dot(direction);
        let inside = along * along - (origin.length_squared() - self.radius * self.radius);
        let distance = -along - inside.max(0.0).sqrt();
        (inside >= 0.0 && distance >= 0.0).then(|| self.site(origin + direction * distance))
    }

    fn area(&self) -> f64 {
        4.0 * PI * self.radius * self.radius
    }

    fn sample(&self, random: &mut Random) -> Site {
        self.site(random.direction() * self.radius)
    }

    fn meetings(&self, origin: DVec3, direction: DVec3, sites: &mut Vec<Site>) {
        let along = origin.dot(direction);
        let inside = along * along - (origin.length_squared() - self.radius * self.radius);
        if inside >= 0.0 {
            sites.extend([-1.0, 1.0].map(|sign| self.site(origin + direction * (sign * inside.sqrt() - along))));
        }
    }
}

impl Sphere {
    fn site(&self, position: DVec3) -> Site {
        Site { position, normal: position.normalize(), place: 0 }
    }
}
