//! `inspect` as text and as JSON.

use crate::{Folder, stderr};
use serde_json::Value;

#[test]
fn inspect_says_what_a_scene_requires() {
    let folder = Folder::new("inspect");
    let words = "inspect SPOT --unit cm --material wax=marble --resolution 64x48";
    let text = folder.done(words);
    for part in ["wax", "preset marble", "model", "mean free path", "accumulate", "PROJECTION_MIS", "hit_lists"] {
        assert!(text.contains(part), "{part}: {text}");
    }
    // A constant environment stands in for the light that the file lacks; it is not a table.
    assert!(text.contains("WARNINGS") && text.contains("constant environment of radiance 1"), "{text}");
    assert!(text.lines().any(|line| line.contains("environment_cdf") && line.contains("left out")), "{text}");

    let json: Value = serde_json::from_str(&folder.done(&format!("{words} --json"))).expect("JSON");
    let matter = &json["materials"][0]["matter"];
    let near = |value: &Value, expected: f64| {
        let value = value.as_f64().expect("a number");
        assert!((value / expected - 1.0).abs() < 1e-12, "{value}, not {expected}");
    };
    near(&matter["sigmaSPrimePerMm"][1], 2.62);
    near(&matter["sigmaAPerMm"][2], 0.0071);
    near(&matter["meanFreePathMm"][0], 1.0 / 2.1921);
    near(&json["materials"][0]["ior"], 1.5);
    assert_eq!(json["image"]["bands"], serde_json::json!([64 * 48]));
    let buffers = json["buffers"].as_array().expect("a list");
    let sum: u64 = buffers.iter().map(|buffer| buffer["bytes"].as_u64().expect("bytes")).sum();
    assert_eq!(json["deviceBytes"].as_u64(), Some(sum));
    // No model that is recommended for marble needs single scattering.
    let kernels = json["kernels"].as_array().expect("a list");
    let unused = ["begin", "irradiance", "cluster", "gather", "single"];
    let expected = |stem: &serde_json::Value| !unused.contains(&stem.as_str().expect("a stem"));
    assert!(kernels.iter().all(|kernel| (kernel["used"] == true) == expected(&kernel["kernel"])), "{kernels:?}");
    assert_eq!(folder.files(), [""; 0]);

    let missing = folder.run("inspect missing.glb");
    assert_eq!(missing.status.code(), Some(2));
    assert!(stderr(&missing).contains("missing.glb"));
}

#[test]
fn auto_is_what_inspect_recommends() {
    let folder = Folder::new("auto");
    let inspect = |words: &str| -> Value {
        let words = format!("inspect SPOT --material wax=marble --resolution 64x48 --json {words}");
        serde_json::from_str(&folder.done(&words)).expect("JSON")
    };
    // Animals of 13 cm, 13 m and 130 km; light travels some 3 mm.
    for (unit, model, limit_of) in
        [("m", "table", "table"), ("100m", "burley", "burley"), ("1000000m", "lambert", "better")]
    {
        let json = inspect(&format!("--unit {unit}"));
        let matter = &json["materials"][0]["matter"];
        assert_eq!((&matter["model"], &matter["limitOf"]), (&model.into(), &limit_of.into()), "{unit}: {matter}");
        assert_eq!(matter["recommended"]["model"], model);
        let used = |name: &str| {
            let kernels = json["kernels"].as_array().expect("a list");
            kernels.iter().find(|kernel| kernel["kernel"] == name).expect("a kernel")["used"] == true
        };
        let probes = model != "lambert";
        assert_eq!(["sample", "reproject", "accumulate"].map(used), [probes, probes, true], "{unit}");
    }
    // The settings' model comes first.
    let matter = &inspect("--unit m --model standard")["materials"][0]["matter"];
    assert_eq!((&matter["model"], &matter["recommended"]["model"]), (&"standard".into(), &"table".into()));
}

#[test]
fn models_beyond_their_validity_bring_a_warning_with_the_expected_error() {
    let folder = Folder::new("validity");
    // An animal of 1.3 mm is no longer than a mean free path.
    let small = "SPOT --unit cm --material wax=skin1 --resolution 8x8 --model directional";
    let render = folder.run(&format!("render {small} --samples 1"));
    for text in [stderr(&render), folder.done(&format!("inspect {small}"))] {
        let plane = "wax: a plane with the directional model sends out +";
        assert!(text.contains(plane) && text.contains("; table errs less"), "{text}");
        assert!(text.contains("wax: its bodies are 0.") && text.contains("(plates)"), "{text}");
    }
    let quiet = folder.run(&format!("render {small} --samples 1 --quiet"));
    assert_eq!((quiet.status.code(), stderr(&quiet)), (Some(0), String::new()));
    // One of 13 cm is a hundred, and what is recommended needs no warning.
    let thick = folder.done("inspect SPOT --material wax=skin1 --resolution 8x8");
    assert!(!thick.contains("mean free paths thick") && !thick.contains("a plane with the"), "{thick}");
}
