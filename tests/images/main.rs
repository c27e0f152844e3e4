//! Whole renders on the device: against closed forms, against the independent area integrator, against the twins,
//! and against themselves. Under the validation layer with synchronization checks.

mod adaptive;
mod bad_meshes;
mod cached;
mod closed_forms;
mod cloud;
mod edge_cases;
mod emitters;
mod fireflies;
mod harness;
mod inspect;
mod integrator;
mod lambert;
mod lights;
mod measure;
mod mixtures;
#[path = "../common/pool.rs"]
mod pool;
mod references;
mod repeatable;
mod reuse;
mod scenes;
mod screen;
mod single;
mod statistics;
mod table;
mod textures;
mod twins;

pub use harness::{channel, device, mean_and_error, render};
