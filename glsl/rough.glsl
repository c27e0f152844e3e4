// Transmittance of smooth and rough boundaries. The mathematics is in src/reference/rough.rs.

BOUNDARIES(readonly);

// Share of the light at a cosine outside that crosses the surface of a translucent material.
float crossing(Material m, float cos_outside) {
    if (ROUGH == 0 || m.boundary == 0u) return transmittance(m.ior, cos_outside);
    float x = sqrt(clamp(cos_outside, 0.0, 1.0)) * float(BOUNDARY_NODES - 1u);
    uint i = min(uint(x), BOUNDARY_NODES - 2u);
    uint first = (m.boundary - 1u) * BOUNDARY_NODES + i;
    return mix(boundaries[first], boundaries[first + 1u], x - float(i));
}
