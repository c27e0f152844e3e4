//! Sets of several materials: light travels by the profile of the matter that it entered. Twin of `mixture.glsl`.
//!
//! # What is modelled
//! Light that entered matter k at xi and leaves matter e at xo:
//!
//!   S = Ft_k(wi) Ft_e(wo) Rd_k(|xo - xi|) / (pi (1 - rho_e)),
//!
//! with the profile, textures and boundary of the entry, and the boundary of the exit, whose rho_e makes what leaves in
//! all directions Rd_k. A base colour tints at each. So every point of entry sends out the total of its own profile,
//! whatever lies around it.
//!
//! That is not reciprocal where the matter changes: S(xi, xo) is not S(xo, xi), so eye and light may not be exchanged
//! there, and paths from the light and from the eye give different images. The true light diffuses on in the matter that
//! it crosses, which no profile of one medium knows.
//!
//! In the opaque limit light leaves where it entered: such matter neither gives light to the others nor takes theirs.
//!
//! # Sampling
//! What matter a probe will meet is not known when its radius is drawn. So one of the set's K media is taken, each with
//! the probability 1 / K, and the density is their mean (balance heuristic of the one-sample model, E. Veach, L. Guibas,
//! SIGGRAPH 1995):
//!
//!   p = (p_1 + ... + p_K) / K.
//!
//! p > 0 wherever any member's is, so every pair of media is met without bias, and f_k / p <= K f_k / p_k: nothing weighs
//! more than K times what it weighs on a body of k alone. All look into one ball, the largest; the camera projection's
//! exponential is the slowest.

use super::Inputs;
use crate::shared::Material;

/// The media from which radii are drawn on a triangle of the matter `own`; none where nothing scatters.
pub fn members(inputs: &Inputs, own: &Material, triangle: u32) -> Vec<Material> {
    let mut all = match inputs.mixtures.get(inputs.triangles[triangle as usize].set as usize) {
        None => vec![*own],
        Some(mixture) => {
            let member = |&k: &u32| Material {
                radius_max: mixture.radius_max,
                camera_rate: mixture.camera_rate,
                ..inputs.materials[k as usize]
            };
            mixture.members[..mixture.count as usize].iter().map(member).collect()
        }
    };
    all.retain(|member| member.component_cdf[8] > 0.0);
    all
}

/// The member that a number in [0, 1) picks, and the number's place within that share.
pub fn pick(members: &[Material], u: f64) -> (&Material, f64) {
    let x = u * members.len() as f64;
    let k = (x as usize).min(members.len() - 1);
    (&members[k], x - k as f64)
}

/// The matter that light enters on a triangle; `own` is that of the surface that is seen.
pub fn entered<'a>(inputs: &Inputs<'a>, own: &'a Material, triangle: u32) -> &'a Material {
    if inputs.mixtures.is_empty() {
        return own;
    }
    &inputs.materials[inputs.shadings[triangle as usize].material as usize]
}
