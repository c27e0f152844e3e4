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

// E + slope O at a point of a triangle; `m` is what light enters there.
vec3 cached_light(Material m, uint triangle, vec2 b) {
    Lattice lattice = lattices[triangle];
    if (lattice.cells == 0u) return vec3(0.0);
    float n = float(lattice.cells);
    b = max(b, vec2(0.0));
    vec2 at = b / max(b.x + b.y, 1.0) * n;
    vec2 cell = vec2(min(floor(at.x), n - 1.0), 0.0);
    cell.y = min(floor(at.y), n - 1.0 - cell.x);
    vec2 rest = at - cell;
    uint i = uint(cell.x), j = uint(cell.y);
    bool lower = rest.x + rest.y <= 1.0 || i + j + 1u == lattice.cells;
    uint a = lattice_number(lattice, lower ? i : i + 1u, lower ? j : j + 1u);
    uint right = lattice_number(lattice, i + 1u, j), above = lattice_number(lattice, i, j + 1u);
    vec3 weights = lower ? vec3(1.0 - rest.x - rest.y, rest) : vec3(rest.x + rest.y - 1.0, 1.0 - rest.yx);
    vec3 light = weights.x * clusters[a].flux + weights.y * clusters[right].flux + weights.z * clusters[above].flux;
    if (!has_model(m, MODEL_TABLE)) return light;
    return light + table_slope(m) * (weights.x * clusters[a].oblique + weights.y * clusters[right].oblique
        + weights.z * clusters[above].oblique);
}
