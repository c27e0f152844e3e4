// Adds the light that was scattered once, at one point behind the first surface of each pixel.
#version 460
#include "shared.glsl"
#include "math.glsl"
#include "random.glsl"
#include "pixel.glsl"
#include "active.glsl"
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
SURFACES(readonly);
#include "emitter.glsl"

// Density of directions about the refracted camera ray d: the phase functions' mean, as refracted at the plane of n.
float scattered_density(Material m, vec3 chances, vec3 d, vec3 n, vec3 w) {
    float c = dot(w, n);
    vec3 inner = w;
    float spread = 1.0;
    if (c > 0.0 && m.ior > 1.0) {
        inner = refracted(w, n, m.ior);
        spread = c / (m.ior * m.ior * dot(inner, n));
    }
    return spread * dot(chances, vec3(phase(m.g.x, d, inner), phase(m.g.y, d, inner), phase(m.g.z, d, inner)));
}

// Density per solid angle of the directions that are drawn: those, or half of them and half of the image's.
float direction_density(View view, Material m, vec3 chances, vec3 d, vec3 n, vec3 w) {
    float scattered = scattered_density(m, chances, d, n, w);
    if (ENVIRONMENT_KIND != ENVIRONMENT_IMAGE) return scattered;
    return 0.5 * environment_density(view, w) + 0.5 * scattered;
}

// A direction about d with that density; zero if total reflection keeps it inside.
vec3 draw_direction(Material m, vec3 chances, vec3 d, vec3 n, vec2 u) {
    float low = u.x < chances.x ? 0.0 : (u.x < chances.x + chances.y ? chances.x : chances.x + chances.y);
    uint channel = u.x < chances.x ? 0u : (u.x < chances.x + chances.y ? 1u : 2u);
    vec3 inner = draw_phase(m.g[channel], d, vec2(min((u.x - low) / chances[channel], 0.99999994), u.y));
    float c = dot(inner, n);
    if (c <= 0.0 || m.ior <= 1.0) return inner;
    vec3 along = m.ior * (inner - c * n);
    float c2 = 1.0 - dot(along, along);
    return c2 > 0.0 ? along + sqrt(c2) * n : vec3(0.0);
}

void main() {
    uint index = active_pixel();
    if (index >= step_.pixel_count) return;
    Surface surface = surfaces[surface_index(index)];
    if (surface.triangle == MISS) return;
    Shading shading = shadings[surface.triangle];
    Material m = materials[shading.material];
    if (m.scattering == vec3(0.0)) return;

    View view = views[0];
    Seen s = seen(view, surface, triangles[surface.triangle], shading);
    uint set = triangles[surface.triangle].set;
    uint key = pixel_key(view.seed, pixel_position(view, index));
    uint batch = sample_index() % BATCHES;
    vec2 u = vec2(unit(scramble(sample_point(0), dimension_key(key, batch, DIM_SINGLE))),
        unit(scramble(sample_point(1), dimension_key(key, batch, DIM_SINGLE + 1u))));
    // Channels that scatter, equally probable.
    vec3 chances = vec3(greaterThan(m.scattering, vec3(0.0)));
    chances /= chances.x + chances.y + chances.z;
    uint channel = u.x < chances.x ? 0u : (u.x < chances.x + chances.y ? 1u : 2u);

    // The camera ray inside; it must leave the triangle's outer side.
    vec3 n = s.shading_normal;
    vec3 d = -refracted(s.wo, n, m.ior);
    if (!(dot(d, s.normal) < 0.0)) {
        n = s.normal;
        d = -refracted(s.wo, n, m.ior);
    }
    if (!(dot(d, n) < 0.0)) return;
    vec3 leaving = vec3(crossing(m, dot(n, s.wo), roughness_share(surface.triangle, surface.barycentric)));
    if (has_texture(TEXTURE_BASE_COLOR)) {
        leaving *= texture_value(TEXTURE_BASE_COLOR, surface.triangle, surface.barycentric).rgb;
    }

    float least = min(m.extinction.x, min(m.extinction.y, m.extinction.z));
    // Of the point: its depth along the ray, and scattering over density without the exponent of the least extinction.
    float depth = 0.0;
    vec3 over_density = vec3(0.0);
    // Of the light that is connected: its rays' direction and end, what is there, which part of it arrives.
    uint target = MISS;
    float share = 0.0;
    float directional = 0.0;
    vec3 light = vec3(0.0);
    vec3 part = vec3(0.0);
    vec3 direction = vec3(0.0);
    float distance = -1.0;
    float along = 0.0;
    vec3 exit = vec3(0.0);
    vec3 exit_offset = vec3(0.0);
    vec3 radiance = vec3(0.0);
    // The first ray goes along the camera ray to the other side of the matter; then two to each light, one to the surface
    // and one from there.
    uint trace = 0u;
    do {
        bool to_surface = trace % 2u == 1u;
        uint k = step_.ray_begin + (max(trace, 1u) - 1u) / 2u;
        bool wanted = max(part.x, max(part.y, part.z)) > 0.0;
        if (to_surface) {
            vec3 position = s.position + depth * d;
            target = MISS;
            directional = 0.0;
            share = emitter_share(view, position);
            uint j = sample_index() / BATCHES * view.directions + (k - view.light_count);
            if (k < view.light_count) {
                Incoming incoming = delta_light(k, position);
                direction = incoming.direction;
                distance = incoming.distance;
                light = incoming.irradiance;
            } else if (EMISSIVE != 0 && unit(dimension_key(key, batch, DIM_SINGLE_SOURCE) + GOLDEN * j) < share) {
                EmitterPoint point =
                    draw_emitter(view, s.position, depth * d, random_point(key, batch, DIM_SINGLE_EMITTER, j));
                direction = point.direction;
                distance = point.distance * EMITTER_REACH;
                target = point.triangle;
                light = combined(emitted(target, point.barycentric, direction), share * point.density, point.distance,
                    target, direction, (1.0 - share) * direction_density(view, m, chances, d, n, direction))
                    / float(view.directions);
            } else {
                vec2 v = random_point(key, batch, DIM_SINGLE_LIGHT, j);
                bool image = ENVIRONMENT_KIND == ENVIRONMENT_IMAGE;
                if (image && v.x < 0.5) {
                    direction = draw_environment(view, vec2(2.0 * v.x, v.y));
                } else {
                    direction = draw_direction(m, chances, d, n, vec2(image ? 2.0 * v.x - 1.0 : v.x, v.y));
                }
                if (direction != vec3(0.0)) {
                    directional = (1.0 - share) * direction_density(view, m, chances, d, n, direction);
                }
                light = directional > 0.0 ? environment_radiance(view, direction) / (directional * float(view.directions))
                    : vec3(0.0);
                distance = 1e30;
            }
            wanted = light.x + light.y + light.z > 0.0 || EMISSIVE != 0 && directional > 0.0;
        }
        Ray ray = Ray(s.position, -s.normal * SHADOW_OFFSET, d, 0.0, 1e30);
        if (trace > 0u) {
            // A point whose depth is a rounding of its position may lie before the surface.
            ray = to_surface ? Ray(s.position, depth * d, direction, -SHADOW_OFFSET, wanted ? distance : -1.0)
                : Ray(exit, exit_offset, direction, 0.0, wanted ? distance - along : -1.0);
        }
        traverse(ray, CLOSEST, trace == 0u || to_surface ? set : EVERY_SET, 0u);
        if (trace == 0u) {
            float end = hit_count != 0u ? hit_t[0] : 1e30;
            // 1 - e^(-way), to the other side.
            vec3 within;
            for (uint c = 0; c < 3; c++) {
                float way = min(m.extinction[c] * end, 1e30);
                within[c] = way * one_minus_exp_over(way);
            }
            float y = u.y * within[channel];
            depth = min(log1p_(y / (1.0 - y)) / m.extinction[channel], end);
            vec3 fall = exp_((least - m.extinction) * depth);
            vec3 rate = vec3(0.0);
            for (uint c = 0; c < 3; c++) if (chances[c] > 0.0) rate[c] = m.extinction[c] / within[c] * fall[c];
            over_density = m.scattering / dot(chances, rate);
        } else if (to_surface) {
            part = vec3(0.0);
            // An emitter that bounds the matter shines away from it.
            if (wanted && hit_count != 0u && hit_triangle[0] != target) {
                uint found = hit_triangle[0];
                Triangle triangle = triangles[found];
                vec3 outward = geometric_normal(triangle);
                float side = dot(outward, direction) < 0.0 ? -1.0 : 1.0;
                outward *= side;
                vec3 shading_n = side * shading_normal(shadings[found], found, hit_barycentric);
                along = max(hit_t[0], 0.0);
                // Where the surface is that of the first surface, rounding has no say.
                if (found == surface.triangle) along = -depth * dot(d, outward) / dot(direction, outward);
                float c = dot(shading_n, direction);
                vec3 inner = refracted(direction, shading_n, m.ior);
                float cos_inside = dot(inner, shading_n);
                if (c > 0.0 && cos_inside > 0.0) {
                    float ratio = c / cos_inside;
                    vec3 scattered = vec3(phase(m.g.x, d, inner), phase(m.g.y, d, inner), phase(m.g.z, d, inner));
                    vec3 exponent = (least - m.extinction) * depth - m.extinction * (along * ratio);
                    Material boundary = m;
                    if (MIXED != 0) boundary = materials[shadings[found].material];
                    part = over_density * scattered * exp_(exponent)
                        * (crossing(boundary, c, roughness_share(found, hit_barycentric)) * ratio / (m.ior * m.ior));
                    if (has_texture(TEXTURE_BASE_COLOR)) {
                        part *= texture_value(TEXTURE_BASE_COLOR, found, hit_barycentric).rgb;
                    }
                }
                exit = triangle.vertices[0] + from_corner(triangle, hit_barycentric);
                exit_offset = outward * SHADOW_OFFSET;
            }
        } else if (wanted) {
            bool seen_light = hit_count == 0u;
            if (EMISSIVE != 0 && hit_count != 0u) {
                uint found = hit_triangle[0];
                bool direction_ray = k >= view.light_count && target == MISS;
                if (direction_ray) {
                    light = combined(emitted(found, hit_barycentric, direction), share * emitter_density(view, found),
                        along + hit_t[0], found, direction, directional) / float(view.directions);
                }
                seen_light = direction_ray || found == target;
            }
            if (seen_light) radiance += light * part;
        }
    } while (++trace <= 2u * step_.ray_count);
    add_subsurface(index, leaving * radiance);
}
