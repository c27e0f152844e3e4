// The standard dipole. The mathematics is in src/reference/profile/standard.rs.

vec3 standard_shape(Material m, float r2, float shift) {
    vec3 s = source_shape(m.sigma_tr, m.z_real, r2, shift) + source_shape(m.sigma_tr, m.z_virtual, r2, shift);
    return s * (0.5 / PI);
}

float standard_radius(Material m, float u_component, float u_radius) {
    // The first component whose cumulative probability exceeds u; the third of each channel is void.
    float sigma = m.sigma_tr.x, z = m.z_real.x;
    if (u_component >= m.component_cdf[0]) z = m.z_virtual.x;
    if (u_component >= m.component_cdf[2]) sigma = m.sigma_tr.y, z = m.z_real.y;
    if (u_component >= m.component_cdf[3]) z = m.z_virtual.y;
    if (u_component >= m.component_cdf[5]) sigma = m.sigma_tr.z, z = m.z_real.z;
    if (u_component >= m.component_cdf[6]) z = m.z_virtual.z;
    return source_radius(sigma, z, u_radius);
}
