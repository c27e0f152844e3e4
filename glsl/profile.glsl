// How much light leaves matter at a distance from where it entered: value, density and draw of the radius, for the
// models that the scene uses. The mathematics is in src/reference/profile/.

#include "model.glsl"

// The component that a number in [0, 1) picks: its channel, its place among the channel's three, and where in it the
// number lies, 0 to 1.
void pick_component(Material m, float u, out uint c, out uint kind, out float share) {
    uint component = 0;
    float start = 0.0, end = m.component_cdf[0];
    for (uint i = 1; i < 9; i++) {
        if (u >= m.component_cdf[i - 1]) component = i, start = m.component_cdf[i - 1], end = m.component_cdf[i];
    }
    c = component / 3;
    kind = component % 3;
    share = end > start ? (u - start) / (end - start) : 0.0;
}

#include "profile_source.glsl"
#include "profile_standard.glsl"
#include "profile_better.glsl"
#include "profile_burley.glsl"
#include "profile_directional.glsl"
#include "profile_table.glsl"

// The profile over the material's strength, times e^shift, for each channel; of the directional dipole, that of the
// radii drawn. Exponents are combined before exp: `shift` is the exponent of what the caller multiplies by.
vec3 shape_shifted(Material m, float r2, float shift) {
    if (has_model(m, MODEL_TABLE)) return table_shape(m, r2, shift);
    if (has_model(m, MODEL_BETTER)) return better_shape(m, r2, shift);
    if (has_model(m, MODEL_BURLEY)) return burley_shape(m, r2, shift);
    return standard_shape(m, r2, shift);
}

vec3 shape(Material m, float r2) {
    return shape_shifted(m, r2, 0.0);
}

// As `shape`, of a table at the curvature that `table_draw` drew.
vec3 shape_drawn(Material m, float r2) {
    if (has_model(m, MODEL_TABLE)) return table_drawn(m, r2);
    return shape(m, r2);
}

// Density of the radius per area of the plane.
float radial_density(Material m, float r2) {
    if (has_model(m, MODEL_TABLE)) return table_density(m, r2);
    return dot(m.density, shape(m, r2));
}

// Factor on light that enters, or leaves, at the cosine outside.
vec3 obliqueness(Material m, float c, bool leaving) {
    if (has_model(m, MODEL_TABLE)) return table_obliqueness(m, table_slope(m), c, leaving);
    if (has_model(m, MODEL_LAMBERT)) return table_obliqueness(m, m.slope, c, leaving);
    return vec3(1.0);
}

// Radius with that density.
float draw_radius(Material m, float u_component, float u_radius) {
    if (has_model(m, MODEL_TABLE)) return table_radius(m, u_component, u_radius);
    if (has_model(m, MODEL_BETTER)) return better_radius(m, u_component, u_radius);
    if (has_model(m, MODEL_BURLEY)) return burley_radius(m, u_component, u_radius);
    return standard_radius(m, u_component, u_radius);
}
