// Transmittance of smooth and rough boundaries. The mathematics is in src/reference/rough.rs.

BOUNDARIES(readonly);

// Number x of a row, counted from the nodes and interpolated.
float in_row(uint row, float x) {
    uint i = min(uint(x), BOUNDARY_NODES - 2u);
    uint first = row * BOUNDARY_ROW + i;
    return mix(boundaries[first], boundaries[first + 1u], x - float(i));
}

// The row below a share of the roughness, and how far above it the share is, in rows.
float row_below(Material m, float share, out uint row) {
    float y = sqrt(clamp(share, 0.0, 1.0)) * float(ROUGH - 1);
    row = min(uint(y), uint(ROUGH) - 2u);
    float above = y - float(row);
    row += (m.boundary - 1u) * uint(ROUGH);
    return above;
}

// Share of the light at a cosine outside that crosses the surface of a translucent material; `share` is the texture's, of
// the roughness.
float crossing(Material m, float cos_outside, float share) {
    if (ROUGH == 0 || m.boundary == 0u) return transmittance(m.ior, cos_outside);
    float x = sqrt(clamp(cos_outside, 0.0, 1.0)) * float(BOUNDARY_NODES - 1u);
    if (ROUGH == 1) return in_row(m.boundary - 1u, x);
    uint row;
    float above = row_below(m, share, row);
    return mix(in_row(row, x), in_row(row + 1u, x), above);
}

// What a texture of the roughness makes of radiance that leaves, besides its crossing: rho_e is that of the place.
float leaving_share(Material m, float share) {
    if (ROUGH < 2 || m.boundary == 0u) return 1.0;
    uint row;
    float above = row_below(m, share, row);
    float here = mix(boundaries[row * BOUNDARY_ROW + BOUNDARY_NODES],
        boundaries[(row + 1u) * BOUNDARY_ROW + BOUNDARY_NODES], above);
    return boundaries[m.boundary * uint(ROUGH) * BOUNDARY_ROW - 1u] / here;
}
