// The directional dipole: what a beam adds. The mathematics is in src/reference/profile/directional.rs.

// n made perpendicular to x.
vec3 modified_normal(vec3 n, vec3 x) {
    float r2 = dot(x, x);
    if (!(r2 > 0.0)) return n;
    vec3 along = x / sqrt(r2);
    vec3 across = n - dot(n, along) * along;
    float across2 = dot(across, across);
    // Beyond, rounding alone decides on the direction.
    if (across2 > 1e-12) return across / sqrt(across2);
    vec3 tangent, bitangent;
    orthonormal_basis(along, tangent, bitangent);
    return tangent;
}

// All of a term but its fluence: distance d, and the products of its place, its direction and the exit's normal.
vec3 directional_term(Material m, vec3 d, vec3 x_w, vec3 w_no, vec3 x_no, float shift) {
    vec3 sd = m.sigma_tr * d;
    vec3 k = 1.0 + sd;
    vec3 d2 = d * d;
    // 3 D = z_r.
    vec3 flux = m.z_real * k * w_no - (k + m.z_real * (3.0 * k + sd * sd) / d2 * x_w) * x_no;
    return exp_(shift - sd) / (d2 * d) * (3.0 * m.c_phi * k * x_w - m.c_e * flux);
}

// S e^shift of light from wi that enters with the normal ni and leaves at the distance x from there with the normal no;
// without the Fresnel factors.
vec3 directional_value(Material m, vec3 x, vec3 ni, vec3 wi, vec3 no, float shift) {
    float cos_i = dot(wi, ni);
    float refracted = 1.0 - (1.0 - cos_i * cos_i) / (m.ior * m.ior);
    if (refracted < 0.0) return vec3(0.0);
    vec3 w = (cos_i * ni - wi) / m.ior - ni * sqrt(refracted);
    float r2 = dot(x, x), x_w = dot(x, w), w_no = dot(w, no), x_no = dot(x, no);
    vec3 h = m.height;
    vec3 diffusion = m.z_real * (1.0 / 3.0);
    vec3 extrapolation = h * (m.c_phi / (1.0 - m.c_e));

    vec3 front = m.free_path * m.free_path;
    if (w_no < 0.0) {
        // r^2 - (x.w)^2 without cancellation.
        vec3 x_cross_w = cross(x, w);
        vec3 across = sqrt(dot(x_cross_w, x_cross_w) / (r2 + extrapolation * extrapolation));
        vec3 mu = -w_no * diffusion;
        front = max(mu * (mu + 2.0 * extrapolation * across), m.floor * m.floor);
    }
    vec3 near = sqrt(r2 + front), far = sqrt(r2 + h * h);
    vec3 gap = (h * h - front) / (far + near);
    vec3 n = modified_normal(ni, x);
    float w_n = dot(w, n), n_no = dot(n, no);
    vec3 fluence = exp_(shift - m.sigma_tr * near) * (gap / far)
        * (1.0 / near + m.sigma_tr * one_minus_exp_over(m.sigma_tr * gap)) * (m.c_phi / diffusion);
    vec3 real = directional_term(m, near, vec3(x_w), vec3(w_no), vec3(x_no), shift);
    vec3 mirrored = directional_term(m, far, x_w + h * w_n, vec3(w_no - 2.0 * w_n * n_no), x_no - h * n_no, shift);
    return m.beam * max(fluence + real - mirrored, 0.0);
}
