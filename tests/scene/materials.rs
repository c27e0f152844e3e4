//! Materials: which source wins, what each form of a medium means, and warnings for what is left out.

use crate::build::*;
use glam::DVec3;
use serde_json::{Value, json};
use translucent::scene::{LoadOptions, Material, Medium};
use translucent::{Model, settings::Directional};

/// Total diffuse reflectance of the standard dipole (Jensen & Buhler 2002), with the Fresnel moment in closed form
/// (Walsh; n > 1).
pub fn dipole_total(alpha: f64, n: f64) -> f64 {
    let (n2, n3, n4) = (n * n, n * n * n, n * n * n * n);
    let rho_e = 0.5
        + (n - 1.0) * (3.0 * n + 1.0) / (6.0 * (n + 1.0).powi(2))
        + n2 * (n2 - 1.0).powi(2) / (n2 + 1.0).powi(3) * ((n - 1.0) / (n + 1.0)).ln()
        - 2.0 * n3 * (n2 + 2.0 * n - 1.0) / ((n2 + 1.0) * (n4 - 1.0))
        + 8.0 * n4 * (n4 + 1.0) / ((n2 + 1.0) * (n4 - 1.0).powi(2)) * n.ln();
    let rho_i = 1.0 - (1.0 - rho_e) / n2;
    let a = (1.0 + rho_i) / (1.0 - rho_i);
    let e = (3.0 * (1.0 - alpha)).sqrt();
    alpha / 2.0 * (1.0 + (-4.0 / 3.0 * a * e).exp()) * (-e).exp()
}

fn material(json: Value) -> Material {
    load(&with_material(json)).materials[0].clone()
}

fn medium(json: Value) -> Medium {
    material(json).medium.expect("a medium")
}

fn bssrdf(json: Value) -> Medium {
    medium(json!({"extras": {"bssrdf": json}}))
}

fn warnings(json: Value) -> Vec<String> {
    load(&with_material(json)).warnings
}

fn assert_close(a: DVec3, b: [f64; 3], relative: f64) {
    let b = DVec3::from_array(b);
    assert!(((a - b).abs().cmple(b.abs() * relative)).all(), "{a} is not {b}");
}

/// The volume of a material whose extinction is `sigma_t` [1/m].
fn volume_of(sigma_t: [f64; 3]) -> Value {
    let distance = 1e-3;
    json!({
        "thicknessFactor": 1,
        "attenuationDistance": distance,
        "attenuationColor": sigma_t.map(|sigma| (-sigma * distance).exp())
    })
}

#[test]
fn surface_factors() {
    let plain = material(json!({}));
    assert_eq!((plain.base_color, plain.metallic, plain.roughness), (DVec3::ONE, 1.0, 1.0), "glTF's defaults");
    assert_eq!((plain.emission, plain.ior, plain.medium), (DVec3::ZERO, 1.5, None));
    let painted = material(json!({
        "pbrMetallicRoughness": {"baseColorFactor": [0.1, 0.2, 0.3, 1], "metallicFactor": 0.5, "roughnessFactor": 0.25},
        "emissiveFactor": [1, 0.5, 0],
        "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": 8}, "KHR_materials_ior": {"ior": 1.38}}
    }));
    assert_eq!((painted.base_color, painted.metallic), (DVec3::new(0.1, 0.2, 0.3), 0.5));
    assert_eq!((painted.roughness, painted.ior), (0.25, 1.38));
    assert_eq!(painted.emission, DVec3::new(8.0, 4.0, 0.0));
}

#[test]
fn the_first_source_wins() {
    let skin = |preset: &str| json!({"bssrdf": {"preset": preset}});
    let extensions = json!({
        "KHR_materials_transmission": {"transmissionFactor": 1},
        "KHR_materials_volume": volume_of([1000.0; 3]),
        "KHR_materials_ior": {"ior": 1.4},
        "KHR_materials_scatter": {"scatterStrengthFactor": 1, "multiscatterColorFactor": [0.5, 0.5, 0.5]},
        "KHR_materials_volume_scatter": {"multiscatterColorFactor": [0.5, 0.5, 0.5]}
    });
    let mut json = with_material(json!({"extras": skin("skin2"), "extensions": extensions}));
    let options = LoadOptions {
        materials: vec![("matter".into(), "cream".into()), ("matter".into(), "marble".into())],
        ..LoadOptions::default()
    };
    let overridden = load_with(&json, &options).expect("a preset for a material").materials[0].clone();
    assert_eq!(overridden.ior, 1.5, "a preset of the caller's brings its index of refraction");
    let source = |material: &Material| material.medium.as_ref().map(|medium| medium.source.clone());
    assert_eq!(source(&overridden).as_deref(), Some("preset marble"), "the last one counts");

    let mut next = || {
        let found = load(&json).materials[0].clone();
        let members = json["materials"][0].as_object_mut().expect("an object");
        if members.remove("extras").is_none() {
            let extensions = members["extensions"].as_object_mut().expect("an object");
            let _ = extensions
                .remove("KHR_materials_scatter")
                .or_else(|| extensions.remove("KHR_materials_volume_scatter"));
        }
        (source(&found), found.ior)
    };
    assert_eq!(next(), (Some("preset skin2".into()), 1.4), "an authored index of refraction beats the preset's");
    assert_eq!(next(), (Some("KHR_materials_scatter".into()), 1.4));
    assert_eq!(next(), (Some("KHR_materials_volume_scatter".into()), 1.4));
    assert_eq!(next(), (None, 1.4));
}

#[test]
fn presets_are_per_millimetre() {
    let skin = material(json!({"extras": {"bssrdf": {"preset": "skin1"}}}));
    assert_eq!(skin.ior, 1.3, "the preset's own");
    let medium = skin.medium.expect("a medium");
    assert_close(medium.sigma_s_prime, [740.0, 880.0, 1010.0], 1e-12);
    assert_close(medium.sigma_a, [32.0, 170.0, 480.0], 1e-12);
    let changed =
        material(json!({"extras": {"bssrdf": {"preset": "skin1", "ior": 1.45, "g": 0.8, "surface": "smooth"}}}));
    assert_eq!((changed.ior, changed.roughness), (1.45, 0.0));
    assert_eq!(changed.medium.expect("a medium").g, DVec3::splat(0.8));
}

#[test]
fn coefficients() {
    for (unit, factor) in [("1/mm", 1e3), ("1/cm", 1e2), ("1/m", 1.0)] {
        let found = bssrdf(json!({"sigma_s_prime": [0.74, 0.88, 1.01], "sigma_a": [0.032, 0.17, 0], "unit": unit}));
        assert_close(found.sigma_s_prime, [0.74 * factor, 0.88 * factor, 1.01 * factor], 1e-12);
        assert_close(found.sigma_a, [0.032 * factor, 0.17 * factor, 0.0], 1e-12);
        assert_eq!((found.g, found.source.as_str()), (DVec3::ZERO, "extras.bssrdf"));
    }
    let unreduced = bssrdf(json!({"sigma_s": [10, 20, 30], "g": [0.9, 0.5, -0.5], "sigma_a": 1, "unit": "1/m"}));
    assert_close(unreduced.sigma_s_prime, [1.0, 10.0, 45.0], 1e-12);
    assert_close(unreduced.sigma_a, [1.0; 3], 0.0);
    let ior = material(json!({"extras": {"bssrdf": {"sigma_s_prime": 1, "sigma_a": 0, "unit": "1/m"}},
        "extensions": {"KHR_materials_ior": {"ior": 1.38}}}))
    .ior;
    assert_eq!(ior, 1.38, "KHR_materials_ior where bssrdf names none");
}

#[test]
fn albedo_is_the_total_of_the_profile() {
    // alpha' for totals of .1, .5, .9, .99, and how far it is from 1 decides: the tail digits of 1 - alpha'.
    let known = [
        (1.3, [(0.1, 0.591934548), (0.5, 0.972563550), (0.9, 0.999487726), (0.99, 0.999995479)]),
        (1.5, [(0.1, 0.597952842), (0.5, 0.981539772), (0.9, 0.999705251), (0.99, 0.999997442)]),
    ];
    for (ior, rows) in known {
        for (albedo, alpha) in rows {
            let found =
                bssrdf(json!({"albedo": [albedo, 0, 1], "mean_free_path": [2, 4, 5], "unit": "mm", "ior": ior}));
            let sigma_t = found.sigma_s_prime + found.sigma_a;
            assert_close(sigma_t, [500.0, 250.0, 200.0], 1e-12);
            assert!((found.sigma_s_prime.x / sigma_t.x - alpha).abs() < 1e-9, "{albedo} {ior}");
            assert!((dipole_total(found.sigma_s_prime.x / sigma_t.x, ior) - albedo).abs() < 1e-9);
            assert_eq!((found.sigma_s_prime.y, found.sigma_a.z), (0.0, 0.0), "black and white are exact");
        }
    }
    // Close to 1: e -> (1 - R) / (1 + 2A/3), 1 - alpha' = e^2 / 3, to all digits; A is 2.600079 at 1.3.
    let missing = 1e-9;
    let found = bssrdf(json!({"albedo": 1.0 - missing, "mean_free_path": 1, "unit": "m", "ior": 1.3}));
    let e = missing / (1.0 + 2.0 * 2.600079 / 3.0);
    assert!((found.sigma_a.x / (e * e / 3.0) - 1.0).abs() < 1e-6, "{}", found.sigma_a.x);
}

#[test]
fn diffuse_mean_free_path_is_one_over_sigma_tr() {
    for ior in [1.0, 0.8, 1.33] {
        let found = bssrdf(json!({"albedo": [0.8, 0.3, 0], "diffuse_mean_free_path": [2, 1, 0.5], "unit": "cm",
            "ior": ior}));
        let sigma_tr = (3.0 * found.sigma_a * (found.sigma_a + found.sigma_s_prime)).map(f64::sqrt);
        assert_close(sigma_tr, [50.0, 100.0, 200.0], 1e-9);
        assert_eq!(found.sigma_s_prime.z, 0.0);
    }
    // Without a boundary A = 1: the total is alpha'/2 (1 + e^(-4e/3)) e^-e.
    let found = bssrdf(json!({"albedo": 0.5, "diffuse_mean_free_path": 1, "unit": "m", "ior": 1}));
    let e = (1.0 / (found.sigma_a + found.sigma_s_prime)).x;
    let total = (1.0 - e * e / 3.0) / 2.0 * (1.0 + (-4.0 / 3.0 * e).exp()) * (-e).exp();
    assert!((total - 0.5).abs() < 1e-12, "{total}");
}

/// s of the drafts, as they print it.
fn printed_s(rho: f64) -> f64 {
    4.09712 + 4.20863 * rho - (9.59217 + 41.6808 * rho + 17.7126 * rho * rho).sqrt()
}

#[test]
fn volume_scatter_in_both_spellings() {
    for spelling in ["multiscatterColorFactor", "multiscatterColor"] {
        let (rho, g) = ([0.8, 0.6, 0.5], 0.25);
        let found = medium(json!({"extensions": {
            "KHR_materials_transmission": {"transmissionFactor": 1},
            "KHR_materials_volume": volume_of([500.0, 400.0, 300.0]),
            "KHR_materials_volume_scatter": {spelling: rho, "scatterAnisotropy": g}
        }}));
        let s = rho.map(printed_s);
        let sigma_t = [500.0, 400.0, 300.0];
        // The printed constants have six digits.
        assert_close(found.sigma_a, [0, 1, 2].map(|i| sigma_t[i] * s[i] * s[i]), 1e-4);
        assert_close(found.sigma_s_prime, [0, 1, 2].map(|i| sigma_t[i] * (1.0 - s[i] * s[i]) * (1.0 - g)), 1e-4);
        assert_eq!(found.g, DVec3::splat(g));
    }
    // Khronos' ScatteringSkull: sigma_t about 59.2, 42.8, 54.8 /m and single-scatter albedos .55, .92, .95.
    let skull = medium(json!({"extensions": {
        "KHR_materials_transmission": {"transmissionFactor": 1},
        "KHR_materials_volume": {"attenuationColor": [0.36787945, 0.48573145, 0.39640999],
            "attenuationDistance": 0.01689185, "thicknessFactor": 1},
        "KHR_materials_volume_scatter": {"multiscatterColor": [0.16827136, 0.52711987, 0.59062535]}
    }}));
    let sigma_t = skull.sigma_s_prime + skull.sigma_a;
    assert_close(sigma_t, [59.2, 42.75, 54.8], 2e-3);
    assert_close(skull.sigma_s_prime / sigma_t, [0.55, 0.92, 0.95], 0.01);
}

#[test]
fn scatter_in_both_spellings() {
    for spelling in ["scatterStrengthFactor", "scatterFactor"] {
        let (rho, g, strength) = (0.8, -0.5, 0.75);
        let found = medium(json!({"extensions": {
            "KHR_materials_transmission": {"transmissionFactor": 1},
            "KHR_materials_volume": volume_of([500.0; 3]),
            "KHR_materials_scatter": {spelling: strength, "multiscatterColorFactor": [rho, rho, rho],
                "scatterAnisotropy": g}
        }}));
        let s = printed_s(rho * strength);
        let albedo = (1.0 - s * s) / (1.0 - g * s * s);
        assert_close(found.sigma_s_prime, [500.0 * albedo * (1.0 - g); 3], 1e-4);
        assert_close(found.sigma_a, [500.0 * (1.0 - albedo); 3], 1e-4);
        // alpha' = 1 - s^2 for every g.
        let alpha = found.sigma_s_prime.x / (found.sigma_s_prime.x + found.sigma_a.x);
        assert!((alpha - (1.0 - s * s)).abs() < 1e-5);
    }
}

#[test]
fn bright_media_keep_their_absorption() {
    let at = |rho: f64| {
        medium(json!({"extensions": {
            "KHR_materials_transmission": {"transmissionFactor": 1},
            "KHR_materials_volume": volume_of([1000.0; 3]),
            "KHR_materials_scatter": {"scatterStrengthFactor": 1, "multiscatterColorFactor": [rho, rho, 1.0]}
        }}))
    };
    // s -> 2 (1 - rho) / (2 * 2.309): absorption falls with the square, down to numbers that 1 - albedo cannot hold.
    let found = at(1.0 - 1e-9);
    let s: f64 = 1e-9 / 2.309;
    assert!((found.sigma_a.x / (1000.0 * s * s) - 1.0).abs() < 1e-6, "{}", found.sigma_a.x);
    assert_eq!(found.sigma_a.z, 0.0, "white absorbs nothing");
    assert_close(DVec3::splat(found.sigma_s_prime.z), [1000.0; 3], 1e-12);
    // The drafts' formula is the inverse of van de Hulst's albedo, to the six digits of its constants.
    for rho in [0.0625, 0.5, 0.999, 0.999999] {
        let found = at(rho);
        let s = (found.sigma_a.x / (found.sigma_a.x + found.sigma_s_prime.x)).sqrt();
        let albedo = (1.0 - s) * (1.0 - 0.139 * s) / (1.0 + 1.17 * s);
        assert!((albedo - rho).abs() < 1e-12, "{rho}: {albedo}");
    }
}

#[test]
fn what_scatters_nothing_is_opaque_and_said() {
    let with = |scatter: Value, volume: Option<Value>| {
        let mut extensions = json!({"KHR_materials_transmission": {"transmissionFactor": 1}});
        extensions["KHR_materials_scatter"] = scatter;
        if let Some(volume) = volume {
            extensions["KHR_materials_volume"] = volume;
        }
        let json = json!({"extensions": extensions});
        assert_eq!(material(json.clone()).medium, None);
        let warnings = warnings(json);
        assert_eq!(warnings.len(), 1, "{warnings:?}");
        warnings[0].clone()
    };
    let dense = Some(volume_of([1000.0; 3]));
    let place = "materials[0] (matter).extensions.KHR_materials_scatter: ";
    let strength = with(json!({"multiscatterColorFactor": [1, 1, 1]}), dense.clone());
    assert!(strength.starts_with(place) && strength.contains("scatterStrengthFactor, default 0) is 0"), "{strength}");
    let black = with(json!({"scatterStrengthFactor": 1, "multiscatterColorFactor": [0, 0, 0]}), dense);
    assert!(black.contains("black"), "{black}");
    let bright = json!({"scatterStrengthFactor": 1});
    assert!(with(bright.clone(), None).contains("no extinction"));
    assert!(with(bright.clone(), Some(json!({"thicknessFactor": 1}))).contains("no extinction"));
    let distance = json!({"thicknessFactor": 1, "attenuationDistance": 0.01});
    assert!(with(bright, Some(distance)).contains("no extinction"), "white attenuates nothing");
}

#[test]
fn warnings_name_what_is_left_out() {
    let texture = json!({"index": 0});
    let table = [
        (json!({"occlusionTexture": texture}), "materials[0] (matter).occlusionTexture: shadows are traced"),
        (
            json!({"extensions": {"KHR_materials_transmission": {"transmissionTexture": texture}}}),
            "transmissionTexture: this texture is not modelled",
        ),
        (json!({"alphaMode": "BLEND"}), "materials[0] (matter).alphaMode: transparency by alpha"),
        (json!({"extensions": {"KHR_materials_ior": {"ior": 0}}}), "0 (a full reflector"),
        (json!({"extensions": {"KHR_materials_transmission": {"transmissionFactor": 1}}}), "refraction through clear"),
        (json!({"extensions": {"KHR_materials_clearcoat": {}}}), "clear coat (KHR_materials_clearcoat)"),
        (
            json!({"extras": {"bssrdf": {"preset": "ketchup"}}}),
            "preset ketchup absorbs more than it scatters in green, blue",
        ),
        (json!({"extras": {"bssrdf": {"sigma_s_prime": 0, "sigma_a": 1, "unit": "1/m"}}}), "scatters nothing"),
    ];
    for (json, wanted) in table {
        let warnings = warnings(json.clone());
        assert!(warnings.len() == 1 && warnings[0].contains(wanted), "{json}: {warnings:?}");
    }
    let scattering = |name: &str, member: &str, value: Value| {
        let mut extensions = json!({
            "KHR_materials_transmission": {"transmissionFactor": 1},
            "KHR_materials_volume": volume_of([1000.0; 3]),
            "KHR_materials_volume_scatter": {"multiscatterColorFactor": [0.5, 0.5, 0.5]}
        });
        extensions[name][member] = value;
        warnings(json!({"extensions": extensions})).join("; ")
    };
    let share = scattering("KHR_materials_transmission", "transmissionFactor", json!(0.5));
    assert!(share.contains("transmits 0.5 of the light is taken as wholly translucent"), "{share}");
    let wall = scattering("KHR_materials_volume", "thicknessFactor", json!(0));
    assert!(wall.contains("thin wall"), "{wall}");
    let dark = scattering("KHR_materials_volume", "attenuationColor", json!([0, 0.5, 0.5]));
    assert!(dark.contains("0 would be an infinite extinction; 0.0001 is used"), "{dark}");

    let model = |name: &str| json!({"extras": {"bssrdf": {"preset": "skin1", "model": name}}});
    assert_eq!(warnings(model("standard")), Vec::<String>::new());
    assert_eq!(medium(model("burley")).model, Some(Model::Burley));
    assert_eq!(medium(model("lambert")).model, Some(Model::Lambert));
    let mut options = model("directional");
    assert_eq!(medium(options.clone()).directional, None);
    options["extras"]["bssrdf"]["kappa"] = json!(0.5);
    options["extras"]["bssrdf"]["reciprocal"] = json!(true);
    let expected = Directional { reciprocal: true, kappa: 0.5, ..Directional::default() };
    assert_eq!(medium(options).directional, Some(expected));
}

#[test]
fn warnings_outside_materials() {
    let primitive = |members: Value| {
        let mut json = tetrahedron();
        for (key, value) in members.as_object().expect("an object") {
            json["meshes"][0]["primitives"][0][key] = value.clone();
        }
        load(&json).warnings.join("; ")
    };
    assert!(primitive(json!({"attributes": {"POSITION": 0, "COLOR_0": 0}})).contains("vertex colours"));
    let instancing = json!({"nodes": [{"mesh": 0, "extensions": {"EXT_mesh_gpu_instancing": {"attributes": {}}}}],
        "extensionsUsed": ["EXT_mesh_gpu_instancing", "ACME_sparkle", "KHR_materials_ior"]});
    let warnings = load(&patched(instancing)).warnings;
    assert_eq!(warnings.len(), 2, "{warnings:?}");
    assert!(warnings[0].contains("the extension ACME_sparkle is not modelled"));
    assert!(warnings[1].contains("nodes[0].extensions.EXT_mesh_gpu_instancing: instances"));
    let animated = load(&patched(json!({"animations": [{}]}))).warnings.join("; ");
    assert!(animated.contains("animations are not modelled"), "{animated}");
    let mut lines = tetrahedron();
    let more = json!({"attributes": {"POSITION": 0}, "mode": 1});
    lines["meshes"][0]["primitives"].as_array_mut().expect("an array").push(more);
    assert!(load(&lines).warnings[0].contains("primitives[1]: points and lines"));
}
