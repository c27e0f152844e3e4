// Adds the light that the first surface of each pixel reflects or emits, and the environment where it is shown.
#version 460
#include "shared.glsl"
#include "math.glsl"
#include "random.glsl"
#include "pixel.glsl"
#include "active.glsl"
#include "boundary.glsl"
#include "profile.glsl"
#include "texture.glsl"
#include "projection.glsl"
#include "intersect.glsl"
#include "light.glsl"
#include "sums.glsl"
SHADINGS(readonly);
#include "emitter.glsl"
SURFACES(readonly);

// BRDF x cosine for directions in the frame where the shading normal is z.
vec3 reflected(Material m, bool translucent, float alpha, vec3 wo, vec3 wi) {
    vec3 h = normalize(wo + wi);
    float cos_h = dot(wo, h);
    float visibility = 1.0 / (1.0 + ggx_lambda(alpha, wo) + ggx_lambda(alpha, wi));
    float specular = ggx_distribution(alpha, h) * visibility / (4.0 * wo.z);
    if (translucent) return vec3(fresnel(m.ior, cos_h) * specular);
    float f0 = (m.ior - 1.0) / (m.ior + 1.0);
    vec3 normal_incidence = mix(vec3(f0 * f0), m.base_color, m.metallic);
    float c = clamp(1.0 - cos_h, 0.0, 1.0);
    vec3 f = normal_incidence + (1.0 - normal_incidence) * (c * c * c * c * c);
    return f * specular + (1.0 - f) * (1.0 - m.metallic) * m.base_color * (wi.z / PI);
}

// Density of the visible normals' reflections.
float visible_normal_density(float alpha, vec3 wo, vec3 wi) {
    vec3 h = normalize(wo + wi);
    return ggx_distribution(alpha, h) / ((1.0 + ggx_lambda(alpha, wo)) * 4.0 * wo.z);
}

void main() {
    uint index = active_pixel();
    if (index >= step_.pixel_count) return;
    Surface surface = surfaces[surface_index(index)];
    View view = views[0];
    if (step_.count != 0u) count_covered(index, surface.triangle != MISS);
    vec3 radiance = vec3(0.0);
    if (surface.triangle == MISS) {
        if (view.show_environment == 0 || step_.first == 0) return;
        vec2 within = random_point(pixel_key(view.seed, pixel_position(view, index)), sample_index() % BATCHES,
            DIM_PIXEL, sample_index() / BATCHES / STRATUM);
        vec2 ndc = 2.0 * (vec2(pixel_position(view, index)) + within) / vec2(view.width, view.height) - 1.0;
        vec3 to = view.forward + view.perspective * (ndc.x * view.right - ndc.y * view.up);
        radiance = environment_radiance(view, normalize(to));
    } else {
        Shading shading = shadings[surface.triangle];
        Material m = textured_surface(materials[shading.material], surface.triangle, surface.barycentric);
        Triangle triangle = triangles[surface.triangle];
        Seen s = seen(view, surface, triangle, shading);
        // Positions round as the vertices do, and opaque surfaces may reach far beyond the unit ball.
        vec3 extent = max(abs(triangle.vertices[0]), max(abs(triangle.vertices[1]), abs(triangle.vertices[2])));
        vec3 offset = s.normal * (SHADOW_OFFSET * max(1.0, max(extent.x, max(extent.y, extent.z))));
        bool translucent = (m.flags & TRANSLUCENT) != 0;
        float alpha = translucent ? m.alpha : max(m.alpha, OPAQUE_ALPHA_MIN);
        bool mirror = alpha == 0.0;
        vec3 tangent, bitangent;
        orthonormal_basis(s.shading_normal, tangent, bitangent);
        mat3 frame = mat3(tangent, bitangent, s.shading_normal);
        vec3 wo = s.wo * frame;
        bool image = ENVIRONMENT_KIND == ENVIRONMENT_IMAGE;
        // Shares of the image's density, the visible normals and the cosine among environment directions.
        vec3 shares = translucent ? (image ? vec3(0.5, 0.5, 0.0) : vec3(0.0, 1.0, 0.0))
            : (image ? vec3(0.5, 0.25, 0.25) : vec3(0.0, 0.5, 0.5));
        uint key = pixel_key(view.seed, pixel_position(view, index));
        uint next = step_.ray_begin;
        bool to_emitter = false;
        while (next < step_.ray_begin + step_.ray_count) {
            // Where there are emitters, a ray to a point of theirs goes before that in each direction.
            uint k = next;
            to_emitter = EMISSIVE != 0 && k >= view.light_count && !mirror && !to_emitter;
            if (!to_emitter) next++;
            vec3 direction;
            float distance = 1e30;
            vec3 light = vec3(0.0);
            bool direction_ray = k >= view.light_count && !to_emitter;
            EmitterPoint point;
            point.triangle = MISS;
            if (k < view.light_count) {
                Incoming incoming = delta_light(k, s.position);
                direction = incoming.direction;
                distance = incoming.distance;
                light = incoming.irradiance;
            } else if (to_emitter) {
                vec2 u = random_point(key, sample_index() % BATCHES, DIM_EMITTER_REFLECT,
                    sample_index() / BATCHES * view.directions + k - view.light_count);
                point = draw_emitter(view, s.position, offset, u);
                direction = point.direction;
                distance = point.distance * EMITTER_REACH;
                light = emitted(point.triangle, point.barycentric, direction);
            } else {
                uint j = k - view.light_count;
                vec2 u = random_point(key, sample_index() % BATCHES, DIM_REFLECT,
                    sample_index() / BATCHES * view.directions + j);
                if (mirror) {
                    direction = frame * vec3(-wo.xy, wo.z);
                } else if (u.x < shares.x) {
                    direction = draw_environment(view, vec2(u.x / shares.x, u.y));
                } else if (u.x < shares.x + shares.y) {
                    vec3 h = draw_half_vector(wo, alpha, vec2((u.x - shares.x) / shares.y, u.y));
                    direction = frame * (2.0 * dot(wo, h) * h - wo);
                } else {
                    direction = draw_cosine(s.shading_normal, vec2((u.x - shares.x - shares.y) / shares.z, u.y));
                }
                light = environment_radiance(view, direction);
            }
            vec3 wi = direction * frame;
            bool open = dot(s.normal, direction) > 0.0 && wi.z > 0.0;
            // What is left of light from this direction, and the density of the directions that are drawn.
            vec3 weight = vec3(0.0);
            float density = 0.0;
            if (mirror) {
                // One direction is all.
                weight = vec3(k == view.light_count ? fresnel(m.ior, wo.z) : 0.0);
                light *= weight;
            } else if (open) {
                weight = reflected(m, translucent, alpha, wo, wi);
                light *= weight;
                if (k >= view.light_count) {
                    density = shares.y * visible_normal_density(alpha, wo, wi) + shares.z * wi.z / PI;
                    if (image) density += shares.x * environment_density(view, direction);
                }
                if (direction_ray) light = density > 0.0 ? light / (density * float(view.directions)) : vec3(0.0);
                weight /= float(view.directions);
                if (to_emitter) {
                    light = combined(light, point.density, point.distance, point.triangle, direction, density)
                        / float(view.directions);
                }
            }
            vec3 at_stake = EMISSIVE != 0 && direction_ray ? weight : light;
            open = open && at_stake.x + at_stake.y + at_stake.z > 0.0;
            traverse(Ray(s.position, offset, direction, 0.0, open ? distance : -1.0), EMISSIVE != 0 ? CLOSEST : ANY,
                EVERY_SET, 0u);
            if (EMISSIVE != 0 && open && hit_count != 0u) {
                uint found = hit_triangle[0];
                if (direction_ray) {
                    vec3 emission = emitted(found, hit_barycentric, direction);
                    // Only a mirror's own direction shows it what emits.
                    light = weight * (mirror ? emission
                        : combined(emission, emitter_density(view, found), hit_t[0], found, direction, density));
                }
                if (direction_ray || found == point.triangle) hit_count = 0u;
            }
            if (open && hit_count == 0u) radiance += light;
        }
        if (step_.first != 0 && (s.side > 0.0 || (m.flags & TWO_SIDED) != 0)) radiance += m.emission;
    }
    add_reflection(index, radiance);
}
