//! Textures and scattering colours from the command line: what is refused, and what a colour means.

use crate::{
    Folder,
    scenes::{Eye, Mesh, gltf},
    stderr,
};
use base64::Engine;
use glam::{DVec2, DVec3};
use serde_json::{Value, json};
use std::fs;
use translucent::reference::{
    boundary::transmittance,
    profile::{Dipole, Radial},
};

/// A square block, seen from above, of a material.
fn block(material: Value) -> Value {
    let mut mesh = Mesh::default();
    mesh.cuboid(DVec3::splat(-200.0), DVec3::new(200.0, 200.0, 0.0), 1);
    let eye = Eye { eye: DVec3::new(1.0, 2.0, 10.0), at: DVec3::new(1.0, 2.0, 0.0), lens: 0.02 };
    gltf(&[(mesh, 0)], &[material], &[], &eye)
}

#[test]
fn pictures_that_cannot_be_read_are_named() {
    let folder = Folder::new("pictures");
    let mut file = block(json!({"name": "skin", "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}));
    let count = file["accessors"][0]["count"].as_u64().expect("a number") as usize;
    let bytes: Vec<u8> = bytemuck::cast_slice(&vec![DVec2::ZERO.as_vec2(); count]).to_vec();
    let uri = base64::engine::general_purpose::STANDARD.encode(&bytes);
    let mut push = |list: &str, item: Value| {
        let list = file[list].as_array_mut().expect("a list");
        list.push(item);
        list.len() - 1
    };
    let buffer = push(
        "buffers",
        json!({"uri": format!("data:application/octet-stream;base64,{uri}"), "byteLength": bytes.len()}),
    );
    let view = push("bufferViews", json!({"buffer": buffer, "byteLength": bytes.len()}));
    let accessor =
        push("accessors", json!({"bufferView": view, "componentType": 5126, "count": count, "type": "VEC2"}));
    file["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_0"] = json!(accessor);
    file["textures"] = json!([{"source": 0}]);
    let png = b"\x89PNG\r\n\x1a\n";
    for (name, content, problem) in [
        ("missing.png", None, "images[0].uri: missing.png: "),
        (
            "corrupt.png",
            Some([&png[..], b"and no more of it that makes sense"].concat()),
            "images[0]: cannot be decoded",
        ),
        ("short.jpg", Some(b"\xff\xd8\xff\xe0\x00\x10JFIF".to_vec()), "images[0]: cannot be decoded"),
        ("text.png", Some(b"no picture".to_vec()), "images[0]: is neither PNG nor JPEG"),
        ("map.bmp", Some([&b"BM"[..], &[0; 60]].concat()), "images[0]: is neither PNG nor JPEG"),
        ("map.webp", Some(b"RIFF\x24\0\0\0WEBPVP8 ".to_vec()), "images[0]: is WebP, which is not supported"),
        ("map.ktx2", Some(b"\xabKTX 20\xbb\r\n\x1a\n".to_vec()), "images[0]: is KTX, which is not supported"),
    ] {
        if let Some(content) = content {
            fs::write(folder.join(name), content).expect("written");
        }
        file["images"] = json!([{"uri": name}]);
        fs::write(folder.join("scene.gltf"), file.to_string()).expect("written");
        let output = folder.run("render scene.gltf --resolution 4x4 --samples 1 -o out.exr");
        let message = stderr(&output);
        assert_eq!(output.status.code(), Some(2), "{name}: {message}");
        assert!(message.starts_with("error: scene.gltf: ") && message.contains(problem), "{name}: {message}");
        assert!(!folder.join("out.exr").exists(), "{name}");
    }
}

#[test]
fn the_albedo_mapping_says_what_a_scattering_colour_is() {
    let folder = Folder::new("mapping");
    let (colour, ior) = (0.6f64, 1.3);
    let e = (-1f64).exp();
    let material = json!({"pbrMetallicRoughness": {"roughnessFactor": 0.0, "metallicFactor": 0.0}, "extensions": {
        "KHR_materials_transmission": {"transmissionFactor": 1},
        "KHR_materials_volume": {"thicknessFactor": 1, "attenuationDistance": 1, "attenuationColor": [e, e, e]},
        "KHR_materials_ior": {"ior": ior},
        "KHR_materials_scatter": {"scatterStrengthFactor": 1, "multiscatterColorFactor": [colour, colour, colour]}}});
    fs::write(folder.join("scene.gltf"), block(material).to_string()).expect("written");
    // The drafts' albedo is that of matter without a boundary.
    let s = 4.09712 + 4.20863 * colour - (9.59217 + 41.6808 * colour + 17.7126 * colour * colour).sqrt();
    let drafts = Dipole::new(1.0 - s * s, s * s, ior).total();
    assert!(drafts < 0.75 * colour, "the two differ");
    for (options, total) in [("", drafts), (" --albedo-mapping gltf", drafts), (" --albedo-mapping surface", colour)] {
        let render = "render scene.gltf --model standard --single-scattering off --environment constant:1,1,1 \
            --resolution 4x4 --reuse 1 --samples 256 --quiet -o out.exr";
        folder.done(&format!("{render}{options}"));
        let image = folder.image("out.exr");
        let values: Vec<f64> = image.channel("subsurface.G").expect("light").iter().map(|x| f64::from(*x)).collect();
        let mean = values.iter().sum::<f64>() / 16.0;
        let variance = values.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / 15.0;
        let (error, expected) = ((variance / 16.0).sqrt(), transmittance(ior, 1.0) * total);
        // Six digits of the drafts' constants; the light beyond the ball.
        assert!(
            (mean - expected).abs() < 4.0 * error + 2e-5 * expected,
            "{options}: {mean} +- {error}, not {expected}"
        );
        assert!(error < 0.02 * expected, "{options}: {error}");
    }
    let output = folder.run("render scene.gltf --albedo-mapping other");
    assert_eq!(output.status.code(), Some(2), "{}", stderr(&output));
}
