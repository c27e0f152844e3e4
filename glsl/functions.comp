// Evaluates the function that step_.ray_begin names, once for each invocation: its argument is batch_sums, where its value
// goes, and the vectors and the number in shadings. Only tests run it; src/verify/functions.rs has the other side.
#version 460
#include "shared.glsl"
#include "math.glsl"
#include "random.glsl"
#include "pixel.glsl"
#include "profile.glsl"
#include "texture.glsl"
#include "boundary.glsl"
#include "rough.glsl"
#include "phase.glsl"
#include "projection.glsl"
#include "intersect.glsl"
#include "light.glsl"
#include "sums.glsl"
SHADINGS(readonly);
#include "emitter.glsl"
SURFACES(readonly);
PROBES(readonly);
#include "mixture.glsl"

// An integer of two halves, and the halves of one: as floats, which no driver changes in passing.
uint word(vec3 x) {
    return uint(x.x) | uint(x.y) << 16;
}

vec3 halves(uint w) {
    return vec3(w & 0xffffu, w >> 16, 0.0);
}

void main() {
    uint i = pixel_index();
    if (i >= step_.pixel_count) return;
    uint f = step_.ray_begin;
    vec3 x = batch_sums[i];
    vec3 a = shadings[i].normal0, b = shadings[i].normal1, c = shadings[i].normal2;
    uint k = shadings[i].material;
    vec3 y = vec3(0.0);

    if (f == FUNCTION_ARITHMETIC) y = vec3(x.x * x.y + x.z, x.x / x.y, sqrt(abs(x.x)));
    if (f == FUNCTION_DOT) y = vec3(dot(x, a), length(x), cross(x, a).y);
    if (f == FUNCTION_HASH) y = halves(hash(word(x)));
    if (f == FUNCTION_SCRAMBLE) y = halves(scramble(word(x), k));
    if (f == FUNCTION_SOBOL) y = halves(sobol1(word(x)));
    if (f == FUNCTION_KEY) y = halves(dimension_key(pixel_key(k, uvec2(x.xy)), uint(x.z), DIM_LIGHT));
    if (f == FUNCTION_POINT) y = vec3(random_point(k, uint(x.z), DIM_EMITTER, word(x)), 0.0);

    if (f == FUNCTION_EXP) y.x = exp_(x.x);
    if (f == FUNCTION_LOG) y.x = log_(x.x);
    if (f == FUNCTION_LOG1P) y.x = log1p_(x.x);
    if (f == FUNCTION_ONE_MINUS_EXP_OVER) y.x = one_minus_exp_over(x.x);
    if (f == FUNCTION_COS_SIN) y.xy = cos_sin_2pi(x.x);
    if (f == FUNCTION_ATAN2) y.x = atan2_(x.y, x.x);
    if (f == FUNCTION_BASIS) {
        vec3 tangent, bitangent;
        orthonormal_basis(a, tangent, bitangent);
        y = x.x * tangent + x.y * bitangent + x.z * a;
    }

    if (f == FUNCTION_FRESNEL) y.x = fresnel(x.x, x.y);
    if (f == FUNCTION_CROSSING) y.xy = vec2(crossing(materials[k], x.x, x.y), leaving_share(materials[k], x.y));
    if (f == FUNCTION_GGX) y.xy = vec2(ggx_distribution(x.x, a), ggx_lambda(x.x, a));
    if (f == FUNCTION_HALF_VECTOR) y = draw_half_vector(a, x.x, x.yz);
    if (f == FUNCTION_REFRACTED) y = refracted(a, b, x.x);
    if (f == FUNCTION_PHASE) y.x = phase(x.x, a, b);
    if (f == FUNCTION_DRAW_PHASE) y = draw_phase(x.x, a, x.yz);

    if (f == FUNCTION_TEXTURE) y = texture_at(textures[uint(x.z)], x.xy).rgb;
    if (f == FUNCTION_TEXTURE_ALPHA) y.x = texture_at(textures[uint(x.z)], x.xy).a;

    if (f == FUNCTION_DELTA_LIGHT) y = delta_light(k, x).irradiance;
    if (f == FUNCTION_LIGHT_DIRECTION) y = delta_light(k, x).direction;
    if (f == FUNCTION_ENVIRONMENT) y = environment_radiance(views[0], a);
    if (f == FUNCTION_ENVIRONMENT_DENSITY) y.x = environment_density(views[0], a);
    if (f == FUNCTION_DRAW_ENVIRONMENT) y = draw_environment(views[0], x.xy);
    if (f == FUNCTION_DRAW_COSINE) y = draw_cosine(a, x.xy);
    if (f == FUNCTION_DRAW_EMITTER) {
        EmitterPoint point = draw_emitter(views[0], a, b, x.xy);
        y = point.direction * point.distance;
    }
    if (f == FUNCTION_EMITTER_DENSITY) y = combined(vec3(1.0), emitter_density(views[0], k), x.x, k, a, x.y);

    if (f >= FUNCTION_SHAPE && f <= FUNCTION_OBLIQUENESS) {
        Material m = materials[k];
        if (has_model(m, MODEL_TABLE)) table_at(m, Surface(vec3(0.0), i, vec2(0.25, 0.5)));
        if (f == FUNCTION_SHAPE) y = shape_shifted(m, x.x * x.x, x.y);
        if (f == FUNCTION_RADIUS) y = vec3(draw_radius(m, x.y, x.z), radial_density(m, x.x * x.x), 0.0);
        if (f == FUNCTION_DIRECTIONAL) y = directional_value(m, x, a, b, c, 0.0);
        if (f == FUNCTION_OBLIQUENESS) y = obliqueness(m, x.x, x.y > 0.5);
    }
    if (f == FUNCTION_PICK) {
        float u = x.x;
        uint member = pick_member(mixtures[k], u);
        y = vec3(member, u, 0.0);
    }

    if (f == FUNCTION_FRACTIONS) y = technique_fractions(x.x).xyw;
    if (f == FUNCTION_SEEN || f == FUNCTION_DENSITY) {
        Surface surface = surfaces[i];
        Shading shading = shadings[surface.triangle];
        Seen s = seen(views[0], surface, triangles[surface.triangle], shading);
        if (f == FUNCTION_SEEN) y = x.x == 0.0 ? s.wo : x.x == 1.0 ? s.shading_normal
            : vec3(s.eye_distance, s.inverse_distance, s.side);
        if (f == FUNCTION_DENSITY) y = vec3(mixture_density(s, materials[shading.material], probes[i].offset,
            probes[i].direction), camera_ratio(s, probes[i].offset), 0.0);
    }

    // CLOSEST, ANY or ALL; x.z says which part of the result is wanted.
    if (f >= FUNCTION_CLOSEST && f <= FUNCTION_ALL) {
        traverse(Ray(a, b, c, x.x, x.y), f - FUNCTION_CLOSEST, k, 0u);
        uint entry = uint(x.z);
        y = vec3(hit_count, 0.0, 0.0);
        if (entry < min(hit_count, MAX_HITS)) y.yz = vec2(hit_t[entry], hit_triangle[entry]);
        if (entry == MAX_HITS && hit_count != 0u) y.yz = hit_barycentric;
    }

    if (f == FUNCTION_ADD) {
        vec3 sum = a, carry = b;
        compensated_add(sum, carry, x);
        y = k == 0u ? sum : carry;
    }
    batch_sums[i] = y;
}
