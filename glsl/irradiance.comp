// Adds the light of shadow rays to one point whose light is kept, as of the cloud. The mathematics is in
// src/reference/irradiance.rs.
#version 460
#include "shared.glsl"
#include "math.glsl"
#include "random.glsl"
#include "pixel.glsl"
#include "tile.glsl"
#include "profile.glsl"
#include "texture.glsl"
#include "boundary.glsl"
#include "rough.glsl"
#include "projection.glsl"
#include "intersect.glsl"
#include "light.glsl"
SHADINGS(readonly);
#include "emitter.glsl"
#include "arriving.glsl"
CLUSTERS(read_write);

void main() {
    uint index = pixel_index();
    if (index >= step_.pixel_count) return;
    View view = views[0];
    uint number = step_.node + index;
    Cluster point = clusters[number];
    if (point.area == 0.0) return;
    Material m = materials[shadings[point.triangle].material];
    vec3 shading_n = shading_normal(shadings[point.triangle], point.triangle, point.barycentric);
    float share = roughness_share(point.triangle, point.barycentric);
    Place place = Place(uvec2(index, POINTS_ROW - step_.first_row), 0u);
    uint key = pixel_key(view.seed, place.tile);
    vec3 flux = vec3(0.0), oblique = vec3(0.0);
    uint k = step_.ray_begin;
    if (step_.ray_count != 0u) do {
        vec3 direction;
        vec3 light = arriving(view, k, point.position, point.normal, shading_n, place, key,
            sample_index() % BATCHES, sample_index() / BATCHES, direction);
        if (light != vec3(0.0)) {
            float c = dot(shading_n, direction);
            light *= crossing(m, c, share);
            // A delta light is asked once.
            if (k >= view.light_count) light /= float(step_.range_end - step_.range_begin);
            flux += light;
            oblique += light * table_oblique(m, c);
        }
    } while (++k < step_.ray_begin + step_.ray_count);
    vec3 tint = vec3(point.area);
    // Between points pixels bring their own.
    if (IRRADIANCE != IRRADIANCE_CACHED && has_texture(TEXTURE_BASE_COLOR)) {
        tint *= texture_value(TEXTURE_BASE_COLOR, point.triangle, point.barycentric).rgb;
    }
    clusters[number].flux = point.flux + flux * tint;
    clusters[number].oblique = point.oblique + oblique * tint;
}
