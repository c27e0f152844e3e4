// Profiles tabulated by simulation. The mathematics is in src/reference/profile/table.rs, the layout of the numbers in
// src/table/block.rs.
PROFILES(readonly);
THICKNESS(readonly);

// The curvatures of the table around that of the surface that is seen: the first of two, its weight, and the squared
// factors on distances. Without curvatures there is the half-space alone.
uint table_node = 0u;
float table_weight = 1.0;
vec2 table_stretch2 = vec2(1.0);

uint table_base(Material m, uint node) {
    return m.table + node * (TABLE_HEADER + 6u * (m.table_cells + 1u));
}

// Chooses the curvatures at the surface that is seen.
void table_at(Material m, Surface surface) {
    if (m.model != MODEL_TABLE) return;
    table_node = m.table_nodes - 1u;
    if (CURVATURE == 0) return;
    vec2 b = surface.barycentric;
    float curvature = dot(thickness[surface.triangle], vec3(1.0 - b.x - b.y, b));
    uint above = 0u;
    while (above < min(m.table_nodes, TABLE_NODES) && profiles[table_base(m, above)] > curvature) above++;
    if (above == m.table_nodes) return;
    float low = profiles[table_base(m, above)];
    if (above == 0u) {
        table_node = 0u;
        if (low > 0.0 && curvature > 0.0) table_stretch2 = vec2(curvature * curvature / (low * low));
        return;
    }
    float high = profiles[table_base(m, above - 1u)];
    table_node = above - 1u;
    table_weight = (curvature - low) / (high - low);
    if (low > 0.0) table_stretch2 = curvature * curvature / vec2(high * high, low * low);
}

// The channels' values at one curvature.
vec3 table_value(Material m, uint node, float r2) {
    uint base = table_base(m, node);
    uint cell = floatBitsToUint(r2) >> TABLE_SHIFT;
    uint nodes = m.table_cells + 1u;
    uint values = base + TABLE_HEADER;
    if (cell < m.table_first) {
        uint within = values + nodes;
        vec3 inner = vec3(profiles[within], profiles[within + 2u * nodes], profiles[within + 4u * nodes]);
        return inner / (PI * uintBitsToFloat(m.table_first << TABLE_SHIFT));
    }
    uint i = cell - m.table_first;
    if (i >= uint(profiles[base + 1u])) return vec3(0.0);
    float low = uintBitsToFloat(cell << TABLE_SHIFT), high = uintBitsToFloat((cell + 1u) << TABLE_SHIFT);
    float t = (r2 - low) / (high - low);
    i += values;
    vec3 a = vec3(profiles[i], profiles[i + 2u * nodes], profiles[i + 4u * nodes]);
    i += 1u;
    vec3 b = vec3(profiles[i], profiles[i + 2u * nodes], profiles[i + 4u * nodes]);
    return mix(a, b, t);
}

vec3 table_vector(Material m, uint node, uint at) {
    uint i = table_base(m, node) + at;
    return vec3(profiles[i], profiles[i + 1u], profiles[i + 2u]);
}

vec3 table_shape(Material m, float r2, float shift) {
    vec3 f = table_weight * table_stretch2.x * table_value(m, table_node, r2 * table_stretch2.x);
    if (CURVATURE != 0 && table_weight < 1.0) {
        f += (1.0 - table_weight) * table_stretch2.y * table_value(m, table_node + 1u, r2 * table_stretch2.y);
    }
    if (shift == 0.0) return f;
    // One exponential: the value may be as small as the other factor is large.
    return vec3(f.x > 0.0 ? exp_(log_(f.x) + shift) : 0.0, f.y > 0.0 ? exp_(log_(f.y) + shift) : 0.0,
        f.z > 0.0 ? exp_(log_(f.z) + shift) : 0.0);
}

// Density of the radius per area of the plane. The half-space's mass is 1.
float table_density(Material m, float r2) {
    if (CURVATURE == 0) return dot(m.density, table_value(m, table_node, r2));
    vec3 p = table_weight * table_stretch2.x * table_value(m, table_node, r2 * table_stretch2.x)
        * table_vector(m, table_node, 2u);
    if (table_weight < 1.0) {
        p += (1.0 - table_weight) * table_stretch2.y * table_value(m, table_node + 1u, r2 * table_stretch2.y)
            * table_vector(m, table_node + 1u, 2u);
    }
    return dot(m.density, p);
}

// Radius with that density.
float table_radius(Material m, float u_component, float u) {
    uint c = u_component < m.component_cdf[2] ? 0u : u_component < m.component_cdf[5] ? 1u : 2u;
    float start = c == 0u ? 0.0 : m.component_cdf[3u * c - 1u];
    float share = (u_component - start) / (m.component_cdf[3u * c] - start);
    bool second = CURVATURE != 0 && table_weight < 1.0 && share >= table_weight;
    uint base = table_base(m, table_node + (second ? 1u : 0u));
    uint nodes = m.table_cells + 1u;
    uint values = base + TABLE_HEADER + 2u * c * nodes;
    uint within = values + nodes;
    uint low = 0u, high = uint(profiles[base + 1u]);
    float target = u * profiles[within + high];
    float stretch2 = second ? table_stretch2.y : table_stretch2.x;
    if (target < profiles[within]) {
        return sqrt(uintBitsToFloat(m.table_first << TABLE_SHIFT) * (target / profiles[within]) / stretch2);
    }
    for (uint k = 0u; k < TABLE_HALVINGS && high - low > 1u; k++) {
        uint middle = (low + high) / 2u;
        if (profiles[within + middle] <= target) low = middle;
        else high = middle;
    }
    float s0 = uintBitsToFloat((m.table_first + low) << TABLE_SHIFT);
    float width = uintBitsToFloat((m.table_first + low + 1u) << TABLE_SHIFT) - s0;
    float a = profiles[values + low], b = profiles[values + low + 1u];
    float q = (target - profiles[within + low]) / (PI * width);
    float root = a + sqrt(max(a * a + 2.0 * (b - a) * q, 0.0));
    float t = root > 0.0 ? min(2.0 * q / root, 1.0) : 0.0;
    return sqrt((s0 + t * width) / stretch2);
}

// Factor on light that enters, or leaves, at the cosine outside.
vec3 table_obliqueness(Material m, float c, bool leaving) {
    vec3 slope = table_weight * table_vector(m, table_node, 5u);
    if (CURVATURE != 0 && table_weight < 1.0) slope += (1.0 - table_weight) * table_vector(m, table_node + 1u, 5u);
    float inside = sqrt(max(1.0 - (1.0 - c * c) / (m.ior * m.ior), 0.0));
    vec3 factor = 1.0 + slope * (1.0 - inside);
    return leaving ? factor / (1.0 + slope * m.obliqueness) : factor;
}
