//! Single kernels on a device, so that a driver can be tested.

mod bench;

pub use bench::{Bench, Dispatch, Loaded};
