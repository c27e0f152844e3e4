// Fresnel and roughness at the surface. The mathematics is in src/reference/boundary.rs.

// Unpolarised reflectance of a smooth dielectric, seen from outside; ior = inside / outside.
float fresnel(float ior, float cos_outside) {
    // At grazing incidence the quotient is 0/0 without a boundary.
    if (ior == 1.0) return 0.0;
    float c = clamp(cos_outside, 0.0, 1.0);
    float g2 = ior * ior - 1.0 + c * c;
    if (g2 <= 0.0) return 1.0;
    float g = sqrt(g2);
    float s = (c - g) / (c + g);
    float p = (ior * ior * c - g) / (ior * ior * c + g);
    return 0.5 * (s * s + p * p);
}

float transmittance(float ior, float cos_outside) {
    return 1.0 - fresnel(ior, cos_outside);
}

// Directions are in the frame where n = z; squared sines come from x and y, which keeps their digits near n.

// GGX normal distribution.
float ggx_distribution(float alpha, vec3 h) {
    float a2 = alpha * alpha;
    float t = dot(h.xy, h.xy) + a2 * h.z * h.z;
    return a2 / (PI * t * t);
}

// Smith's Lambda, above the horizon.
float ggx_lambda(float alpha, vec3 w) {
    return 0.5 * (sqrt(1.0 + alpha * alpha * dot(w.xy, w.xy) / (w.z * w.z)) - 1.0);
}

// A half vector with the density of visible normals (Heitz 2018); wo in the frame where n = z.
vec3 draw_half_vector(vec3 wo, float alpha, vec2 u) {
    vec3 v = normalize(vec3(alpha * wo.xy, wo.z));
    float len2 = dot(v.xy, v.xy);
    vec3 t1 = len2 > 0.0 ? vec3(-v.y, v.x, 0.0) / sqrt(len2) : vec3(1.0, 0.0, 0.0);
    vec3 t2 = cross(v, t1);
    vec2 p = sqrt(u.x) * cos_sin_2pi(u.y);
    float s = 0.5 * (1.0 + v.z);
    p.y = (1.0 - s) * sqrt(max(1.0 - p.x * p.x, 0.0)) + s * p.y;
    vec3 h = p.x * t1 + p.y * t2 + sqrt(max(1.0 - dot(p, p), 0.0)) * v;
    return normalize(vec3(alpha * h.xy, max(h.z, 0.0)));
}
