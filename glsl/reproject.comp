// Carries each pixel's probe onto the real surface: all hits on its set, in order of distance.
#version 460
#include "shared.glsl"
#include "math.glsl"
#include "random.glsl"
#include "pixel.glsl"
#include "active.glsl"
#include "texture.glsl"
#include "intersect.glsl"
SURFACES(readonly);
#include "screen.glsl"
PROBES(readonly);
HIT_LISTS(writeonly);

void main() {
    uint index = active_pixel();
    if (index >= step_.pixel_count) return;
    Probe probe = probes[index];
    Surface surface = surfaces[surface_index(index)];
    View view = views[0];
    bool has_probe = probe.t_min <= probe.t_max;
    uint set = has_probe ? triangles[surface.triangle].set : 0u;
    uint key = dimension_key(pixel_key(view.seed, pixel_position(view, index)), sample_index() % BATCHES, DIM_OVERFLOW)
        + hash(sample_index() / BATCHES);
    Ray ray = Ray(surface.position, probe.offset, probe.direction, probe.t_min, probe.t_max);
    hit_count = 0u;
    if (REPROJECT == REPROJECT_SCREEN) {
        if (has_probe) look_up(view, ray, set);
    } else {
        traverse(ray, PROJECTION == PROJECTION_CAMERA ? CLOSEST : ALL, set, key);
    }

    uint kept = min(hit_count, MAX_HITS);
    // Insertion sort: most lists hold one or two.
    for (uint i = 1; i < kept; i++) {
        float t = hit_t[i];
        uint triangle = hit_triangle[i];
        uint j = i;
        for (; j > 0 && hit_t[j - 1] > t; j--) {
            hit_t[j] = hit_t[j - 1];
            hit_triangle[j] = hit_triangle[j - 1];
        }
        hit_t[j] = t;
        hit_triangle[j] = triangle;
    }
    hit_lists[index].count = hit_count;
    uint i = 0u;
    if (kept != 0u) do {
        hit_lists[index].t[i] = hit_t[i];
        hit_lists[index].triangle[i] = hit_triangle[i];
    } while (++i < kept);
}
