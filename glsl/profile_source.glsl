// One source of a dipole, at the distance z from the surface. The mathematics is in src/reference/profile/source.rs.

// z (1 + sigma d) e^{shift - sigma d} / d^3, d^2 = r2 + z^2, for each channel; over 2 pi it has the mass e^{-sigma z}.
vec3 source_shape(vec3 sigma, vec3 z, float r2, float shift) {
    vec3 d2 = z * z + r2;
    vec3 d = sqrt(d2);
    vec3 sd = sigma * d;
    return z * (1.0 + sd) * exp_(shift - sd) / (d2 * d);
}

// Radius with that density: the distance d = z (1 + s) solves ln(1 + s) + sigma z s = -ln(1 - u).
float source_radius(float sigma, float z, float u) {
    float a = sigma * z;
    float logarithm = -log_(1.0 - u);
    // Both terms alone bound s from above; from there four steps of Newton's method reach rounding.
    float s = u / (1.0 - u);
    if (a > 0.0) s = min(s, logarithm / a);
    for (int i = 0; i < 4; i++) s -= (log1p_(s) + a * s - logarithm) / (1.0 / (1.0 + s) + a);
    return z * sqrt(max(s * (s + 2.0), 0.0));
}
