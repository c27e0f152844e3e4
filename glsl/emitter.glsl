// Emissive triangles as lights: draws of their points and the density of those. Included after SHADINGS. The mathematics
// is in src/reference/emitter.rs.

EMITTERS(readonly);

// Radiance that a triangle sends against the unit vector `direction`, at the weights of its second and third vertex.
vec3 emitted(uint triangle, vec2 barycentric, vec3 direction) {
    Material m = materials[shadings[triangle].material];
    bool back = dot(geometric_normal(triangles[triangle]), direction) > 0.0;
    if (back && (m.flags & TWO_SIDED) == 0 || !solid(triangle, barycentric)) return vec3(0.0);
    if (has_texture(TEXTURE_EMISSION)) m.emission *= texture_value(TEXTURE_EMISSION, triangle, barycentric).rgb;
    return m.emission;
}

// Density per area with which points of a triangle are drawn; 0 where none is.
float emitter_density(View view, uint triangle) {
    uint low = 0u, high = view.emitter_count;
    while (high - low > 1u) {
        uint middle = (low + high) / 2u;
        if (emitters[middle].triangle <= triangle)
            low = middle;
        else
            high = middle;
    }
    return emitters[low].triangle == triangle ? emitters[low].density : 0.0;
}

// Probability that a ray from a position goes to a point of an emitter, rather than in a direction.
float emitter_share(View view, vec3 position) {
    if (EMISSIVE == 0) return 0.0;
    if (ENVIRONMENT_KIND != ENVIRONMENT_NONE) return 0.5;
    vec3 to = view.emitters_centre - position;
    float ratio = view.emitters_radius2 / dot(to, to);
    return 1.0 - 0.5 * min(ratio * ratio, 1.0);
}

// Radiance over the sum of two densities per solid angle: `directional`, and `density` per area at this distance.
vec3 combined(vec3 radiance, float density, float distance, uint triangle, vec3 direction, float directional) {
    float c = abs(dot(geometric_normal(triangles[triangle]), direction));
    float sum = density * distance * distance + c * directional;
    return sum > 0.0 ? radiance * (c / sum) : vec3(0.0);
}

// A point of an emitter as a position sees it.
struct EmitterPoint {
    vec3 direction;
    float distance;
    uint triangle;
    vec2 barycentric;
    float density;
};

EmitterPoint draw_emitter(View view, vec3 base, vec3 offset, vec2 u) {
    uint low = 0u, high = view.emitter_count;
    while (high - low > 1u) {
        uint middle = (low + high) / 2u;
        if (emitters[middle].cumulative[0] <= u.x)
            low = middle;
        else
            high = middle;
    }
    EmitterPoint point;
    Emitter emitter = emitters[low];
    point.triangle = emitter.triangle;
    point.density = emitter.density;
    // u.x is a multiple of 2^-24, and so stands for the middle of an interval of that width.
    float rest = ((u.x - emitter.cumulative[0]) + 2.98023223876953125e-8) / (emitter.cumulative[1] - emitter.cumulative[0]);
    float s = sqrt(rest);
    point.barycentric = vec2(s - s * u.y, s * u.y);
    Triangle triangle = triangles[point.triangle];
    vec3 to = ((triangle.vertices[0] - base) - offset) + from_corner(triangle, point.barycentric);
    point.distance = length(to);
    point.direction = to / point.distance;
    return point;
}
