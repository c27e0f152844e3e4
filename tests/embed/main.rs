//! The library inside somebody else's Vulkan application. Every test ends with a silent validation layer, after the
//! device is gone.

mod app;
mod c;
mod device;
mod faults;
mod leaks;
mod names;
mod record;
mod update;
