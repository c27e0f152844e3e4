//! Scenes with a known answer, written as glTF in memory.

use base64::Engine;
use glam::DVec3;
use serde_json::{Value, json};
use std::f64::consts::PI;

/// Triangles of one mesh, with one normal for each vertex.
#[derive(Clone, Default)]
pub struct Mesh {
    pub positions: Vec<DVec3>,
    pub normals: Vec<DVec3>,
    pub indices: Vec<u32>,
}

impl Mesh {
    /// Adds a parallelogram with corners p, p + u, p + u + v, p + v and the normal u x v.
    pub fn quad(&mut self, p: DVec3, u: DVec3, v: DVec3) {
        let first = self.positions.len() as u32;
        self.positions.extend([p, p + u, p + u + v, p + v]);
        self.normals.extend([u.cross(v).normalize(); 4]);
        self.indices.extend([0, 1, 2, 0, 2, 3].map(|i| first + i));
    }

    /// Adds the box between two corners, `n` x `n` quads a side.
    pub fn cuboid(&mut self, low: DVec3, high: DVec3, n: u32) {
        let size = high - low;
        for axis in 0..3 {
            let (a, b) = ((axis + 1) % 3, (axis + 2) % 3);
            let unit = |i: usize| DVec3::AXES[i] * size[i] / f64::from(n);
            for i in 0..n {
                for j in 0..n {
                    let at = unit(a) * f64::from(i) + unit(b) * f64::from(j);
                    self.quad(low + DVec3::AXES[axis] * size[axis] + at, unit(a), unit(b));
                    self.quad(low + at, unit(b), unit(a));
                }
            }
        }
    }

    /// A sphere from a subdivided octahedron, its vertices and normals on the true sphere: 8 n^2 triangles.
    pub fn sphere(radius: f64, n: u32) -> Mesh {
        let mut mesh = Mesh::default();
        for octant in 0..8u32 {
            let sign = |bit: u32| if octant >> bit & 1 == 0 { 1.0 } else { -1.0 };
            let corner = [DVec3::X * sign(0), DVec3::Y * sign(1), DVec3::Z * sign(2)];
            let turned = sign(0) * sign(1) * sign(2) < 0.0;
            let first = mesh.positions.len() as u32;
            let index = |i: u32, j: u32| first + i * (i + 1) / 2 + j;
            for i in 0..=n {
                for j in 0..=i {
                    let (a, b, c) = (f64::from(n - i), f64::from(i - j), f64::from(j));
                    let direction = (corner[0] * a + corner[1] * b + corner[2] * c).normalize();
                    mesh.positions.push(direction * radius);
                    mesh.normals.push(direction);
                }
            }
            let mut triangle = |a: u32, b: u32, c: u32| {
                mesh.indices.extend(if turned { [a, c, b] } else { [a, b, c] });
            };
            for i in 0..n {
                for j in 0..=i {
                    triangle(index(i, j), index(i + 1, j), index(i + 1, j + 1));
                    if j < i {
                        triangle(index(i, j), index(i + 1, j + 1), index(i, j + 1));
                    }
                }
            }
        }
        mesh
    }
}

/// A scattering material with coefficients in 1/m.
pub fn matter(sigma_s_prime: [f64; 3], sigma_a: [f64; 3], ior: f64) -> Value {
    json!({"name": "matter", "extras": {"bssrdf": {
        "sigma_s_prime": sigma_s_prime, "sigma_a": sigma_a, "unit": "1/m", "ior": ior, "surface": "smooth"}}})
}

/// A perspective camera at `eye` that looks at `at`.
pub struct Eye {
    pub eye: DVec3,
    pub at: DVec3,
    /// Full vertical angle (radians); for an orthographic camera half the height (m), negated.
    pub lens: f64,
}

fn rotation(forward: DVec3, up: DVec3) -> [f64; 4] {
    let z = -forward;
    let x = up.cross(z).normalize();
    glam::DQuat::from_mat3(&glam::DMat3::from_cols(x, z.cross(x), z)).to_array()
}

/// A glTF file with these meshes (each with the index of its material), materials, lights and camera.
pub fn gltf(meshes: &[(Mesh, usize)], materials: &[Value], lights: &[(Value, DVec3, DVec3)], eye: &Eye) -> Value {
    let mut buffers = vec![];
    let mut views = vec![];
    let mut accessors = vec![];
    let mut nodes = vec![];
    let mut gltf_meshes = vec![];
    let mut array = |bytes: Vec<u8>, component: u32, kind: &str, count: usize, bounds: Option<(DVec3, DVec3)>| {
        let uri = format!(
            "data:application/octet-stream;base64,{}",
            base64::engine::general_purpose::STANDARD.encode(&bytes)
        );
        buffers.push(json!({"uri": uri, "byteLength": bytes.len()}));
        views.push(json!({"buffer": buffers.len() - 1, "byteLength": bytes.len()}));
        let mut accessor =
            json!({"bufferView": views.len() - 1, "componentType": component, "count": count, "type": kind});
        if let Some((low, high)) = bounds {
            accessor["min"] = json!(low.to_array());
            accessor["max"] = json!(high.to_array());
        }
        accessors.push(accessor);
        accessors.len() - 1
    };
    let floats = |vectors: &[DVec3]| {
        vectors.iter().flat_map(|v| v.as_vec3().to_array()).flat_map(f32::to_le_bytes).collect::<Vec<u8>>()
    };
    for (mesh, material) in meshes {
        let low = mesh.positions.iter().copied().reduce(DVec3::min).unwrap_or_default();
        let high = mesh.positions.iter().copied().reduce(DVec3::max).unwrap_or_default();
        let count = mesh.positions.len();
        let positions = array(floats(&mesh.positions), 5126, "VEC3", count, Some((low, high)));
        let normals = array(floats(&mesh.normals), 5126, "VEC3", count, None);
        let indices = mesh.indices.iter().flat_map(|i| i.to_le_bytes()).collect();
        let indices = array(indices, 5125, "SCALAR", mesh.indices.len(), None);
        gltf_meshes.push(json!({"primitives": [{
            "attributes": {"POSITION": positions, "NORMAL": normals}, "indices": indices, "material": material}]}));
        nodes.push(json!({"name": format!("object {}", nodes.len()), "mesh": gltf_meshes.len() - 1}));
    }
    for (index, (_, position, towards)) in lights.iter().enumerate() {
        let forward = (*towards - *position).normalize();
        let up = if forward.y.abs() < 0.9 { DVec3::Y } else { DVec3::X };
        nodes.push(json!({"translation": position.to_array(), "rotation": rotation(forward, up),
            "extensions": {"KHR_lights_punctual": {"light": index}}}));
    }
    let forward = (eye.at - eye.eye).normalize();
    let up = if forward.y.abs() < 0.9 { DVec3::Y } else { DVec3::Z };
    nodes.push(json!({"translation": eye.eye.to_array(), "rotation": rotation(forward, up), "camera": 0}));
    let camera = if eye.lens > 0.0 {
        json!({"type": "perspective", "perspective": {"yfov": eye.lens, "znear": 0.001}})
    } else {
        json!({"type": "orthographic",
            "orthographic": {"xmag": -eye.lens, "ymag": -eye.lens, "znear": 0.0, "zfar": 1000.0}})
    };
    let lights: Vec<_> = lights.iter().map(|(light, _, _)| light).collect();
    let mut file = json!({
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": (0..nodes.len()).collect::<Vec<_>>()}],
        "nodes": nodes, "meshes": gltf_meshes, "materials": materials, "cameras": [camera],
        "accessors": accessors, "bufferViews": views, "buffers": buffers,
    });
    if !lights.is_empty() {
        file["extensionsUsed"] = json!(["KHR_lights_punctual"]);
        file["extensions"] = json!({"KHR_lights_punctual": {"lights": lights}});
    }
    file
}

/// A directional light of perpendicular irradiance pi.
pub fn sun() -> Value {
    json!({"type": "directional", "intensity": PI})
}
