//! A scene for the twins and for single kernels, made by hand.

use crate::{reference::Inputs, shared::*};
use glam::{DMat3, DVec3, Vec3, vec2};

/// Owner of everything that [`Inputs`] borrows.
#[derive(Clone, Default)]
pub struct World {
    pub features: Features,
    pub view: View,
    pub triangles: Vec<Triangle>,
    pub shadings: Vec<Shading>,
    pub materials: Vec<Material>,
    pub lights: Vec<Light>,
    pub emitters: Vec<Emitter>,
    pub boundaries: Vec<f32>,
    pub environment: Vec<Vec3>,
    pub environment_cdf: Vec<f32>,
    pub texels: Vec<u32>,
    pub textures: Vec<Texture>,
    pub coordinates: Vec<Coordinates>,
    pub profiles: Vec<Vec3>,
    pub balances: Vec<Balance>,
    pub mixtures: Vec<Mixture>,
}

impl World {
    /// No triangles; one material; radiance 1 from everywhere; `pixels` pixels in a row.
    pub fn new(material: Material, projection: u32, pixels: u32) -> World {
        let view = View {
            width: pixels,
            height: 1,
            crop_width: pixels,
            directions: 1,
            seed: 1,
            environment_scale: Vec3::ONE,
            environment_row0: Vec3::X,
            environment_row1: Vec3::Y,
            environment_row2: Vec3::Z,
            ..Default::default()
        };
        let features = Features {
            projection,
            environment: ENVIRONMENT_CONSTANT,
            batches: 1,
            models: 1 << material.model,
            ..Features::default()
        };
        World { features, view, materials: vec![material], ..Default::default() }
    }

    pub fn inputs(&self) -> Inputs<'_> {
        Inputs {
            features: self.features,
            view: &self.view,
            triangles: &self.triangles,
            shadings: &self.shadings,
            materials: &self.materials,
            lights: &self.lights,
            emitters: &self.emitters,
            boundaries: &self.boundaries,
            environment: &self.environment,
            environment_cdf: &self.environment_cdf,
            texels: &self.texels,
            textures: &self.textures,
            coordinates: &self.coordinates,
            profiles: &self.profiles,
            balances: &self.balances,
            mixtures: &self.mixtures,
            kept: &[],
            lattices: &[],
            tree: None,
        }
    }

    /// A perspective camera whose image, around `target`, has the half width and height `half`.
    pub fn look(&mut self, eye: DVec3, target: DVec3, half: f64) {
        let forward = target - eye;
        let (x, y) = forward.normalize().any_orthonormal_pair();
        let view = &mut self.view;
        (view.pivot, view.forward, view.perspective) = (target.as_vec3(), forward.as_vec3(), 1.0);
        (view.right, view.up) = ((x * half).as_vec3(), (y * half).as_vec3());
    }

    /// An orthographic camera at `distance` from `target`, which looks along `forward`.
    pub fn look_along(&mut self, forward: DVec3, target: DVec3, distance: f64, half: f64) {
        self.look(target - forward.normalize(), target, half);
        (self.view.perspective, self.view.reach) = (0.0, distance as f32);
    }

    pub fn light(&mut self, light: Light) {
        self.lights.push(light);
        self.view.light_count += 1;
    }

    /// Adds a flat triangle of material 0 and set 0, counter-clockwise seen from outside.
    pub fn triangle(&mut self, [a, b, c]: [DVec3; 3]) {
        self.triangles.push(Triangle { vertices: [a, b, c].map(|vertex| vertex.as_vec3()), set: 0 });
        let normal = (b - a).cross(c - a).normalize().as_vec3();
        self.shadings.push(Shading { normal0: normal, normal1: normal, normal2: normal, material: 0 });
    }

    /// The surface at `position` on triangle `index`.
    pub fn surface(&self, index: u32, position: DVec3) -> Surface {
        let [corner, edge1, edge2] = self.triangles[index as usize].corner_and_edges();
        let weights = DMat3::from_cols(edge1, edge2, edge1.cross(edge2)).inverse() * (position - corner);
        Surface { position: position.as_vec3(), triangle: index, barycentric: vec2(weights.x as f32, weights.y as f32) }
    }
}
