// The standard dipole: value, density and draw of the radius. The mathematics is in src/reference/profile.rs.

// The sum over both sources of z (1 + sigma d) e^{shift - sigma d} / d^3 / (2 pi), d^2 = r2 + z^2, for each channel.
// Exponents are combined before exp: `shift` is the exponent of what the caller multiplies by.
vec3 shape_shifted(Material m, float r2, float shift) {
    vec3 d2 = m.z_real * m.z_real + r2;
    vec3 d = sqrt(d2);
    vec3 sd = m.sigma_tr * d;
    vec3 s = m.z_real * (1.0 + sd) * exp_(shift - sd) / (d2 * d);
    d2 = m.z_virtual * m.z_virtual + r2;
    d = sqrt(d2);
    sd = m.sigma_tr * d;
    s += m.z_virtual * (1.0 + sd) * exp_(shift - sd) / (d2 * d);
    return s * (0.5 / PI);
}

vec3 shape(Material m, float r2) {
    return shape_shifted(m, r2, 0.0);
}

// Density of the radius per area of the plane.
float radial_density(Material m, float r2) {
    return dot(m.density, shape(m, r2));
}

// Radius with the exact density of the chosen component. Its source is at height z; the distance d = z (1 + s) solves
// ln(1 + s) + sigma z s = -ln(1 - u).
float draw_radius(Material m, float u_component, float u_radius) {
    // The first component whose cumulative probability exceeds u.
    float sigma = m.sigma_tr.x, z = m.z_real.x;
    if (u_component >= m.component_cdf[0]) z = m.z_virtual.x;
    if (u_component >= m.component_cdf[1]) sigma = m.sigma_tr.y, z = m.z_real.y;
    if (u_component >= m.component_cdf[2]) z = m.z_virtual.y;
    if (u_component >= m.component_cdf[3]) sigma = m.sigma_tr.z, z = m.z_real.z;
    if (u_component >= m.component_cdf[4]) z = m.z_virtual.z;
    float a = sigma * z;
    float logarithm = -log_(1.0 - u_radius);
    // Both terms alone bound s from above; from there four steps of Newton's method reach rounding.
    float s = u_radius / (1.0 - u_radius);
    if (a > 0.0) s = min(s, logarithm / a);
    for (int i = 0; i < 4; i++) s -= (log1p_(s) + a * s - logarithm) / (1.0 / (1.0 + s) + a);
    return z * sqrt(max(s * (s + 2.0), 0.0));
}
