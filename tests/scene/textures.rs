//! Textures: what references, samplers, transforms and pictures become, and what is said of broken ones.

use crate::build::*;
use glam::{DVec3, Vec2};
use image::{DynamicImage, ImageFormat, Rgba, RgbaImage};
use serde_json::{Value, json};
use std::io::Cursor;
use translucent::scene::{AlbedoMapping, LoadOptions, Picture, Scene, Texture, Wrap};
use translucent::shared::*;

/// A picture of 3 x 2 texels, no two alike.
pub fn picture() -> RgbaImage {
    RgbaImage::from_fn(3, 2, |x, y| Rgba([(80 * x) as u8, (100 * y) as u8, (10 + x + y) as u8, (255 - 40 * x) as u8]))
}

pub fn encoded(picture: &RgbaImage, format: ImageFormat) -> Vec<u8> {
    let mut bytes = Cursor::new(Vec::new());
    let picture = DynamicImage::from(picture.clone());
    let picture = if format == ImageFormat::Jpeg { picture.to_rgb8().into() } else { picture };
    picture.write_to(&mut bytes, format).expect("a picture in memory");
    bytes.into_inner()
}

/// Texture coordinates of the tetrahedron's vertices.
const UV: [[f32; 2]; 4] = [[0.0, 0.0], [1.0, 0.25], [0.5, 0.75], [-1.5, 2.0]];

/// The tetrahedron with texture coordinates, this material, and one texture of a picture.
fn textured(material: Value) -> Value {
    let mut json = with_material(material);
    push_bytes(&mut json, bytemuck::cast_slice(&UV), 5126, 4, "VEC2");
    json["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_0"] = json!(2);
    json["textures"] = json!([{"source": 0}]);
    json["images"] = json!([{"uri": data_uri(&encoded(&picture(), ImageFormat::Png))}]);
    json
}

fn colored() -> Value {
    textured(json!({"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}))
}

fn texture(scene: &Scene, kind: u32) -> Texture {
    scene.materials[0].textures[kind as usize].expect("a texture of this kind")
}

fn texels(picture: &RgbaImage) -> Vec<u32> {
    picture.pixels().map(|pixel| u32::from_le_bytes(pixel.0)).collect()
}

#[test]
fn pictures_from_uris_views_and_files() {
    let expected = Picture { width: 3, height: 2, texels: texels(&picture()) };
    let scene = load(&colored());
    assert_eq!(scene.warnings, Vec::<String>::new());
    assert_eq!(scene.pictures, std::slice::from_ref(&expected));
    assert_eq!(texture(&scene, TEXTURE_BASE_COLOR), Texture::default());

    let png = encoded(&picture(), ImageFormat::Png);
    let mut in_view = colored();
    push_bytes(&mut in_view, &png, 5121, 1, "SCALAR");
    in_view["images"][0] = json!({"bufferView": 3, "mimeType": "image/png"});
    assert_eq!(load(&in_view).pictures, std::slice::from_ref(&expected));

    let folder = std::env::temp_dir().join(format!("translucent-textures-{}", std::process::id()));
    std::fs::create_dir_all(&folder).expect("a temporary folder");
    std::fs::write(folder.join("a picture.png"), &png).expect("a temporary file");
    let mut beside = colored();
    beside["images"][0] = json!({"uri": "a%20picture.png"});
    let found = Scene::from_bytes(folder.join("x.gltf"), beside.to_string().as_bytes(), &LoadOptions::default());
    std::fs::remove_dir_all(&folder).expect("our own folder");
    assert_eq!(found.expect("the picture lies beside the file").pictures, [expected]);

    // JPEG, whose smooth texels it keeps within a few steps; 16 bits are rounded.
    let grey = RgbaImage::from_pixel(16, 16, Rgba([200, 100, 50, 255]));
    let mut jpeg = colored();
    jpeg["images"][0]["uri"] = json!(data_uri(&encoded(&grey, ImageFormat::Jpeg)));
    let read = load(&jpeg).pictures[0].texels[37].to_le_bytes();
    assert!([200, 100, 50, 255].iter().zip(read).all(|(a, b): (&i32, u8)| (a - i32::from(b)).abs() <= 3), "{read:?}");
    let deep = image::ImageBuffer::<image::Luma<u16>, _>::from_pixel(2, 2, image::Luma([0x1234]));
    let mut bytes = Cursor::new(Vec::new());
    DynamicImage::from(deep).write_to(&mut bytes, ImageFormat::Png).expect("a picture in memory");
    let mut sixteen = colored();
    sixteen["images"][0]["uri"] = json!(data_uri(bytes.get_ref()));
    assert_eq!(load(&sixteen).pictures[0].texels[0].to_le_bytes(), [0x12, 0x12, 0x12, 255]);

    // What no triangle shows is not decoded.
    let mut unused = colored();
    unused["images"].as_array_mut().expect("images").push(json!({"uri": "nowhere.png"}));
    unused["textures"].as_array_mut().expect("textures").push(json!({"source": 1}));
    unused["materials"].as_array_mut().expect("materials").push(json!({"normalTexture": {"index": 1}}));
    assert_eq!(load(&unused).pictures.len(), 1);
}

#[test]
fn samplers_and_transforms() {
    let mut json = colored();
    json["samplers"] = json!([{"wrapS": 33071, "wrapT": 33648, "magFilter": 9728, "minFilter": 9987}]);
    json["textures"][0]["sampler"] = json!(0);
    json["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"]["extensions"] = json!({
        "KHR_texture_transform": {"offset": [0.25, -0.5], "rotation": 0.3, "scale": [2, 3], "texCoord": 1}});
    let attributes = &mut json["meshes"][0]["primitives"][0]["attributes"];
    attributes["TEXCOORD_1"] = attributes["TEXCOORD_0"].take();
    attributes.as_object_mut().expect("an object").remove("TEXCOORD_0");
    let scene = load(&json);
    assert_eq!(scene.warnings, Vec::<String>::new());
    let found = texture(&scene, TEXTURE_BASE_COLOR);
    assert_eq!((found.wrap, found.nearest, found.set), ([Wrap::Clamp, Wrap::Mirror], true, 1));
    // The extension's example: scaled, turned counter-clockwise, then moved.
    let (sin, cos) = 0.3f64.sin_cos();
    for [u, v] in [[0.0, 0.0], [1.0, 0.0], [0.3, 0.8]] {
        let [x, y] = [2.0 * u, 3.0 * v];
        let expected = [cos * x + sin * y + 0.25, -sin * x + cos * y - 0.5];
        for (row, expected) in found.rows.iter().zip(expected) {
            assert!((row.dot(DVec3::new(u, v, 1.0)) - expected).abs() < 1e-15);
        }
    }
    for (triangle, coordinates) in metres(&scene).iter().zip(&scene.coordinates) {
        for (corner, uv) in triangle.iter().zip(&coordinates.uv[3..]) {
            let vertex = CORNERS.iter().position(|c| DVec3::from_array(c.map(f64::from)).distance(*corner) < 1e-6);
            assert_eq!(*uv, Vec2::from(UV[vertex.expect("one of the vertices")]));
        }
        assert_eq!(coordinates.uv[..3], [Vec2::ZERO; 3]);
    }
}

#[test]
fn coordinates_may_be_normalised_integers() {
    for (component, bytes) in [
        (5121, vec![0u8, 255, 51, 102, 0, 0, 255, 255]),
        (5123, [0u16, 65535, 13107, 26214, 0, 0, 65535, 65535].iter().flat_map(|v| v.to_le_bytes()).collect()),
    ] {
        let mut json = colored();
        push_bytes(&mut json, &bytes, component, 4, "VEC2");
        json["accessors"][3]["normalized"] = json!(true);
        json["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_0"] = json!(3);
        let scene = load(&json);
        let uv = |vertex: usize| {
            let corner = DVec3::from_array(CORNERS[vertex].map(f64::from));
            let all = metres(&scene).into_iter().zip(&scene.coordinates);
            let found = all.flat_map(|(t, c)| [0, 1, 2].map(|i| (t[i], c.uv[i])));
            found.into_iter().find(|(at, _)| at.distance(corner) < 1e-6).expect("a vertex").1
        };
        assert_eq!([uv(0), uv(1), uv(3)], [Vec2::new(0.0, 1.0), Vec2::new(0.2, 0.4), Vec2::ONE]);
    }
}

#[test]
fn every_kind_has_its_place() {
    let scatter = |name: &str, members: Value| {
        let mut scatter = json!({"multiscatterColorFactor": [0.8, 0.6, 0.5], "multiscatterColorTexture": {"index": 0}});
        for (key, value) in members.as_object().expect("an object") {
            scatter[key] = value.clone();
        }
        textured(json!({
            "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}, "metallicRoughnessTexture": {"index": 0},
                "baseColorFactor": [1, 1, 1, 0.5]},
            "normalTexture": {"index": 0, "scale": 0.5}, "emissiveTexture": {"index": 0}, "alphaMode": "MASK",
            "alphaCutoff": 0.25,
            "extensions": {"KHR_materials_transmission": {"transmissionFactor": 1}, name: scatter,
                "KHR_materials_volume": {"thicknessFactor": 1, "attenuationDistance": 0.1,
                    "attenuationColor": [0.1, 0.2, 0.3]}}
        }))
    };
    let found = load(&scatter(
        "KHR_materials_scatter",
        json!({"scatterStrengthFactor": 0.5,
        "scatterStrengthTexture": {"index": 0}}),
    ));
    assert_eq!(found.warnings, Vec::<String>::new());
    assert!(found.materials[0].textures.iter().all(Option::is_some));
    assert_eq!((texture(&found, TEXTURE_NORMAL).scale, texture(&found, TEXTURE_ALPHA).scale), (0.5, 2.0));
    let volume = load(&scatter("KHR_materials_volume_scatter", json!({})));
    let material = &volume.materials[0];
    assert!(material.textures[TEXTURE_SCATTER_STRENGTH as usize].is_none() && material.tinted);
    // The ramp ends at the material's own medium.
    assert_eq!(material.ramp.len(), RAMP as usize + 1);
    assert_eq!(material.ramp.last(), material.medium.as_ref());
    let halfway = load(&scatter("KHR_materials_volume_scatter", json!({"multiscatterColorFactor": [0.4, 0.3, 0.25]})));
    let (a, b) = (&material.ramp[RAMP as usize / 2], halfway.materials[0].medium.as_ref().expect("a medium"));
    assert!((a.sigma_a - b.sigma_a).abs().max_element() < 1e-9 * b.sigma_a.max_element());

    // A medium with a colour of its own is not tinted.
    let preset = load(&textured(json!({"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}},
        "extras": {"bssrdf": {"preset": "skin1"}}})));
    assert!(preset.materials[0].textures.iter().all(Option::is_none));
    assert_eq!((preset.pictures.len(), preset.coordinates.len()), (0, 0));
    assert!(preset.warnings[0].contains("preset skin1 brings the colour of the matter"), "{:?}", preset.warnings);
}

#[test]
fn masks_without_a_texture_hide_or_show_the_whole() {
    let mut json = colored();
    let primitive = json!({"attributes": {"POSITION": 0}, "indices": 1, "material": 1});
    json["meshes"][0]["primitives"].as_array_mut().expect("primitives").push(primitive);
    for (mask, triangles) in [
        (json!({"alphaMode": "MASK", "pbrMetallicRoughness": {"baseColorFactor": [1, 1, 1, 0.4]}}), 4),
        (json!({"alphaMode": "MASK", "pbrMetallicRoughness": {"baseColorFactor": [1, 1, 1, 0.5]}}), 8),
        (json!({"alphaMode": "MASK", "alphaCutoff": 0}), 8),
        (json!({"alphaMode": "MASK", "alphaCutoff": 1.5}), 4),
    ] {
        json["materials"].as_array_mut().expect("materials").truncate(1);
        json["materials"].as_array_mut().expect("materials").push(mask.clone());
        assert_eq!(load(&json).triangles.len(), triangles, "{mask}");
    }
}

#[test]
fn tangents_point_along_u_and_up_the_picture() {
    // One triangle in z = 0 whose u runs along +x and whose v runs along -y: up the picture is +y.
    let flat = |uv: [[f32; 2]; 3], node: Value, tangents: Option<[[f32; 4]; 3]>| {
        let mut json = with_bytes(&[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], &[0, 1, 2]);
        json["materials"][0] = json!({"normalTexture": {"index": 0}});
        json["textures"] = json!([{"source": 0}]);
        json["images"] = json!([{"uri": data_uri(&encoded(&picture(), ImageFormat::Png))}]);
        push_bytes(&mut json, bytemuck::cast_slice(&uv), 5126, 3, "VEC2");
        json["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_0"] = json!(2);
        if let Some(tangents) = tangents {
            push_bytes(&mut json, bytemuck::cast_slice(&tangents), 5126, 3, "VEC4");
            json["meshes"][0]["primitives"][0]["attributes"]["TANGENT"] = json!(3);
        }
        json["nodes"][0] = node;
        let scene = load(&json);
        let (c, t) = (scene.coordinates[0], scene.triangles[0]);
        let [_, edge1, edge2] = t.corner_and_edges();
        let normal = edge1.cross(edge2).normalize().as_vec3();
        (c.tangent[1], c.handedness * normal.cross(c.tangent[1]))
    };
    let (x, y) = (glam::Vec3::X, glam::Vec3::Y);
    let close = |(a, b): (glam::Vec3, glam::Vec3), c: glam::Vec3, d: glam::Vec3| {
        assert!(a.distance(c) < 1e-6 && b.distance(d) < 1e-6, "{a} {b}, not {c} {d}");
    };
    let upright = [[0.0, 1.0], [1.0, 1.0], [0.0, 0.0]];
    let plain = json!({"mesh": 0});
    close(flat(upright, plain.clone(), None), x, y);
    // The picture seen from behind, and turned by a quarter.
    close(flat([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]], plain.clone(), None), x, -y);
    close(flat([[0.0, 0.0], [0.0, 1.0], [1.0, 0.0]], plain.clone(), None), y, -x);
    let mirrored = json!({"mesh": 0, "scale": [-2, 1, 1]});
    close(flat(upright, mirrored.clone(), None), -x, y);
    close(flat([[0.0, 0.0]; 3], plain.clone(), None), glam::Vec3::ZERO, glam::Vec3::ZERO);
    // Authored ones win, and their handedness follows a mirror.
    let authored = Some([[0.6, 0.8, 0.0, -1.0]; 3]);
    let (a, b) = (glam::Vec3::new(0.6, 0.8, 0.0), glam::Vec3::new(0.8, -0.6, 0.0));
    close(flat(upright, plain, authored), a, b);
    let (a, b) = flat(upright, mirrored, Some([[1.0, 0.0, 0.0, 1.0]; 3]));
    close((a, b), -x, y);
}

#[test]
fn hostile_pictures_are_refused_by_name() {
    let refused = |picture: Value, problem: &str| {
        let mut json = colored();
        json["images"][0] = picture;
        let message = refusal(&json);
        assert!(message.starts_with("test.gltf: images[0]"), "{message}");
        assert!(message.contains(problem) && message.len() < 500, "{message} should say {problem}");
    };
    let uri = |bytes: &[u8]| json!({"uri": data_uri(bytes)});
    let png = encoded(&picture(), ImageFormat::Png);
    let jpeg = encoded(&picture(), ImageFormat::Jpeg);
    refused(uri(b""), "is neither PNG nor JPEG");
    refused(uri(b"BM not a bitmap"), "is neither PNG nor JPEG");
    refused(uri(&[&b"\xabKTX 20\xbb\r\n\x1a\n"[..], &[0; 64]].concat()), "gltf-transform ktxdecompress");
    refused(uri(b"RIFF\x10\0\0\0WEBPVP8 ................"), "is WebP, which is not supported: convert it to PNG");
    refused(uri(&png[..png.len() / 2]), "cannot be decoded");
    refused(uri(&jpeg[..20]), "cannot be decoded");
    refused(json!({}), "has neither `uri` nor `bufferView`");
    refused(json!({"bufferView": 9}), "is 9, but `bufferViews` holds 3");
    refused(json!({"uri": "no/such.png"}), "no/such.png");
    refused(json!({"uri": "src"}), "is not a regular file");
    // Sizes that only a header claims.
    let mut huge = png.clone();
    for (width, height, problem) in [
        (0x7fff_ffffu32, 0x7fff_ffffu32, "cannot be decoded"),
        (32_768, 32_768, "texels are read"),
        (8192, 8192, "cannot hold"),
    ] {
        huge[16..20].copy_from_slice(&width.to_be_bytes());
        huge[20..24].copy_from_slice(&height.to_be_bytes());
        let crc = crc32(&huge[12..29]);
        huge[29..33].copy_from_slice(&crc.to_be_bytes());
        refused(uri(&huge), problem);
    }
    // Whatever is changed in them.
    let mut numbers = Numbers(5);
    for bytes in [png, jpeg] {
        for _ in 0..300 {
            let mut broken = bytes.clone();
            for _ in 0..1 + numbers.below(4) {
                let place = numbers.below(broken.len());
                broken[place] = numbers.next() as u8;
            }
            let mut json = colored();
            json["images"][0] = uri(&broken);
            match load_with(&json, &LoadOptions::default()) {
                Ok(scene) => assert!(scene.pictures[0].texels.len() <= 1 << 26),
                Err(error) => assert!(error.is_input() && error.to_string().len() < 500, "{error}"),
            }
        }
    }
}

/// Checksum of a PNG chunk.
fn crc32(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0u32, |crc, byte| {
        (0..8).fold(crc ^ u32::from(*byte), |crc, _| if crc & 1 == 1 { crc >> 1 ^ 0xedb8_8320 } else { crc >> 1 })
    })
}

#[test]
fn broken_references_are_refused_by_name() {
    let base = "materials[0] (matter).pbrMetallicRoughness.baseColorTexture";
    let table = [
        ("/textures/0", json!({}), "textures[0]", "has no `source`"),
        ("/textures/0/source", json!(1), "textures[0].source", "is 1, but `images` holds 1"),
        ("/textures/0/sampler", json!(0), "textures[0].sampler", "but `samplers` holds 0"),
        (
            "/textures/0",
            json!({"extensions": {"KHR_texture_basisu": {"source": 0}}}),
            "textures[0]",
            "has a picture of KHR_texture_basisu alone, which is not supported: convert it with `gltf-transform ktx",
        ),
        (
            "/textures/0",
            json!({"extensions": {"EXT_texture_webp": {"source": 0}}}),
            "textures[0]",
            "has a picture of EXT_texture_webp alone",
        ),
        ("/materials/0/pbrMetallicRoughness/baseColorTexture", json!({}), base, "has no `index`"),
        ("/materials/0/pbrMetallicRoughness/baseColorTexture/index", json!(3), &format!("{base}.index"), "is 3"),
        (
            "/materials/0/pbrMetallicRoughness/baseColorTexture/texCoord",
            json!(2),
            &format!("{base}.texCoord"),
            "is 2; TEXCOORD_0 and TEXCOORD_1 are read",
        ),
        (
            "/materials/0/pbrMetallicRoughness/baseColorTexture/extensions",
            json!({"KHR_texture_transform": {"scale": [1, 1e9]}}),
            &format!("{base}.extensions.KHR_texture_transform.scale[1]"),
            "must be from",
        ),
        ("/samplers", json!([{"wrapS": 7}]), "samplers[0].wrapS", "must be 10497, 33071 or 33648, is 7"),
        ("/samplers", json!([{"magFilter": 9987}]), "samplers[0].magFilter", "must be 9728 or 9729"),
        ("/samplers", json!([{"minFilter": 1}]), "samplers[0].minFilter", "1 is no filter"),
        ("/accessors/2/count", json!(3), "meshes[0] (tetrahedron).primitives[0]", "has 3 TEXCOORD_0 for 4 positions"),
        ("/accessors/2/type", json!("VEC3"), "accessors[2].type", "must be VEC2"),
        ("/materials/0/alphaCutoff", json!(-1), "materials[0] (matter).alphaCutoff", "must be at least 0"),
    ];
    for (pointer, value, item, problem) in table {
        let mut json = colored();
        json["materials"][0]["alphaMode"] = json!("MASK");
        let (parent, key) = pointer.rsplit_once('/').expect("a pointer");
        match json.pointer_mut(parent).expect("a place in the file") {
            Value::Array(items) => items[key.parse::<usize>().expect("an index")] = value,
            other => other[key] = value,
        }
        if pointer == "/samplers" {
            json["textures"][0]["sampler"] = json!(0);
        }
        let message = refusal(&json);
        assert!(message.starts_with(&format!("test.gltf: {item}: ")) && message.contains(problem), "{message}");
    }
    // A picture of the core beside one that is not read.
    let mut both = colored();
    both["textures"][0]["extensions"] = json!({"KHR_texture_basisu": {"source": 7}});
    assert_eq!(load(&both).pictures.len(), 1);
    let mut bare = colored();
    bare["meshes"][0]["primitives"][0]["attributes"] = json!({"POSITION": 0});
    assert!(load(&bare).warnings[0].contains("has no TEXCOORD_0, so its textures show one texel"));
}

#[test]
fn the_hash_knows_textures() {
    let hash = |change: &dyn Fn(&mut Value)| {
        let mut json = colored();
        change(&mut json);
        load(&json).hash
    };
    let plain = hash(&|_| {});
    assert_eq!(plain, hash(&|_| {}));
    let mut other = picture();
    other.put_pixel(2, 1, Rgba([1, 2, 3, 4]));
    let changed = [
        hash(&|json| json["images"][0]["uri"] = json!(data_uri(&encoded(&other, ImageFormat::Png)))),
        hash(&|json| {
            json["samplers"] = json!([{"magFilter": 9728}]);
            json["textures"][0]["sampler"] = json!(0);
        }),
        hash(&|json| json["accessors"][2]["byteOffset"] = json!(0)),
        hash(&|json| {
            let texture = json["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"].take();
            json["materials"][0]["emissiveTexture"] = texture;
            json["materials"][0]["pbrMetallicRoughness"] = json!({});
        }),
    ];
    assert_eq!(changed[2], plain, "the same said otherwise");
    assert!([0, 1, 3].iter().all(|&i| changed[i] != plain) && changed[0] != changed[1]);
}

#[test]
fn the_colour_that_is_seen() {
    // Whatever the anisotropy, the total of the dipole is the colour.
    for name in ["KHR_materials_scatter", "KHR_materials_volume_scatter"] {
        for (rho, g) in [([0.8, 0.5, 0.1], 0.0), ([0.999, 0.3, 0.01], 0.7), ([1.0, 0.6, 0.2], -0.9)] {
            let json = with_material(json!({"extensions": {
                "KHR_materials_transmission": {"transmissionFactor": 1},
                "KHR_materials_volume": {"thicknessFactor": 1, "attenuationDistance": 0.01,
                    "attenuationColor": [0.1, 0.2, 0.3]},
                "KHR_materials_ior": {"ior": 1.4},
                name: {"multiscatterColorFactor": rho, "scatterStrengthFactor": 1, "scatterAnisotropy": g}
            }}));
            let options = LoadOptions { albedo_mapping: AlbedoMapping::Surface, ..LoadOptions::default() };
            let medium = load_with(&json, &options).expect("a scene").materials[0].medium.clone().expect("a medium");
            for c in 0..3 {
                let alpha = medium.sigma_s_prime[c] / (medium.sigma_s_prime[c] + medium.sigma_a[c]);
                let total = crate::materials::dipole_total(alpha, 1.4);
                assert!((total - rho[c]).abs() < 1e-9, "{name} {g}: {total} for {}", rho[c]);
                // The extinction is what the volume says: sigma_s = sigma_s' / (1 - g).
                let sigma_t = -[0.1f64, 0.2, 0.3][c].ln() / 0.01;
                let found = medium.sigma_s_prime[c] / (1.0 - g) + medium.sigma_a[c];
                assert!((found / sigma_t - 1.0).abs() < 1e-12, "{found} {sigma_t}");
            }
        }
    }
}
