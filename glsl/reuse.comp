// Adds the light of all hits of a tile to each of its pixels.
#version 460
#include "shared.glsl"
#include "math.glsl"
#include "random.glsl"
#include "pixel.glsl"
#include "active.glsl"
#include "tile.glsl"
#include "profile.glsl"
#include "texture.glsl"
#include "boundary.glsl"
#include "rough.glsl"
#include "projection.glsl"
#include "sums.glsl"
TRIANGLES(readonly);
SHADINGS(readonly);
SURFACES(readonly);
PROBES(readonly);
#include "shared_hit.glsl"

void main() {
    uint index = active_pixel();
    if (index >= step_.pixel_count) return;
    if (probes[index].stamp != sample_index() + 1u) return;

    View view = views[0];
    Surface surface = surfaces[surface_index(index)];
    Shading shading = shadings[surface.triangle];
    Material m = materials[shading.material];
    if (has_model(m, MODEL_TABLE)) table_of(probes[index]);
    uint batch = sample_index() % BATCHES;
    vec3 sum = vec3(0.0);
    uint group = probes[index].group;
    Tile tile = tile_of(view, place_of(view, index, batch), batch);
    [[dont_unroll]] for (uint y = tile.first.y; y < tile.end.y; y++) {
        [[dont_unroll]] for (uint x = tile.first.x; x < tile.end.x; x++) {
            uint other = y * view.crop_width + x;
            if (!shares(other, group)) continue;
            vec3 light = probes[other].light;
            if (light == vec3(0.0)) continue;
            vec3 delta = surfaces[surface_index(other)].position - surface.position + probes[other].delta;
            sum += light * value_at(m, delta, other == index);
        }
    }

    Seen s = seen(view, surface, triangles[surface.triangle], shading);
    float cos_eye = dot(s.shading_normal, s.wo);
    float share = roughness_share(surface.triangle, surface.barycentric);
    vec3 radiance = crossing(m, cos_eye, share) * leaving_share(m, share) * obliqueness(m, cos_eye, true) * sum;
    if (has_model(m, MODEL_TABLE)) radiance *= table_balance(m, surface);
    if (has_texture(TEXTURE_BASE_COLOR)) {
        radiance *= texture_value(TEXTURE_BASE_COLOR, surface.triangle, surface.barycentric).rgb;
    }
    add_subsurface(index, radiance);
}
