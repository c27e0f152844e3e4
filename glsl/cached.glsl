// Light that enters, kept at points of the surface. The mathematics is in src/reference/cached.rs.
LATTICES(readonly);
CLUSTERS(readonly);

// Number of the point b1 = i / cells, b2 = j / cells.
uint lattice_number(Lattice lattice, uint i, uint j) {
    uint n = lattice.cells;
    if (i + j == 0u) return lattice.corners[0];
    if (i == n) return lattice.corners[1];
    if (j == n) return lattice.corners[2];
    return lattice.first + (j * (2u * n + 3u - j)) / 2u + i - (j == 0u ? 1u : 2u);
}

// The cell of a triangle that is cut into n along each edge, and weights within it.
bool lattice_cell(uint n, inout vec2 weights, out uint i, out uint j) {
    vec2 inside = max(weights, vec2(0.0));
    vec2 at = inside / max(inside.x + inside.y, 1.0) * float(n);
    float x = min(floor(at.x), float(n) - 1.0);
    float y = min(floor(at.y), float(n) - 1.0 - x);
    vec2 rest = at - vec2(x, y);
    i = uint(x);
    j = uint(y);
    bool upper = rest.x + rest.y > 1.0 && i + j + 1u < n;
    weights = upper ? 1.0 - rest : rest;
    return upper;
}

// E + slope O at a point of a triangle; `m` is what light enters there.
vec3 cached_light(Material m, uint triangle, vec2 weights) {
    Lattice lattice = lattices[triangle];
    uint i, j;
    if (lattice.patches > 1u) {
        uint n = lattice.patches;
        uint upper = lattice_cell(n, weights, i, j) ? 1u : 0u;
        lattice = lattices[lattice.first + j * (2u * n - j) + 2u * i + upper];
    }
    if (lattice.cells == 0u) return vec3(0.0);
    bool upper = lattice_cell(lattice.cells, weights, i, j);
    uint right = lattice_number(lattice, i + 1u, j), above = lattice_number(lattice, i, j + 1u);
    uint a = upper ? lattice_number(lattice, i + 1u, j + 1u) : lattice_number(lattice, i, j);
    uint b = upper ? above : right, c = upper ? right : above;
    vec3 shares = vec3(1.0 - weights.x - weights.y, weights);
    vec3 light = shares.x * clusters[a].flux + shares.y * clusters[b].flux + shares.z * clusters[c].flux;
    if (!has_model(m, MODEL_TABLE)) return light;
    return light + table_slope(m) * (shares.x * clusters[a].oblique + shares.y * clusters[b].oblique
        + shares.z * clusters[c].oblique);
}
