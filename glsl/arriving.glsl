// Light that one shadow ray brings to a point of a surface. Included after LIGHT, EMITTER and INTERSECT. The mathematics is
// in src/reference/accumulate.rs.

// Density per solid angle of the directions that are drawn: the cosine, or half of it and half of the image's.
float direction_density(View view, vec3 direction, float c) {
    if (ENVIRONMENT_KIND != ENVIRONMENT_IMAGE) return 1.0 / PI * c;
    return 0.5 * environment_density(view, direction) + 0.5 / PI * c;
}

// Ray k of the sample `number` of a batch: radiance x cosine / density of where it comes from, 0 if that is hidden or
// below the horizon; `direction` is where. n is the geometric normal, `key` that of the random numbers.
vec3 arriving(View view, uint k, vec3 position, vec3 n, vec3 shading_n, Place place, uint key, uint batch, uint number,
    out vec3 direction) {
    uint first_direction = view.light_count + (EMISSIVE != 0 ? view.directions : 0u);
    float distance = 1e30;
    vec3 light;
    uint target = MISS;
    float directional = 0.0;
    if (k < view.light_count) {
        Incoming incoming = delta_light(k, position);
        direction = incoming.direction;
        distance = incoming.distance;
        light = incoming.irradiance * max(dot(shading_n, direction), 0.0);
    } else if (EMISSIVE != 0 && k < first_direction) {
        uint j = k - view.light_count;
        vec2 u = point_at(place, key, batch, DIM_EMITTER, number * view.directions + j);
        EmitterPoint point = draw_emitter(view, position, n * SHADOW_OFFSET, u);
        direction = point.direction;
        distance = point.distance * EMITTER_REACH;
        target = point.triangle;
        float c = max(dot(shading_n, direction), 0.0);
        directional = direction_density(view, direction, c);
        light = combined(emitted(target, point.barycentric, direction), point.density, point.distance, target,
            direction, directional) * (c / float(view.directions));
    } else {
        uint j = k - first_direction;
        vec2 u = point_at(place, key, batch, DIM_LIGHT, number * view.directions + j);
        // The image and the cosine, half of the directions each, combined by the balance heuristic.
        bool image = ENVIRONMENT_KIND == ENVIRONMENT_IMAGE;
        if (image && u.x < 0.5) {
            direction = draw_environment(view, vec2(2.0 * u.x, u.y));
        } else {
            direction = draw_cosine(shading_n, vec2(image ? 2.0 * u.x - 1.0 : u.x, u.y));
        }
        float c = max(dot(shading_n, direction), 0.0);
        directional = direction_density(view, direction, c);
        float over_density = image ? c / directional : PI;
        light = c > 0.0 ? environment_radiance(view, direction) * (over_density / float(view.directions)) : vec3(0.0);
    }
    float cos_shading = dot(shading_n, direction);
    bool open = dot(n, direction) > 0.0 && cos_shading > 0.0
        && (EMISSIVE != 0 && k >= first_direction || light.x + light.y + light.z > 0.0);
    traverse(Ray(position, n * SHADOW_OFFSET, direction, 0.0, open ? distance : -1.0),
        EMISSIVE != 0 ? CLOSEST : ANY, EVERY_SET, 0u);
    if (EMISSIVE != 0 && open && hit_count != 0u) {
        uint found = hit_triangle[0];
        if (k >= first_direction) {
            light = combined(emitted(found, hit_barycentric, direction), emitter_density(view, found), hit_t[0],
                found, direction, directional) * (cos_shading / float(view.directions));
        }
        if (k >= first_direction || found == target) hit_count = 0u;
    }
    return open && hit_count == 0u ? light : vec3(0.0);
}
