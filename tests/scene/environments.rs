//! Environments: files, checks, and the scene's hash; lengths as the command line writes them.

use crate::build::*;
use glam::{DVec3, Vec3};
use serde_json::json;
use std::path::PathBuf;
use translucent::scene::{Environment, EnvironmentMap, LoadOptions, parse_unit};

/// A directory of its own that is removed at the end.
struct Directory(PathBuf);

impl Directory {
    fn new(name: &str) -> Self {
        let path = std::env::temp_dir().join(format!("translucent-{name}-{}", std::process::id()));
        std::fs::create_dir_all(&path).expect("a temporary directory");
        Directory(path)
    }
}

impl Drop for Directory {
    fn drop(&mut self) {
        // Nothing depends on the removal.
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

/// Texels that .hdr holds exactly: powers of two.
fn texel(column: usize, row: usize) -> [f32; 3] {
    [2f32.powi(column as i32), 2f32.powi(column as i32 - row as i32), 0.5]
}

#[test]
fn files() {
    let directory = Directory::new("environments");
    let hdr = directory.0.join("light.hdr");
    let texels: Vec<_> = (0..8).map(|i| image::Rgb(texel(i % 4, i / 4))).collect();
    let file = std::fs::File::create(&hdr).expect("a temporary file");
    image::codecs::hdr::HdrEncoder::new(file).encode(&texels, 4, 2).expect("an .hdr file");
    let exr = directory.0.join("light.exr");
    exr::prelude::write_rgb_file(&exr, 4, 2, |column, row| texel(column, row).into()).expect("an .exr file");
    let wanted: Vec<Vec3> = (0..8).map(|i| Vec3::from_array(texel(i % 4, i / 4))).collect();
    for path in [&hdr, &exr] {
        let environment = Environment::load(path).expect("an environment");
        let EnvironmentMap::Image { width, height, radiance } = environment.map else { panic!("an image") };
        assert_eq!((width, height, environment.rotation, environment.scale), (4, 2, 0.0, 1.0));
        assert_eq!(radiance, wanted, "rows from the top, {}", path.display());
    }

    for (value, shown) in [(f32::NAN, "NaN"), (f32::INFINITY, "inf")] {
        exr::prelude::write_rgb_file(&exr, 4, 2, |column, row| {
            (1.0f32, if (column, row) == (2, 1) { value } else { 0.0 }, 1.0f32)
        })
        .expect("an .exr file");
        let message = Environment::load(&exr).expect_err("no radiance").to_string();
        let wanted = format!("light.exr: texel (2, 1): is [1.0, {shown}, 1.0]; radiance must be finite");
        assert!(message.ends_with(&wanted), "{message}");
    }
    for path in ["nothing.hdr", "nothing.exr", "picture.png"] {
        let message = Environment::load(directory.0.join(path)).expect_err("no such file").to_string();
        assert!(message.contains(path), "{message}");
    }
    let huge = directory.0.join("huge.hdr");
    std::fs::write(&huge, "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1000000 +X 1000000\n").expect("a temporary file");
    assert!(Environment::load(&huge).is_err(), "a header alone takes no memory");
    // Broken contents are errors, whatever is broken.
    let mut numbers = Numbers(3);
    for path in [&hdr, &exr] {
        let whole = std::fs::read(path).expect("our own file");
        for length in 0..whole.len() {
            std::fs::write(path, &whole[..length]).expect("our own file");
            let read = Environment::load(path);
            assert!(read.is_err() || length + 8 > whole.len(), "{length} of {} bytes", whole.len());
        }
        for _ in 0..200 {
            let mut bytes = whole.clone();
            let place = numbers.below(bytes.len());
            bytes[place] = numbers.next() as u8;
            std::fs::write(path, &bytes).expect("our own file");
            if let Ok(Environment { map: EnvironmentMap::Image { width, height, radiance }, .. }) =
                Environment::load(path)
            {
                assert_eq!(width as usize * height as usize, radiance.len());
                assert!(radiance.iter().all(|texel| texel.is_finite()));
            }
        }
    }
}

#[test]
fn constants_are_checked() {
    assert!(Environment::constant(DVec3::ZERO).is_ok());
    for radiance in [DVec3::new(1.0, -0.1, 1.0), DVec3::new(f64::NAN, 0.0, 0.0), DVec3::INFINITY] {
        let message = Environment::constant(radiance).expect_err("no radiance").to_string();
        assert!(message.contains("must be finite, not negative"), "{message}");
    }
}

#[test]
fn a_scene_checks_what_it_is_given() {
    let image = |width, height, texels| EnvironmentMap::Image { width, height, radiance: vec![Vec3::ONE; texels] };
    let table = [
        (Environment { scale: -1.0, ..Environment::default() }, "the scale is -1"),
        (Environment { rotation: f64::NAN, ..Environment::default() }, "the rotation is NaN"),
        (Environment { map: image(2, 1, 2), scale: 1e31, ..Environment::default() }, "its radiance reaches 1e31"),
        (
            Environment { map: EnvironmentMap::Constant(DVec3::X * 1e29), scale: 20.0, rotation: 0.0 },
            "e30; 1e30 at most",
        ),
        (Environment { map: image(3, 2, 5), ..Environment::default() }, "3 x 2 is not the size of 5 texels"),
        (Environment { map: image(0, 7, 0), ..Environment::default() }, "0 x 7 is not the size of 0 texels"),
    ];
    let mut scene = load(&tetrahedron());
    let (hash, environment) = (scene.hash.clone(), scene.environment.clone());
    for (environment, wanted) in table {
        let message = scene.set_environment(environment).expect_err("no environment").to_string();
        assert!(message.contains(wanted), "{message}");
    }
    assert_eq!((scene.hash, scene.environment), (hash, environment), "what is refused changes nothing");
}

#[test]
fn a_little_negative_light_is_raised_and_said() {
    let image = |least: f32| Environment {
        map: EnvironmentMap::Image { width: 2, height: 1, radiance: vec![Vec3::ONE, Vec3::new(1.0, least, 1.0)] },
        ..Environment::default()
    };
    let mut scene = load(&tetrahedron());
    // The positive light sums to 5.
    let message = scene.set_environment(image(-0.06)).expect_err("too much").to_string();
    assert!(message.contains("environment: negative radiance sums to 0.05"), "{message}");
    scene.set_environment(image(-0.04)).expect("what filters leave");
    assert_eq!(scene.warnings, ["environment: 1 texels of negative radiance are taken as 0"]);
    let zero = image(0.0);
    assert_eq!(scene.environment, zero);
    let hash = scene.hash.clone();
    scene.set_environment(zero).expect("an environment");
    assert_eq!((scene.warnings, scene.hash), (Vec::new(), hash), "a new environment takes the warning back");
}

#[test]
fn the_hash_covers_what_the_image_depends_on() {
    let base = load(&tetrahedron());
    assert_eq!(base.hash.len(), 64);
    assert_eq!(base.hash, load(&tetrahedron()).hash);
    let renamed = patched(json!({"nodes": [{"name": "other", "mesh": 0}], "asset": {"copyright": "x"}}));
    assert_eq!(base.hash, load(&renamed).hash, "names do not change the image");

    let light = |intensity: f64| {
        json!({"scenes": [{"nodes": [0, 1]}], "nodes": [{"mesh": 0}, {"extensions": {"KHR_lights_punctual":
            {"light": 0}}}], "extensions": {"KHR_lights_punctual": {"lights":
            [{"type": "point", "intensity": intensity}]}}})
    };
    let camera = |yfov: f64| {
        json!({"scenes": [{"nodes": [0, 1]}], "nodes": [{"mesh": 0}, {"camera": 0}],
            "cameras": [{"type": "perspective", "perspective": {"yfov": yfov, "znear": 1}}]})
    };
    let matter = |material| json!({"materials": [material]});
    let mut hashes = vec![base.hash];
    for patch in [
        json!({"nodes": [{"mesh": 0, "translation": [1, 0, 0]}]}),
        json!({"nodes": [{"mesh": 0, "scale": [1, 1, 2]}]}),
        matter(json!({"extras": {"bssrdf": {"preset": "skin2"}}})),
        matter(json!({"extras": {"bssrdf": {"preset": "skin1", "ior": 1.31}}})),
        matter(json!({"extras": {"bssrdf": {"preset": "skin1", "surface": "smooth"}}})),
        matter(json!({})),
        light(1.0),
        light(2.0),
        camera(0.5),
        camera(0.6),
    ] {
        hashes.push(load(&patched(patch)).hash);
    }
    let mut scene = load(&tetrahedron());
    let image = |last: f32| EnvironmentMap::Image { width: 2, height: 1, radiance: vec![Vec3::ONE, Vec3::splat(last)] };
    for environment in [
        Environment { map: EnvironmentMap::Constant(DVec3::ONE), ..Environment::default() },
        Environment { map: EnvironmentMap::Constant(DVec3::X), ..Environment::default() },
        Environment { map: image(1.0), ..Environment::default() },
        Environment { map: image(2.0), ..Environment::default() },
        Environment { map: image(2.0), rotation: 90.0, ..Environment::default() },
        Environment { map: image(2.0), scale: 2.0, ..Environment::default() },
    ] {
        scene.set_environment(environment).expect("an environment");
        hashes.push(scene.hash.clone());
    }
    let count = hashes.len();
    hashes.sort();
    hashes.dedup();
    assert_eq!(hashes.len(), count, "every change changes the hash");
}

#[test]
fn lengths() {
    for (text, metres) in
        [("m", 1.0), ("cm", 0.01), ("mm", 0.001), ("29.2mm", 0.0292), (" 2 m ", 2.0), ("1e-2cm", 1e-4)]
    {
        assert_eq!(parse_unit(text).ok(), Some(metres), "{text}");
    }
    for text in ["", "3", "inch", "-1mm", "0m", "nanm", "infm", "1e999m", "mm3", "1 2 mm", "²mm"] {
        let message = parse_unit(text).expect_err("no length").to_string();
        assert!(message.starts_with("unit: "), "{message}");
    }
    for unit in [0.0, -1.0, f64::NAN, 1e300] {
        let options = LoadOptions { unit, ..LoadOptions::default() };
        let message = load_with(&tetrahedron(), &options).expect_err("no unit").to_string();
        assert!(message.starts_with("unit: must be from"), "{message}");
    }
}
