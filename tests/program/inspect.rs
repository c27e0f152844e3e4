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
    // The standard dipole needs no single scattering.
    let kernels = json["kernels"].as_array().expect("a list");
    let unused = ["begin", "clear", "single"];
    let expected = |stem: &serde_json::Value| !unused.contains(&stem.as_str().expect("a stem"));
    assert!(kernels.iter().all(|kernel| (kernel["used"] == true) == expected(&kernel["kernel"])), "{kernels:?}");
    assert_eq!(folder.files(), [""; 0]);

    let missing = folder.run("inspect missing.glb");
    assert_eq!(missing.status.code(), Some(2));
    assert!(stderr(&missing).contains("missing.glb"));
}
