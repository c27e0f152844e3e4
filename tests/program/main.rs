//! The program as a user meets it, and the images that it writes.

mod amber;
mod bench;
mod dump;
mod faults;
mod goals;
mod image;
mod inspect;
mod interrupt;
mod measure;
mod merge;
mod profile;
#[allow(dead_code)]
#[path = "../images/scenes.rs"]
mod scenes;
mod tev;
mod textures;
mod tradeoff;
mod usage;
mod verify;

use std::{
    fs,
    path::{Path, PathBuf},
    process::{Command, Output},
};
use translucent::{Device, Image, image::Attribute, scene::presets};

/// A new empty folder, removed at the end of the test.
pub struct Folder(PathBuf);

impl Folder {
    pub fn new(name: &str) -> Folder {
        let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("program-{}-{name}", std::process::id()));
        let _ = fs::remove_dir_all(&folder);
        fs::create_dir_all(&folder).expect("the build's temporary folder is writable");
        Folder(folder)
    }

    pub fn join(&self, name: &str) -> PathBuf {
        self.0.join(name)
    }

    /// Names of all files in it, hidden ones too.
    pub fn files(&self) -> Vec<String> {
        let entries = fs::read_dir(&self.0).expect("the folder exists");
        let mut names: Vec<_> =
            entries.map(|entry| entry.expect("readable").file_name().to_string_lossy().into_owned()).collect();
        names.sort();
        names
    }

    /// The program with these words, run in this folder; `SPOT` stands for the shipped scene, rendered with the standard
    /// dipole unless the words name a model: it needs no preparation.
    pub fn command(&self, words: &str) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_translucent"));
        let spot = concat!(env!("CARGO_MANIFEST_DIR"), "/assets/spot.glb");
        command
            .current_dir(&self.0)
            .args(words.split_whitespace().map(|word| if word == "SPOT" { spot } else { word }));
        if words.starts_with("render SPOT") && !words.contains("--model") {
            command.args(["--model", "standard"]);
        }
        command
    }

    pub fn run(&self, words: &str) -> Output {
        self.command(words).output().expect("the program starts")
    }

    /// Runs what must succeed; its stdout.
    pub fn done(&self, words: &str) -> String {
        let output = self.run(words);
        assert_eq!(output.status.code(), Some(0), "{words}: {}", stderr(&output));
        String::from_utf8(output.stdout).expect("UTF-8")
    }

    pub fn image(&self, name: &str) -> Image {
        Image::read(self.join(name)).expect("an image that can be read")
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

pub fn stderr(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

pub fn integer(image: &Image, name: &str) -> i32 {
    match image.attributes.get(&format!("translucent.{name}")) {
        Some(Attribute::Integer(value)) => *value,
        other => panic!("attribute {name} is {other:?}"),
    }
}

fn names(image: &Image) -> Vec<&str> {
    image.channels.iter().map(|channel| channel.name.as_str()).collect()
}

const CHANNELS: [&str; 22] = [
    "A",
    "B",
    "G",
    "N.X",
    "N.Y",
    "N.Z",
    "P.X",
    "P.Y",
    "P.Z",
    "R",
    "Z",
    "material.Y",
    "reflection.B",
    "reflection.G",
    "reflection.R",
    "samples.Y",
    "subsurface.B",
    "subsurface.G",
    "subsurface.R",
    "variance.B",
    "variance.G",
    "variance.R",
];

#[test]
fn a_render_has_the_channels_and_attributes_of_the_contract() {
    let folder = Folder::new("contract");
    let summary = folder.done("render SPOT --resolution 32x24 --samples 8 --seed 4000000000 --quiet");
    assert_eq!(summary.lines().count(), 1, "{summary}");
    assert!(summary.starts_with("spot.exr: 32x24, 8 samples, "), "{summary}");
    assert_eq!(folder.files(), ["spot.exr"]);

    let image = folder.image("spot.exr");
    assert_eq!((image.width, image.height, image.origin, image.full), (32, 24, (0, 0), (32, 24)));
    assert_eq!(names(&image), CHANNELS);
    for (name, value) in [("samples", 8), ("sampleBegin", 0), ("sampleEnd", 8), ("invalidSamples", 0)] {
        assert_eq!(integer(&image, name), value, "{name}");
    }
    assert_eq!(image.attributes["translucent.seed"], Attribute::Text("4000000000".into()));
    for name in ["version", "spirvHash", "device", "driver", "sceneHash", "settings"] {
        match image.attributes.get(&format!("translucent.{name}")) {
            Some(Attribute::Text(text)) => assert!(!text.is_empty(), "{name}"),
            other => panic!("{name} is {other:?}"),
        }
    }

    let channel = |name: &str| image.channel(name).expect("it was listed");
    for i in 0..32 * 24 {
        for c in ["R", "G", "B"] {
            let light = channel(&format!("subsurface.{c}"))[i] + channel(&format!("reflection.{c}"))[i];
            assert_eq!(channel(c)[i], light, "{c} is the sum of its parts");
            assert!(light >= 0.0 && channel(&format!("variance.{c}"))[i] >= 0.0);
        }
        assert!((0.0..=1.0).contains(&channel("A")[i]));
        assert!(channel("A")[i] > 0.0 || channel("R")[i] == 0.0, "light without a surface");
        assert_eq!(channel("samples.Y")[i], 8.0);
        let is_hit = channel("material.Y")[i] >= 0.0;
        let normal = ["N.X", "N.Y", "N.Z"].map(|name| channel(name)[i]);
        let length = normal.iter().map(|n| n * n).sum::<f32>().sqrt();
        assert!((length - if is_hit { 1.0 } else { 0.0 }).abs() < 1e-6);
        assert_eq!(channel("Z")[i] > 0.0, is_hit);
    }
    // The default camera frames the scene: something is seen, and something is not.
    assert!(channel("A").contains(&1.0) && channel("A").contains(&0.0));
}

#[test]
fn the_file_is_one_part_of_f32_with_zip_and_its_crop_as_data_window() {
    use exr::{
        meta::{MetaData, attribute::SampleType},
        prelude::{Compression, Vec2},
    };
    let folder = Folder::new("file");
    folder.done("render SPOT --resolution 32x32 --crop 8,4,24,20 --samples 1 -o crop.exr");
    let meta = MetaData::read_from_file(folder.join("crop.exr"), true).expect("a valid file");
    assert_eq!(meta.headers.len(), 1);
    let header = &meta.headers[0];
    assert_eq!(header.compression, Compression::ZIP16);
    assert!(header.channels.list.iter().all(|channel| channel.sample_type == SampleType::F32));
    assert_eq!(header.own_attributes.layer_position, Vec2(8, 4));
    assert_eq!(header.layer_size, Vec2(16, 16));
    assert_eq!(header.shared_attributes.display_window.size, Vec2(32, 32));
    let primaries = header.shared_attributes.chromaticities.expect("they are written");
    assert_eq!((primaries.red, primaries.white), (Vec2(0.64, 0.33), Vec2(0.3127, 0.329)));

    // A crop is the same pixels, but for nothing.
    folder.done("render SPOT --resolution 32x32 --samples 1 -o full.exr");
    let (crop, full) = (folder.image("crop.exr"), folder.image("full.exr"));
    for channel in &crop.channels {
        let whole = full.channel(&channel.name).expect("the same channels");
        for (i, value) in channel.data.iter().enumerate() {
            assert_eq!(*value, whole[(4 + i / 16) * 32 + 8 + i % 16], "{}", channel.name);
        }
    }
}

#[test]
fn the_same_command_gives_the_same_file() {
    let folder = Folder::new("same");
    for name in ["a", "b"] {
        folder.done(&format!("render SPOT --resolution 40x30 --samples 9 --png {name}.png -o {name}.exr"));
    }
    let read = |name: &str| fs::read(folder.join(name)).expect("it was written");
    assert!(read("a.exr") == read("b.exr"));
    assert!(read("a.png") == read("b.png"));
    folder.done("render SPOT --resolution 40x30 --samples 9 --seed 1 -o c.exr");
    assert_ne!(folder.image("a.exr").channel("R"), folder.image("c.exr").channel("R"));
}

#[test]
fn only_the_layers_asked_for_are_written_and_variance_needs_eight_samples() {
    let folder = Folder::new("layers");
    folder.done("render SPOT --resolution 16x16 --samples 8 --aov variance,N -o few.exr");
    assert_eq!(
        names(&folder.image("few.exr")),
        ["A", "B", "G", "N.X", "N.Y", "N.Z", "R", "variance.B", "variance.G", "variance.R"]
    );
    folder.done("render SPOT --resolution 16x16 --samples 7 -o seven.exr");
    let image = folder.image("seven.exr");
    assert_eq!(names(&image), CHANNELS.into_iter().filter(|name| !name.starts_with("variance")).collect::<Vec<_>>());
    assert!(matches!(&image.attributes["translucent.variance"], Attribute::Text(why) if why.contains("fewer than 8")));
}

#[test]
fn a_scene_without_light_is_lit_by_radiance_one_with_a_warning() {
    let folder = Folder::new("light");
    let small = "--resolution 16x16 --samples 2";
    let dark = folder.run(&format!("render SPOT {small} -o default.exr"));
    assert!(stderr(&dark).contains("constant environment of radiance 1"), "{}", stderr(&dark));
    let quiet = folder.run(&format!("render SPOT {small} --quiet -o quiet.exr"));
    assert_eq!((quiet.status.code(), stderr(&quiet)), (Some(0), String::new()));
    folder.done(&format!("render SPOT {small} --environment constant:1,1,1 -o one.exr"));
    assert_eq!(folder.image("default.exr").channels, folder.image("one.exr").channels);

    // Light is linear, and a power of two is exact.
    folder.done(&format!("render SPOT {small} --environment constant:1,1,1 --environment-scale 4 -o four.exr"));
    folder.done(&format!("render SPOT {small} --environment constant:1,1,1 --show-environment -o shown.exr"));
    let (one, four, shown) = (folder.image("one.exr"), folder.image("four.exr"), folder.image("shown.exr"));
    let channel = |image: &Image, name: &str| image.channel(name).expect("contract").to_vec();
    let times_four: Vec<f32> = channel(&one, "G").iter().map(|g| 4.0 * g).collect();
    assert_eq!(channel(&four, "G"), times_four);
    for (i, alpha) in channel(&shown, "A").iter().enumerate() {
        assert_eq!(*alpha, channel(&one, "A")[i]);
        assert!(*alpha > 0.0 || channel(&shown, "G")[i] == 1.0);
    }
}

#[test]
fn the_png_has_the_pixels_of_the_render_and_follows_the_exposure() {
    let folder = Folder::new("png");
    folder.done("render SPOT --resolution 24x16 --samples 4 --png dark.png --exposure -6 -o a.exr");
    folder.done("render SPOT --resolution 24x16 --samples 4 --png bright.png --exposure 0 -o a.exr");
    let open = |name: &str| ::image::open(folder.join(name)).expect("a PNG").into_rgba8();
    let (dark, bright) = (open("dark.png"), open("bright.png"));
    assert_eq!(dark.dimensions(), (24, 16));
    let alpha = folder.image("a.exr").channel("A").expect("contract").to_vec();
    for ((dark, bright), alpha) in dark.pixels().zip(bright.pixels()).zip(alpha) {
        assert_eq!(bright.0[3], (255.0 * alpha).round() as u8);
        assert!((0..3).all(|c| dark.0[c] <= bright.0[c]));
    }
    let sum = |image: &::image::RgbaImage| image.pixels().map(|p| u64::from(p.0[1])).sum::<u64>();
    assert!(2 * sum(&dark) < sum(&bright));
}

#[test]
fn presets_lists_every_material_in_columns() {
    let folder = Folder::new("presets");
    let table = folder.done("presets");
    let lines: Vec<&str> = table.lines().collect();
    assert_eq!(lines.len(), 1 + presets().len());
    for (line, preset) in lines[1..].iter().zip(presets()) {
        let cells: Vec<&str> = line.split_whitespace().collect();
        // Name, index of refraction and five triples.
        assert_eq!((cells.len(), cells[0]), (17, preset.name), "{line}");
        let number = |i: usize| cells[i].parse::<f64>().expect("a number");
        for i in 0..3 {
            // Four digits are shown.
            let near = |shown: f64, exact: f64| (shown - exact).abs() <= 5.001e-4 * exact.abs();
            assert!(near(number(1 + i), preset.sigma_s_prime[i]), "{line}");
            assert!(near(number(4 + i), preset.sigma_a[i]), "{line}");
            assert!(near(number(11 + i), 1.0 / (preset.sigma_s_prime[i] + preset.sigma_a[i])), "{line}");
            assert!((0.0..=1.0).contains(&number(14 + i)), "{line}");
        }
        assert_eq!(number(10), preset.ior);
    }
}

#[test]
fn devices_lists_every_device_and_says_what_is_missing() {
    let folder = Folder::new("devices");
    let table = folder.done("devices");
    for info in Device::list().expect("a driver is installed") {
        let line = table.lines().find(|line| line.contains(&info.uuid)).expect("one line each");
        assert!(line.starts_with(&info.index.to_string()) && line.contains(&info.name), "{line}");
        assert!(line.ends_with(&if info.lacks.is_empty() { "nothing".into() } else { info.lacks.join(", ") }));
    }
    let none = "/no/such/driver.json";
    let output = folder.command("devices").env("VK_DRIVER_FILES", none).env("VK_ICD_FILENAMES", none).output();
    let output = output.expect("the program starts");
    assert_eq!(output.status.code(), Some(1));
    assert!(stderr(&output).contains("mesa-vulkan-drivers"), "{}", stderr(&output));
}

#[test]
fn a_device_is_chosen_by_index() {
    let folder = Folder::new("device");
    let usable = Device::list().expect("a driver").into_iter().find(|info| info.lacks.is_empty()).expect("usable");
    folder.done(&format!("render SPOT --resolution 8x8 --samples 1 --device {} -o a.exr", usable.index));
    assert_eq!(folder.image("a.exr").attributes["translucent.device"], Attribute::Text(usable.name));
}

#[test]
fn a_scene_without_translucent_matter_is_rendered_with_a_warning_that_names_its_materials() {
    let folder = Folder::new("opaque");
    let corners: Vec<u8> =
        [0.0f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0].iter().flat_map(|value| value.to_le_bytes()).collect();
    fs::write(folder.join("corners.bin"), corners).expect("writable");
    let scene = r#"{"asset": {"version": "2.0"}, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
        "materials": [{"name": "chalk"}], "buffers": [{"uri": "corners.bin", "byteLength": 36}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3",
            "min": [0, 0, 0], "max": [1, 1, 0]}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "material": 0}]}]}"#;
    fs::write(folder.join("triangle.gltf"), scene).expect("writable");
    let render = "render triangle.gltf --resolution 8x8 --samples 1 --environment constant:1,1,1";
    let said = |words: &str| {
        let output = folder.run(&format!("{render} {words}"));
        assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
        stderr(&output)
    };
    let warning = said("");
    assert!(warning.contains("translucent") && warning.contains("chalk"), "{warning}");
    assert!(!said("--material chalk=skin1").contains("translucent"));
    assert_eq!(said("--quiet"), "");
}

/// The largest radiance that is accepted: its squares overflow.
#[test]
fn variance_beyond_what_f32_holds_is_written_as_the_largest_number() {
    let folder = Folder::new("bright");
    let output = folder.run("render SPOT --resolution 16x16 --samples 8 --environment constant:1e30,1,1e30 -o a.exr");
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let image = folder.image("a.exr");
    for channel in &image.channels {
        assert!(channel.data.iter().all(|value| value.is_finite()), "{}", channel.name);
    }
    assert!(image.channel("variance.B").expect("contract").contains(&f32::MAX));
    assert_eq!(integer(&image, "invalidSamples"), 0);

    let output = folder.run("render SPOT --resolution 16x16 --environment constant:1e38,1,1 -o b.exr");
    assert_eq!(output.status.code(), Some(2));
    assert!(stderr(&output).contains("1e30 at most"), "{}", stderr(&output));
    assert!(!folder.join("b.exr").exists());
}

#[test]
fn negative_texels_of_an_environment_are_counted_in_a_warning() {
    let folder = Folder::new("negative");
    let texel = |x: usize, y: usize| if (x, y) == (3, 1) { (-0.001f32, 0.0, 0.0) } else { (1.0, 1.0, 1.0) };
    exr::prelude::write_rgb_file(folder.join("light.exr"), 8, 4, texel).expect("writable");
    let output = folder.run("render SPOT --resolution 8x8 --samples 1 --environment light.exr -o a.exr");
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    assert!(stderr(&output).contains("1 texels of negative radiance"), "{}", stderr(&output));
}
