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

// Radius with the exact density of the chosen component: inverts 1 - (z/d) e^{-sigma (d - z)} = u for d.
float draw_radius(Material m, float u_component, float u_radius) {
    float sigma = m.sigma_tr.x, z = m.z_real.x;
    // The first component whose cumulative probability exceeds u.
    if (u_component >= m.component_cdf[0]) z = m.z_virtual.x;
    if (u_component >= m.component_cdf[1]) sigma = m.sigma_tr.y, z = m.z_real.y;
    if (u_component >= m.component_cdf[2]) z = m.z_virtual.y;
    if (u_component >= m.component_cdf[3]) sigma = m.sigma_tr.z, z = m.z_real.z;
    if (u_component >= m.component_cdf[4]) z = m.z_virtual.z;
    float d = z / (1.0 - u_radius);
    if (sigma > 0.0) {
        // y + ln y = L for y = sigma d, by Newton's method.
        float y_min = sigma * z;
        float L = log_(y_min) + y_min - log_(1.0 - u_radius);
        float e_L = exp_(min(L, 1.0));
        float y = L > 1.0 ? L - log_(max(L, 1.0)) : e_L / (1.0 + e_L);
        for (int i = 0; i < 5; i++) {
            y = max(y, y_min);
            y = y * (1.0 + L - log_(y)) / (1.0 + y);
        }
        d = max(y, y_min) / sigma;
    }
    return sqrt(max((d - z) * (d + z), 0.0));
}
