// Draws radius, angle, channel and technique of one probe at the surface of each pixel.
#version 460
#include "shared.glsl"
#include "math.glsl"
#include "random.glsl"
#include "pixel.glsl"
#include "active.glsl"
#include "tile.glsl"
#include "profile.glsl"
#include "texture.glsl"
#include "projection.glsl"
TRIANGLES(readonly);
SHADINGS(readonly);
#include "mixture.glsl"
SURFACES(readonly);
PROBES(writeonly);

Probe drawn(uint index) {
    Probe probe;
    probe.offset = vec3(0.0);
    probe.direction = vec3(0.0);
    probe.t_min = 1.0;
    probe.t_max = 0.0;
    probe.radius = 0.0;
    probe.seat = uvec4(0u);
    probe.table_node = 0u;
    probe.table_weight = 1.0;
    probe.table_bend = vec2(0.0);
    probe.table_scale = 0.0;
    probe.hit = vec3(0.0);
    probe.hit_r2 = 0.0;
    probe.lit = uvec4(0u);
    Surface surface = surfaces[surface_index(index)];
    if (surface.triangle == MISS) return probe;
    Shading shading = shadings[surface.triangle];
    Material m = materials[shading.material];
    if ((m.flags & TRANSLUCENT) == 0) return probe;

    View view = views[0];
    Seen s = seen(view, surface, triangles[surface.triangle], shading);
    uint batch = sample_index() % BATCHES;
    Place place = place_of(view, index, batch);
    uint key = pixel_key(view.seed, place.tile);
    float u[4];
    for (uint i = 0; i < 4; i++) u[i] = coordinate(place, key, batch, i);
    if (MIXED != 0) {
        Mixture mixture = mixture_at(surface);
        if (mixture.count == 0u) return probe;
        m = mixture_member(mixture, pick_member(mixture, u[DIM_COMPONENT]), surface);
    } else {
        if (m.component_cdf[8] == 0.0) return probe;
        if (has_model(m, MODEL_TABLE)) table_at(m, surface);
    }
    if (REUSE != 0u) {
        probe.lit.w = first_share(view) + 2u * triangles[surface.triangle].set + (s.side < 0.0 ? 1u : 0u);
        float reach2 = m.radius_max * m.radius_max;
        if (has_model(m, MODEL_TABLE)) {
            reach2 = min(reach2, table_reach2(m));
            probe.table_node = table_node;
            probe.table_weight = table_weight;
            probe.table_bend = table_bend;
            probe.table_scale = table_scale;
        }
        probe.seat = floatBitsToUint(vec4(surface.position, reach2));
    }

    vec4 fractions = technique_fractions(dot(s.wo, s.normal));
    float u_technique = u[DIM_TECHNIQUE];
    uint technique = PROJECTION == PROJECTION_CAMERA ? TECHNIQUE_CAMERA : TECHNIQUE_NORMAL;
    if (PROJECTION == PROJECTION_MIS) {
        vec3 cumulative = vec3(fractions.x, fractions.x + fractions.y, fractions.x + fractions.y + fractions.z);
        technique = u_technique < cumulative.x ? TECHNIQUE_NORMAL : u_technique < cumulative.y ? TECHNIQUE_U
            : u_technique < cumulative.z || fractions.w == 0.0 ? TECHNIQUE_V : TECHNIQUE_CAMERA;
    }

    vec3 tangent, bitangent;
    orthonormal_basis(s.normal, tangent, bitangent);
    vec3 first = technique == TECHNIQUE_U ? bitangent : technique == TECHNIQUE_V ? s.normal : tangent;
    vec3 second = technique == TECHNIQUE_U ? s.normal : technique == TECHNIQUE_V ? tangent : bitangent;
    probe.radius = PROJECTION == PROJECTION_CAMERA ? -log_(1.0 - u[DIM_RADIUS]) / m.camera_rate
        : draw_radius(m, u[DIM_COMPONENT], u[DIM_RADIUS]);
    vec2 cs = cos_sin_2pi(u[DIM_ANGLE]);
    probe.offset = probe.radius * (cs.x * first + cs.y * second);

    probe.direction = technique == TECHNIQUE_NORMAL ? -s.normal : technique == TECHNIQUE_U ? tangent : bitangent;
    // Nothing behind the eye, or the plane of an orthographic camera, is reached by a camera ray.
    float from_eye = 1e30;
    if (technique == TECHNIQUE_CAMERA) {
        probe.direction = normalize(probe.offset * s.inverse_distance - s.wo);
        from_eye = view.perspective != 0.0 ? length(probe.offset - s.wo * s.eye_distance)
            : s.eye_distance - dot(probe.offset, s.wo);
    }
    if (PROJECTION == PROJECTION_CAMERA || m.radius_max >= 1e30) {
        probe.t_min = -from_eye;
        probe.t_max = 1e30;
    } else {
        // The chord of the ball |x - xo| <= radius_max.
        float b = dot(probe.offset, probe.direction);
        float r2 = probe.radius * probe.radius - b * b;
        float half2 = m.radius_max * m.radius_max - r2;
        if (!(half2 > 0.0)) {
            probe.offset = vec3(0.0);
            probe.direction = vec3(0.0);
            probe.radius = 0.0;
        } else {
            float half_chord = sqrt(half2);
            probe.t_min = max(-b - half_chord, -from_eye);
            probe.t_max = -b + half_chord;
        }
    }
    return probe;
}

void main() {
    uint index = active_pixel();
    if (index < step_.pixel_count) probes[index] = drawn(index);
}
