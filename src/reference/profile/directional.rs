//! The directional dipole: a beam's profile, which depends on where the light comes from. Twin of
//! `profile_directional.glsl`.
//!
//! # Value
//! J. R. Frisvad, T. Hachisuka, T. K. Kjeldsen, "Directional dipole model for subsurface scattering", ACM TOG 34:5
//! (2014). Light from wi enters at xi (normal ni), refracted along w12, and leaves at xo (normal no); x = xo - xi, r = |x|,
//! s = sigma_tr and D = z_r / 3 of the standard dipole, C_phi, C_E and A of the better one, d_e = 2.131 D / sqrt(alpha').
//! What leaves towards wo is Ft(wi) Ft(wo) S with
//!
//!   S = max(0, real - virtual) / (4 pi^2 (1 - rho_e)),
//!   term(x, w, d) = e^(-s d) / d^3 { C_phi [d^2 / D + 3 (1 + s d) x.w]
//!       - C_E [3 D (1 + s d) w.no - ((1 + s d) + 3 D (3 (1 + s d) + (s d)^2) / d^2 x.w) x.no] },
//!   real = term(x, w12, d_r),  virtual = term(x - h n*, w12 - 2 (w12.n*) n*, d_v),  d_v^2 = r^2 + h^2,  h = 2 A d_e,
//!
//! where n* is ni made perpendicular to x (ni itself where x = 0, any perpendicular where ni is along x). With
//! mu_0 = -no.w12 and cos b = -sqrt((r^2 - (x.w12)^2) / (r^2 + d_e^2)),
//!
//!   d_r^2 = r^2 + D mu_0 (D mu_0 - 2 d_e cos b)   in front (mu_0 > 0),   r^2 + 1 / (3 sigma_t)^2   behind,
//!
//! sigma_t not reduced. Virtual directions need no vectors: (x - h n*).(w12 - 2 (w12.n*) n*) = x.w12 + h w12.n*. The two
//! d^2 / D terms nearly cancel at large r and are subtracted as in the [better dipole](super::better).
//!
//! # Regularisation
//! As published, d_r jumps at mu_0 = 0: in front it goes to r, and S to infinity at r = 0, which meshes coarser than the
//! mean free path and normal maps turn into fireflies. Here d_r^2 >= r^2 + (kappa / (3 sigma_t))^2 in front too. kappa = 1
//! makes d_r continuous and leaves smooth surfaces as they are, where D mu_0 (...) is larger; 0 is the published model. It
//! takes light away near r = 0 where the refracted beam is within kappa (1 - g) or so of the exit's tangent plane.
//! Under grazing light on noisy normal maps, and beside the edges of boxes, the published model's brightest pixel has 20 to
//! 270 times the median at 64 samples; with kappa = 1 it has 3 to 9 times, which is the picture's contrast.
//!
//! # What it lacks
//! It conserves no energy: under diffuse light the total exceeds 1 at high albedos, by 10 to 25 percent. `renormalise`
//! multiplies each channel by the standard dipole's total over its own, [`Directional::diffuse_total`]. It is not
//! reciprocal: `reciprocal` averages it with light and eye exchanged. Light that is not deflected at all (the paper's
//! delta-Eddington term), which leaves thin bodies on the other side, is not modelled. It takes the index of refraction
//! from one side of total reflection only: for n < 1 light beyond the critical angle does not enter.
//!
//! # Sampling
//! Radii and hits come from the standard dipole, which falls as fast.

use super::super::boundary::{self, Side, diffuse_reflectance};
use super::super::math::{basis, integrate};
use super::better::{boundary_constants, phi};
use super::{COMPONENTS, Coefficients, Dipole, Matter, Options, Radial};
use crate::shared::Material;
use glam::DVec3;
use std::f64::consts::PI;

/// The directional dipole of one channel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Directional {
    /// From which radii and hits are drawn.
    pub proposal: Dipole,
    /// h, the height of the virtual source over the modified tangent plane, a length.
    pub height: f64,
    /// 1 / (3 sigma_t) with sigma_t not reduced, a length.
    pub free_path: f64,
    /// kappa / (3 sigma_t), a length.
    pub floor: f64,
    pub c_phi: f64,
    pub c_e: f64,
    /// Index of refraction, inside over outside.
    pub ior: f64,
    /// What stands before the maximum.
    pub beam: f64,
}

impl Directional {
    /// From one channel's coefficients and the kappa of the regularisation, normalised as S above.
    ///
    /// Matter that does not scatter has the beam 0.
    pub fn new(matter: &Coefficients, kappa: f64) -> Directional {
        let proposal = Dipole::of(matter);
        let (c_phi, c_e) = boundary_constants(matter.ior);
        let scatters = proposal.albedo > 0.0;
        let extrapolation = if scatters { 2.131 / 3.0 * proposal.z_real / proposal.albedo.sqrt() } else { 1.0 };
        let sigma_t = matter.sigma_s_prime / (1.0 - matter.g) + matter.sigma_a;
        let free_path = if scatters { 1.0 / (3.0 * sigma_t) } else { 1.0 };
        let entering = 1.0 - diffuse_reflectance(matter.ior, Side::Outside);
        Directional {
            proposal,
            height: (1.0 - c_e) / c_phi * extrapolation,
            free_path,
            floor: kappa * free_path,
            c_phi,
            c_e,
            ior: matter.ior,
            beam: if scatters { 1.0 / (4.0 * PI * PI * entering) } else { 0.0 },
        }
    }

    pub(super) fn of(matter: &Coefficients) -> Directional {
        Directional::new(matter, 1.0)
    }

    /// Channel `c` of a material as kernels read it.
    pub fn unpack(matter: Matter, c: usize) -> Directional {
        let material = matter.material;
        Directional {
            proposal: Dipole::unpack(matter, c),
            height: f64::from(material.height[c]),
            free_path: f64::from(material.free_path[c]),
            floor: f64::from(material.floor[c]),
            c_phi: f64::from(material.c_phi),
            c_e: f64::from(material.c_e),
            ior: f64::from(material.ior),
            beam: f64::from(material.beam[c]),
        }
    }

    /// S e^exponent [1/(length^2 sr)] of light from `wi` (away from the surface) that enters with the normal `ni` and
    /// leaves with `no` at the distance `x` from there; without the Fresnel factors.
    pub fn value(&self, x: DVec3, ni: DVec3, wi: DVec3, no: DVec3, exponent: f64) -> f64 {
        let [fluence, real, mirrored] = self.terms(x, ni, wi, no, exponent);
        self.beam * (fluence + real - mirrored).max(0.0)
    }

    /// The difference of both sources' d^2 / D terms, the rest of the real one's, the rest of the virtual one's.
    pub fn terms(&self, x: DVec3, ni: DVec3, wi: DVec3, no: DVec3, exponent: f64) -> [f64; 3] {
        let Some(w) = self.refracted(ni, wi) else { return [0.0; 3] };
        let (s, diffusion, h) = (self.proposal.sigma_tr, self.proposal.z_real / 3.0, self.height);
        let (c_phi, c_e) = (self.c_phi, self.c_e);
        let r2 = x.length_squared();
        let x_w = x.dot(w);

        let front = self.nearest(x, ni, wi, no).powi(2);
        let (near, far) = ((r2 + front).sqrt(), r2.sqrt().hypot(h));
        let gap = (h * h - front) / (far + near);
        let n = modified_normal(ni, x);
        let (w_n, n_no) = (w.dot(n), n.dot(no));

        // All of a term but d^2 / D, over e^exponent.
        let rest = |d: f64, x_w: f64, w_no: f64, x_no: f64| {
            let sd = s * d;
            let k = 1.0 + sd;
            let flux = 3.0 * diffusion * k * w_no - (k + 3.0 * diffusion * (3.0 * k + sd * sd) / (d * d) * x_w) * x_no;
            (exponent - sd).exp() / (d * d * d) * (3.0 * c_phi * k * x_w - c_e * flux)
        };
        let fluence = (exponent - s * near).exp() * (gap / far) * (1.0 / near + s * phi(s * gap)) * c_phi / diffusion;
        let (w_no, x_no) = (w.dot(no), x.dot(no));
        let real = rest(near, x_w, w_no, x_no);
        let mirrored = rest(far, x_w + h * w_n, w_no - 2.0 * w_n * n_no, x_no - h * n_no);
        [fluence, real, mirrored]
    }

    /// w12; none beyond the critical angle.
    fn refracted(&self, ni: DVec3, wi: DVec3) -> Option<DVec3> {
        let cos = wi.dot(ni);
        let squared = 1.0 - (1.0 - cos * cos) / (self.ior * self.ior);
        (squared >= 0.0).then(|| (cos * ni - wi) / self.ior - ni * squared.sqrt())
    }

    /// sqrt(d_r^2 - r^2), how far the real source is from the exit at the least; 0 where no light enters.
    pub fn nearest(&self, x: DVec3, ni: DVec3, wi: DVec3, no: DVec3) -> f64 {
        let Some(w) = self.refracted(ni, wi) else { return 0.0 };
        let (diffusion, extrapolation) = (self.proposal.z_real / 3.0, self.height * self.c_phi / (1.0 - self.c_e));
        let mu = -no.dot(w);
        if mu <= 0.0 {
            return self.free_path;
        }
        let (r2, x_w) = (x.length_squared(), x.dot(w));
        let across = ((r2 - x_w * x_w).max(0.0) / (r2 + extrapolation * extrapolation)).sqrt();
        (diffusion * mu * (diffusion * mu + 2.0 * extrapolation * across)).sqrt().max(self.floor)
    }

    /// Part of the flux that entered a plane from a direction with this cosine that leaves it again, for beam = 1 / (4
    /// pi^2 (1 - rho_e)).
    pub fn total_at(&self, cos: f64) -> f64 {
        if self.beam == 0.0 {
            return 0.0;
        }
        let wi = DVec3::new((1.0 - cos * cos).max(0.0).sqrt(), 0.0, cos);
        let start = 1e-3 * self.proposal.z_real;
        let ring = |r: f64| {
            let value =
                |angle: f64| self.value(r * DVec3::new(angle.cos(), angle.sin(), 0.0), DVec3::Z, wi, DVec3::Z, 0.0);
            2.0 * r * integrate(0.0, PI, 2, value)
        };
        let end = (self.proposal.radius_beyond(1e-6) / start).ln();
        let sum = integrate(0.0, start, 1, ring)
            + integrate(0.0, end, 12, |t| {
                let r = start * t.exp();
                ring(r) * r
            });
        PI * (1.0 - diffuse_reflectance(self.ior, Side::Outside)) * sum
    }

    /// The same under diffuse light, to about 1e-4.
    pub fn diffuse_total(&self) -> f64 {
        let entering = |cos: f64| 2.0 * cos * boundary::transmittance(self.ior, cos);
        let least = if self.ior < 1.0 { (1.0 - self.ior * self.ior).sqrt() } else { 0.0 };
        integrate(least, 1.0, 1, |cos| entering(cos) * self.total_at(cos)) / integrate(least, 1.0, 1, entering)
    }
}

/// ni made perpendicular to x.
fn modified_normal(ni: DVec3, x: DVec3) -> DVec3 {
    let Some(along) = x.try_normalize() else { return ni };
    let across = ni - ni.dot(along) * along;
    // Beyond, rounding alone decides on the direction.
    if across.length_squared() > 1e-12 { across.normalize() } else { basis(along).0 }
}

impl Radial for Directional {
    fn shape_shifted(&self, r: f64, exponent: f64) -> f64 {
        self.proposal.shape_shifted(r, exponent)
    }

    fn strength(&self) -> f64 {
        self.proposal.strength()
    }

    fn masses(&self) -> [f64; COMPONENTS] {
        self.proposal.masses()
    }

    fn inside(&self, radius: f64) -> f64 {
        self.proposal.inside(radius)
    }

    fn outside(&self, radius: f64) -> f64 {
        self.proposal.outside(radius)
    }

    fn response(&self, k: f64) -> f64 {
        self.proposal.response(k)
    }

    fn radius(&self, component: usize, share: f64, u: f64) -> f64 {
        self.proposal.radius(component, share, u)
    }

    fn rate(&self) -> f64 {
        self.proposal.rate()
    }

    fn pack(&self, c: usize, options: &Options, material: &mut Material) {
        self.proposal.pack(c, options, material);
        let scatters = self.beam > 0.0;
        let total = if scatters && options.directional.renormalise { self.diffuse_total() } else { 0.0 };
        let factor = if total > 0.0 { self.proposal.total() / total } else { 1.0 };
        material.height[c] = self.height as f32;
        material.free_path[c] = self.free_path as f32;
        material.floor[c] = (options.directional.kappa * self.free_path) as f32;
        material.beam[c] = if scatters {
            (factor / (4.0 * PI * options.leaving(diffuse_reflectance(self.ior, Side::Outside)))) as f32
        } else {
            0.0
        };
        material.c_phi = self.c_phi as f32;
        material.c_e = self.c_e as f32;
    }

    /// Its own, under diffuse light.
    fn total(&self) -> f64 {
        self.diffuse_total()
    }
}
