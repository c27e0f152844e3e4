// Adds light x BSSRDF x Jacobian / density of one probe's hits to the running sums of each pixel.
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
#include "intersect.glsl"
#include "light.glsl"
#include "sums.glsl"
SHADINGS(readonly);
#include "emitter.glsl"
#include "arriving.glsl"
SURFACES(readonly);
PROBES(read_write);
HIT_LISTS(readonly);
#include "mixture.glsl"
#include "cached.glsl"
#include "shared_hit.glsl"

// Weights of the second and third vertex at a point of a triangle, relative to its first.
vec2 weights(Triangle triangle, vec3 point) {
    vec3 edge1 = triangle.vertices[1] - triangle.vertices[0], edge2 = triangle.vertices[2] - triangle.vertices[0];
    vec3 n = cross(edge1, edge2);
    return vec2(dot(cross(point, edge2), n), dot(cross(edge1, point), n)) / dot(n, n);
}

// The matter that light enters at a point of a triangle; `m` is that of the surface that is seen.
Material entered_matter(Material m, Surface surface, uint triangle, vec2 barycentric) {
    if (MIXED != 0) {
        m = materials[shadings[triangle].material];
        if (has_model(m, MODEL_TABLE)) table_at(m, surface);
    }
    return textured_medium(m, triangle, barycentric);
}

// Density of the hit at xo + delta: the mean over the media of the set.
float hit_density(Seen s, Material m, Surface surface, vec3 delta, vec3 n) {
    if (MIXED == 0) return mixture_density(s, m, delta, n);
    Mixture mixture = mixture_at(surface);
    float sum = 0.0;
    for (uint k = 0u; k < min(mixture.count, MAX_MEMBERS); k++) {
        sum += mixture_density(s, mixture_member(mixture, k, surface), delta, n);
    }
    return sum / float(mixture.count);
}

// 1 / density of the hit at xo + delta under the camera projection, but for e^{rate radius}, which goes into the profile.
float camera_factor(Seen s, Material m, Probe probe, vec3 delta, vec3 n) {
    float q = camera_ratio(s, delta);
    vec3 d = probe.direction;
    float cos_hit = abs(dot(n, d));
    // A hit in its own plane's direction has no density.
    float jacobian = cos_hit > 0.0 && q > 0.0 ? abs(dot(s.normal, d)) / (cos_hit * q * q) : 0.0;
    return 2.0 * PI * probe.radius / m.camera_rate * jacobian;
}

// The directional dipole's value of light from wi that enters at xo + delta with the normal ni.
vec3 directed(Material m, Seen s, vec3 delta, vec3 ni, vec3 wi, float shift) {
    vec3 value = directional_value(m, -delta, ni, wi, s.shading_normal, shift);
    if ((m.flags & RECIPROCAL) == 0u) return value;
    return 0.5 * (value + directional_value(m, delta, s.shading_normal, s.wo, ni, shift));
}

void main() {
    uint index = active_pixel();
    if (index >= step_.pixel_count) return;
    Surface surface = surfaces[surface_index(index)];
    bool covered = surface.triangle != MISS;
    if (step_.count != 0u) count_covered(index, covered);
    if (!covered || step_.ray_count == 0u) return;

    View view = views[0];
    Shading shading = shadings[surface.triangle];
    Material m = materials[shading.material];
    if ((m.flags & TRANSLUCENT) == 0u) return;
    // Other integrators do the rest.
    if (INTEGRATOR != INTEGRATOR_SAMPLE && !has_model(m, MODEL_LAMBERT)) return;
    if (MIXED != 0) {
        m.camera_rate = mixture_at(surface).camera_rate;
    } else if (has_model(m, MODEL_TABLE)) {
        table_at(m, surface);
    }
    Seen s = seen(view, surface, triangles[surface.triangle], shading);
    bool cached = IRRADIANCE == IRRADIANCE_CACHED && s.side > 0.0 && !has_model(m, MODEL_LAMBERT);
    // It has the light of all rays.
    if (cached && step_.ray_begin != 0u) return;
    uint batch = sample_index() % BATCHES;
    Place place = place_of(view, index, batch);
    uint key = pixel_key(view.seed, place.tile);

    // Where light enters. In the opaque limit that is where it leaves, and there are no probes.
    vec3 delta = vec3(0.0);
    uint lit = surface.triangle;
    vec2 barycentric = surface.barycentric;
    float shift = 0.0;
    vec3 factor;
    Material local;
    bool own_value = false;
    if (has_model(m, MODEL_LAMBERT)) {
        local = textured_medium(m, lit, barycentric);
        factor = local.strength;
        if (factor == vec3(0.0)) return;
    } else {
        Probe probe = probes[index];
        uint count = hit_lists[index].count;
        if (!(probe.t_min <= probe.t_max) || count == 0u) return;

        // One hit is lit, chosen in proportion to its profile over density.
        float total = 0.0;
        float u = coordinate(place, key, batch, DIM_HIT);
        vec3 f;
        float given = 1.0;
        if (PROJECTION == PROJECTION_CAMERA) shift = m.camera_rate * probe.radius;
        [[dont_unroll]] for (uint j = 0u; j < min(count, MAX_HITS); j++) {
            vec3 to = probe.offset + hit_lists[index].t[j] * probe.direction;
            uint triangle = hit_lists[index].triangle[j];
            vec3 n = geometric_normal(triangles[triangle]);
            vec2 at = weights(triangles[triangle], (s.position - triangles[triangle].vertices[0]) + to);
            Material there = entered_matter(m, surface, triangle, at);
            vec3 value = there.strength * shape_shifted(there, dot(to, to), shift);
            if (PROJECTION == PROJECTION_CAMERA) given = camera_factor(s, m, probe, to, n);
            value *= given;
            // In the opaque limit light leaves nowhere else.
            if (MIXED != 0 && has_model(there, MODEL_LAMBERT)) value = vec3(0.0);
            float p = PROJECTION == PROJECTION_CAMERA ? 1.0 : hit_density(s, m, surface, to, n);
            float weight = p > 0.0 ? (value.x + value.y + value.z) / p : 0.0;
            total += weight;
            float chance = total > 0.0 ? weight / total : 0.0;
            // What is left of the number, of the hit that is chosen so far or of the others, is one in [0, 1) again.
            bool chosen = u < chance;
            u = chosen ? u / chance : (u - chance) / (1.0 - chance);
            if (chosen) {
                delta = to;
                lit = triangle;
                barycentric = at;
                f = value;
            }
        }
        if (!(total > 0.0)) return;
        local = entered_matter(m, surface, lit, barycentric);
        own_value = has_model(local, MODEL_DIRECTIONAL);
        // f / p x total / (sum(f) / p): the density cancels. The directional dipole's own value comes with each ray.
        float weight = total * max(1.0, float(count) / float(MAX_HITS));
        weight /= f.x + f.y + f.z;
        // The tile's pixels bring their own values of the hit.
        factor = REUSE != 0u ? vec3(weight) : (own_value ? vec3(given) : f) * weight;
    }

    vec3 n = s.side * geometric_normal(triangles[lit]);
    vec3 shading_n = s.side * shading_normal(shadings[lit], lit, barycentric);
    vec3 position = s.position + delta;
    float entry_share = roughness_share(lit, barycentric);

    vec3 entering = cached ? cached_light(local, lit, barycentric) : vec3(0.0);
    uint k = step_.ray_begin;
    if (!cached) do {
        vec3 direction;
        vec3 light = arriving(view, k, position, n, shading_n, place, key, batch,
            sample_index() / BATCHES, direction);
        if (light != vec3(0.0)) {
            light *= crossing(local, dot(shading_n, direction), entry_share);
            light *= obliqueness(local, dot(shading_n, direction), false);
            if (own_value) light *= directed(local, s, delta, shading_n, direction, shift);
            entering += light;
        }
    } while (++k < step_.ray_begin + step_.ray_count);

    if (REUSE != 0u && !has_model(m, MODEL_LAMBERT)) {
        if (has_texture(TEXTURE_BASE_COLOR)) entering *= texture_value(TEXTURE_BASE_COLOR, lit, barycentric).rgb;
        if (entering == vec3(0.0)) return;
        float r2 = dot(delta, delta);
        probes[index].hit = position;
        probes[index].hit_r2 = r2;
        factor *= tile_share(tile_of(view, place, batch), view.crop_width, m, index, position, r2);
        vec3 light = uintBitsToFloat(probes[index].lit.xyz) + entering * factor;
        probes[index].lit.xyz = floatBitsToUint(light);
        return;
    }

    float cos_eye = dot(s.shading_normal, s.wo);
    float exit_share = roughness_share(surface.triangle, surface.barycentric);
    vec3 radiance = crossing(m, cos_eye, exit_share) * leaving_share(m, exit_share)
        * obliqueness(local, cos_eye, true) * factor * entering;
    if (has_model(local, MODEL_TABLE)) radiance *= table_balance(local, surface);
    if (MIXED != 0) radiance *= m.exit;
    // The base colour tints what crosses the surface, there and here.
    if (has_texture(TEXTURE_BASE_COLOR)) {
        radiance *= texture_value(TEXTURE_BASE_COLOR, lit, barycentric).rgb
            * texture_value(TEXTURE_BASE_COLOR, surface.triangle, surface.barycentric).rgb;
    }
    add_subsurface(index, radiance);
}
