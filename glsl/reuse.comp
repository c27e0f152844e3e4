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
    View view = views[0];
    uint share = probes[index].lit.w;
    if (share - first_share(view) >= view.groups) return;

    Surface surface = surfaces[surface_index(index)];
    Shading shading = shadings[surface.triangle];
    Material m = materials[shading.material];
    uint batch = sample_index() % BATCHES;
    uint key = dimension_key(pixel_key(view.seed, pixel_position(view, index)), batch, DIM_REUSE)
        + hash(sample_index() / BATCHES);
    if (has_model(m, MODEL_TABLE)) {
        table_of(probes[index]);
        table_draw(m, unit(hash(key)));
    }
    float reach2 = uintBitsToFloat(probes[index].seat.w), own_r2 = probes[index].hit_r2;
    vec3 sum = vec3(0.0);
    Tile tile = tile_of(view, place_of(view, index, batch), batch);
    uint row = tile.first.y * view.crop_width + tile.first.x;
    uvec2 at = uvec2(0u);
    [[dont_unroll]] do {
        at.x = 0u;
        [[dont_unroll]] do {
            bool there = in_band(tile, at);
            uint other = there ? row + at.x : index;
            uvec4 lit = probes[other].lit;
            vec3 light = uintBitsToFloat(lit.xyz);
            if (there && lit.w == share && light != vec3(0.0)) {
                vec3 delta = probes[other].hit - surface.position;
                float r2 = other == index ? own_r2 : dot(delta, delta);
                if (other == index || r2 <= reach2) sum += light * shape_drawn(m, r2);
            }
        } while (++at.x < REUSE);
        row += view.crop_width;
    } while (++at.y < REUSE);

    Seen s = seen(view, surface, triangles[surface.triangle], shading);
    float cos_eye = dot(s.shading_normal, s.wo);
    float exit_share = roughness_share(surface.triangle, surface.barycentric);
    vec3 radiance = crossing(m, cos_eye, exit_share) * leaving_share(m, exit_share) * obliqueness(m, cos_eye, true) * m.strength
        * sum;
    if (has_model(m, MODEL_TABLE)) radiance *= table_balance(m, surface);
    if (has_texture(TEXTURE_BASE_COLOR)) {
        radiance *= texture_value(TEXTURE_BASE_COLOR, surface.triangle, surface.barycentric).rgb;
    }
    add_subsurface(index, radiance);
}
