// What a lit hit brings to the pixels of its tile. The mathematics is in src/reference/shared_hit.rs
// and reuse.rs.

// The tabulated profile is that at a pixel's surface.
void table_of(Probe probe) {
    table_node = probe.table_node;
    table_weight = probe.table_weight;
    table_bend = probe.table_bend;
    table_scale = probe.table_scale;
}

// G: about the profile of light that enters at a squared distance, the same for all pixels that share the hit.
float tile_weight(Material m, float r2) {
    if (has_model(m, MODEL_TABLE)) return table_weighed(m, r2);
    vec3 value = m.strength * shape(m, r2);
    return value.x + value.y + value.z;
}

// Of the hit of pixel `index` its weight over that of all pixels of the tile that may find it.
float tile_share(Tile tile, uint width, Material m, uint index, vec3 hit, float hit_r2) {
    float own = 0.0, sum = 0.0;
    uint share = probes[index].lit.w;
    uint row = tile.first.y * width + tile.first.x;
    uvec2 at = uvec2(0u);
    [[dont_unroll]] do {
        at.x = 0u;
        [[dont_unroll]] do {
            bool there = in_band(tile, at);
            uint other = there ? row + at.x : index;
            if (there && probes[other].lit.w == share) {
                vec4 seat = uintBitsToFloat(probes[other].seat);
                vec3 delta = hit - seat.xyz;
                // Its own hits count as in reach.
                float r2 = other == index ? hit_r2 : dot(delta, delta);
                float weight = tile_weight(m, r2);
                if (other == index) own = weight;
                if (other == index || r2 <= seat.w) sum += weight;
            }
        } while (++at.x < REUSE);
        row += width;
    } while (++at.y < REUSE);
    return own / sum;
}
