// How much light leaves matter at a distance from where it entered: value, density and draw of the radius, for the
// models that the scene uses. The mathematics is in src/reference/profile/.
#include "profile_source.glsl"
#include "profile_standard.glsl"
#include "profile_table.glsl"

// Whether a material has a model. Models that no material of the scene has cost nothing; a scene with one model does
// not ask.
bool has_model(Material m, uint model) {
    uint bit = 1u << model;
    return (MODELS & bit) != 0u && (MODELS == bit || m.model == model);
}

// The profile over the material's strength, times e^shift, for each channel. Exponents are combined before exp: `shift`
// is the exponent of what the caller multiplies by.
vec3 shape_shifted(Material m, float r2, float shift) {
    if (has_model(m, MODEL_TABLE)) return table_shape(m, r2, shift);
    return standard_shape(m, r2, shift);
}

vec3 shape(Material m, float r2) {
    return shape_shifted(m, r2, 0.0);
}

// Density of the radius per area of the plane.
float radial_density(Material m, float r2) {
    if (has_model(m, MODEL_TABLE)) return table_density(m, r2);
    return dot(m.density, shape(m, r2));
}

// Radius with that density.
float draw_radius(Material m, float u_component, float u_radius) {
    if (has_model(m, MODEL_TABLE)) return table_radius(m, u_component, u_radius);
    return standard_radius(m, u_component, u_radius);
}
