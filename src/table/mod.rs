//! The tabulated profile: Monte Carlo of light in a half-space or a sphere with its true boundary.

pub mod grid;
pub mod single;
pub mod store;
pub mod walk;
pub mod white;

/// Indices of refraction of the tables that the crate ships.
pub const SHIPPED_IORS: [f64; 5] = [1.0, 1.3, 1.33, 1.4, 1.5];

/// Radii of the tabulated spheres: 2 a = 2^(i/2) / sigma_s' for each number i.
pub const SPHERES: [i32; 13] = [0, 1, 2, 3, 4, 5, 6, 7, 8, 10, 12, 14, 16];
