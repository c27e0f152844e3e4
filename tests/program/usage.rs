//! Wrong usage and wrong input: exit status 2, a message that names what is wrong, and no file.

use crate::{Folder, stderr};
use std::fs;

#[test]
fn wrong_usage_and_input_end_with_2_and_a_message_and_leave_nothing() {
    let folder = Folder::new("usage");
    fs::create_dir(folder.join("taken.exr")).expect("writable");
    fs::write(folder.join("garbage.glb"), b"glTF, but not really").expect("writable");
    fs::write(folder.join("empty.gltf"), b"{}").expect("writable");
    fs::write(folder.join("text.hdr"), b"no image").expect("writable");
    fs::copy(concat!(env!("CARGO_MANIFEST_DIR"), "/assets/spot.glb"), folder.join("scene.exr")).expect("writable");
    fs::write(folder.join("light.exr"), b"an environment").expect("writable");
    let before = folder.files();
    for (words, expected) in [
        ("", "Usage"),
        ("bake SPOT", "bake"),
        ("render", "SCENE"),
        ("render SPOT --error 0", "--error"),
        ("render SPOT --error=-1%", "--error"),
        ("render SPOT --error little", "--error"),
        ("render SPOT --error 1% --samples 0:8", "--error"),
        ("render SPOT --time 1s --samples 8:16", "--time"),
        ("render SPOT --time 0s", "--time"),
        ("render SPOT --time 5days", "--time"),
        ("render SPOT --integrator cloud --error 1%", "cloud"),
        ("render SPOT --reproject magic", "magic"),
        ("render SPOT --precision half", "half"),
        ("render SPOT --reproject screen --projection normal", "projection normal"),
        ("render SPOT --resolution 32x32 --reproject screen --error 1%", "reproject screen"),
        ("render SPOT --irradiance magic", "magic"),
        ("render SPOT --resolution 32x32 --irradiance cached --error 1%", "irradiance is cached"),
        ("render SPOT --irradiance cached --model directional", "directional"),
        ("render SPOT --irradiance cached --cache-samples 1", "--cache-samples"),
        ("render SPOT --irradiance cached --cache-points 1000000", "--cache-points"),
        ("render SPOT --irradiance cached --cache-spacing 0", "cache spacing"),
        ("render SPOT --irradiance cached --cache-tolerance=-1", "--cache-tolerance"),
        ("render SPOT --projection sideways", "sideways"),
        ("render SPOT --model magic", "magic"),
        ("render missing.glb", "missing.glb"),
        ("render garbage.glb", "garbage.glb"),
        ("render empty.gltf", "empty.gltf"),
        ("render taken.exr", "taken.exr"),
        ("render SPOT --resolution 0x5", "--resolution"),
        ("render SPOT --resolution 5", "--resolution"),
        ("render SPOT --resolution 100000x5", "100000"),
        ("render SPOT --samples 0", "--samples"),
        ("render SPOT --samples 8:8", "--samples"),
        ("render SPOT --samples 9:3", "--samples"),
        ("render SPOT --samples 3000000000", "--samples"),
        ("render SPOT --directions 0", "--directions"),
        ("render SPOT --camera nobody", "nobody"),
        ("render SPOT --camera 7", "7"),
        ("render SPOT --crop 0,0,0,4", "--crop"),
        ("render SPOT --resolution 32x32 --crop 0,0,64,4", "crop"),
        ("render SPOT --aov beauty", "beauty"),
        ("render SPOT --material wax", "NAME=PRESET"),
        ("render SPOT --material nowhere=skin1", "nowhere"),
        ("render SPOT --material wax=granite", "granite"),
        ("render SPOT --unit furlong", "furlong"),
        ("render SPOT --unit 0mm", "unit"),
        ("render SPOT --environment missing.hdr", "missing.hdr"),
        ("render SPOT --environment text.hdr", "text.hdr"),
        ("render SPOT --environment constant:1,1", "constant:R,G,B"),
        ("render SPOT --environment constant:1,1,-1", "constant:R,G,B"),
        ("render SPOT --environment constant:1,1,1 --environment-scale -1", "--environment-scale"),
        ("render SPOT --environment light.exr -o light.exr", "overwritten"),
        ("render scene.exr", "overwritten"),
        ("render scene.exr -o ./scene.exr", "overwritten"),
        ("render SPOT --environment constant:1e39,1,1", "environment"),
        ("render SPOT --environment constant:1e30,1,1 --environment-scale 1e30", "environment"),
        ("render SPOT --environment-rotation 90", "--environment"),
        ("render SPOT --exposure 1", "--png"),
        ("render SPOT --seed -1", "--seed"),
        ("render SPOT --device nonesuch", "nonesuch"),
        ("render SPOT -o nowhere/out.exr", "nowhere"),
        ("render SPOT --tev localhost", "--tev"),
        ("render SPOT --tev localhost:port", "--tev"),
        ("render SPOT --profile times.txt", ".json or .csv"),
        ("render SPOT --profile nowhere/times.json", "nowhere"),
        ("bench", "SCENE"),
        ("bench missing.glb", "missing.glb"),
        ("bench SPOT --repeat 0", "--repeat"),
        ("bench SPOT -o times.csv", ".json"),
        ("bench SPOT --scaling height", "--scaling"),
        ("bench SPOT --scaling all --samples 3", "--scaling"),
        ("bench SPOT --values 3", "--scaling"),
        ("bench SPOT --scaling lights --values 0", "--values"),
        ("bench SPOT --scaling lights -o times.txt", ".json or .csv"),
        ("bench --compare one.json", "--compare"),
        ("bench --compare one.json two.json", "one.json"),
        ("bench SPOT --compare one.json two.json", "--compare"),
        ("bench --confidence 95", "--compare"),
        ("render SPOT -o taken.exr", "taken.exr"),
        ("render SPOT -o out.jpg", "out.jpg"),
        ("render SPOT --png nowhere/out.png", "nowhere"),
        ("render SPOT --png out.exr", "out.exr"),
        ("render SPOT --integrator magic", "--integrator"),
        ("render SPOT --integrator area --error 1%", "integrator area"),
        ("render SPOT --integrator walk --error 1%", "integrator walk"),
        ("render SPOT --integrator cloud --cloud-points 0", "--cloud-points"),
        ("render SPOT --integrator cloud --cloud-opening 2", "cloud opening"),
        ("render SPOT --integrator cloud --cloud-spacing 0", "cloud spacing"),
        ("render SPOT --integrator cloud --model directional", "directional"),
        ("tradeoff", "SCENE"),
        ("tradeoff missing.glb", "missing.glb"),
        ("tradeoff SPOT --models standard,magic", "magic"),
        ("tradeoff SPOT --integrators magic", "--integrators"),
        ("tradeoff SPOT --projections sideways", "sideways"),
        ("tradeoff SPOT --reproject magic", "--reproject"),
        ("tradeoff SPOT --reuse 3", "--reuse"),
        ("tradeoff SPOT --precision half", "--precision"),
        ("tradeoff SPOT --samples 1,0", "--samples"),
        ("tradeoff SPOT --samples 4:8", "--samples"),
        ("tradeoff SPOT --directions 0", "--directions"),
        ("tradeoff SPOT --reference-samples 1", "--reference-samples"),
        ("tradeoff SPOT --against fast", "--against"),
        ("tradeoff SPOT --exposure bright", "--exposure"),
        ("tradeoff SPOT -o nowhere/out", "nowhere"),
        ("tradeoff SPOT -o light.exr", "light.exr"),
        ("tradeoff SPOT --camera nobody", "nobody"),
        ("merge -o out.exr", "PART"),
        ("merge missing.exr -o out.exr", "missing.exr"),
        ("merge garbage.glb -o out.exr", "garbage.glb"),
        ("merge garbage.glb -o nowhere/out.exr", "nowhere"),
    ] {
        let output = folder.run(words);
        let message = stderr(&output);
        assert_eq!(output.status.code(), Some(2), "{words}: {message}");
        assert!(message.contains(expected), "{words}: {message}");
        assert!(!message.contains("panicked"), "{words}: {message}");
        assert!(output.stdout.is_empty(), "{words}");
        assert_eq!(folder.files(), before, "{words}");
    }
}

#[test]
fn the_help_names_every_option_that_is_built_and_no_other() {
    let help = Folder::new("help").done("render --help");
    let mut options: Vec<&str> =
        help.split(|c: char| !(c.is_ascii_alphanumeric() || c == '-')).filter(|word| word.starts_with("--")).collect();
    options.sort();
    options.dedup();
    assert_eq!(
        options,
        [
            "--albedo-mapping",
            "--aov",
            "--band-pixels",
            "--cache-points",
            "--cache-samples",
            "--cache-spacing",
            "--cache-tolerance",
            "--camera",
            "--cloud-opening",
            "--cloud-points",
            "--cloud-samples",
            "--cloud-spacing",
            "--crop",
            "--curvature",
            "--device",
            "--directions",
            "--environment",
            "--environment-rotation",
            "--environment-scale",
            "--error",
            "--exposure",
            "--help",
            "--integrator",
            "--irradiance",
            "--kappa",
            "--material",
            "--model",
            "--normalisation",
            "--output",
            "--png",
            "--precision",
            "--profile",
            "--projection",
            "--quiet",
            "--reciprocal",
            "--renormalise",
            "--reproject",
            "--resolution",
            "--reuse",
            "--samples",
            "--seed",
            "--show-environment",
            "--single-scattering",
            "--tev",
            "--time",
            "--unit",
        ]
    );
}

#[test]
fn a_closed_pipe_is_no_failure() {
    let folder = Folder::new("pipe");
    let mut child = folder
        .command("presets")
        .stdout(std::process::Stdio::piped())
        .stderr(std::process::Stdio::piped())
        .spawn()
        .expect("the program starts");
    drop(child.stdout.take());
    let output = child.wait_with_output().expect("it ends");
    assert_eq!((output.status.code(), stderr(&output)), (Some(0), String::new()));
}
