//! Textures: their values at a point of a triangle, and what they make of normals and materials. Twin of
//! `texture.glsl`.
//!
//! # Values
//! glTF 2.0, section 3.8: the coordinates (u, v), after the affine map of KHR_texture_transform, have (0, 0) at the
//! upper left corner of the image and (1, 1) at the lower right one. Texel i covers [i, i + 1] / size; the nearest one
//! is taken, or the four around are interpolated, after decoding. sRGB bytes b decode by IEC 61966-2-1, c = b / 255:
//!
//!   c / 12.92 for c <= 0.04045, else ((c + 0.055) / 1.055)^2.4.
//!
//! Beyond the image, place i of n texels is that of (Vulkan 1.3, "Wrapping Operation")
//!
//!   repeat: i mod n,  clamp: max(0, min(i, n - 1)),  mirror: n - 1 - m((i mod 2n) - n), m(a) = a if a >= 0, else -1 - a.
//!
//! There are no mip maps: a pixel is the mean over its area of samples, each of which takes the texture as it is.
//!
//! # Surface
//! Section 3.9 and appendix B: base colour, emission, metallic (blue) and roughness (green) are products of factor and
//! texture. Where alphaMode is MASK, there is a surface where factor times alpha reaches the cutoff.
//!
//! A normal map holds v = 2 c - 1 in the frame of tangent, bitangent and normal, its x and y times the scale. It turns
//! the shading normal, which is in cosines and Fresnel's terms alone: densities and sides know the geometric one only.
//!
//! # Medium
//! The scatter textures multiply the multi-scatter colour where light enters. The profile of that point is used with
//! the distance, so that S(xi, xo) is not S(xo, xi) where the texture varies: the drafts of the extension say so too.
//! A texture only darkens. Probes are drawn from the profile of the factor alone, and with e = sigma_tr z_r =
//! sqrt(3 (1 - alpha')) rising as the colour falls, f / p of a textured standard dipole is at most
//!
//!   alpha'_l / alpha' max(z_l / z, (z / z_l)^2)
//!
//! times what it is without the texture (index l: the darker medium; for each source (1 + x) e^-x falls with
//! x = sigma_tr d, and sigma_tr d rises). At |g| <= .9 that is below 2.8, and 1 at g = 0.
//!
//! The parameters of the medium as functions of the share of the colour are tabulated along the material's ramp, and
//! interpolated.

use super::Inputs;
use crate::shared::{
    Material, RAMP, TEXTURE_ALPHA, TEXTURE_BASE_COLOR, TEXTURE_EMISSION, TEXTURE_KINDS, TEXTURE_METALLIC_ROUGHNESS,
    TEXTURE_NORMAL, TEXTURE_SCATTER_COLOR, TEXTURE_SCATTER_STRENGTH, Texture, WRAP_CLAMP, WRAP_REPEAT,
};
use glam::{DVec2, DVec3, DVec4, Vec3};

/// Linear value of an sRGB byte.
pub fn decode(byte: u8) -> f64 {
    let c = f64::from(byte) / 255.0;
    if c <= 0.04045 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) }
}

/// Whether any material has a texture of this kind.
pub fn has(inputs: &Inputs, kind: u32) -> bool {
    inputs.features.textures & (1 << kind) != 0
}

/// The texture of this kind of the triangle's material.
fn texture<'a>(inputs: &Inputs<'a>, kind: u32, triangle: u32) -> Option<&'a Texture> {
    if !has(inputs, kind) {
        return None;
    }
    let material = inputs.coordinates[triangle as usize].material;
    let texture = &inputs.textures[(material * TEXTURE_KINDS + kind) as usize];
    (texture.width > 0).then_some(texture)
}

/// The place from 0 to n - 1 that stands for place i.
fn wrap(i: i64, n: i64, mode: u32) -> i64 {
    match mode {
        WRAP_REPEAT => i.rem_euclid(n),
        WRAP_CLAMP => i.clamp(0, n - 1),
        _ => {
            let a = i.rem_euclid(2 * n) - n;
            n - 1 - if a >= 0 { a } else { -1 - a }
        }
    }
}

fn texel(inputs: &Inputs, texture: &Texture, x: i64, y: i64) -> DVec4 {
    let (width, height) = (i64::from(texture.width), i64::from(texture.height));
    let place = wrap(y, height, texture.wrap_v) * width + wrap(x, width, texture.wrap_u);
    let bytes = inputs.texels[texture.offset as usize + place as usize].to_le_bytes();
    let color = |i: usize| if texture.srgb != 0 { decode(bytes[i]) } else { f64::from(bytes[i]) / 255.0 };
    DVec4::new(color(0), color(1), color(2), f64::from(bytes[3]) / 255.0)
}

/// Value of a texture at coordinates of the triangle.
pub fn at(inputs: &Inputs, texture: &Texture, coordinates: DVec2) -> DVec4 {
    let coordinates = coordinates.extend(1.0);
    let x = texture.row_u.as_dvec3().dot(coordinates) * f64::from(texture.width);
    let y = texture.row_v.as_dvec3().dot(coordinates) * f64::from(texture.height);
    if texture.linear == 0 {
        return texel(inputs, texture, x.floor() as i64, y.floor() as i64);
    }
    let (x, y) = (x - 0.5, y - 0.5);
    let (i, j) = (x.floor() as i64, y.floor() as i64);
    let row = |j: i64| texel(inputs, texture, i, j).lerp(texel(inputs, texture, i + 1, j), x - x.floor());
    row(j).lerp(row(j + 1), y - y.floor())
}

/// Value of a texture at a point of a triangle, given by the weights of its second and third vertex.
fn on(inputs: &Inputs, texture: &Texture, triangle: u32, barycentric: DVec2) -> DVec4 {
    let uv = &inputs.coordinates[triangle as usize].uv[3 * texture.set as usize..];
    let [a, b, c] = [uv[0], uv[1], uv[2]].map(|uv| uv.as_dvec2());
    at(inputs, texture, a * (1.0 - barycentric.x - barycentric.y) + b * barycentric.x + c * barycentric.y)
}

/// Value of the triangle's texture of this kind; 1 where its material has none.
pub fn value(inputs: &Inputs, kind: u32, triangle: u32, barycentric: DVec2) -> DVec4 {
    texture(inputs, kind, triangle).map_or(DVec4::ONE, |texture| on(inputs, texture, triangle, barycentric))
}

/// Whether there is a surface: alpha reaches the cutoff.
pub fn solid(inputs: &Inputs, triangle: u32, barycentric: DVec2) -> bool {
    texture(inputs, TEXTURE_ALPHA, triangle)
        .is_none_or(|texture| on(inputs, texture, triangle, barycentric).w * f64::from(texture.scale) >= 1.0)
}

/// The unit normal as the triangle's normal map turns it.
pub fn mapped_normal(inputs: &Inputs, normal: DVec3, triangle: u32, barycentric: DVec2) -> DVec3 {
    let Some(texture) = texture(inputs, TEXTURE_NORMAL, triangle) else { return normal };
    let coordinates = &inputs.coordinates[triangle as usize];
    let [a, b, c] = coordinates.tangent.map(|tangent| tangent.as_dvec3());
    let along = a * (1.0 - barycentric.x - barycentric.y) + b * barycentric.x + c * barycentric.y;
    let Some(tangent) = along.reject_from_normalized(normal).try_normalize() else { return normal };
    let bitangent = f64::from(coordinates.handedness) * normal.cross(tangent);
    let v = 2.0 * on(inputs, texture, triangle, barycentric).truncate() - 1.0;
    let scale = f64::from(texture.scale);
    (scale * v.x * tangent + scale * v.y * bitangent + v.z * normal).try_normalize().unwrap_or(normal)
}

/// The texture's share of the roughness at a point, for boundaries.
pub fn roughness_share(inputs: &Inputs, triangle: u32, barycentric: DVec2) -> f64 {
    if inputs.features.rough < 2 {
        return 1.0;
    }
    value(inputs, TEXTURE_METALLIC_ROUGHNESS, triangle, barycentric).y
}

/// The material with its surface as the textures have it at a point.
pub fn surface(inputs: &Inputs, material: &Material, triangle: u32, barycentric: DVec2) -> Material {
    let value = |kind: u32| value(inputs, kind, triangle, barycentric);
    let tinted = |color: Vec3, kind: u32| (color.as_dvec3() * value(kind).truncate()).as_vec3();
    let mut out = *material;
    out.base_color = tinted(material.base_color, TEXTURE_BASE_COLOR);
    out.emission = tinted(material.emission, TEXTURE_EMISSION);
    if has(inputs, TEXTURE_METALLIC_ROUGHNESS) {
        let value = value(TEXTURE_METALLIC_ROUGHNESS);
        out.metallic = (f64::from(material.metallic) * value.z) as f32;
        // alpha is the square of the roughness.
        let alpha = f64::from(material.alpha) * value.y * value.y;
        out.alpha = if alpha < f64::from(crate::shared::MIRROR_ALPHA) { 0.0 } else { alpha as f32 };
    }
    out
}

/// The material with its medium as the textures have it where light enters.
pub fn medium(inputs: &Inputs, material: &Material, triangle: u32, barycentric: DVec2) -> Material {
    let scatters = has(inputs, TEXTURE_SCATTER_COLOR) || has(inputs, TEXTURE_SCATTER_STRENGTH);
    if !scatters || material.ramp == 0 {
        return *material;
    }
    let share = value(inputs, TEXTURE_SCATTER_COLOR, triangle, barycentric).truncate()
        * value(inputs, TEXTURE_SCATTER_STRENGTH, triangle, barycentric).w;
    let nodes = &inputs.materials[material.ramp as usize..][..=RAMP as usize];
    medium_at(material, nodes, share)
}

/// What a medium determines of each channel of a material.
pub fn medium_fields() -> [fn(&mut Material) -> &mut Vec3; 9] {
    [
        |m| &mut m.sigma_tr,
        |m| &mut m.z_real,
        |m| &mut m.z_virtual,
        |m| &mut m.fluence,
        |m| &mut m.height,
        |m| &mut m.free_path,
        |m| &mut m.floor,
        |m| &mut m.beam,
        |m| &mut m.strength,
    ]
}

/// The material with its medium at a share of its multi-scatter colour, between two of the nodes of its ramp.
pub fn medium_at(material: &Material, nodes: &[Material], share: DVec3) -> Material {
    let mut out = *material;
    for c in 0..3 {
        let at = share[c].clamp(0.0, 1.0) * f64::from(RAMP);
        let node = (at as usize).min(RAMP as usize - 1);
        for field in medium_fields() {
            let [a, b] = [nodes[node], nodes[node + 1]].map(|mut node| f64::from(field(&mut node)[c]));
            field(&mut out)[c] = (a + (b - a) * (at - node as f64)) as f32;
        }
    }
    out
}
