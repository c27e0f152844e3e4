//! Which pixel an invocation works on: twin of `pixel.glsl`.

use crate::shared::{Step, View};

/// Column and row, in the full image, of pixel `index` of the step's band.
pub fn position(view: &View, step: &Step, index: u32) -> (u32, u32) {
    (view.crop_x + index % view.crop_width, step.first_row + index / view.crop_width)
}
