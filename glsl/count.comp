// Counts samples of each pixel; forgets its sums first where a recording starts new ones.
#version 460
#include "shared.glsl"
#include "pixel.glsl"
PROGRESSES(readonly);
ACTIVES(readonly);
RUNNING_SUMS(read_write);
BATCH_SUMS(writeonly);

void main() {
    uint index = pixel_index();
    if (index >= step_.pixel_count) return;
    if (step_.traced != 0u) {
        if (index >= step_.traced) return;
        index = actives[ACTIVE_HEADER + index];
    }
    if (RECORDED != 0 && progresses[0].restart != 0u) {
        running_sums[index] = Sums(vec3(0.0), vec3(0.0), vec3(0.0), vec3(0.0), 0u, 0u, 0u);
        if (BATCHED != 0) {
            for (uint b = 0u; b < BATCHES * BATCHED; b++) batch_sums[b * step_.pixel_count + index] = vec3(0.0);
        }
    }
    running_sums[index].samples += step_.count;
}
