//! The C interface: its header, its libraries as a user installs them, and the examples.

use glam::DVec3;
use std::{
    f64::consts::PI,
    fs,
    path::{Path, PathBuf},
    process::Command,
    sync::Once,
};
use translucent::{
    Environment, Image, Model, Renderer, Scene, Settings,
    scene::{Camera, Lens, Material},
};

const HEADER: &str = "src/capi/include/translucent.h";

/// The header that cbindgen makes of the sources.
fn header() -> String {
    let config = cbindgen::Config::from_file("src/capi/cbindgen.toml").expect("a valid file");
    let builder = cbindgen::Builder::new().with_config(config).with_src("src/capi/lib.rs");
    let mut text = Vec::new();
    builder.generate().expect("cbindgen reads the sources").write(&mut text);
    String::from_utf8(text).expect("a header is text")
}

#[test]
fn header_in_the_repository_is_fresh() {
    let fresh = header();
    if std::env::var_os("BLESS").is_some() {
        fs::write(HEADER, &fresh).expect("the header can be written");
    }
    let kept = fs::read_to_string(HEADER).unwrap_or_default();
    assert!(kept == fresh, "{HEADER} is stale: BLESS=1 cargo test --test embed header");
}

#[test]
fn versions_agree() {
    let package = fs::read_to_string("src/capi/include/translucent.pc").expect("it is in the repository");
    assert!(package.contains(&format!("Version: {}\n", env!("CARGO_PKG_VERSION"))));
    let capi = fs::read_to_string("src/capi/Cargo.toml").expect("it is in the repository");
    assert!(capi.contains(&format!("version = \"{}\"\n", env!("CARGO_PKG_VERSION"))));
}

/// Runs a command to its end, which must be good; its standard output.
#[track_caller]
fn run(command: &mut Command) -> String {
    let output = command.output().unwrap_or_else(|error| panic!("{command:?}: {error}"));
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    assert!(output.status.success(), "{command:?}: {}\n{}", output.status, text(&output.stderr));
    text(&output.stdout)
}

/// Builds the libraries and lays them out as an installation.
fn installed(name: &str) -> PathBuf {
    // With this test among what is built, dependencies have the features that they have now, and are not built again.
    static BUILT: Once = Once::new();
    let build = ["build", "--quiet", "--workspace", "--lib", "--test", "embed", "--example", "embed"];
    BUILT.call_once(|| drop(run(Command::new(env!("CARGO")).args(build))));
    let root = Path::new(env!("CARGO_TARGET_TMPDIR"));
    let (prefix, built) = (root.join(name), root.join("../debug"));
    let _ = fs::remove_dir_all(&prefix);
    for (from, to) in [
        (built.join("libtranslucent.so"), "lib/libtranslucent.so"),
        (built.join("libtranslucent.a"), "lib/libtranslucent.a"),
        (HEADER.into(), "include/translucent.h"),
        ("src/capi/include/translucent.pc".into(), "lib/pkgconfig/translucent.pc"),
        ("src/capi/include/translucent-config.cmake".into(), "lib/cmake/translucent/translucent-config.cmake"),
    ] {
        let to = prefix.join(to);
        fs::create_dir_all(to.parent().expect("it has one")).expect("a folder");
        fs::hard_link(&from, &to).or_else(|_| fs::copy(&from, &to).map(drop)).expect("a file");
    }
    prefix
}

/// What pkg-config says, word by word.
fn flags(prefix: &Path, arguments: &[&str]) -> Vec<String> {
    let path = prefix.join("lib/pkgconfig");
    let text = run(Command::new("pkg-config").args(arguments).arg("translucent").env("PKG_CONFIG_PATH", path));
    text.split_whitespace().map(String::from).collect()
}

/// Runs a program under the validation layer, core and synchronization, which must be there and have nothing to say.
#[track_caller]
fn run_validated(command: &mut Command) -> String {
    command
        .env("VK_INSTANCE_LAYERS", "VK_LAYER_KHRONOS_validation")
        .env("VK_LAYER_ENABLES", "VK_VALIDATION_FEATURE_ENABLE_SYNCHRONIZATION_VALIDATION_EXT")
        .env("VK_LAYER_VALIDATE_SYNC", "1")
        .env("VK_LOADER_DEBUG", "layer");
    let output = command.output().unwrap_or_else(|error| panic!("{command:?}: {error}"));
    let [out, err] = [&output.stdout, &output.stderr].map(|bytes| String::from_utf8_lossy(bytes).into_owned());
    assert!(output.status.success(), "{command:?}: {}\n{err}", output.status);
    assert!(err.contains("Insert instance layer \"VK_LAYER_KHRONOS_validation\""), "the layer is there: {err}");
    // Without a messenger the layer writes to the standard output.
    assert!(!out.contains("Validation") && !err.contains("VUID") && !err.contains("SYNC-HAZARD"), "{out}{err}");
    out
}

const SIZE: u32 = 16;

/// What the examples render.
fn expected(samples: u32) -> Image {
    let device = translucent::Device::open(&Default::default()).expect("a device");
    let mut scene = Scene::load("assets/spot.glb").expect("the asset");
    scene.set_environment(Environment::constant(glam::DVec3::ONE).expect("a radiance")).expect("an environment");
    let settings = Settings { resolution: Some((SIZE, SIZE)), model: Model::Standard, ..Settings::default() };
    let mut renderer = Renderer::new(&device, &scene, &settings).expect("a renderer");
    renderer.render(samples).expect("a render");
    renderer.image().expect("an image")
}

#[test]
fn the_example_in_c_renders_the_same_image_with_the_shared_library() {
    let prefix = installed("shared");
    let program = prefix.join("spot");
    run(Command::new("cc")
        .args(["-std=c11", "-Wall", "-Wextra", "-Werror", "-pedantic", "examples/c/spot.c", "-o"])
        .arg(&program)
        .args(flags(&prefix, &["--cflags", "--libs"]))
        .arg("-lvulkan"));
    let image = prefix.join("spot.pfm");
    run_validated(
        Command::new(&program)
            .arg("assets/spot.glb")
            .arg(&image)
            .args([&SIZE.to_string(), "8"])
            .env("LD_LIBRARY_PATH", prefix.join("lib")),
    );
    let bytes = fs::read(&image).expect("the example wrote it");
    let head = format!("PF\n{SIZE} {SIZE}\n-1\n");
    assert!(bytes.starts_with(head.as_bytes()));
    let found: Vec<f32> = bytemuck::pod_collect_to_vec(&bytes[head.len()..]);
    let expected = expected(8);
    let channels = ["R", "G", "B"].map(|name| expected.channel(name).expect("every image has it"));
    assert_eq!(found.len(), 3 * (SIZE * SIZE) as usize);
    for (i, value) in found.iter().enumerate() {
        let (pixel, channel) = (i / 3, i % 3);
        let (row, column) = (SIZE as usize - 1 - pixel / SIZE as usize, pixel % SIZE as usize);
        assert_eq!(*value, channels[channel][row * SIZE as usize + column]);
    }
    assert!(found.iter().any(|value| *value > 0.1));
    // A failure has a reason.
    let output = Command::new(&program).args(["no.glb", "no.pfm"]).env("LD_LIBRARY_PATH", prefix.join("lib")).output();
    let output = output.expect("it starts");
    assert_eq!(output.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&output.stderr).contains("no.glb"));
}

#[test]
fn the_example_in_cpp_turns_the_camera_with_the_static_library() {
    let prefix = installed("static");
    let program = prefix.join("turntable");
    let mut static_flags = flags(&prefix, &["--cflags", "--libs", "--static"]);
    for flag in &mut static_flags {
        if flag == "-ltranslucent" {
            *flag = "-l:libtranslucent.a".into();
        }
    }
    run(Command::new("c++")
        .args(["-std=c++17", "-Wall", "-Wextra", "-Werror", "-Wno-missing-field-initializers"])
        .args(["examples/c/turntable.cpp", "-o"])
        .arg(&program)
        .args(static_flags)
        .arg("-lvulkan"));
    let frame = prefix.join("frame");
    let times =
        run_validated(Command::new(&program).arg("assets/spot.glb").arg(&frame).args([&SIZE.to_string(), "8", "2"]));
    assert!(times.contains("accumulate ") && times.contains("resolve "), "{times}");
    let frames = [0, 1].map(|number| Image::read(prefix.join(format!("frame{number}.exr"))).expect("it was written"));
    assert!(frames[0].channel("R") != frames[1].channel("R"));
    // The second from behind, in marble: as a renderer that was made for it has it.
    let mut scene = Scene::load("assets/spot.glb").expect("the asset");
    scene.set_environment(Environment::constant(DVec3::ONE).expect("a radiance")).expect("an environment");
    let marble = Material { roughness: 0.3, base_color: DVec3::ZERO, ..Material::from_preset("marble").expect("one") };
    scene.set_material(0, marble).expect("translucent, too");
    let lens = Lens::Perspective { yfov: 0.6, aspect: None };
    let eye = 0.35 * DVec3::new(PI.sin(), 0.0, PI.cos());
    scene.set_cameras(vec![Camera::new("behind", eye, -eye, DVec3::Y, lens)]).expect("a camera");
    let settings = Settings { resolution: Some((SIZE, SIZE)), model: Model::Burley, ..Settings::default() };
    let device = translucent::Device::open(&Default::default()).expect("a device");
    let mut renderer = Renderer::new(&device, &scene, &settings).expect("a renderer");
    renderer.render(8).expect("a render");
    let expected = renderer.image().expect("an image");
    for name in ["R", "G", "B"] {
        assert!(frames[1].channel(name).is_some() && frames[1].channel(name) == expected.channel(name), "{name}");
    }
    for frame in frames {
        assert!(frame.channel("A").is_some_and(|alpha| alpha.iter().sum::<f32>() > 10.0));
        assert_eq!(frame.channel("samples.Y").map(|samples| samples[0]), Some(8.0));
    }
}

#[test]
fn the_example_in_rust_renders_the_same_image() {
    let prefix = installed("rust");
    let image = prefix.join("spot.exr");
    let program = Path::new(env!("CARGO_TARGET_TMPDIR")).join("../debug/examples/embed");
    let said = run_validated(Command::new(program).arg("assets/spot.glb").arg(&image).args([&SIZE.to_string(), "10"]));
    assert!(said.starts_with("10 samples in 3 submissions"), "{said}");
    let (found, expected) = (Image::read(&image).expect("the example wrote it"), expected(10));
    for name in ["R", "G", "B", "A"] {
        assert_eq!(found.channel(name), expected.channel(name));
    }
}

#[test]
fn misuse_is_an_error_with_a_reason() {
    let prefix = installed("misuse");
    let program = prefix.join("misuse");
    run(Command::new("cc")
        .args(["-std=c11", "-Wall", "-Wextra", "-Werror", "tests/embed/misuse.c", "-o"])
        .arg(&program)
        .args(flags(&prefix, &["--cflags", "--libs"])));
    let version = run(Command::new(&program).env("LD_LIBRARY_PATH", prefix.join("lib")));
    assert_eq!(version.trim(), env!("CARGO_PKG_VERSION"));
}

#[test]
fn cmake_finds_the_installation() {
    if Command::new("cmake").arg("--version").output().is_err() {
        println!("skipped: there is no cmake");
        return;
    }
    let prefix = installed("cmake");
    let source = prefix.join("source");
    fs::create_dir_all(&source).expect("a folder");
    let example = fs::canonicalize("examples/c/spot.c").expect("it is in the repository");
    let project = format!(
        "cmake_minimum_required(VERSION 3.16)\nproject(spot C)\nfind_package(translucent REQUIRED)\n\
         find_package(Vulkan REQUIRED)\nadd_executable(spot {0})\nadd_executable(spot-static {0})\n\
         target_link_libraries(spot translucent::translucent Vulkan::Vulkan)\n\
         target_link_libraries(spot-static translucent::static Vulkan::Vulkan)\n",
        example.display()
    );
    fs::write(source.join("CMakeLists.txt"), project).expect("a file");
    let (prefix_option, build) = (format!("-DCMAKE_PREFIX_PATH={}", prefix.display()), prefix.join("build"));
    run(Command::new("cmake").arg("-S").arg(&source).arg("-B").arg(&build).arg(prefix_option));
    run(Command::new("cmake").arg("--build").arg(&build));
    for program in ["spot", "spot-static"] {
        let output = Command::new(build.join(program)).output().expect("it starts");
        assert_eq!(output.status.code(), Some(2), "{program} without arguments shows its usage");
    }
}
