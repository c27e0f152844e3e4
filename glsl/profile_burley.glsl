// Normalised diffusion. The mathematics is in src/reference/profile/burley.rs.

vec3 burley_shape(Material m, float r2, float shift) {
    float r = max(sqrt(r2), BURLEY_RADIUS_MIN);
    vec3 x = m.sigma_tr * r;
    vec3 wide = exp_(shift - x * (1.0 / 3.0));
    // Without a shift the narrow exponential is the wide one's cube.
    vec3 narrow = shift == 0.0 ? wide * wide * wide : exp_(shift - x);
    return (narrow + wide) * (m.sigma_tr / r) * (0.125 / PI);
}

float burley_radius(Material m, float u_component, float u_radius) {
    uint c, kind;
    float share;
    pick_component(m, u_component, c, kind, share);
    return (kind == 0u ? -1.0 : -3.0) * log_(1.0 - u_radius) / m.sigma_tr[c];
}
