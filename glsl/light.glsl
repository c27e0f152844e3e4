// Lights: what arrives at a point, and draws of environment directions. The mathematics is in src/reference/light.rs.

LIGHTS(readonly);
ENVIRONMENT(readonly);
ENVIRONMENT_CDF(readonly);

// Light from one direction: unit vector, distance, and irradiance on a plane that faces it.
struct Incoming {
    vec3 direction;
    float distance;
    vec3 irradiance;
};

Incoming delta_light(uint index, vec3 position) {
    Light light = lights[index];
    Incoming incoming;
    if (light.kind == LIGHT_DIRECTIONAL) {
        incoming.direction = -light.direction;
        incoming.distance = 1e30;
        incoming.irradiance = light.intensity;
        return incoming;
    }
    vec3 to = light.position - position;
    float d2 = dot(to, to);
    incoming.distance = sqrt(d2);
    incoming.direction = to / incoming.distance;
    float range = incoming.distance * light.inverse_range;
    range *= range;
    float falloff = clamp(1.0 - range * range, 0.0, 1.0) / d2;
    if (light.kind == LIGHT_SPOT) {
        float cone = clamp(-dot(incoming.direction, light.direction) * light.spot_scale + light.spot_offset, 0.0, 1.0);
        falloff *= cone * cone;
    }
    incoming.irradiance = light.intensity * falloff;
    return incoming;
}

// Image coordinates (u, v) of a direction.
vec2 environment_uv(View view, vec3 direction) {
    vec3 e = vec3(dot(view.environment_row0, direction), dot(view.environment_row1, direction),
        dot(view.environment_row2, direction));
    float u = 0.5 + atan2_(e.z, e.x) * (0.5 / PI);
    // acos(y), without its cancellation near the poles.
    float v = atan2_(sqrt(e.x * e.x + e.z * e.z), e.y) / PI;
    return vec2(u, v);
}

vec3 environment_texel(View view, int x, int y) {
    int w = int(view.environment_width);
    // No index leaves the image, whatever the direction.
    x = clamp(x < 0 ? x + w : (x >= w ? x - w : x), 0, w - 1);
    y = clamp(y, 0, int(view.environment_height) - 1);
    return environment[y * w + x];
}

vec3 environment_radiance(View view, vec3 direction) {
    if (ENVIRONMENT_KIND == ENVIRONMENT_CONSTANT) return view.environment_scale;
    if (ENVIRONMENT_KIND == ENVIRONMENT_NONE) return vec3(0.0);
    vec2 uv = environment_uv(view, direction);
    vec2 at = uv * vec2(view.environment_width, view.environment_height) - 0.5;
    vec2 lower = floor(at);
    vec2 f = at - lower;
    int x = int(lower.x), y = int(lower.y);
    vec3 top = mix(environment_texel(view, x, y), environment_texel(view, x + 1, y), f.x);
    vec3 bottom = mix(environment_texel(view, x, y + 1), environment_texel(view, x + 1, y + 1), f.x);
    return mix(top, bottom, f.y) * view.environment_scale;
}

// Index of the interval of the table [begin, begin + count] that contains u.
uint find_interval(uint begin, uint count, float u) {
    uint low = 0u, high = count;
    while (high - low > 1u) {
        uint middle = (low + high) / 2u;
        if (environment_cdf[begin + middle] <= u)
            low = middle;
        else
            high = middle;
    }
    return low;
}

// Density per solid angle of the image technique.
float environment_density(View view, vec3 direction) {
    vec2 uv = environment_uv(view, direction);
    uint w = view.density_width, h = view.density_height;
    uint column = min(uint(uv.x * float(w)), w - 1u);
    uint row = min(uint(uv.y * float(h)), h - 1u);
    uint row_begin = h + 1u + row * (w + 1u);
    float p = (environment_cdf[row + 1u] - environment_cdf[row]) * float(h)
        * (environment_cdf[row_begin + column + 1u] - environment_cdf[row_begin + column]) * float(w);
    float sin_theta = cos_sin_2pi(0.5 * uv.y).y;
    return sin_theta > 0.0 ? p / (2.0 * PI * PI * sin_theta) : 0.0;
}

vec3 draw_environment(View view, vec2 u) {
    uint w = view.density_width, h = view.density_height;
    uint row = find_interval(0u, h, u.y);
    float low = environment_cdf[row];
    float v = (float(row) + (u.y - low) / (environment_cdf[row + 1u] - low)) / float(h);
    uint row_begin = h + 1u + row * (w + 1u);
    uint column = find_interval(row_begin, w, u.x);
    low = environment_cdf[row_begin + column];
    float s = (float(column) + (u.x - low) / (environment_cdf[row_begin + column + 1u] - low)) / float(w);
    vec2 phi = -cos_sin_2pi(s);
    vec2 theta = cos_sin_2pi(0.5 * v);
    vec3 e = vec3(theta.y * phi.x, theta.x, theta.y * phi.y);
    // The rows of a rotation are the columns of its inverse.
    return e.x * view.environment_row0 + e.y * view.environment_row1 + e.z * view.environment_row2;
}

// A cosine-weighted direction about n.
vec3 draw_cosine(vec3 n, vec2 u) {
    vec3 tangent, bitangent;
    orthonormal_basis(n, tangent, bitangent);
    vec2 p = sqrt(u.x) * cos_sin_2pi(u.y);
    return p.x * tangent + p.y * bitangent + sqrt(1.0 - u.x) * n;
}
