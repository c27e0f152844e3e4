// Turns the running sums of each pixel into its means and the variance of the mean between batches.
#version 460
#include "shared.glsl"
#include "pixel.glsl"
RUNNING_SUMS(readonly);
BATCH_SUMS(readonly);
PIXELS(writeonly);

// Samples below `end` of batch `b`.
uint samples_of_batch(uint b, uint end) {
    return (end + BATCHES - 1u - b) / BATCHES;
}

void main() {
    uint index = pixel_index();
    if (index >= step_.pixel_count) return;
    Sums sums = running_sums[index];
    Pixel pixel;
    float n = float(max(sums.samples, 1u));
    pixel.subsurface = max((sums.subsurface + sums.subsurface_carry) / n, vec3(0.0));
    pixel.reflection = max((sums.reflection + sums.reflection_carry) / n, vec3(0.0));
    pixel.variance = vec3(0.0);
    if (BATCHED != 0) {
        vec3 mean = vec3(0.0);
        for (uint b = 0; b < BATCHES; b++) mean += batch_sums[b * step_.pixel_count + index];
        float samples = float(step_.range_end - step_.range_begin);
        mean /= samples;
        for (uint b = 0; b < BATCHES; b++) {
            float n_b = float(samples_of_batch(b, step_.range_end) - samples_of_batch(b, step_.range_begin));
            vec3 deviation = batch_sums[b * step_.pixel_count + index] / max(n_b, 1.0) - mean;
            pixel.variance += n_b * deviation * deviation;
        }
        pixel.variance /= float(BATCHES - 1u) * samples;
    }
    pixel.alpha = float(sums.covered) / n;
    pixel.samples = sums.samples;
    pixel.invalid = sums.invalid;
    pixels[index] = pixel;
}
