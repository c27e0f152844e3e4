//! One number for a scene: SHA-256 of everything that determines the image.

use super::{EnvironmentMap, Lens, LightKind, Scene};
use crate::settings::Directional;
use sha2::{Digest, Sha256};

/// Feeds numbers in a fixed order, each list preceded by its length.
struct Feed(Sha256);

impl Feed {
    fn bytes(&mut self, bytes: &[u8]) {
        self.count(bytes.len());
        self.0.update(bytes);
    }

    fn count(&mut self, count: usize) {
        self.0.update((count as u64).to_le_bytes());
    }

    fn numbers<const N: usize>(&mut self, numbers: [f64; N]) {
        // -0 and 0 are the same scene.
        numbers.iter().for_each(|number| self.0.update((number + 0.0).to_le_bytes()));
    }
}

/// SHA-256 of a scene's geometry: frame, triangles with their normals, materials, sets and texture coordinates. The BVH
/// follows from the triangles and their order.
pub(crate) type Geometry = [u8; 32];

pub(crate) fn geometry(scene: &Scene) -> Geometry {
    let mut feed = Feed(Sha256::new());
    feed.numbers(scene.frame.centre.to_array());
    feed.numbers([scene.frame.scale]);
    feed.bytes(bytemuck::cast_slice(&scene.triangles));
    feed.bytes(bytemuck::cast_slice(&scene.shadings));
    feed.bytes(bytemuck::cast_slice(&scene.coordinates));
    for set in &scene.sets {
        feed.count(set.materials.len());
        set.materials.iter().for_each(|&material| feed.count(material));
    }
    feed.0.finalize().into()
}

/// Hex SHA-256 of geometry, materials, lights, cameras and environment. Names of cameras count, for they choose;
/// other names, the file's place and warnings do not.
pub(crate) fn hash(scene: &Scene, geometry: Geometry) -> String {
    let mut feed = Feed(Sha256::new());
    feed.bytes(b"translucent scene 3");
    feed.bytes(&geometry);
    feed.count(scene.materials.len());
    for material in &scene.materials {
        feed.numbers(material.base_color.to_array());
        feed.numbers([material.metallic, material.roughness, material.ior]);
        feed.numbers(material.emission.to_array());
        feed.count(usize::from(material.two_sided));
        feed.count(usize::from(material.medium.is_some()));
        for medium in material.medium.iter().chain(&material.ramp) {
            feed.numbers(medium.sigma_s_prime.to_array());
            feed.numbers(medium.sigma_a.to_array());
            feed.numbers(medium.g.to_array());
            feed.count(medium.model.map_or(0, |model| 1 + model as usize));
            feed.count(medium.single_scattering as usize);
            if let Some(Directional { renormalise, reciprocal, kappa }) = medium.directional {
                feed.numbers([f64::from(u8::from(renormalise)), f64::from(u8::from(reciprocal)), kappa]);
            }
            if let Some(appearance) = &medium.appearance {
                feed.numbers(appearance.albedo.to_array());
                feed.numbers(appearance.length.to_array());
                feed.count(appearance.kind as usize);
            }
        }
        feed.count(usize::from(material.tinted));
        for (kind, texture) in material.textures.iter().enumerate() {
            let Some(texture) = texture else { continue };
            feed.count(kind);
            feed.count(texture.picture);
            feed.numbers([f64::from(texture.set), f64::from(u8::from(texture.nearest)), texture.scale]);
            feed.numbers(texture.wrap.map(|wrap| f64::from(wrap as u8)));
            texture.rows.iter().for_each(|row| feed.numbers(row.to_array()));
        }
    }
    feed.count(scene.pictures.len());
    for picture in &scene.pictures {
        feed.numbers([f64::from(picture.width), f64::from(picture.height)]);
        feed.bytes(bytemuck::cast_slice(&picture.texels));
    }
    feed.count(scene.lights.len());
    for light in &scene.lights {
        feed.numbers(light.position.to_array());
        feed.numbers(light.direction.to_array());
        feed.numbers(light.intensity.to_array());
        feed.numbers(match light.kind {
            LightKind::Point => [0.0, 0.0, 0.0],
            LightKind::Spot { inner, outer } => [1.0, inner, outer],
            LightKind::Directional => [2.0, 0.0, 0.0],
        });
        // No range is negative: -1 stands for none.
        feed.numbers([light.range.unwrap_or(-1.0)]);
    }
    feed.count(scene.cameras.len());
    for camera in &scene.cameras {
        feed.bytes(camera.name.as_bytes());
        for vector in [camera.eye, camera.right, camera.up, camera.forward] {
            feed.numbers(vector.to_array());
        }
        feed.numbers(match camera.lens {
            Lens::Perspective { yfov, aspect } => [0.0, yfov, aspect.unwrap_or(-1.0)],
            Lens::Orthographic { xmag, ymag } => [1.0, xmag, ymag],
        });
    }
    let environment = &scene.environment;
    feed.numbers([environment.rotation, environment.scale]);
    match &environment.map {
        EnvironmentMap::None => feed.count(0),
        EnvironmentMap::Constant(radiance) => {
            feed.count(1);
            feed.numbers(radiance.to_array());
        }
        EnvironmentMap::Image { width, height, radiance } => {
            feed.count(2);
            feed.count(*width as usize);
            feed.count(*height as usize);
            feed.bytes(bytemuck::cast_slice(radiance));
        }
    }
    feed.0.finalize().iter().map(|byte| format!("{byte:02x}")).collect()
}
