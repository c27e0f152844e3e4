//! Environments: constant, or a latitude-longitude image in .hdr or .exr.

use super::frame::INTENSITY_MAX;
use super::{Environment, EnvironmentMap};
use crate::{Error, Result};
use glam::{DVec3, Vec3};
use std::path::Path;

/// Most texels of an image (16384 x 16384): a broken header must not ask for all memory.
const TEXELS_MAX: usize = 1 << 28;

/// Most negative light that an image may hold, as a share of the positive. Filters that resize a picture leave about
/// half of this around bright lamps; more is a mistake.
const NEGATIVE_SHARE_MAX: f64 = 0.01;

impl Environment {
    /// The same radiance from everywhere.
    ///
    /// # Errors
    /// [`Error::Setting`] for radiance that is negative or not finite.
    pub fn constant(radiance: DVec3) -> Result<Environment> {
        let environment = Environment { map: EnvironmentMap::Constant(radiance), ..Environment::default() };
        environment.check()?;
        Ok(environment)
    }

    /// Reads a latitude-longitude image: Radiance .hdr, or the first layer with R, G, B of an OpenEXR file.
    ///
    /// # Errors
    /// [`Error::File`] if the file cannot be read or decoded; [`Error::Scene`] naming the texel for radiance that is not
    /// finite. Negative radiance stays as it is; [`Scene::set_environment`](super::Scene::set_environment) judges it.
    pub fn load(path: impl AsRef<Path>) -> Result<Environment> {
        let path = path.as_ref();
        let extension = path.extension().and_then(|extension| extension.to_str()).unwrap_or("").to_lowercase();
        let (width, height, radiance) = match extension.as_str() {
            "hdr" => read_hdr(path)?,
            "exr" => read_exr(path)?,
            _ => return Err(Error::file(path, "an environment is a .hdr or .exr file")),
        };
        if let Some(texel) = radiance.iter().position(|texel| !texel.is_finite()) {
            let (column, row, found) = (texel as u32 % width, texel as u32 / width, radiance[texel]);
            let problem = format!("is {:?}; radiance must be finite", found.to_array());
            return Err(Error::scene(path, format!("texel ({column}, {row})"), problem));
        }
        if radiance.is_empty() {
            return Err(Error::file(path, "holds no texels"));
        }
        Ok(Environment { map: EnvironmentMap::Image { width, height, radiance }, ..Environment::default() })
    }

    /// What [`Scene::set_environment`](super::Scene::set_environment) demands.
    pub(super) fn check(&self) -> Result<()> {
        let wrong = |problem: String| Err(Error::setting("environment", problem));
        match &self.map {
            EnvironmentMap::None => {}
            EnvironmentMap::Constant(radiance) => {
                if !(radiance.is_finite() && radiance.min_element() >= 0.0) {
                    return wrong(format!(
                        "the radiance is {:?}; it must be finite, not negative",
                        radiance.to_array()
                    ));
                }
            }
            EnvironmentMap::Image { width, height, radiance } => {
                if radiance.is_empty() || *width as u64 * *height as u64 != radiance.len() as u64 {
                    return wrong(format!("{width} x {height} is not the size of {} texels", radiance.len()));
                }
                if let Some(texel) = radiance.iter().position(|texel| !texel.is_finite()) {
                    return wrong(format!("texel {texel} is {:?}; it must be finite", radiance[texel].to_array()));
                }
                let (negative, positive) = radiance.iter().fold((0.0, 0.0), |(negative, positive), texel| {
                    let part = |texel: Vec3| texel.as_dvec3().element_sum();
                    (negative - part(texel.min(Vec3::ZERO)), positive + part(texel.max(Vec3::ZERO)))
                });
                if negative > NEGATIVE_SHARE_MAX * positive {
                    return wrong(format!("negative radiance sums to {negative}, positive to {positive}"));
                }
            }
        }
        if !self.rotation.is_finite() {
            return wrong(format!("the rotation is {}", self.rotation));
        }
        if !(self.scale.is_finite() && self.scale >= 0.0) {
            return wrong(format!("the scale is {}; it must be finite, not negative", self.scale));
        }
        let brightest = match &self.map {
            EnvironmentMap::None => 0.0,
            EnvironmentMap::Constant(radiance) => radiance.max_element(),
            EnvironmentMap::Image { radiance, .. } => {
                radiance.iter().fold(0.0, |most: f64, texel| most.max(texel.max_element().into()))
            }
        };
        if brightest * self.scale > INTENSITY_MAX {
            return wrong(format!("its radiance reaches {:e}; {INTENSITY_MAX:e} at most", brightest * self.scale));
        }
        Ok(())
    }

    /// Raises negative texels to 0; how many there were.
    pub(super) fn raise_negative(&mut self) -> usize {
        let EnvironmentMap::Image { radiance, .. } = &mut self.map else { return 0 };
        let mut raised = 0;
        for texel in radiance.iter_mut().filter(|texel| texel.min_element() < 0.0) {
            *texel = texel.max(Vec3::ZERO);
            raised += 1;
        }
        raised
    }
}

fn read_hdr(path: &Path) -> Result<(u32, u32, Vec<Vec3>)> {
    let mut reader = image::ImageReader::open(path).map_err(|error| Error::file(path, error))?;
    reader.set_format(image::ImageFormat::Hdr);
    let mut limits = image::Limits::default();
    limits.max_alloc = Some((TEXELS_MAX * size_of::<Vec3>()) as u64);
    reader.limits(limits);
    let image = reader.decode().map_err(|error| Error::file(path, error))?.into_rgb32f();
    let (width, height) = image.dimensions();
    Ok((width, height, image.pixels().map(|pixel| Vec3::from_array(pixel.0)).collect()))
}

fn read_exr(path: &Path) -> Result<(u32, u32, Vec<Vec3>)> {
    let image = exr::prelude::read_first_rgba_layer_from_file(
        path,
        |size, _| {
            let count = size.width().checked_mul(size.height()).filter(|&count| count <= TEXELS_MAX);
            (size.width(), vec![Vec3::ZERO; count.unwrap_or(0)])
        },
        |(width, texels), position, (r, g, b, _): (f32, f32, f32, f32)| {
            if let Some(texel) = texels.get_mut(position.y() * *width + position.x()) {
                *texel = Vec3::new(r, g, b);
            }
        },
    )
    .map_err(|error| Error::file(path, error))?;
    let size = image.layer_data.size;
    let (_, texels) = image.layer_data.channel_data.pixels;
    if texels.is_empty() {
        let (width, height) = (size.width(), size.height());
        return Err(Error::file(path, format!("is {width} x {height}; {TEXELS_MAX} texels at most")));
    }
    Ok((size.width() as u32, size.height() as u32, texels))
}
