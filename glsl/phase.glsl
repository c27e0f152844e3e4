// Refraction at the surface and scattering in the matter. The mathematics is in src/reference/single.rs.

// The direction that w (unit, above the normal n) has inside, on the same side of n; zero beyond the critical angle.
vec3 refracted(vec3 w, vec3 n, float ior) {
    float c = dot(w, n);
    float c2 = 1.0 - max(1.0 - c * c, 0.0) / (ior * ior);
    return c2 > 0.0 ? (w - c * n) / ior + sqrt(c2) * n : vec3(0.0);
}

// Henyey and Greenstein's phase function: density per solid angle of the unit vector w about d. 1 -+ cosine come from
// differences of the vectors, which keep their digits in the peak.
float phase(float g, vec3 d, vec3 w) {
    vec3 from_peak = g < 0.0 ? w + d : w - d;
    float k = 1.0 - abs(g);
    float b = k * k + abs(g) * dot(from_peak, from_peak);
    return (0.25 / PI) * k * (1.0 + abs(g)) / (b * sqrt(b));
}

vec3 draw_phase(float g, vec3 d, vec2 u) {
    float k = 1.0 - abs(g);
    float below = k + 2.0 * abs(g) * u.x;
    // 1 - cosine to the peak.
    float t = min(k * (1.0 - u.x) / below * (k * (1.0 + abs(g)) / below + k), 2.0);
    vec3 peak = g < 0.0 ? -d : d;
    vec3 tangent, bitangent;
    orthonormal_basis(peak, tangent, bitangent);
    vec2 p = sqrt(t * (2.0 - t)) * cos_sin_2pi(u.y);
    return normalize(p.x * tangent + p.y * bitangent + (1.0 - t) * peak);
}
