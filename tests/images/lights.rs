//! Lights, environments and cameras through the whole renderer, against closed forms.

use crate::{
    channel, mean_and_error, render,
    scenes::{Eye, Mesh, gltf, matter, scene, standard},
};
use glam::{DVec3, Vec3};
use serde_json::{Value, json};
use std::f64::consts::PI;
use std::ops::ControlFlow;
use translucent::{
    Projection, Renderer, Scene, Settings,
    reference::{
        boundary::{Side, diffuse_reflectance, transmittance},
        profile::{Dipole, Radial},
    },
    scene::{Environment, EnvironmentMap, LoadOptions},
};

/// Diffuse reflectance of [`plaster`].
const WHITE: f64 = 0.5;

/// An opaque material without a highlight near the normal: F0 = 0.
fn plaster() -> Value {
    json!({"pbrMetallicRoughness": {"baseColorFactor": [WHITE, WHITE, WHITE, 1.0], "metallicFactor": 0.0},
        "extensions": {"KHR_materials_ior": {"ior": 1.0}}})
}

/// A square in z = 0 that faces +z.
fn square(half: f64) -> Mesh {
    let mut mesh = Mesh::default();
    mesh.quad(DVec3::new(-half, -half, 0.0), DVec3::X * 2.0 * half, DVec3::Y * 2.0 * half);
    mesh
}

/// Looks at the origin from +z, so narrowly that all of the picture is the origin.
fn from_above(distance: f64) -> Eye {
    Eye { eye: DVec3::Z * distance, at: DVec3::ZERO, lens: 1e-6 }
}

fn settings() -> Settings {
    Settings { resolution: Some((4, 4)), seed: 3, ..standard() }
}

/// Mean and standard error of a channel over independent pixels.
fn mean(scene: &Scene, settings: &Settings, samples: u32, name: &str) -> (f64, f64) {
    let image = render(scene, settings, samples);
    let values: Vec<f64> = channel(&image, name).iter().map(|&x| f64::from(x)).collect();
    mean_and_error(&values)
}

#[test]
fn lamps_have_the_radiance_of_their_units() {
    let lamp = |extra: Value| {
        let mut light = json!({"type": "point", "intensity": 1.0});
        light.as_object_mut().expect("an object").extend(extra.as_object().expect("an object").clone());
        light
    };
    let at = DVec3::new(0.0, 0.0, 2.0);
    let spot = |angle: f64, inner: f64, outer: f64| {
        let light = lamp(json!({"type": "spot", "spot": {"innerConeAngle": inner, "outerConeAngle": outer}}));
        (light, at, at - DVec3::new(angle.sin(), 0.0, angle.cos()))
    };
    // KHR_lights_punctual, as its text has it.
    let cone = |angle: f64, inner: f64, outer: f64| {
        let scale = 1.0 / f64::max(0.001, inner.cos() - outer.cos());
        let factor = (angle.cos() * scale - outer.cos() * scale).clamp(0.0, 1.0);
        factor * factor / 4.0
    };
    let oblique = DVec3::new(0.0, 3f64.sqrt(), 1.0);
    let mut cases = vec![
        ((lamp(json!({})), at, DVec3::ZERO), 0.25),
        ((lamp(json!({"intensity": 3.0, "color": [0.25, 0.25, 0.25]})), at, DVec3::ZERO), 0.75 * 0.25),
        ((lamp(json!({"range": 3.0})), at, DVec3::ZERO), 0.25 * (1.0 - (2.0f64 / 3.0).powi(4))),
        ((lamp(json!({"range": 1.9})), at, DVec3::ZERO), 0.0),
        // 1 W/sr at sqrt(8) m, 45 degrees from the normal.
        ((lamp(json!({})), DVec3::new(2.0, 0.0, 2.0), DVec3::ZERO), 0.5f64.sqrt() / 8.0),
        ((lamp(json!({"type": "directional", "intensity": 2.0})), oblique, DVec3::ZERO), 1.0),
    ];
    for angle in [0.0, 0.19, 0.25, 0.35, 0.41] {
        cases.push((spot(angle, 0.2, 0.4), cone(angle, 0.2, 0.4)));
    }
    // An edge narrower than the least width.
    cases.push((spot(0.3, 0.3, 0.3001), cone(0.3, 0.3, 0.3001)));
    // All at once; each gives between 1 % and 30 % of the sum, or nothing.
    let expected: f64 = cases
        .iter()
        .map(|((_, position, _), irradiance)| {
            // Schlick's term with F0 = 0 takes a little from oblique light.
            let half = (position.normalize() + DVec3::Z).normalize().z;
            irradiance * WHITE / PI * (1.0 - (1.0 - half).powi(5))
        })
        .sum();
    // The square alone; beside a translucent ball that sets another internal scale; in centimetres.
    for (unit, ball) in [(1.0, None), (1.0, Some(0.01)), (0.01, None), (0.01, Some(3.0))] {
        let size = 1.0 / unit;
        let mut meshes = vec![(square(5.0 * size), 0)];
        if let Some(radius) = ball {
            let mut ball = Mesh::sphere(radius * size, 4);
            ball.positions.iter_mut().for_each(|p| p.x += 60.0 * size);
            meshes.push((ball, 1));
        }
        let lights: Vec<_> = cases
            .iter()
            .map(|((light, position, towards), _)| {
                // A range is a length, intensities are not.
                let mut light = light.clone();
                if let Some(range) = light["range"].as_f64() {
                    light["range"] = json!(range * size);
                }
                (light, *position * size, *towards * size)
            })
            .collect();
        let file = gltf(&meshes, &[plaster(), matter([1.0; 3], [1.0; 3], 1.3)], &lights, &from_above(10.0 * size));
        let options = LoadOptions { unit, ..LoadOptions::default() };
        let scene = Scene::from_bytes("test.gltf", file.to_string().as_bytes(), &options).expect("valid");
        let (found, _) = mean(&scene, &settings(), 1, "R");
        assert!((found - expected).abs() <= 1e-3 * expected, "{unit} {ball:?}: {found}, not {expected}");
    }
}

/// The direction of image coordinates (u, v).
fn direction(u: f64, v: f64) -> DVec3 {
    let (phi, theta) = (2.0 * PI * (u - 0.5), PI * v);
    DVec3::new(theta.sin() * phi.cos(), theta.cos(), theta.sin() * phi.sin())
}

fn image(width: u32, height: u32, texel: impl Fn(u32, u32) -> f32) -> Environment {
    let radiance = (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).map(|(x, y)| Vec3::splat(texel(x, y)));
    let map = EnvironmentMap::Image { width, height, radiance: radiance.collect() };
    Environment { map, ..Environment::default() }
}

#[test]
fn environment_image_lies_as_documented() {
    let bright = image(8, 4, |x, y| if (x, y) == (5, 1) { 7.0 } else { 1.0 });
    let towards = direction(5.5 / 8.0, 1.5 / 4.0);
    // Centre of the image at +X, columns towards +Z, rows from +Y.
    assert!(towards.x > 0.0 && towards.y > 0.0 && towards.z > 0.0);
    let quarter = DVec3::new(towards.z, towards.y, -towards.x);
    for (rotation, scale, towards) in [(0.0, 1.0, towards), (-270.0, 3.0, quarter)] {
        let environment = Environment { rotation, scale, ..bright.clone() };
        // Seen beside the scene.
        let eye = Eye { eye: DVec3::ZERO, at: towards, lens: 1e-3 };
        let mut behind = square(1.0);
        behind.positions.iter_mut().for_each(|p| *p -= 5.0 * towards);
        let mut open = scene(&gltf(&[(behind, 0)], &[plaster()], &[], &eye));
        open.set_environment(environment.clone()).expect("valid");
        let (found, _) = mean(&open, &Settings { show_environment: true, ..settings() }, 1, "R");
        assert!((found - 7.0 * scale).abs() < 0.01 * scale, "{rotation}: {found}");
        // Mirrored by a smooth surface in its direction: F x radiance.
        let mut mesh = square(1.0);
        let turn = glam::DQuat::from_rotation_arc(DVec3::Z, towards);
        mesh.positions.iter_mut().for_each(|p| *p = turn * *p);
        mesh.normals.iter_mut().for_each(|n| *n = turn * *n);
        let eye = Eye { eye: towards * 10.0, at: DVec3::ZERO, lens: 1e-3 };
        let mut mirror = scene(&gltf(&[(mesh.clone(), 0)], &[matter([1.0; 3], [1.0; 3], 1.5)], &[], &eye));
        mirror.set_environment(environment.clone()).expect("valid");
        let (found, _) = mean(&mirror, &Settings { directions: 3, ..settings() }, 2, "reflection.R");
        assert!((found - 7.0 * scale * 0.04).abs() < 1e-3 * scale, "{rotation}: {found}");
        // And lit by it: more than by the rest alone.
        let mut lit = scene(&gltf(&[(mesh, 0)], &[plaster()], &[], &eye));
        lit.set_environment(environment).expect("valid");
        let (found, error) = mean(&lit, &settings(), 64, "R");
        assert!(found > 1.2 * WHITE * scale + 4.0 * error, "{rotation}: {found} +- {error}");
    }
}

#[test]
fn a_tiny_sun_lights_as_its_directional_light() {
    // One texel of 128 x 64 is 1e5 times as bright as the rest; the lookup is bilinear, so it shines as a tent.
    let (width, height, sun_x, sun_y) = (128u32, 64u32, 41u32, 13u32);
    let environment = image(width, height, |x, y| if (x, y) == (sun_x, sun_y) { 1e5 } else { 1.0 });
    let towards = direction((f64::from(sun_x) + 0.5) / f64::from(width), (f64::from(sun_y) + 0.5) / f64::from(height));
    let mut mesh = square(50.0);
    let turn = glam::DQuat::from_rotation_arc(DVec3::Z, DVec3::new(0.3, 1.0, 0.2).normalize());
    mesh.positions.iter_mut().for_each(|p| *p = turn * *p);
    mesh.normals.iter_mut().for_each(|n| *n = turn * *n);
    let normal = turn * DVec3::Z;
    let eye = Eye { eye: normal * 10.0, at: DVec3::ZERO, lens: 1e-3 };
    // Solid angle of the tent, and the irradiance of it and of the rest.
    let solid: f64 = 2.0 * PI / f64::from(width) * PI / f64::from(height) * towards.y.acos().sin();
    let irradiance = solid * 1e5;
    for material in [plaster(), matter([9.0; 3], [1.0; 3], 1.3)] {
        let opaque = material["extras"].is_null();
        let file = |lights: &[(Value, DVec3, DVec3)]| {
            gltf(&[(mesh.clone(), 0)], std::slice::from_ref(&material), lights, &eye)
        };
        let light = json!({"type": "directional", "intensity": irradiance});
        let mut expected = scene(&file(&[(light, towards, DVec3::ZERO)]));
        expected.set_environment(Environment::constant(DVec3::ONE).expect("valid")).expect("valid");
        let mut found = scene(&file(&[]));
        found.set_environment(environment.clone()).expect("valid");
        let name = if opaque { "reflection.R" } else { "subsurface.R" };
        let settings = Settings { resolution: Some((32, 32)), directions: 8, ..settings() };
        let (expected, expected_error) = mean(&expected, &settings, 64, name);
        let (found, error) = mean(&found, &settings, 64, name);
        let error = error.hypot(expected_error);
        assert!((found - expected).abs() < 4.0 * error, "{found} +- {error}, not {expected}");
        assert!(error < 0.0025 * expected, "no force: {found} +- {error}, {expected}");
    }
}

#[test]
fn matter_of_any_density_has_its_radiance() {
    // A wide slab of a million to 1e12 mean free paths: E_perp = pi, n = 1.3, alpha' = .95, view along the normal.
    let golden = 0.418_550_831;
    let turn = glam::DQuat::from_euler(glam::EulerRot::XYZ, 0.3, 0.5, 0.7);
    let mut mesh = Mesh::default();
    mesh.cuboid(DVec3::new(-1.0, -1.0, -1.0), DVec3::new(1.0, 1.0, 0.0), 3);
    mesh.positions.iter_mut().for_each(|p| *p = turn * *p);
    mesh.normals.iter_mut().for_each(|n| *n = turn * *n);
    let up = turn * DVec3::Z;
    let sun = json!({"type": "directional", "intensity": PI});
    for sigma_t in [1e5, 3e6, 1e12] {
        let materials = [matter([0.95 * sigma_t; 3], [0.05 * sigma_t; 3], 1.3)];
        let eye = Eye { eye: up * 5.0, at: turn * DVec3::new(0.2, 0.1, 0.0), lens: 1e-3 };
        let scene = scene(&gltf(&[(mesh.clone(), 0)], &materials, &[(sun.clone(), up, DVec3::ZERO)], &eye));
        let (found, error) = mean(&scene, &Settings { resolution: Some((16, 16)), ..settings() }, 32, "subsurface.G");
        assert!(error < 0.01, "{sigma_t}: {found} +- {error}");
        assert!((found - golden).abs() < 4.0 * error + 1e-3, "{sigma_t}: {found} +- {error}");
    }
}

#[test]
fn a_wide_ground_does_not_shade_itself() {
    // A tilted ground a thousand times as wide as the translucent ball on it.
    let turn = glam::DQuat::from_euler(glam::EulerRot::XYZ, 0.3, 0.5, 0.7);
    let mut ground = Mesh::default();
    ground.quad(DVec3::new(-1e3, -1e3, 0.0), DVec3::X * 2e3, DVec3::Y * 2e3);
    ground.positions.iter_mut().for_each(|p| *p = turn * *p);
    ground.normals.iter_mut().for_each(|n| *n = turn * *n);
    let up = turn * DVec3::Z;
    let materials = [plaster(), matter([1.0; 3], [1.0; 3], 1.3)];
    for place in [turn * DVec3::new(500.0, 300.0, 0.0), turn * DVec3::new(3.0, 2.0, 0.0)] {
        let eye = Eye { eye: place + up * 1.0, at: place, lens: 0.5 };
        let light = (json!({"type": "directional", "intensity": PI}), up, DVec3::ZERO);
        let scene = scene(&gltf(&[(ground.clone(), 0), (Mesh::sphere(1.0, 4), 1)], &materials, &[light], &eye));
        let (found, _) = mean(&scene, &Settings { resolution: Some((32, 32)), ..settings() }, 1, "R");
        // Schlick's term at up to 20 degrees from the normal, half of that for the half vector: below 1e-8.
        assert!((found - WHITE).abs() < 1e-4, "{found}");
    }
}

#[test]
fn a_ball_inside_out_looks_the_same() {
    // Wound inward with normals that point outward, and mirrored by its node.
    let lamp = || (json!({"type": "point", "intensity": 50.0}), DVec3::new(2.0, 3.0, 4.0), DVec3::ZERO);
    let eye = Eye { eye: DVec3::new(0.0, 0.0, 5.0), at: DVec3::ZERO, lens: 0.5 };
    let materials = [matter([5.0; 3], [0.5; 3], 1.3)];
    let image_of = |mesh: &Mesh, mirrored: bool| {
        let mut file = gltf(&[(mesh.clone(), 0)], &materials, &[lamp()], &eye);
        if mirrored {
            file["nodes"][0]["scale"] = json!([-1.0, 1.0, 1.0]);
        }
        let image = render(&scene(&file), &Settings { resolution: Some((16, 16)), ..settings() }, 32);
        channel(&image, "subsurface.G").iter().map(|&x| f64::from(x)).sum::<f64>()
    };
    let ball = Mesh::sphere(1.0, 8);
    let mut inverted = ball.clone();
    inverted.indices.chunks_exact_mut(3).for_each(|t| t.swap(1, 2));
    let expected = image_of(&ball, false);
    assert!(expected > 1.0);
    for (name, found) in [("inverted", image_of(&inverted, false)), ("mirrored", image_of(&ball, true))] {
        assert!((found / expected - 1.0).abs() < 0.02, "{name}: {found}, not {expected}");
    }
}

#[test]
fn nearly_smooth_surfaces_stay_finite() {
    for roughness in [1e-4, 1e-8] {
        let mut material = matter([5.0; 3], [0.5; 3], 1.5);
        material["extras"]["bssrdf"]["surface"] = json!("rough");
        material["pbrMetallicRoughness"] = json!({"roughnessFactor": roughness});
        let lamp = (json!({"type": "point", "intensity": 1.0}), DVec3::Z * 3.0, DVec3::ZERO);
        let mut scene = scene(&gltf(&[(square(1.0), 0)], &[material], &[lamp], &from_above(3.0)));
        scene.set_environment(Environment::constant(DVec3::ONE).expect("valid")).expect("valid");
        scene.lights[0].intensity = DVec3::ZERO;
        let (found, _) = mean(&scene, &settings(), 8, "reflection.R");
        assert!((found - 0.04).abs() < 1e-4, "{roughness}: {found}");
    }
}

/// Share of uniform light that a GGX surface with height-correlated shadowing reflects at `cos`, by quadrature over the
/// incoming directions; independent of the crate.
fn reflected_share(alpha: f64, cos: f64, fresnel: impl Fn(f64) -> f64) -> f64 {
    let wo = DVec3::new((1.0 - cos * cos).sqrt(), 0.0, cos);
    let lambda = |c: f64| ((1.0 + alpha * alpha * (1.0 / (c * c) - 1.0)).sqrt() - 1.0) / 2.0;
    let (rings, spokes) = (1500, 500);
    let mut sum = 0.0;
    for i in 0..rings {
        let c = (f64::from(i) + 0.5) / f64::from(rings);
        for j in 0..spokes {
            let phi = PI * (f64::from(j) + 0.5) / f64::from(spokes);
            let s = (1.0 - c * c).sqrt();
            let half = (wo + DVec3::new(s * phi.cos(), s * phi.sin(), c)).normalize();
            let d = alpha * alpha / PI / (half.z * half.z * (alpha * alpha - 1.0) + 1.0).powi(2);
            sum += d * fresnel(half.dot(wo)) / (1.0 + lambda(cos) + lambda(c)) / (4.0 * cos);
        }
    }
    sum * 2.0 * PI / f64::from(rings * spokes)
}

#[test]
fn highlights_in_uniform_light_agree_with_quadrature() {
    let dielectric = |c: f64| {
        let refracted = (1.0 - (1.0 - c * c) / 2.25).sqrt();
        let s = (c - 1.5 * refracted) / (c + 1.5 * refracted);
        let p = (1.5 * c - refracted) / (1.5 * c + refracted);
        (s * s + p * p) / 2.0
    };
    for (roughness, tilt) in [(0.4f64, 0.2f64), (1.0, 1.4)] {
        let eye = Eye { eye: DVec3::new(0.0, -tilt.sin(), tilt.cos()) * 10.0, at: DVec3::ZERO, lens: 1e-4 };
        let pbr = json!({"roughnessFactor": roughness, "metallicFactor": 1.0});
        let metal = json!({"pbrMetallicRoughness": pbr});
        let mut matter = matter([1.0; 3], [1.0; 3], 1.5);
        matter["extras"]["bssrdf"]["surface"] = json!("rough");
        matter["pbrMetallicRoughness"] = pbr;
        for (material, share) in [
            (metal, reflected_share(roughness * roughness, tilt.cos(), |_| 1.0)),
            (matter, reflected_share(roughness * roughness, tilt.cos(), dielectric)),
        ] {
            assert!(share <= 1.0 + 1e-3);
            let mut scene = scene(&gltf(&[(square(1.0), 0)], &[material], &[], &eye));
            for environment in [Environment::constant(DVec3::ONE).expect("valid"), image(8, 4, |_, _| 1.0)] {
                scene.set_environment(environment).expect("valid");
                // 20 directions take three dispatches of a sample: none counts twice.
                let settings = Settings { resolution: Some((16, 16)), directions: 20, ..settings() };
                let (found, error) = mean(&scene, &settings, 8, "reflection.G");
                let off = (found - share).abs();
                assert!(off < 4.0 * error + 1e-3 * share, "{roughness} {tilt}: {found} +- {error}, not {share}");
                assert!(error < 0.01 * share, "no force: {found} +- {error}");
            }
        }
    }
}

#[test]
fn every_range_of_samples_has_the_same_mean() {
    // A ball on a table under a lamp and a sky with dark and bright texels: one sample, early or late, against many others.
    let mut table = square(3.0);
    table.positions.iter_mut().for_each(|p| p.z -= 1.0);
    let mut skin = matter([2.0, 4.0, 6.0], [0.1, 0.5, 2.0], 1.3);
    skin["extras"]["bssrdf"]["surface"] = json!("rough");
    skin["pbrMetallicRoughness"] = json!({"roughnessFactor": 0.5});
    let lamp = (json!({"type": "point", "intensity": 30.0}), DVec3::new(2.0, 1.0, 4.0), DVec3::ZERO);
    let eye = Eye { eye: DVec3::new(0.0, -5.0, 2.0), at: DVec3::ZERO, lens: 0.5 };
    let mut scene = scene(&gltf(&[(Mesh::sphere(1.0, 8), 0), (table, 1)], &[skin, plaster()], &[lamp], &eye));
    scene.set_environment(image(8, 4, |x, y| if (x + y) % 3 == 0 { 2.0 } else { 0.0 })).expect("valid");
    let device = crate::device();
    let settings = Settings { resolution: Some((64, 64)), seed: 11, ..standard() };
    let mut renderer = Renderer::new(&device, &scene, &settings).expect("the renderer is made");
    let mut image_of = |range: std::ops::Range<u32>| {
        renderer.reset();
        renderer.render_range(range, &mut |_| ControlFlow::Continue(())).expect("rendered");
        renderer.image().expect("an image")
    };
    let many = image_of(100..228);
    for range in [0..1, 1..2, 7..8, 33..34, 5..8] {
        let few = image_of(range.clone());
        for name in ["subsurface.R", "subsurface.B", "reflection.G", "A"] {
            let pairs = channel(&few, name).iter().zip(channel(&many, name));
            // Pixels are independent, and so are their differences.
            let differences: Vec<f64> = pairs.map(|(a, b)| f64::from(a - b)).collect();
            let (difference, error) = mean_and_error(&differences);
            assert!(difference.abs() < 4.0 * error, "{range:?} {name}: {difference} +- {error}");
        }
    }
}

#[test]
fn the_inside_of_a_ball_is_lit_by_a_lamp_in_its_middle() {
    // From within, the outside of the matter is the room. All of the wall is lit alike, and the chords of a ball have the
    // same lengths from both sides.
    let dipole = Dipole::new(4.5, 0.5, 1.3);
    let lamp = (json!({"type": "point", "intensity": 2.0}), DVec3::ZERO, DVec3::X);
    let eye = Eye { eye: DVec3::new(0.3, 0.0, 0.0), at: DVec3::new(2.0, 0.0, 0.0), lens: 0.3 };
    let mesh = Mesh::sphere(1.0, 40);
    let scene = scene(&gltf(&[(mesh, 0)], &[matter([4.5; 3], [0.5; 3], 1.3)], &[lamp], &eye));
    let (found, error) = mean(&scene, &Settings { resolution: Some((16, 16)), ..settings() }, 64, "subsurface.G");
    let leaving = PI * (1.0 - diffuse_reflectance(1.3, Side::Outside));
    // Seen at up to .1 rad: Ft changes by less than 1e-4. The mesh's area is 2e-3 below the ball's.
    let expected = 2.0 * transmittance(1.3, 1.0).powi(2) * dipole.cdf(2.0) / leaving;
    assert!((found - expected).abs() < 4.0 * error + 4e-3 * expected, "{found} +- {error}, not {expected}");
    assert!(error < 5e-3 * expected, "no force: {found} +- {error}");
}

#[test]
fn pixels_lie_where_the_lens_says() {
    // A plane z = 0 behind a small ball; sizes of the picture that are not square.
    let meshes = [(square(40.0), 0), (Mesh::sphere(1.0, 2), 1)];
    let materials = [plaster(), matter([1.0; 3], [1.0; 3], 1.3)];
    let (width, height) = (12u32, 8u32);
    for (distance, lens) in [(5.0, 0.9f64), (5.0, -3.0), (1e5, 6e-5), (1.0, 2.0)] {
        let centre = DVec3::new(8.0, 3.0, 0.0);
        let eye = Eye { eye: centre + DVec3::Z * distance, at: centre, lens };
        let scene = scene(&gltf(&meshes, &materials, &[], &eye));
        let image = render(&scene, &Settings { resolution: Some((width, height)), ..settings() }, 1);
        let half_height = if lens > 0.0 { distance * (lens / 2.0).tan() } else { -lens };
        for (i, row) in (0..height).flat_map(|row| (0..width).map(move |column| (column, row))).enumerate() {
            let (column, row) = row;
            // Left is -x and up is +y.
            let x = (2.0 * f64::from(column) + 1.0 - f64::from(width)) / f64::from(height) * half_height;
            let y = (f64::from(height) - 2.0 * f64::from(row) - 1.0) / f64::from(height) * half_height;
            let at = |name: &str| f64::from(channel(&image, name)[i]);
            let found = DVec3::new(at("P.X"), at("P.Y"), at("P.Z"));
            let wanted = centre + DVec3::new(x, y, 0.0);
            // Internal coordinates reach 40: roundings of 4e-6.
            assert!(found.distance(wanted) < 3e-5, "{distance} {lens} ({column}, {row}): {found}, not {wanted}");
            assert!((at("Z") - distance).abs() < 1e-4 + 1e-7 * distance, "{}", at("Z"));
        }
    }
}

#[test]
fn a_scene_without_camera_is_framed() {
    let eye = Eye { eye: DVec3::Z, at: DVec3::ZERO, lens: 1.0 };
    let mut ball = Mesh::sphere(2.0, 12);
    ball.positions.iter_mut().for_each(|p| *p += DVec3::new(30.0, -7.0, 4.0));
    let mut file = gltf(&[(ball, 0)], &[matter([1.0; 3], [1.0; 3], 1.3)], &[], &eye);
    let nodes = file["nodes"].as_array_mut().expect("nodes");
    nodes.pop();
    file["scenes"][0]["nodes"] = json!([0]);
    for (width, height) in [(40u32, 40u32), (60, 30), (30, 60)] {
        let image = render(&scene(&file), &Settings { resolution: Some((width, height)), ..settings() }, 1);
        let seen = |column: u32, row: u32| channel(&image, "material.Y")[(row * width + column) as usize] >= 0.0;
        let edge = (0..width).any(|x| seen(x, 0) || seen(x, height - 1))
            || (0..height).any(|y| seen(0, y) || seen(width - 1, y));
        assert!(!edge, "{width} x {height}: the ball reaches the edge");
        let covered = channel(&image, "material.Y").iter().filter(|&&m| m >= 0.0).count() as f64;
        // A disk in a square with a margin of 5 %: pi / 4 / 1.05^2 = .71 of the smaller side's square.
        let share = covered / f64::from(width.min(height).pow(2));
        assert!((0.6..0.8).contains(&share), "{width} x {height}: {share}");
    }
}

#[test]
fn uniform_light_leaves_matter_of_any_index() {
    // Lo = Ft(wo) Rd Li; one channel scatters nothing, one absorbs nothing but for what the edge of the slab loses.
    use Projection::{Camera, Mis, Normal};
    for (ior, tilt, projection) in
        [(0.4, 0.2f64, Mis), (0.7, 0.5, Camera), (1.0, 1.5, Normal), (3.0, 1.2, Mis), (9.0, 0.0, Camera)]
    {
        let mut mesh = Mesh::default();
        mesh.cuboid(DVec3::new(-1e3, -1e3, -1e3), DVec3::new(1e3, 1e3, 0.0), 1);
        let eye = Eye { eye: DVec3::new(0.0, -tilt.sin(), tilt.cos()) * 10.0, at: DVec3::ZERO, lens: 1e-4 };
        let materials = [matter([0.0, 0.9, 1.0], [1.0, 0.1, 0.01], ior)];
        let mut scene = scene(&gltf(&[(mesh, 0)], &materials, &[], &eye));
        scene.set_environment(Environment::constant(DVec3::ONE).expect("valid")).expect("valid");
        let leaving = transmittance(ior, tilt.cos());
        let image = render(&scene, &Settings { resolution: Some((16, 16)), projection, ..settings() }, 64);
        let of = |name: &str| {
            let values: Vec<f64> = channel(&image, name).iter().map(|&x| f64::from(x)).collect();
            mean_and_error(&values)
        };
        assert_eq!(of("subsurface.R"), (0.0, 0.0));
        for (name, sigma_s, sigma_a) in [("subsurface.G", 0.9, 0.1), ("subsurface.B", 1.0, 0.01)] {
            let expected = leaving * Dipole::new(sigma_s, sigma_a, ior).total();
            let (found, error) = of(name);
            let problem = format!("{projection:?}, n = {ior}, {name}: {found} +- {error}, not {expected}");
            assert!((found - expected).abs() < 4.0 * error + 1e-4 * expected, "{problem}");
            assert!(error < 0.05 * expected, "no force: {problem}");
        }
    }
}

#[test]
fn unlikely_places_stay_finite() {
    // A lamp in the surface and one in the eye; normals that vanish, cancel within a triangle, or are not of unit length;
    // the plane of a face through the eye; triangles wound at random.
    let lamps = [DVec3::new(0.3, 0.2, 1.0), DVec3::new(0.0, -4.0, 1.0), DVec3::new(0.0, 0.0, 30.0)]
        .map(|place| (json!({"type": "point", "intensity": 5.0}), place, DVec3::ZERO));
    let mut broken = Mesh::default();
    broken.cuboid(DVec3::splat(-1.0), DVec3::splat(1.0), 2);
    for (i, normal) in broken.normals.iter_mut().enumerate() {
        *normal *= [1.0, 0.0, -1.0, 1e-6, 1e6][i % 5];
    }
    broken.indices.chunks_exact_mut(3).step_by(3).for_each(|t| t.swap(0, 1));
    let mut skin = matter([2.0, 4.0, 6.0], [0.1, 0.5, 2.0], 1.3);
    skin["extras"]["bssrdf"]["surface"] = json!("rough");
    skin["pbrMetallicRoughness"] = json!({"roughnessFactor": 0.3});
    let eye = Eye { eye: DVec3::new(0.0, -4.0, 1.0), at: DVec3::new(0.0, 0.0, 1.0), lens: 0.8 };
    // Normals that cancel along the middle row of pixels.
    let corners = [DVec3::new(-1.0, -1.0, 1.5), DVec3::new(1.0, -1.0, 1.5), DVec3::new(0.0, 1.0, 1.5)];
    broken.indices.extend([0, 1, 2].map(|i| broken.positions.len() as u32 + i));
    broken.positions.extend(corners.map(|corner| DVec3::new(corner.x, -1.5, 1.0 + 0.2 * corner.y)));
    broken.normals.extend([DVec3::NEG_Y, DVec3::NEG_Y, DVec3::Y]);
    for material in [skin, plaster()] {
        let mut scene = scene(&gltf(&[(broken.clone(), 0)], &[material], &lamps, &eye));
        scene.set_environment(image(4, 2, |x, y| if (x, y) == (1, 0) { 9.0 } else { 0.0 })).expect("valid");
        for projection in [Projection::Mis, Projection::Normal, Projection::Camera] {
            // No sample is invalid, as `render` checks.
            let image = render(&scene, &Settings { resolution: Some((33, 33)), projection, ..settings() }, 16);
            assert!(image.channels.iter().all(|channel| channel.data.iter().all(|value| value.is_finite())));
            assert!(channel(&image, "R").iter().any(|&value| value > 0.0));
        }
    }
}

#[test]
fn a_very_far_eye_sees_what_an_orthographic_one_does() {
    let lamp = (json!({"type": "point", "intensity": 30.0}), DVec3::new(2.0, 1.0, 4.0), DVec3::ZERO);
    let far = 1e5;
    for projection in [Projection::Mis, Projection::Camera] {
        let values = [(10.0, -1.2), (far, 2.4 / far)].map(|(distance, lens)| {
            let eye = Eye { eye: DVec3::Z * distance, at: DVec3::ZERO, lens };
            let materials = [matter([5.0; 3], [0.5; 3], 1.3)];
            let scene = scene(&gltf(&[(Mesh::sphere(1.0, 8), 0)], &materials, std::slice::from_ref(&lamp), &eye));
            let image = render(&scene, &Settings { resolution: Some((32, 32)), projection, ..settings() }, 16);
            channel(&image, "subsurface.G").iter().map(|&x| f64::from(x)).collect::<Vec<_>>()
        });
        // The same samples: they differ by what f32 and the last 1e-5 rad make of them.
        let total: f64 = values[0].iter().sum();
        let difference: f64 = values[0].iter().zip(&values[1]).map(|(a, b)| (a - b).abs()).sum();
        assert!(total > 1.0 && difference < 5e-3 * total, "{projection:?}: {difference} of {total}");
    }
}
