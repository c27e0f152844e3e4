//! Scenes that change between recordings, in the buffers that there are.

use super::{
    app::App,
    faults, leaks,
    record::{SIZE, record, same, settings},
};
use glam::{DVec3, Vec3, Vec4};
use translucent::{
    Device, Environment, Image, LoadOptions, Model, Renderer, Scene, Settings,
    ash::vk,
    gpu::{Buffer, Location, RawDevice},
    measure::scenes::{self, Eye, gltf, matter, sun},
    prepare::{Prepared, prepare},
    scene::{EnvironmentMap, Material, Mesh, Picture, Texture},
    shared::TEXTURE_BASE_COLOR,
};

const EYE: Eye = Eye { eye: DVec3::new(0.0, 0.0, 3.0), at: DVec3::ZERO, lens: 0.7 };

fn read(file: serde_json::Value) -> Scene {
    Scene::from_bytes("test.gltf", file.to_string().as_bytes(), &LoadOptions::default()).expect("a scene")
}

/// An ellipsoid of matter for which diffusion is not enough, and a lamp.
fn pebble() -> Scene {
    let mut mesh = scenes::Mesh::sphere(1.0, 6);
    mesh.positions.iter_mut().for_each(|position| *position *= DVec3::new(1.0, 0.6, 0.3));
    let lamp = serde_json::json!({"type": "point", "intensity": 10.0});
    let lights = [(lamp, DVec3::new(1.0, 2.0, 3.0), DVec3::ZERO)];
    let mut scene = read(gltf(&[(mesh, 0)], &[matter([20.0; 3], [10.0; 3], 1.3)], &lights, &EYE));
    scene.set_environment(Environment::constant(DVec3::ONE).expect("a radiance")).expect("an environment");
    scene
}

fn with(scene: &Scene, sigma_s_prime: [f64; 3], sigma_a: [f64; 3]) -> Scene {
    let mut other = scene.clone();
    let medium = other.materials[0].medium.as_mut().expect("it is translucent");
    (medium.sigma_s_prime, medium.sigma_a) = (sigma_s_prime.into(), sigma_a.into());
    other
}

/// The image of a renderer that was made for it.
fn rendered(device: &Device, scene: &Scene, settings: &Settings, samples: u32) -> Image {
    let mut renderer = Renderer::new(device, scene, settings).expect("a renderer");
    renderer.render(samples).expect("a render");
    renderer.image().expect("an image")
}

/// The model of the first material.
fn model(prepared: &Prepared) -> Model {
    prepared.advice[0].as_ref().expect("it scatters").choice.model
}

#[test]
fn tables_lights_camera_and_environment_change_without_an_allocation() {
    // Its counts are of the process.
    let _alone = faults::alone();
    let app = App::validated(leaks::wrap);
    let device = app.open();
    let (scene, settings) = (pebble(), Settings { model: Model::Auto, ..settings() });
    let mut renderer = Renderer::new(&device, &scene, &settings).expect("a renderer");
    assert_eq!(model(renderer.prepared()), Model::Table);
    let commands = record(&app, &renderer, 0..8);
    app.submit(&[commands]);
    let before = renderer.image().expect("an image");

    // Lengths that differ by the hundred: more spheres and cells.
    let mut other = with(&scene, [2.0, 20.0, 200.0], [1.0, 0.0, 20.0]);
    other.lights[0].intensity *= 3.0;
    other.environment = Environment::constant(DVec3::new(0.2, 0.3, 0.5)).expect("a radiance");
    let mut camera = scene.camera(&Default::default(), 1.0).expect("every scene has one");
    camera.eye += 0.1 * camera.right;
    other.cameras = vec![camera];
    let (made, settled) = (leaks::made(), renderer.buffers());
    renderer.update(&other).expect("it fits");
    assert_eq!((leaks::made(), renderer.buffers()), (made, settled), "nothing is made");
    assert_eq!(renderer.samples(), 0..0);
    app.submit(&[commands]);
    let after = renderer.image().expect("an image");
    let table = Settings { model: Model::Table, ..settings.clone() };
    same(&after, &rendered(&device, &other, &table, 8));
    assert!(after.channel("R") != before.channel("R"));
    assert!(renderer.prepared().profiles.len() > prepare(&scene, &settings).expect("valid").profiles.len());
    renderer.update(&scene).expect("it was made of it");
    app.submit(&[commands]);
    same(&renderer.image().expect("an image"), &before);
    // What was chosen stays, though matter without length needs no profile.
    let short = with(&scene, [1e6; 3], [0.0; 3]);
    assert_eq!(model(&prepare(&short, &settings).expect("valid")), Model::Lambert);
    renderer.update(&short).expect("it fits");
    assert_eq!(model(renderer.prepared()), Model::Table);
    drop((renderer, device));
    app.close();
}

/// A ball of two halves of one set with a profile each, and a lamp of four quads, in the light of a picture.
fn halves() -> Scene {
    let sphere = scenes::Mesh::sphere(1.0, 4);
    let half = |right: bool| {
        let side = |t: &&[u32]| t.iter().map(|&i| sphere.positions[i as usize].x).sum::<f64>() > 0.0;
        let indices = sphere.indices.chunks_exact(3).filter(|t| side(t) == right).flatten().copied().collect();
        scenes::Mesh { indices, ..sphere.clone() }
    };
    let materials = [("burley", 50.0), ("table", 5.0)].map(|(model, scattering)| {
        let mut material = matter([scattering; 3], [0.1, 0.5, 2.0], 1.3);
        material["extras"]["bssrdf"]["set"] = "body".into();
        material["extras"]["bssrdf"]["model"] = model.into();
        material["extras"]["bssrdf"]["surface"] = "rough".into();
        material["pbrMetallicRoughness"] = serde_json::json!({"roughnessFactor": 0.4, "metallicFactor": 0.0});
        material
    });
    let lamp = serde_json::json!({"name": "lamp", "emissiveFactor": [1, 1, 1], "doubleSided": true});
    let mut quads = scenes::Mesh::default();
    (0..4).for_each(|i| quads.quad(DVec3::new(f64::from(i), 2.0, 0.0), DVec3::X * 0.5, DVec3::Z * 0.5));
    let [burley, table] = materials;
    let lights = [(sun(), DVec3::Z, DVec3::NEG_Z)];
    let meshes = [(half(false), 0), (half(true), 1), (quads, 2)];
    let mut scene = read(gltf(&meshes, &[burley, table, lamp], &lights, &EYE));
    scene.set_environment(picture(4, 1.0)).expect("an environment");
    scene
}

fn picture(width: u32, step: f32) -> Environment {
    let radiance = (0..2 * width).map(|i| Vec3::new(1.0, 0.5, step) * (1 + i % 3) as f32).collect();
    Environment { map: EnvironmentMap::Image { width, height: 2, radiance }, ..Environment::default() }
}

#[test]
fn mixed_media_rough_boundaries_emitters_and_pictures_change_or_are_refused_by_name() {
    let device = Device::open(&Default::default()).expect("a device");
    let settings = Settings { model: Model::Auto, ..settings() };
    let scene = halves();
    let mut renderer = Renderer::new(&device, &scene, &settings).expect("a renderer");
    renderer.render(4).expect("a render");
    let before = renderer.image().expect("an image");

    // Each would need another pipeline, geometry or a larger buffer, or is none.
    type Change = fn(&mut Scene);
    let refused: [(&str, Change); 15] = [
        ("geometry: ", |scene| scene.triangles[0].vertices[0].x += 1e-3),
        ("geometry: ", |scene| scene.shadings[0].material ^= 1),
        ("geometry: ", |scene| *scene = pebble()),
        ("materials: 4 in place of 3", |scene| scene.materials.push(scene.materials[0].clone())),
        ("material `matter`: its kind", |scene| scene.materials[0].medium = None),
        ("material `matter`: its index of refraction is NaN", |scene| scene.materials[1].ior = f64::NAN),
        ("set `body`: ", |scene| scene.materials[1].ior = 1.4),
        ("lights: 2 in place of 1", |scene| scene.lights.push(scene.lights[0].clone())),
        ("light `light 0`: ", |scene| scene.lights[0].direction = DVec3::ONE),
        ("camera `", |scene| scene.cameras[0].eye = DVec3::NAN),
        ("feature EMISSIVE: 0 in place of 1", |scene| scene.materials[2].emission = DVec3::ZERO),
        ("feature ENVIRONMENT_KIND: ", |scene| scene.environment = Environment::constant(DVec3::ONE).expect("one")),
        ("feature MODELS: ", |scene| scene.materials[0].medium.as_mut().expect("it is").model = Some(Model::Standard)),
        ("buffer environment: ", |scene| scene.environment = picture(8, 1.0)),
        ("material `matter`: has a texture", |scene| scene.materials[0].textures[0] = Some(Default::default())),
    ];
    for (wanted, change) in refused {
        let mut other = scene.clone();
        change(&mut other);
        let error = renderer.update(&other).expect_err(wanted);
        assert!(error.is_input() && error.to_string().starts_with(wanted), "{wanted}: {error}");
    }
    assert_eq!(renderer.samples(), 0..4);
    same(&renderer.image().expect("an image"), &before);

    let mut other = scene.clone();
    for (material, scale) in other.materials.iter_mut().zip([0.1, 30.0]) {
        // Each with a boundary of its own.
        (material.roughness, material.ior) = (0.4 + 0.01 * scale, 1.5);
        material.medium.as_mut().expect("it is translucent").sigma_a *= scale;
    }
    other.materials[2].emission = DVec3::new(3.0, 2.0, 1.0);
    other.environment = picture(4, 2.0);
    other.lights[0].intensity *= 0.5;
    renderer.update(&other).expect("it fits");
    renderer.render(4).expect("a render");
    same(&renderer.image().expect("an image"), &rendered(&device, &other, &settings, 4));

    // Light alone: nothing is made anew of the materials.
    other.lights[0].intensity *= 4.0;
    other.environment = picture(4, 3.0);
    renderer.update(&other).expect("it fits");
    renderer.render(4).expect("a render");
    same(&renderer.image().expect("an image"), &rendered(&device, &other, &settings, 4));
}

#[test]
fn pictures_change_on_a_device_without_a_queue() {
    let app = App::new();
    let device = unsafe { Device::from_raw(RawDevice { queue: None, ..app.raw() }) }.expect("the device is fit");
    let (corners, indices) =
        ([[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]], [0, 1, 2, 0, 2, 3]);
    let uv = corners.map(|[x, y, _]: [f32; 3]| [x, y]);
    let mesh = Mesh { positions: &corners, indices: &indices, uvs: [Some(&uv), None], ..Mesh::default() };
    let mut board = Material { metallic: 0.0, ..Material::default() };
    board.textures[TEXTURE_BASE_COLOR as usize] = Some(Texture { nearest: true, ..Texture::default() });
    let picture = |texels: &[u32]| Picture { width: texels.len() as u32, height: 1, texels: texels.to_vec() };
    let first = picture(&[0xff00_00ff, 0xff00_ff00, 0xffff_0000]);
    let mut scene = Scene::from_meshes(&[mesh], vec![board], vec![first]).expect("a scene");
    scene.set_environment(Environment::constant(DVec3::ONE).expect("a radiance")).expect("an environment");
    let mut renderer = Renderer::new(&device, &scene, &settings()).expect("a renderer");
    let commands = record(&app, &renderer, 0..4);
    let colors = |renderer: &Renderer| {
        let back = Buffer::new(&device, "back", u64::from(SIZE * SIZE) * 16, Location::Readback).expect("memory");
        let copy = app.commands(|commands| unsafe {
            let from = renderer.output().expect("it records").colors;
            app.device.cmd_copy_buffer(commands, from, back.raw(), &[vk::BufferCopy::default().size(back.bytes())]);
            app.for_the_host(commands);
        });
        app.submit(&[commands, copy]);
        back.read::<Vec4>()
    };
    let before = colors(&renderer);
    let mut other = scene.clone();
    other.pictures[0] = picture(&[0xff80_4020, 0xff20_4080]);
    renderer.update(&other).expect("a smaller picture fits");
    let after = colors(&renderer);
    let ours = app.open();
    let expected = rendered(&ours, &other, &settings(), 4);
    let green: Vec<f32> = after.iter().map(|color| color.y).collect();
    assert!(expected.channel("G") == Some(&green[..]) && after != before);
    other.pictures[0] = picture(&[!0; 4]);
    let error = renderer.update(&other).expect_err("a larger one does not").to_string();
    assert!(error.starts_with("buffer texels: "), "{error}");
    assert_eq!(colors(&renderer), after);
    drop((renderer, device, ours));
    app.close();
}
