// Forgets the sums of a pixel where a recording starts new ones.
#version 460
#include "shared.glsl"
#include "pixel.glsl"
PROGRESSES(readonly);
RUNNING_SUMS(writeonly);
BATCH_SUMS(writeonly);

void main() {
    uint index = pixel_index();
    if (index >= step_.pixel_count || progresses[0].restart == 0u) return;
    running_sums[index] = Sums(vec3(0.0), vec3(0.0), vec3(0.0), vec3(0.0), 0u, 0u, 0u);
    if (BATCHED != 0) {
        for (uint b = 0u; b < BATCHES; b++) batch_sums[b * step_.pixel_count + index] = vec3(0.0);
    }
}
