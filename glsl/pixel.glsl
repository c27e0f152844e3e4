// Which pixel an invocation works on.

VIEWS(readonly);

// Position of the pixel in the band; at least step_.pixel_count for surplus invocations.
uint pixel_index() {
    return gl_WorkGroupID.y * gl_NumWorkGroups.x * gl_WorkGroupSize.x + gl_GlobalInvocationID.x;
}

// Column and row in the full image.
uvec2 pixel_position(View view, uint index) {
    return uvec2(view.crop_x + index % view.crop_width, step_.first_row + index / view.crop_width);
}

// Where the pixel's surface of the current sample is: each batch has a G-buffer.
uint surface_index(uint index) {
    return step_.sample_index % BATCHES * step_.pixel_count + index;
}
