//! The tabulated profile: Monte Carlo of light in a half-space or a sphere with its true boundary.
//!
//! [`walk`] simulates, [`single`] integrates what leaves after one collision, [`white`] keeps both for every absorption
//! and interpolates, [`store`] and [`cache`] keep tables between runs, [`block`] lays a material's profiles out for
//! kernels.
//!
//! # Where a table comes from
//! For isotropic scattering and the indices of refraction [`SHIPPED_IORS`] the crate ships tables (`cargo run --release
//! --example tables` makes them). Any other index or g is simulated when first needed: the half-space alone, half a
//! minute of two cores, and kept in the [`cache`]; what spheres change is taken from the shipped tables at the same
//! reduced coefficients (similarity), between the nearest two indices.
//!
//! # Errors
//! Relative L1 error of R(r), weighted by energy: .3 to .5 % at g = 0 against an independent Monte Carlo whose own noise
//! is .3 %; at g of -.5 to .9 and albedos alpha' of .9 to .99, .5 to .9 % against the random walk of
//! [`reference::walk`](crate::reference::walk), of which its own noise is .3 to .7 %. Each cell states its standard error
//! ([`white::Profile::error`]).

pub mod block;
pub mod cache;
pub mod grid;
pub mod single;
pub mod store;
pub mod walk;
pub mod white;

use crate::reference::profile::Coefficients;
use block::Channel;
use std::collections::HashMap;
use std::sync::{Arc, LazyLock, Mutex, OnceLock};
use white::White;

/// Indices of refraction of the tables that the crate ships.
pub const SHIPPED_IORS: [f64; 6] = [1.0, 1.3, 1.33, 1.4, 1.45, 1.5];

/// Radii of the tabulated spheres: 2 a = 2^(i/2) / sigma_s' for each number i.
pub const SPHERES: [i32; 13] = [0, 1, 2, 3, 4, 5, 6, 7, 8, 10, 12, 14, 16];

const SHIPPED: [&[u8]; SHIPPED_IORS.len()] = [
    include_bytes!("../../assets/tables/1.table"),
    include_bytes!("../../assets/tables/1.3.table"),
    include_bytes!("../../assets/tables/1.33.table"),
    include_bytes!("../../assets/tables/1.4.table"),
    include_bytes!("../../assets/tables/1.45.table"),
    include_bytes!("../../assets/tables/1.5.table"),
];

/// The shipped table of an index of refraction.
pub fn shipped(index: usize) -> Arc<White> {
    static TABLES: [OnceLock<Arc<White>>; SHIPPED_IORS.len()] = [const { OnceLock::new() }; SHIPPED_IORS.len()];
    let read = || Arc::new(store::decode(SHIPPED[index]).expect("the shipped tables are whole"));
    TABLES[index].get_or_init(read).clone()
}

/// The shipped tables around an index of refraction, with their weights.
fn neighbours(ior: f64) -> [(Arc<White>, f64); 2] {
    let last = SHIPPED_IORS.len() - 1;
    let above = SHIPPED_IORS.partition_point(|&n| n < ior).clamp(1, last);
    let (low, high) = (SHIPPED_IORS[above - 1], SHIPPED_IORS[above]);
    let share = ((ior - low) / (high - low)).clamp(0.0, 1.0);
    [(shipped(above - 1), 1.0 - share), (shipped(above), share)]
}

/// Walks of a table that is made when it is needed: the same for every g up to .9, a constant number of collisions beyond.
pub fn walks(g: f64) -> u64 {
    (f64::from(1 << 18) * (10.0 * (1.0 - g)).min(1.0)).max(f64::from(1 << 15)) as u64
}

/// The index of a table that the crate ships.
fn shipped_index(ior: f64, g: f64) -> Option<usize> {
    let near = |a: f64, b: f64| (a - b).abs() < 1e-6;
    SHIPPED_IORS.iter().position(|&shipped| near(shipped, ior)).filter(|_| near(g, 0.0))
}

/// Whether the crate ships the table of matter; else it is simulated, or comes from the cache.
pub fn is_shipped(ior: f64, g: f64) -> bool {
    shipped_index(ior, g).is_some()
}

/// The table of matter: shipped, from memory, from the cache, or simulated.
///
/// Memory here only saves work: a table depends on nothing but its arguments.
pub fn table(ior: f64, g: f64) -> Arc<White> {
    static MADE: LazyLock<Mutex<HashMap<(u64, u64), Arc<White>>>> = LazyLock::new(Mutex::default);
    if let Some(index) = shipped_index(ior, g) {
        return shipped(index);
    }
    // Digits that no measurement has would only fill the cache.
    let [ior, g] = [ior, g].map(|x| (x * 1e6).round() / 1e6);
    let mut made = MADE.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
    let entry = made.entry((ior.to_bits(), g.to_bits()));
    let make = || cache::table(cache::folder().as_deref(), ior, g, walks(g)).curved(&neighbours(ior));
    entry.or_insert_with(|| Arc::new(make())).clone()
}

/// One channel of matter with its table; none for matter that does not scatter.
pub fn channel(matter: &Coefficients) -> Option<Channel> {
    let extinction = matter.sigma_s_prime + matter.sigma_a;
    let scatters = matter.sigma_s_prime > 0.0 && extinction > 0.0;
    scatters.then(|| Channel {
        table: table(matter.ior, matter.g),
        albedo: matter.sigma_s_prime / extinction,
        scattering: matter.sigma_s_prime,
    })
}

impl Channel {
    /// Rate at which the profile falls at large radii [1/length].
    pub fn rate(&self) -> f64 {
        white::decay(self.albedo) * self.scattering / self.albedo
    }
}
