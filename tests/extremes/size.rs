//! Geometry at the ends: slivers, and more than a binding holds.

use crate::{
    channel, render,
    scenes::{Eye, Mesh, gltf, matter, scene, standard, sun},
};
use glam::DVec3;
use translucent::{Device, DeviceOptions, Renderer, Settings};

fn eye() -> Eye {
    Eye { eye: DVec3::new(2.0, 3.0, 4.0), at: DVec3::ZERO, lens: 0.7 }
}

#[test]
fn slivers_change_nothing() {
    // Each face of a cube as two triangles, and as a fan around a point 1e-6 from one edge.
    let mut whole = Mesh::default();
    whole.cuboid(DVec3::splat(-1.0), DVec3::splat(1.0), 1);
    let mut slivers = Mesh::default();
    for face in whole.indices.chunks_exact(6) {
        let corners = [face[0], face[1], face[2], face[5]].map(|i| whole.positions[i as usize]);
        let centre = (corners[0] + corners[1]) / 2.0 + 1e-6 * (corners[3] - corners[0]);
        let first = slivers.positions.len() as u32;
        slivers.positions.extend(corners.into_iter().chain([centre]));
        slivers.normals.extend([whole.normals[face[0] as usize]; 5]);
        slivers.indices.extend((0..4).flat_map(|i| [first + i, first + (i + 1) % 4, first + 4]));
    }
    let light = || (sun(), DVec3::new(3.0, 4.0, 2.0), DVec3::ZERO);
    let images = [whole, slivers].map(|mesh| {
        let scene = scene(&gltf(&[(mesh, 0)], &[matter([4.0, 2.0, 1.0], [0.3; 3], 1.4)], &[light()], &eye()));
        let settings = Settings { resolution: Some((32, 32)), seed: 3, ..standard() };
        let image = render(&scene, &settings, 32);
        channel(&image, "subsurface.G").iter().map(|x| f64::from(*x)).collect::<Vec<_>>()
    });
    let total: f64 = images[0].iter().sum();
    let difference: f64 = images[0].iter().zip(&images[1]).map(|(a, b)| (a - b).abs()).sum();
    // The same samples: they differ by rounding, and where a ray passes between or meets the slivers.
    assert!(total > 1.0 && difference < 1e-3 * total, "{difference} of {total}");
}

#[test]
fn too_many_triangles_are_refused_by_number() {
    let options = DeviceOptions { buffer_bytes: Some(32_768), ..DeviceOptions::default() };
    let device = Device::open(&options).expect("a Vulkan device");
    let of = |subdivision: u32| {
        let mesh = Mesh::sphere(1.0, subdivision);
        let scene = scene(&gltf(&[(mesh, 0)], &[matter([1.0; 3], [0.1; 3], 1.3)], &[], &eye()));
        let settings = Settings { resolution: Some((4, 4)), ..standard() };
        Renderer::new(&device, &scene, &settings).map(|_| ()).map_err(|error| error.to_string())
    };
    of(10).expect("800 triangles of 40 bytes fit");
    let refusal = of(12).expect_err("1152 triangles do not");
    for part in ["triangles", "1152", "32768", "819"] {
        assert!(refusal.contains(part), "{part}: {refusal}");
    }
}
