//! Scattering coefficients from what authors write: colours, albedos, mean free paths.

use crate::Result;
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
    /// (sigma_s', sigma_a) of one channel from the extinction and the multi-scatter albedo.
    ///
    /// With s = 4.09712 + 4.20863 rho - sqrt(9.59217 + 41.6808 rho + 17.7126 rho^2) in a form without cancellation,
    /// and sigma_a as a product: `sigma_t * (1 - albedo)` would lose every digit near 1.
    pub fn coefficients(self, sigma_t: f64, rho: f64, g: f64) -> (f64, f64) {
        let b = 1.139 + 1.17 * rho;
        let s = (2.0 * (1.0 - rho) / (b + (b * b - 0.556 * (1.0 - rho)).sqrt())).min(1.0);
        let scattered = sigma_t * (1.0 - s) * (1.0 + s);
        let absorbed = sigma_t * s * s;
        match self {
            Mapping::VolumeScatter => (scattered * (1.0 - g), absorbed),
            Mapping::Scatter => {
                let factor = (1.0 - g) / (1.0 - g * s * s);
                (scattered * factor, absorbed * factor)
            }
        }
    }
}

/// The length that comes with an albedo.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Length {
    /// 1 / sigma_t'.
    MeanFreePath,
    /// 1 / sigma_tr.
    DiffuseMeanFreePath,
}

/// (sigma_s', sigma_a) of one channel whose standard dipole has the total `albedo`.
///
/// # Errors
/// A diffuse mean free path with an albedo of 1, for which every sigma_s' has sigma_tr = 0.
pub(super) fn from_albedo(albedo: f64, length: f64, kind: Length, ior: f64) -> std::result::Result<(f64, f64), String> {
    let e = effective_ratio(albedo, ior);
    let sigma_t = match kind {
        Length::MeanFreePath => 1.0 / length,
        Length::DiffuseMeanFreePath if e > 0.0 => 1.0 / (length * e),
        Length::DiffuseMeanFreePath => return Err("an albedo of 1 has an infinite diffuse mean free path".into()),
    };
    // e^2 = 3 (1 - alpha').
    let absorbed = sigma_t * (e * e / 3.0).min(1.0);
    let scattered = if albedo == 0.0 { 0.0 } else { sigma_t * (1.0 - e * e / 3.0).max(0.0) };
    Ok((scattered, absorbed))
}

/// e = sigma_tr / sigma_t' = sqrt(3 (1 - alpha')) at which the standard dipole's total is `albedo` in [0, 1].
///
/// The total alpha'/2 (1 + e^(-4Ae/3)) e^(-e) (Jensen & Buhler 2002) falls with e. It is solved for e, through
/// 1 - total in `expm1`, because alpha' itself would lose all digits near 1.
fn effective_ratio(albedo: f64, ior: f64) -> f64 {
    let rho_i = internal_reflectance(ior);
    let virtual_depth = 1.0 + 4.0 / 3.0 * (1.0 + rho_i) / (1.0 - rho_i);
    let missing = |e: f64| {
        let alpha = 1.0 - e * e / 3.0;
        e * e / 3.0 - alpha * ((-e).exp_m1() + (-virtual_depth * e).exp_m1()) / 2.0
    };
    let (mut low, mut high) = (0.0, 3f64.sqrt());
    if albedo >= 1.0 {
        return low;
    }
    if albedo <= 0.0 {
        return high;
    }
    // Halving 100 times reaches a relative 2^-53 for every e above 1e-14, and 1 - albedo >= 2^-53 keeps e above that.
    for _ in 0..100 {
        let middle = 0.5 * (low + high);
        if missing(middle) < 1.0 - albedo {
            low = middle;
        } else {
            high = middle;
        }
    }
    0.5 * (low + high)
}

/// Diffuse reflectance 2 C_1 of the interface seen from inside, exact Fresnel, n = inside / outside.
///
/// Total reflection is integrated analytically; c = cc + (1 - cc) t^2 makes the rest smooth, for Simpson's rule.
pub(super) fn internal_reflectance(n: f64) -> f64 {
    const INTERVALS: u32 = 1024;
    let critical = if n > 1.0 { (1.0 - 1.0 / (n * n)).sqrt() } else { 0.0 };
    let integrand = |t: f64| {
        let c = critical + (1.0 - critical) * t * t;
        // The refracted cosine; its square is formed from c - critical, which is exact near the critical angle.
        let square = if n > 1.0 {
            n * n * (1.0 - critical) * t * t * (c + critical)
        } else {
            1.0 - n * n * (1.0 - c) * (1.0 + c)
        };
        let refracted = square.max(0.0).sqrt();
        let parallel = (n * refracted - c) / (n * refracted + c).max(f64::MIN_POSITIVE);
        let perpendicular = (n * c - refracted) / (n * c + refracted).max(f64::MIN_POSITIVE);
        0.5 * (parallel * parallel + perpendicular * perpendicular) * c * 2.0 * (1.0 - critical) * t
    };
    let h = 1.0 / INTERVALS as f64;
    let mut sum = integrand(0.0) + integrand(1.0);
    for i in 1..INTERVALS {
        sum += integrand(i as f64 * h) * if i % 2 == 1 { 4.0 } else { 2.0 };
    }
    critical * critical + 2.0 * sum * h / 3.0
}

/// The Medium's channels from a function of each channel's index.
pub(super) fn channels(mut channel: impl FnMut(usize) -> Result<(f64, f64)>) -> Result<(DVec3, DVec3)> {
    let (mut scattering, mut absorption) = (DVec3::ZERO, DVec3::ZERO);
    for index in 0..3 {
        (scattering[index], absorption[index]) = channel(index)?;
    }
    Ok((scattering, absorption))
}
