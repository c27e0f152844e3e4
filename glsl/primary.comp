// Finds the surface that a pixel sees through the sub-pixel position of the current stratum.
#version 460
#include "shared.glsl"
#include "math.glsl"
#include "random.glsl"
#include "pixel.glsl"
#include "texture.glsl"
#include "intersect.glsl"
SURFACES(writeonly);
ACTIVES(read_write);

void main() {
    uint index = pixel_index();
    if (index >= step_.pixel_count) return;
    if (step_.traced != 0u) {
        if (index >= step_.traced) return;
        index = actives[ACTIVE_HEADER + index];
    }
    // A recording traces the strata of its first samples, whatever they are, and then each where it starts.
    if (RECORDED != 0 && step_.pixel_centre == 0 && step_.sample_index >= BATCHES
        && sample_index() / BATCHES % stratum_samples() != 0u) return;
    View view = views[0];
    uvec2 pixel = pixel_position(view, index);
    vec2 within = vec2(0.5);
    if (step_.pixel_centre == 0) {
        uint stratum = sample_index() / BATCHES / stratum_samples();
        within = random_point(pixel_key(view.seed, pixel), sample_index() % BATCHES, DIM_PIXEL, stratum);
    }
    vec2 ndc = 2.0 * (vec2(pixel) + within) / vec2(view.width, view.height) - 1.0;
    // The ray starts on the plane through the pivot, near the scene, so that a far eye costs no digits.
    vec3 on_plane = ndc.x * view.right - ndc.y * view.up;
    vec3 to = view.forward + view.perspective * on_plane;
    float len = length(to);
    float reach = view.perspective != 0.0 ? len : view.reach;
    traverse(Ray(view.pivot + on_plane, vec3(0.0), to / len, -reach, 1e30), CLOSEST, EVERY_SET, 0u);

    Surface surface;
    surface.position = vec3(0.0);
    surface.triangle = MISS;
    surface.barycentric = vec2(0.0);
    if (hit_count != 0) {
        Triangle triangle = triangles[hit_triangle[0]];
        precise vec3 position = triangle.vertices[0] + from_corner(triangle, hit_barycentric);
        surface.position = position;
        surface.triangle = hit_triangle[0];
        surface.barycentric = hit_barycentric;
    }
    surfaces[surface_index(index)] = surface;
    if (LISTED != 0 && step_.pixel_centre == 0 && (surface.triangle != MISS || view.show_environment != 0u)) {
        // The next kernels get a workgroup more with the first of its pixels.
        uint batch = sample_index() % BATCHES;
        uint place = atomicAdd(actives[4u * batch + 3u], 1u);
        if (place % gl_WorkGroupSize.x == 0u) atomicAdd(actives[4u * batch], 1u);
        actives[ACTIVE_HEADER + (1u + batch) * step_.pixel_count + place] = index;
    }
}
