//! The twins against truths that they do not contain: closed forms, quadrature, an independent integrator. No GPU.

mod boundary;
mod profile;
mod random;
