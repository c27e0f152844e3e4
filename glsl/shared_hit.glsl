// What a lit hit brings to the pixels of its tile. The mathematics is in src/reference/shared_hit.rs and
// reuse.rs.

// The tabulated profile is that at a pixel's surface.
void table_of(Probe probe) {
    table_node = probe.table_node;
    table_weight = probe.table_weight;
    table_bend = probe.table_bend;
    table_scale = probe.table_scale;
}

// A pixel's value of light that enters at a distance: 0 where none of its probes looks. Its own hits count as in reach.
vec3 value_at(Material m, vec3 delta, bool own) {
    float r2 = dot(delta, delta);
    return own || r2 <= m.radius_max * m.radius_max ? m.strength * shape(m, r2) : vec3(0.0);
}

// Whether a pixel shares hits with those of a group in this sample.
bool shares(uint index, uint group) {
    return probes[index].stamp == sample_index() + 1u && probes[index].group == group;
}

// The sum over pixels of the tile, and channels, of the values of the hit at `delta` from the point that pixel `index` sees.
float tile_value(Tile tile, uint width, Material m, uint index, vec3 delta) {
    float sum = 0.0;
    uint group = probes[index].group;
    vec3 hit = surfaces[surface_index(index)].position;
    [[dont_unroll]] for (uint y = tile.first.y; y < tile.end.y; y++) {
        [[dont_unroll]] for (uint x = tile.first.x; x < tile.end.x; x++) {
            uint other = y * width + x;
            if (!shares(other, group)) continue;
            if (has_model(m, MODEL_TABLE)) table_of(probes[other]);
            vec3 value = value_at(m, hit - surfaces[surface_index(other)].position + delta, other == index);
            sum += value.x + value.y + value.z;
        }
    }
    return sum;
}
