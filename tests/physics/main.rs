//! The twins against truths that they do not contain: closed forms, quadrature, an independent integrator. No GPU.

mod boundary;
mod common;
mod plane;
mod profile;
mod random;
mod sphere;
