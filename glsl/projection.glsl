// The surface seen by a pixel, the axes along which its tangent plane is projected, and the density of a projected
// point. The mathematics is in src/reference/projection.rs.

// What a pixel's stages need to know of its surface.
struct Seen {
    vec3 position;
    // Unit vector to the eye.
    vec3 wo;
    // From the eye, or from the camera's plane.
    float eye_distance;
    // 1 / eye_distance for a perspective camera, 0 for an orthographic one.
    float inverse_distance;
    // -1 where the camera sees the inner side: then the whole set is turned inside out.
    float side;
    // Geometric and shading normal, towards the eye.
    vec3 normal;
    vec3 shading_normal;
};

// Interpolated between the vertices, then turned by the normal map.
vec3 shading_normal(Shading s, uint triangle, vec2 barycentric) {
    vec3 n = normalize(s.normal0 * (1.0 - barycentric.x - barycentric.y) + s.normal1 * barycentric.x + s.normal2 * barycentric.y);
    return mapped_normal(n, triangle, barycentric);
}

vec3 geometric_normal(Triangle t) {
    return normalize(cross(t.vertices[1] - t.vertices[0], t.vertices[2] - t.vertices[0]));
}

Seen seen(View view, Surface surface, Triangle triangle, Shading shading) {
    Seen s;
    s.position = surface.position;
    vec3 from_pivot = surface.position - view.pivot;
    vec3 to = view.forward + view.perspective * from_pivot;
    float len = length(to);
    s.wo = -to / len;
    s.eye_distance = view.perspective != 0.0 ? len : view.reach + dot(from_pivot, view.forward);
    s.inverse_distance = view.perspective / len;
    vec3 n = geometric_normal(triangle);
    s.side = dot(n, s.wo) < 0.0 ? -1.0 : 1.0;
    s.normal = s.side * n;
    s.shading_normal = s.side * shading_normal(shading, surface.triangle, surface.barycentric);
    // A shading normal may face away where the triangle does not.
    if (!(dot(s.shading_normal, s.wo) > 0.0)) s.shading_normal = s.normal;
    return s;
}

const uint TECHNIQUE_NORMAL = 0;
const uint TECHNIQUE_U = 1;
const uint TECHNIQUE_V = 2;
const uint TECHNIQUE_CAMERA = 3;

// Fractions of the techniques normal, U, V and camera, from the cosine to the eye alone.
vec4 technique_fractions(float cos_eye) {
    if (PROJECTION == PROJECTION_NORMAL) return vec4(1.0, 0.0, 0.0, 0.0);
    if (PROJECTION == PROJECTION_CAMERA || REPROJECT == REPROJECT_SCREEN) return vec4(0.0, 0.0, 0.0, 1.0);
    float s = clamp(cos_eye / CAMERA_FADE, 0.0, 1.0);
    float camera = CAMERA_FRACTION * s * s * (3.0 - 2.0 * s);
    float rest = 1.0 - camera;
    float tangents = TANGENT_FRACTION * rest;
    return vec4(rest - tangents, 0.5 * tangents, 0.5 * tangents, camera);
}

// Where the camera ray through xo + delta crosses the tangent plane: dist_tan / dist, and 0 behind the eye.
float camera_ratio(Seen s, vec3 delta) {
    float k = 1.0 - dot(delta, s.normal) * s.inverse_distance / dot(s.wo, s.normal);
    return k > 0.0 ? 1.0 / k : 0.0;
}

// Density per area of the surface, over all techniques, of the point xo + delta with geometric normal n.
float mixture_density(Seen s, Material m, vec3 delta, vec3 n) {
    vec3 tangent, bitangent;
    orthonormal_basis(s.normal, tangent, bitangent);
    vec4 fractions = technique_fractions(dot(s.wo, s.normal));
    // Coordinates in the frame: squared radii about the axes without cancellation.
    vec3 x = vec3(dot(delta, tangent), dot(delta, bitangent), dot(delta, s.normal));
    vec3 x2 = x * x;
    // Squared radii and Jacobians of normal, U, V and camera. Loops keep one copy of the profile: kernels compile for
    // as long as they are.
    vec4 r2 = vec4(x2.x + x2.y, x2.y + x2.z, x2.z + x2.x, 0.0);
    vec4 jacobians = abs(vec4(dot(n, s.normal), dot(n, tangent), dot(n, bitangent), 0.0));
    if (PROJECTION == PROJECTION_MIS) {
        float q = camera_ratio(s, delta);
        vec3 y = q * (delta - s.wo * (x.z / dot(s.wo, s.normal)));
        vec3 d = normalize(delta * s.inverse_distance - s.wo);
        float cos_plane = abs(dot(s.normal, d));
        r2.w = dot(y, y);
        jacobians.w = cos_plane > 0.0 ? abs(dot(n, d)) / cos_plane * q * q : 0.0;
    }
    float p = 0.0;
    uint k = REPROJECT == REPROJECT_SCREEN ? TECHNIQUE_CAMERA : TECHNIQUE_NORMAL;
    [[dont_unroll]] do {
        p += fractions[k] * radial_density(m, r2[k]) * jacobians[k];
    } while (++k < (PROJECTION == PROJECTION_MIS ? 4u : 1u));
    return p;
}
