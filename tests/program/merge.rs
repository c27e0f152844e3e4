//! `merge` through the program: parts of a render make the render; what does not belong together is refused.

use crate::{Folder, integer, stderr};
use std::fs;

const SMALL: &str = "render SPOT --resolution 20x16";

#[test]
fn consecutive_parts_make_the_whole_in_any_order() {
    let folder = Folder::new("parts");
    folder.done(&format!("{SMALL} --samples 3:40 -o whole.exr"));
    for (range, name) in [("3:11", "a"), ("11:30", "b"), ("30:40", "c")] {
        folder.done(&format!("{SMALL} --samples {range} -o {name}.exr"));
    }
    let summary = folder.done("merge b.exr c.exr a.exr -o merged.exr");
    assert_eq!(summary, "merged.exr: 20x16, 37 samples of 3 parts\n");
    folder.done("merge c.exr b.exr a.exr -o again.exr");
    assert!(
        fs::read(folder.join("merged.exr")).expect("written") == fs::read(folder.join("again.exr")).expect("written")
    );

    let (whole, merged) = (folder.image("whole.exr"), folder.image("merged.exr"));
    for name in ["samples", "sampleBegin", "sampleEnd", "invalidSamples"] {
        assert_eq!(integer(&merged, name), integer(&whole, name), "{name}");
    }
    assert_eq!(merged.attributes, whole.attributes);
    for channel in &whole.channels {
        let values = merged.channel(&channel.name).expect("the same channels");
        let layer = channel.name.split('.').next().expect("a name");
        for (merged, whole) in values.iter().zip(&channel.data) {
            match layer {
                // Another estimate of the same variance; checked by statistics elsewhere.
                "variance" => assert!(*merged >= 0.0),
                "N" | "P" | "Z" | "material" | "samples" => assert_eq!(merged, whole, "{}", channel.name),
                // Each mean is one rounded division (2.5 ULP in Vulkan) of a compensated sum of at least 0, and is
                // rounded once more when it is merged: 4 ULP of either, with room for the sums' own last bit.
                _ => {
                    assert!((merged - whole).abs() <= 8.0 * f32::EPSILON * whole, "{}: {merged} {whole}", channel.name)
                }
            }
        }
    }
}

#[test]
fn what_does_not_belong_together_is_refused_with_both_names() {
    let folder = Folder::new("refused");
    for (name, options) in [
        ("first", "--samples 0:8"),
        ("second", "--samples 8:16"),
        ("third", "--samples 16:24"),
        ("overlap", "--samples 4:12"),
        ("seed", "--samples 8:16 --seed 1"),
        ("settings", "--samples 8:16 --projection normal"),
        ("scene", "--samples 8:16 --material wax=skin1"),
        ("environment", "--samples 8:16 --environment constant:1,2,1"),
        ("crop", "--samples 8:16 --crop 0,0,10,10"),
        ("layers", "--samples 8:16 --aov N"),
    ] {
        folder.done(&format!("{SMALL} {options} -o {name}.exr"));
    }
    let before = folder.files();
    for (parts, expected) in [
        ("first overlap", "4:8"),
        ("first first", "0:8"),
        ("first third", "8:16"),
        ("seed first", "seed"),
        ("first settings", "settings"),
        ("first scene", "scene"),
        ("first environment", "scene"),
        ("first crop", "part of the image"),
        ("layers first", "channels"),
        ("first second third overlap", "overlap"),
    ] {
        let files: Vec<String> = parts.split(' ').map(|name| format!("{name}.exr")).collect();
        let output = folder.run(&format!("merge {} -o out.exr", files.join(" ")));
        let message = stderr(&output);
        assert_eq!(output.status.code(), Some(2), "{parts}: {message}");
        assert!(message.contains(expected), "{parts}: {message}");
        assert!(files.iter().filter(|file| message.contains(file.as_str())).count() >= 2, "{parts}: {message}");
        assert_eq!(folder.files(), before, "{parts}");
    }
    let overwrite = folder.run("merge first.exr second.exr -o second.exr");
    assert_eq!(overwrite.status.code(), Some(2));
    assert_eq!(integer(&folder.image("second.exr"), "samples"), 8);
}
