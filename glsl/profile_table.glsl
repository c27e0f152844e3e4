// Profiles tabulated by simulation. The mathematics is in src/reference/profile/table.rs, the layout of the numbers in
// src/table/block.rs.
PROFILES(readonly);
BALANCES(readonly);

// The curvatures of the table around that of the surface that is seen: the first of two, its weight, how distances bend
// for both, and 1/4a^2. Without curvatures there is the half-space alone.
uint table_node = 0u;
float table_weight = 1.0;
vec2 table_bend = vec2(0.0);
float table_scale = 0.0;

uint table_base(Material m, uint node) {
    return m.table + node * (TABLE_HEADER + (CELL_VECTORS + 1u) * (m.table_cells + 1u));
}

// Chooses the curvatures at the surface that is seen.
void table_at(Material m, Surface surface) {
    if (m.model != MODEL_TABLE) return;
    table_node = m.table_nodes - 1u;
    table_weight = 1.0;
    table_bend = vec2(0.0);
    if (CURVATURE == 0) return;
    vec2 b = surface.barycentric;
    float curvature = dot(balances[m.balance + surface.triangle].curvature, vec3(1.0 - b.x - b.y, b));
    table_scale = 0.25 * curvature * curvature;
    uint above = 0u;
    while (above < min(m.table_nodes, TABLE_NODES) && profiles[table_base(m, above)].x > curvature) above++;
    if (above == m.table_nodes) return;
    float low = profiles[table_base(m, above)].x;
    if (above == 0u) {
        table_node = 0u;
        if (low > 0.0) table_bend = vec2(low / curvature - 1.0);
        return;
    }
    float high = profiles[table_base(m, above - 1u)].x;
    table_node = above - 1u;
    table_weight = (curvature - low) / (high - low);
    if (low > 0.0) table_bend = vec2(high, low) / curvature - 1.0;
}

// Squared distance in a table of another diameter, and the factor on areas there; nothing lies beyond the diameter.
float table_bent(float r2, float bend, out float area) {
    area = 1.0;
    if (CURVATURE == 0 || bend == 0.0) return r2;
    float q = r2 * table_scale;
    float over = 1.0 / (1.0 + bend * q);
    area = q <= 1.0 ? (1.0 - bend * q) * over * over * over : 0.0;
    return q <= 1.0 ? r2 * over * over : 0.0;
}

// The channels' values between the two nodes of the cell that begins at `cell`, t from the first to the second.
vec3 table_inside(uint cell, float t) {
    if (CELL_VECTORS == 2u) return mix(profiles[cell], profiles[cell + 1u], t);
    uvec3 bits = floatBitsToUint(profiles[cell]);
    uint most = (1u << TABLE_BITS) - 1u;
    vec3 low = vec3(bits >> (TABLE_BITS - 1u) & (most - 1u) | bits >> 31), high = vec3(bits & most);
    return uintBitsToFloat(bits & 0x7f800000u) * mix(low, high, t);
}

// The channels' values at the curvature whose numbers begin at `base`; no cell that it does not reach has any.
vec3 table_value(Material m, uint base, float r2) {
    uint cell = floatBitsToUint(r2) >> TABLE_SHIFT;
    if (cell >= m.table_first + m.table_cells) return vec3(0.0);
    float low = uintBitsToFloat(cell << TABLE_SHIFT), high = uintBitsToFloat((cell + 1u) << TABLE_SHIFT);
    // The value below the first node stands before the first cell.
    bool before = cell < m.table_first;
    uint i = before ? 0u : cell + 1u - m.table_first;
    return table_inside(base + TABLE_HEADER + CELL_VECTORS * i, before ? 0.0 : (r2 - low) / (high - low));
}

// Values between the two curvatures. Those of a density are divided by their masses.
vec3 table_between(Material m, float r2, bool density) {
    vec3 sum = vec3(0.0);
    float weight = table_weight;
    uint k = 0u;
    [[dont_unroll]] do {
        // Either may be 0: of a flat place the first, beyond the last node the second, which is none.
        if (weight > 0.0) {
            float area;
            float bent = table_bent(r2, table_bend[k], area);
            uint base = table_base(m, table_node + k);
            vec3 value = weight * area * table_value(m, base, bent);
            sum += density ? value * profiles[base + 1u] : value;
        }
        weight = 1.0 - table_weight;
    } while (++k < (CURVATURE != 0 ? 2u : 1u));
    return sum;
}

vec3 table_shape(Material m, float r2, float shift) {
    vec3 f = table_between(m, r2, false);
    if (shift == 0.0) return f;
    // One exponential: the value may be as small as the other factor is large.
    return vec3(f.x > 0.0 ? exp_(log_(f.x) + shift) : 0.0, f.y > 0.0 ? exp_(log_(f.y) + shift) : 0.0,
        f.z > 0.0 ? exp_(log_(f.z) + shift) : 0.0);
}

// Density of the radius per area of the plane.
float table_density(Material m, float r2) {
    return dot(m.density, table_between(m, r2, true));
}

// The distance that is bent to a squared distance.
float table_unbent(float s, float bend) {
    if (CURVATURE == 0 || bend == 0.0) return sqrt(s);
    return 2.0 * sqrt(s) / (1.0 + sqrt(max(1.0 - 4.0 * bend * table_scale * s, 0.0)));
}

// The one of the two curvatures that `table_drawn` reads: where its numbers begin, how distances bend.
uint table_drawn_base = 0u;
float table_drawn_bend = 0.0;

// Draws it by their weights.
void table_draw(Material m, float u) {
    uint second = CURVATURE != 0 && u >= table_weight ? 1u : 0u;
    table_drawn_base = table_base(m, table_node + second);
    table_drawn_bend = table_bend[second];
}

// Its values.
vec3 table_drawn(Material m, float r2) {
    float area;
    float bent = table_bent(r2, table_drawn_bend, area);
    return area * table_value(m, table_drawn_base, bent);
}

// Squared distance beyond which both curvatures have no light.
float table_reach2(Material m) {
    float reach = 0.0;
    [[dont_unroll]] for (uint k = 0u; k < (CURVATURE != 0 && table_weight < 1.0 ? 2u : 1u); k++) {
        uint reached = uint(profiles[table_base(m, table_node + k)].y);
        reach = max(reach, table_unbent(uintBitsToFloat((m.table_first + reached) << TABLE_SHIFT), table_bend[k]));
    }
    return reach * reach;
}

// The half-space's value, all channels together.
float table_weighed(Material m, float r2) {
    uint cell = clamp(floatBitsToUint(r2) >> TABLE_SHIFT, m.table_first, m.table_first + m.table_cells - 1u);
    float low = uintBitsToFloat(cell << TABLE_SHIFT), high = uintBitsToFloat((cell + 1u) << TABLE_SHIFT);
    vec3 ends = profiles[table_base(m, m.table_nodes) + cell - m.table_first];
    return mix(ends.x, ends.y, clamp((r2 - low) / (high - low), 0.0, 1.0));
}

// Radius with that density.
float table_radius(Material m, float u_component, float u) {
    uint c = u_component < m.component_cdf[2] ? 0u : u_component < m.component_cdf[5] ? 1u : 2u;
    float start = c == 0u ? 0.0 : m.component_cdf[3u * c - 1u];
    float share = (u_component - start) / (m.component_cdf[3u * c] - start);
    bool second = CURVATURE != 0 && table_weight < 1.0 && share >= table_weight;
    uint base = table_base(m, table_node + (second ? 1u : 0u));
    uint cells = base + TABLE_HEADER + CELL_VECTORS;
    uint within = cells + CELL_VECTORS * m.table_cells;
    uint low = 0u, high = uint(profiles[base].y);
    float target = u * profiles[within + high][c];
    float bend = second ? table_bend.y : table_bend.x;
    float inner = profiles[within][c];
    if (target < inner) {
        return table_unbent(uintBitsToFloat(m.table_first << TABLE_SHIFT) * (target / inner), bend);
    }
    for (uint k = 0u; k < TABLE_HALVINGS && high - low > 1u; k++) {
        uint middle = (low + high) / 2u;
        if (profiles[within + middle][c] <= target) low = middle;
        else high = middle;
    }
    float s0 = uintBitsToFloat((m.table_first + low) << TABLE_SHIFT);
    float width = uintBitsToFloat((m.table_first + low + 1u) << TABLE_SHIFT) - s0;
    uint cell = cells + CELL_VECTORS * low;
    float a = table_inside(cell, 0.0)[c], b = table_inside(cell, 1.0)[c];
    float q = (target - profiles[within + low][c]) / (PI * width);
    float root = a + sqrt(max(a * a + 2.0 * (b - a) * q, 0.0));
    float t = root > 0.0 ? min(2.0 * q / root, 1.0) : 0.0;
    return table_unbent(s0 + t * width, bend);
}

// Slope of the total in 1 - cosine of refraction.
vec3 table_slope(Material m) {
    vec3 slope = table_weight * profiles[table_base(m, table_node) + 2u];
    if (CURVATURE != 0 && table_weight < 1.0) slope += (1.0 - table_weight) * profiles[table_base(m, table_node + 1u) + 2u];
    return slope;
}

// 1 - cosine of refraction, of light at the cosine outside.
float table_oblique(Material m, float c) {
    return 1.0 - sqrt(max(1.0 - (1.0 - c * c) / (m.ior * m.ior), 0.0));
}

// Factor on light that enters, or leaves, at the cosine outside.
vec3 table_obliqueness(Material m, vec3 slope, float c, bool leaving) {
    vec3 factor = 1.0 + slope * table_oblique(m, c);
    return leaving ? factor / (1.0 + slope * m.obliqueness) : factor;
}

// What the profile is multiplied by at the surface that is seen, so that it gives back what its sphere does.
vec3 table_balance(Material m, Surface surface) {
    if (CURVATURE == 0) return vec3(1.0);
    vec2 b = surface.barycentric;
    vec3 at[3] = balances[m.balance + surface.triangle].at;
    return at[0] * (1.0 - b.x - b.y) + at[1] * b.x + at[2] * b.y;
}
