//! A rendered image: named channels of f32, what made it, and its files (EXR, PNG), written whole or not at all.

mod difference;
mod exr;
mod flip;
mod merge;
mod png;
mod whole;

pub use difference::Difference;
pub(crate) use difference::FLOOR as FLOOR_OF_MEAN;
pub use whole::{check_writable, write_whole};

use crate::{Error, Result};
use std::{collections::BTreeMap, path::Path};

/// The rendered part of an image.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Image {
    /// Columns of the rendered part (pixels).
    pub width: u32,
    /// Rows of the rendered part (pixels).
    pub height: u32,
    /// Where its upper left pixel is in the full image: column, row.
    pub origin: (u32, u32),
    /// Width and height of the full image (pixels).
    pub full: (u32, u32),
    /// Row by row from the top, `width * height` values each.
    pub channels: Vec<Channel>,
    /// What made it, `translucent.samples` and so on.
    pub attributes: BTreeMap<String, Attribute>,
}

/// One value per pixel.
#[derive(Clone, Debug, PartialEq)]
pub struct Channel {
    /// As in the file: `R`, `subsurface.R`, `N.X`.
    pub name: String,
    pub data: Vec<f32>,
}

/// A value that describes the image.
#[derive(Clone, Debug, PartialEq)]
pub enum Attribute {
    Text(String),
    Integer(i32),
    Float(f64),
}

impl Image {
    /// The values of the channel called `name`, row by row.
    pub fn channel(&self, name: &str) -> Option<&[f32]> {
        self.channels.iter().find(|channel| channel.name == name).map(|channel| channel.data.as_slice())
    }

    /// Reads an EXR file of one layer.
    ///
    /// # Errors
    /// [`Error::File`] if there is none, or it is not one that [`Image::write`] could have written.
    pub fn read(path: impl AsRef<Path>) -> Result<Image> {
        exr::read(path.as_ref())
    }

    /// Writes an EXR file: f32, ZIP, one part with the channels' literal names, Rec.709 primaries; the data window is
    /// the rendered part, the display window the full image. Equal images give equal files, byte by byte.
    ///
    /// # Errors
    /// [`Error::File`] if a value is not finite or the file cannot be written; then there is no file, or the old one.
    pub fn write(&self, path: impl AsRef<Path>) -> Result<()> {
        let path = path.as_ref();
        self.check(path)?;
        whole::write(path, |file| exr::write(self, file))
    }

    /// Writes the rendered part as an 8-bit PNG: R, G and B times 2^`exposure`, through the sRGB transfer function.
    ///
    /// EXR's alpha is premultiplied, PNG's is not, so colours are divided by alpha and edges look right over any
    /// background. Where light is seen without a surface (A = 0, the environment shown), the whole PNG is opaque.
    ///
    /// # Errors
    /// [`Error::File`] as in [`Image::write`], or if R, G, B or A is missing.
    pub fn write_png(&self, path: impl AsRef<Path>, exposure: f64) -> Result<()> {
        let path = path.as_ref();
        self.check(path)?;
        let pixels = png::pixels(self, exposure).map_err(|problem| Error::file(path, problem))?;
        whole::write(path, |file| png::write(self, &pixels, file))
    }

    /// One image out of the parts of a larger render, each with the file that errors name. Means are weighted by
    /// samples; the variance of the mean is the sum of w^2 times each part's, and is left out if a part has none.
    /// Normals, positions, depths and materials come from the first. The order of `parts` does not matter.
    ///
    /// An interrupted part of several bands may have pixels with up to 32 samples more than its range says
    /// (`samples.Y`). They are samples of the part that follows too, and count twice: the mean stays unbiased, the
    /// noise is a little more than that many independent samples would leave.
    ///
    /// # Errors
    /// [`Error::File`] if parts overlap, leave a gap, or differ in scene, settings, seed, kernels, version, size or
    /// channels.
    pub fn merge(parts: Vec<(std::path::PathBuf, Image)>) -> Result<Image> {
        merge::merge(parts)
    }

    /// How far R, G and B are from those of `reference`: of each pixel, and on average, the squared deviation over
    /// `ref^2 + .01 mean(ref)^2`, averaged over the three, with the mean over pixels and channels. Its root is the
    /// relative error that this crate speaks of.
    ///
    /// # Errors
    /// [`Error::Setting`] if the images do not show the same pixels, a channel is missing, or the reference is black.
    pub fn relative_mse(&self, reference: &Image) -> Result<Difference> {
        difference::relative_mse(self, reference)
    }

    /// How different both look when one follows the other on a display, 0 to 1: FLIP of R, G and B times 2^`exposure`
    /// over black, through the sRGB transfer function in 8 bits, seen at 67 pixels per degree. P. Andersson, J.
    /// Nilsson, T. Akenine-Moller, M. Oskarsson, K. Astrom, M. D. Fairchild, "FLIP: A Difference Evaluator for
    /// Alternating Images", HPG 2020.
    ///
    /// # Errors
    /// [`Error::Setting`] if the images do not show the same pixels, or a channel is missing.
    pub fn flip(&self, reference: &Image, exposure: f64) -> Result<Difference> {
        difference::flip(self, reference, exposure)
    }

    /// R, G and B of every pixel as [`Image::flip`] sees them, 0 to 255 each.
    ///
    /// # Errors
    /// [`Error::Setting`] if one is missing.
    pub fn encoded(&self, exposure: f64) -> Result<Vec<u8>> {
        difference::encoded(self, exposure)
    }

    /// What a file must not hold: a channel of another size, and NaN or infinity.
    fn check(&self, path: &Path) -> Result<()> {
        let count = self.width as usize * self.height as usize;
        for Channel { name, data } in &self.channels {
            if data.len() != count {
                let problem = format!("channel {name} has {} values for {count} pixels", data.len());
                return Err(Error::file(path, problem));
            }
            if let Some(at) = data.iter().position(|value| !value.is_finite()) {
                let (x, y) = (at % self.width as usize, at / self.width as usize);
                let problem = format!("channel {name} is {} at pixel {x},{y} of the rendered part", data[at]);
                return Err(Error::file(path, problem));
            }
        }
        Ok(())
    }
}
