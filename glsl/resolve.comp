// Turns the running sums of each pixel into its means and the variance of the mean between batches. What exceeds f32 is
// its largest number.
#version 460
#include "shared.glsl"
#include "math.glsl"
#include "pixel.glsl"
RUNNING_SUMS(readonly);
BATCH_SUMS(readonly);
PROGRESSES(readonly);
PIXELS(writeonly);
COLORS(writeonly);

// Samples below `end` of batch `b`.
uint samples_of_batch(uint b, uint end) {
    return (end + BATCHES - 1u - b) / BATCHES;
}

void main() {
    uint index = pixel_index();
    if (index >= step_.pixel_count) return;
    Sums sums = running_sums[index];
    uint begin = RECORDED != 0 ? progresses[0].begin : step_.range_begin;
    uint end = begin + sums.samples;
    Pixel pixel;
    float n = float(max(sums.samples, 1u));
    // Divided first: sum and carry together may exceed f32.
    pixel.subsurface = clamp_finite(max(sums.subsurface / n + sums.subsurface_carry / n, vec3(0.0)));
    pixel.reflection = clamp_finite(max(sums.reflection / n + sums.reflection_carry / n, vec3(0.0)));
    pixel.variance = vec3(0.0);
    if (BATCHED != 0) {
        vec3 mean = vec3(0.0);
        for (uint b = 0; b < BATCHES; b++) mean += batch_sums[b * step_.pixel_count + index] / n;
        // Relative to the largest deviation, whose square may exceed f32.
        vec3 largest = vec3(0.0);
        vec3 deviation[BATCHES];
        float n_b[BATCHES];
        for (uint b = 0; b < BATCHES; b++) {
            n_b[b] = float(samples_of_batch(b, end) - samples_of_batch(b, begin));
            deviation[b] = batch_sums[b * step_.pixel_count + index] / max(n_b[b], 1.0) - mean;
            largest = max(largest, abs(deviation[b]));
        }
        vec3 scale = max(largest, vec3(1e-30));
        vec3 squares = vec3(0.0);
        for (uint b = 0; b < BATCHES; b++) {
            vec3 relative = deviation[b] / scale;
            squares += n_b[b] * relative * relative;
        }
        pixel.variance = clamp_finite(squares / (float(BATCHES - 1u) * n) * scale * scale);
    }
    pixel.alpha = float(sums.covered) / n;
    pixel.samples = sums.samples;
    pixel.invalid = sums.invalid;
    pixels[index] = pixel;
    if (RECORDED != 0) colors[index] = vec4(clamp_finite(pixel.subsurface + pixel.reflection), pixel.alpha);
}
