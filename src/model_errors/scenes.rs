//! The bodies that models are tried on; lengths are in reduced mean free paths 1 / sigma_t'.

use crate::reference::walk::Random;
use crate::reference::walk::exitance::Light;
use crate::reference::walk::mesh::{Corners, Mesh};
use crate::reference::walk::shape::{Body, Met, Shape, Site, Sphere};
use glam::{DVec3, dvec3};

/// Bins of a surface, about.
const BINS: usize = 24;
/// Bands of a sphere about the light's direction.
const BANDS: usize = 16;

/// A body in directional light, looked at from a side.
pub struct Scene {
    pub name: String,
    pub figure: Figure,
    pub light: Light,
    /// Unit vector of view of a camera at infinity, 60 degrees from the light.
    pub forward: DVec3,
    /// Areas of the bins.
    pub areas: Vec<f64>,
    /// Bin of each triangle; a sphere has bands instead.
    parts: Vec<usize>,
}

/// A sphere or a mesh.
pub enum Figure {
    Ball(Sphere),
    Mesh(Mesh),
}

/// Where the light comes from: bodies are lit from above, aside.
const DOWN: DVec3 = DVec3::NEG_Z;

impl Scene {
    fn new(name: String, figure: Figure, direction: DVec3) -> Scene {
        let side = direction.any_orthonormal_vector();
        let forward = (0.5 * direction + 0.75f64.sqrt() * side).normalize();
        let (parts, areas) = match &figure {
            Figure::Ball(ball) => (Vec::new(), vec![ball.area() / BANDS as f64; BANDS]),
            Figure::Mesh(mesh) => mesh.parts(BINS),
        };
        Scene { name, figure, light: Light::Directional(direction), forward, areas, parts }
    }

    /// A sphere.
    pub fn sphere(radius: f64) -> Scene {
        Scene::new(format!("sphere, radius {radius}"), Figure::Ball(Sphere { radius }), DOWN)
    }

    /// A square plate that lies flat.
    pub fn plate(width: f64, thickness: f64) -> Scene {
        let mesh = Mesh::cuboid(dvec3(width, width, thickness), 8);
        Scene::new(format!("plate, {width} x {width} x {thickness}"), Figure::Mesh(mesh), DOWN)
    }

    /// A cube that shows three faces to the light.
    pub fn cube(width: f64) -> Scene {
        let mesh = Mesh::cuboid(DVec3::splat(width), 8);
        Scene::new(format!("cube, {width}"), Figure::Mesh(mesh), -dvec3(3.0, 4.0, 5.0).normalize())
    }

    /// A capsule lit from its side.
    pub fn capsule(radius: f64, length: f64) -> Scene {
        let mesh = Mesh::capsule(radius, length - 2.0 * radius, 32);
        Scene::new(format!("capsule, radius {radius}, {length} long"), Figure::Mesh(mesh), DVec3::NEG_X)
    }

    /// A closed mesh scaled so that its longest side is `size`, lit from above and aside.
    pub fn mesh(name: &str, corners: &[Corners], size: f64) -> Scene {
        let low = corners.iter().flatten().fold(DVec3::INFINITY, |low, &c| low.min(c));
        let high = corners.iter().flatten().fold(DVec3::NEG_INFINITY, |high, &c| high.max(c));
        let scale = size / (high - low).max_element();
        let scaled: Vec<Corners> = corners.iter().map(|t| t.map(|c| c * scale)).collect();
        // glTF: +y is up, +z to the front.
        let direction = -dvec3(2.0, 3.0, 4.0).normalize();
        Scene::new(format!("{name}, {size} long"), Figure::Mesh(Mesh::new(&scaled)), direction)
    }

    /// The bin of a site.
    pub fn bin(&self, position: DVec3, place: usize) -> usize {
        match &self.figure {
            Figure::Ball(ball) => {
                let Light::Directional(direction) = self.light else { return 0 };
                let share = (1.0 + position.dot(direction) / ball.radius) / 2.0;
                ((share.max(0.0) * BANDS as f64) as usize).min(BANDS - 1)
            }
            Figure::Mesh(_) => self.parts[place],
        }
    }
}

macro_rules! each {
    ($self:ident, $body:ident => $call:expr) => {
        match $self {
            Figure::Ball($body) => $call,
            Figure::Mesh($body) => $call,
        }
    };
}

impl Shape for Figure {
    fn leave(&self, origin: DVec3, direction: DVec3, limit: f64) -> Met {
        each!(self, body => body.leave(origin, direction, limit))
    }
}

impl Body for Figure {
    fn ball(&self) -> (DVec3, f64) {
        each!(self, body => body.ball())
    }

    fn enter(&self, origin: DVec3, direction: DVec3) -> Option<Site> {
        each!(self, body => body.enter(origin, direction))
    }

    fn area(&self) -> f64 {
        each!(self, body => body.area())
    }

    fn sample(&self, random: &mut Random) -> Site {
        each!(self, body => body.sample(random))
    }

    fn meetings(&self, origin: DVec3, direction: DVec3, sites: &mut Vec<Site>) {
        each!(self, body => body.meetings(origin, direction, sites))
    }
}
