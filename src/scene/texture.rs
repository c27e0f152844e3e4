//! Textures of a glTF file: references from materials, samplers, transforms. Pictures are decoded when all is read.

use super::json::{Item, shorten};
use super::{Texture, Wrap};
use crate::Result;
use glam::DVec3;

/// Largest number of a transform, beyond which coordinates would have no digits within a texture.
const TRANSFORM_MAX: f64 = 1e6;

/// Extensions that name a picture of another kind, and how to make it one that is read.
const OTHER_PICTURES: &[(&str, &str)] = &[
    ("KHR_texture_basisu", "`gltf-transform ktxdecompress IN.glb OUT.glb`"),
    ("EXT_texture_webp", "`gltf-transform png IN.glb OUT.glb --formats \"*\"`"),
    ("EXT_texture_avif", "`gltf-transform png IN.glb OUT.glb --formats \"*\"`"),
];

/// The lists that a reference to a texture leads through.
pub(super) struct Textures<'a> {
    textures: Vec<Item<'a>>,
    samplers: Vec<Item<'a>>,
    pictures: usize,
}

impl<'a> Textures<'a> {
    pub fn new(root: &Item<'a>) -> Result<Self> {
        Ok(Textures {
            textures: root.list("textures")?,
            samplers: root.list("samplers")?,
            pictures: root.list("images")?.len(),
        })
    }

    /// The texture that the member `key` of `parent` refers to, if it is there.
    pub fn read(&self, parent: &Item<'a>, key: &str) -> Result<Option<Texture>> {
        let Some(info) = parent.get(key)? else { return Ok(None) };
        let item = &self.textures[info.need("index")?.index(self.textures.len(), "textures")?];
        let picture = match item.get("source")? {
            Some(source) => source.index(self.pictures, "images")?,
            None => return Err(self.no_source(item)?),
        };
        let mut texture = Texture { picture, ..Texture::default() };
        if let Some(set) = info.get("texCoord")? {
            texture.set = read_set(&set)?;
        }
        if let Some(scale) = info.get("scale")? {
            texture.scale = scale.within(-TRANSFORM_MAX, TRANSFORM_MAX)?;
        }
        if let Some(sampler) = item.get("sampler")? {
            let sampler = &self.samplers[sampler.index(self.samplers.len(), "samplers")?];
            texture.wrap = [read_wrap(sampler, "wrapS")?, read_wrap(sampler, "wrapT")?];
            texture.nearest = read_filter(sampler)?;
        }
        if let Some(transform) = info.extension("KHR_texture_transform")? {
            texture.rows = read_transform(&transform)?;
            if let Some(set) = transform.get("texCoord")? {
                texture.set = read_set(&set)?;
            }
        }
        Ok(Some(texture))
    }

    /// Why a texture has no picture that is read.
    fn no_source(&self, item: &Item) -> Result<crate::Error> {
        for (extension, remedy) in OTHER_PICTURES {
            if item.extension(extension)?.is_some() {
                let problem =
                    format!("has a picture of {extension} alone, which is not supported: convert it with {remedy}");
                return Ok(item.error(problem));
            }
        }
        Ok(item.error("has no `source`"))
    }
}

fn read_set(item: &Item) -> Result<u32> {
    match item.whole()? {
        set @ (0 | 1) => Ok(set as u32),
        other => Err(item.error(format!("is {other}; TEXCOORD_0 and TEXCOORD_1 are read"))),
    }
}

fn read_wrap(sampler: &Item, key: &str) -> Result<Wrap> {
    let Some(item) = sampler.get(key)? else { return Ok(Wrap::Repeat) };
    match item.whole()? {
        10497 => Ok(Wrap::Repeat),
        33071 => Ok(Wrap::Clamp),
        33648 => Ok(Wrap::Mirror),
        other => Err(item.error(format!("must be 10497, 33071 or 33648, is {other}"))),
    }
}

/// Whether the nearest texel is taken: what the sampler asks for where texels are larger than pixels.
fn read_filter(sampler: &Item) -> Result<bool> {
    if let Some(item) = sampler.get("minFilter")? {
        let filter = item.whole()?;
        if !matches!(filter, 9728 | 9729 | 9984..=9987) {
            return Err(item.error(format!("{filter} is no filter")));
        }
    }
    let Some(item) = sampler.get("magFilter")? else { return Ok(false) };
    match item.whole()? {
        9728 => Ok(true),
        9729 => Ok(false),
        other => Err(item.error(format!("must be 9728 or 9729, is {other}"))),
    }
}

/// The rows of translation x rotation x scale, as KHR_texture_transform has them.
fn read_transform(item: &Item) -> Result<[DVec3; 2]> {
    let pair = |key: &str, default: [f64; 2]| {
        item.get(key)?.map_or(Ok(default), |pair| pair.numbers_within(-TRANSFORM_MAX, TRANSFORM_MAX))
    };
    let ([x, y], [u, v]) = (pair("offset", [0.0; 2])?, pair("scale", [1.0; 2])?);
    let angle = item.get("rotation")?.map_or(Ok(0.0), |angle| angle.within(-TRANSFORM_MAX, TRANSFORM_MAX))?;
    let (sin, cos) = angle.sin_cos();
    Ok([DVec3::new(cos * u, sin * v, x), DVec3::new(-sin * u, cos * v, y)])
}

/// What a picture that is not read may be, and how to convert it.
pub(super) fn other_picture(bytes: &[u8]) -> String {
    let (name, remedy) = match bytes {
        [0xab, b'K', b'T', b'X', ..] => ("KTX", OTHER_PICTURES[0].1),
        [b'R', b'I', b'F', b'F', _, _, _, _, b'W', b'E', b'B', b'P', ..] => ("WebP", OTHER_PICTURES[1].1),
        [_, _, _, _, b'f', b't', b'y', b'p', b'a', b'v', b'i', b'f', ..] => ("AVIF", OTHER_PICTURES[2].1),
        _ => return "is neither PNG nor JPEG".into(),
    };
    format!("is {}, which is not supported: convert it to PNG with {remedy}", shorten(name))
}
