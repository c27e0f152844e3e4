//! Texture lookup on the device against its twin: every wrap, filter, encoding and transform.

use crate::{common::World, evaluate};
use glam::{DVec2, Vec3};
use translucent::{
    reference::{random::hash, texture},
    shared::*,
};

#[test]
fn lookup_is_the_twins() {
    let number = |i: u32| f64::from(hash(i) >> 8) / f64::from(1 << 24);
    let mut texels: Vec<u32> = (0..=255).map(|byte| (texture::decode(byte) as f32).to_bits()).collect();
    texels.extend((0..1000).map(|i| hash(i + 77)));
    let mut textures = vec![];
    for (k, (width, height)) in (0u32..).zip([(1, 1), (2, 3), (7, 5), (32, 31)]) {
        for modes in 0..36 {
            let (wrap_u, wrap_v, linear, srgb) = (modes % 3, modes / 3 % 3, modes / 9 % 2, modes / 18);
            let [a, b, c, d, e, f] =
                [0, 1, 2, 3, 4, 5].map(|j| (4.0 * number(900 + 40 * k + 8 * modes + j) - 2.0) as f32);
            textures.push(Texture {
                width,
                height,
                offset: 256 + k,
                srgb,
                wrap_u,
                wrap_v,
                linear,
                row_u: if modes % 5 == 0 { Vec3::X } else { Vec3::new(a, b, c) },
                row_v: if modes % 5 == 0 { Vec3::Y } else { Vec3::new(d, e, f) },
                ..Texture::default()
            });
        }
    }
    let features = Features { textures: 1, ..Features::default() };
    let world = World { features, texels, textures, ..World::default() };
    let points: Vec<Vec3> = (0..1u32 << 14)
        .map(|i| {
            let u = |j: u32| (4.0 * number(3 * i + j) - 2.0) as f32;
            Vec3::new(u(0), u(1), (i as usize % world.textures.len()) as f32)
        })
        .collect();
    let found = [FUNCTION_TEXTURE, FUNCTION_TEXTURE_ALPHA].map(|part| evaluate(part, &world.inputs(), &[], &points));
    let mut outside = 0;
    for (i, point) in points.iter().enumerate() {
        let texture = &world.textures[point.z as usize];
        let twin = texture::at(&world.inputs(), texture, DVec2::new(point.x.into(), point.y.into()));
        let color = (found[0][i].as_dvec3() - twin.truncate()).abs().max_element();
        let error = color.max((f64::from(found[1][i].x) - twin.w).abs());
        // A coordinate of up to 10 has an error of 1e-6, of up to 32 texels; the nearest texel may flip at its edge.
        outside += usize::from(error > 4e-5);
        assert!(error <= 4e-5 || texture.linear == 0, "{texture:?} at {point}: {} not {twin}", found[0][i]);
    }
    assert!(outside * 1000 <= points.len(), "{outside} of {}", points.len());
}
