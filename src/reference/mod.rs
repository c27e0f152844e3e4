//! The kernels in f64, written from the formulas: twins of glsl/*.comp and glsl/*.glsl under the same stems.
