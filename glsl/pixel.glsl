// Which pixel and which sample an invocation works on.

VIEWS(readonly);
SAMPLES(readonly);

// Position of the pixel in the band; at least step_.pixel_count for surplus invocations.
uint pixel_index() {
    return gl_WorkGroupID.y * gl_NumWorkGroups.x * gl_WorkGroupSize.x + gl_GlobalInvocationID.x;
}

// Column and row in the full image.
uvec2 pixel_position(View view, uint index) {
    return uvec2(view.crop_x + index % view.crop_width, step_.first_row + index / view.crop_width);
}

// Index of the sample.
uint sample_index() {
    return RECORDED != 0 ? samples[step_.sample_index].index : step_.sample_index;
}

// Coordinate of the sample's point, the same for all pixels.
uint sample_point(uint dimension) {
    return RECORDED != 0 ? samples[step_.sample_index].point[dimension] : step_.point[dimension];
}

// Consecutive samples of a batch that share a sub-pixel stratum: gathering is the same in all of it.
uint stratum_samples() {
    return INTEGRATOR == INTEGRATOR_CLOUD ? 1u : STRATUM;
}

// Where the pixel's surface of the current sample is: each batch has a G-buffer. Pixels' centres go to the first.
uint surface_index(uint index) {
    uint batch = step_.pixel_centre != 0 ? 0u : sample_index() % BATCHES;
    return batch * step_.pixel_count + index;
}
