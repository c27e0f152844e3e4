//! Scattering coefficients from what authors write: colours, albedos, mean free paths.

use super::{AlbedoMapping, LengthKind};
use crate::{Result, reference::profile::invert_total};
use glam::DVec3;

/// Extinction, scattering and anisotropy of one channel, in the two drafts of the glTF extension.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Mapping {
    /// KHR_materials_volume_scatter (draft of pull request 2453): Kulla & Conty 2017, the same for every g.
    VolumeScatter,
    /// KHR_materials_scatter (draft of pull request 2579): with g, so that alpha' = 1 - s^2 for every g.
    Scatter,
}

impl Mapping {
    /// (sigma_s', sigma_a) of one channel from the extinction and the multi-scatter colour.
    ///
    /// As the drafts have it: with s = 4.09712 + 4.20863 rho - sqrt(9.59217 + 41.6808 rho + 17.7126 rho^2) in a form without cancellation,
    /// and sigma_a as a product: `sigma_t * (1 - albedo)` would lose every digit near 1. For the colour that is seen,
    /// s^2 is such that alpha' has the total rho instead.
    pub fn coefficients(self, sigma_t: f64, rho: f64, g: f64, albedo: AlbedoMapping, ior: f64) -> (f64, f64) {
        // s^2, and the parts of sigma_t.
        let (s2, scattered, absorbed) = match albedo {
            AlbedoMapping::Gltf => {
                let b = 1.139 + 1.17 * rho;
                let s = (2.0 * (1.0 - rho) / (b + (b * b - 0.556 * (1.0 - rho)).sqrt())).min(1.0);
                (s * s, sigma_t * (1.0 - s) * (1.0 + s), sigma_t * s * s)
            }
            AlbedoMapping::Surface => {
                // 1 - alpha' = e^2 / 3; of the first draft, alpha' = (1 - s^2) (1 - g) / ((1 - s^2) (1 - g) + s^2).
                let lost = if rho > 0.0 { (invert_total(rho, ior).powi(2) / 3.0).min(1.0) } else { 1.0 };
                let (kept, lost) = match self {
                    Mapping::VolumeScatter => (1.0 - lost, lost * (1.0 - g)),
                    Mapping::Scatter => (1.0 - lost, lost),
                };
                let s2 = lost / (kept + lost);
                (s2, sigma_t * kept / (kept + lost), sigma_t * s2)
            }
        };
        match self {
            Mapping::VolumeScatter => (scattered * (1.0 - g), absorbed),
            Mapping::Scatter => {
                let factor = (1.0 - g) / (1.0 - g * s2);
                (scattered * factor, absorbed * factor)
            }
        }
    }
}

/// (sigma_s', sigma_a) of one channel whose standard dipole has the total `albedo`.
///
/// # Errors
/// A diffuse mean free path with an albedo of 1, for which every sigma_s' has sigma_tr = 0.
pub(super) fn from_albedo(
    albedo: f64,
    length: f64,
    kind: LengthKind,
    ior: f64,
) -> std::result::Result<(f64, f64), String> {
    let e = invert_total(albedo, ior);
    let sigma_t = match kind {
        LengthKind::MeanFreePath => 1.0 / length,
        LengthKind::DiffuseMeanFreePath if e > 0.0 => 1.0 / (length * e),
        LengthKind::DiffuseMeanFreePath => return Err("an albedo of 1 has an infinite diffuse mean free path".into()),
    };
    // e^2 = 3 (1 - alpha').
    let absorbed = sigma_t * (e * e / 3.0).min(1.0);
    let scattered = if albedo == 0.0 { 0.0 } else { sigma_t * (1.0 - e * e / 3.0).max(0.0) };
    Ok((scattered, absorbed))
}

/// The Medium's channels from a function of each channel's index.
pub(super) fn channels(mut channel: impl FnMut(usize) -> Result<(f64, f64)>) -> Result<(DVec3, DVec3)> {
    let (mut scattering, mut absorption) = (DVec3::ZERO, DVec3::ZERO);
    for index in 0..3 {
        (scattering[index], absorption[index]) = channel(index)?;
    }
    Ok((scattering, absorption))
}
