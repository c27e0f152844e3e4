// The better dipole: two sources and a line of them between. The mathematics is in src/reference/profile/better.rs.

vec3 better_shape(Material m, float r2, float shift) {
    vec3 near2 = m.z_real * m.z_real + r2;
    vec3 far2 = m.z_virtual * m.z_virtual + r2;
    vec3 near = sqrt(near2), far = sqrt(far2);
    vec3 s_near = m.sigma_tr * near, s_far = m.sigma_tr * far;
    vec3 e_near = exp_(shift - s_near);
    vec3 gap = (m.z_virtual - m.z_real) * ((m.z_virtual + m.z_real) / (near + far));
    vec3 line = e_near * (gap / far) * (1.0 / near + m.sigma_tr * one_minus_exp_over(m.sigma_tr * gap));
    vec3 sources = m.z_real * (1.0 + s_near) * e_near / (near2 * near)
        + m.z_virtual * (1.0 + s_far) * exp_(shift - s_far) / (far2 * far);
    return (sources + m.fluence * line) * (0.5 / PI);
}

float better_radius(Material m, float u_component, float u_radius) {
    uint c, kind;
    float share;
    pick_component(m, u_component, c, kind, share);
    float sigma = m.sigma_tr[c];
    float z = kind == 1u ? m.z_virtual[c] : m.z_real[c];
    if (kind == 2u) {
        // A height above the real source: sigma y = -ln(1 - t), t = share (1 - e^{-x}).
        float len = m.z_virtual[c] - m.z_real[c];
        float x = sigma * len;
        // A share of 1, to which rounding may lead, would be an infinite height.
        float t = min(share * x * one_minus_exp_over(x), 1.0 - 5.9604645e-8);
        z += x < 1e-4 ? len * share * (1.0 - 0.5 * x * (1.0 - share)) : min(log1p_(t / (1.0 - t)) / sigma, len);
    }
    return source_radius(sigma, z, u_radius);
}
