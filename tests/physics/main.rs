//! The twins against truths that they do not contain: closed forms, quadrature, an independent integrator. No GPU.

mod balance;
mod boundary;
#[path = "../common/mod.rs"]
mod common;
mod curvature;
mod density;
mod difference;
mod edge;
mod front;
mod light;
mod model_errors;
mod models;
mod plane;
mod profile;
mod random;
mod rough;
mod single;
mod sphere;
mod stages;
mod table;
mod texture;
mod walk;
mod walk_models;
