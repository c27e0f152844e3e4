//! Scenes: what a file becomes, and what is said of files that break a rule.

mod build;
mod bvh;
mod environments;
mod geometry;
mod materials;
mod mutations;
mod nodes;
mod parts;
mod poses;
mod presets;
mod rules;
#[allow(dead_code)]
#[path = "../images/scenes.rs"]
mod scenes;
mod sets;
mod textures;
