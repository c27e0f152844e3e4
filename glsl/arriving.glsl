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
    bool delta = k < view.light_count;
    float distance = 1e30;
    vec3 light;
    // The emitter whose point the ray goes to; otherwise the ray has a direction, drawn with this density.
    uint target = MISS;
    float share = emitter_share(view, position);
    float directional = 0.0;
    uint j = number * view.directions + (k - view.light_count);
    if (delta) {
        Incoming incoming = delta_light(k, position);
        direction = incoming.direction;
        distance = incoming.distance;
        light = incoming.irradiance * max(dot(shading_n, direction), 0.0);
    } else if (EMISSIVE != 0 && golden_at(place, key, batch, DIM_SOURCE, j) < share) {
        EmitterPoint point = draw_emitter(view, position, n * SHADOW_OFFSET, point_at(place, key, batch, DIM_EMITTER, j));
        direction = point.direction;
        distance = point.distance * EMITTER_REACH;
        target = point.triangle;
        float c = max(dot(shading_n, direction), 0.0);
        directional = (1.0 - share) * direction_density(view, direction, c);
        light = combined(emitted(target, point.barycentric, direction), share * point.density, point.distance, target,
            direction, directional) * (c / float(view.directions));
    } else {
        vec2 u = point_at(place, key, batch, DIM_LIGHT, j);
        // The image and the cosine, half of the directions each, combined by the balance heuristic.
        bool image = ENVIRONMENT_KIND == ENVIRONMENT_IMAGE;
        if (image && u.x < 0.5) {
            direction = draw_environment(view, vec2(2.0 * u.x, u.y));
        } else {
            direction = draw_cosine(shading_n, vec2(image ? 2.0 * u.x - 1.0 : u.x, u.y));
        }
        float c = max(dot(shading_n, direction), 0.0);
        directional = (1.0 - share) * direction_density(view, direction, c);
        float over_density = image ? c / directional : PI / (1.0 - share);
        light = c > 0.0 ? environment_radiance(view, direction) * (over_density / float(view.directions)) : vec3(0.0);
    }
    bool direction_ray = !delta && target == MISS;
    float cos_shading = dot(shading_n, direction);
    bool open = dot(n, direction) > 0.0 && cos_shading > 0.0
        && (EMISSIVE != 0 && direction_ray || light.x + light.y + light.z > 0.0);
    traverse(Ray(position, n * SHADOW_OFFSET, direction, 0.0, open ? distance : -1.0),
        EMISSIVE != 0 ? CLOSEST : ANY, EVERY_SET, 0u);
    if (EMISSIVE != 0 && open && hit_count != 0u) {
        uint found = hit_triangle[0];
        if (direction_ray) {
            light = combined(emitted(found, hit_barycentric, direction), share * emitter_density(view, found), hit_t[0],
                found, direction, directional) * (cos_shading / float(view.directions));
        }
        if (direction_ray || found == target) hit_count = 0u;
    }
    return open && hit_count == 0u ? light : vec3(0.0);
}
