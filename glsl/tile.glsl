// Tiles of pixels that share the hits that they light, and the points that are drawn for their places. Included after PIXEL.
// The mathematics is in src/reference/tile.rs.

// The tiles lie elsewhere in each batch, so that no edge of theirs stays.
uvec2 tile_offset(uint batch) {
    return uvec2(3u, 5u) * batch % max(REUSE, 1u);
}

// A pixel's tile, and where in it the pixel is.
struct Place {
    uvec2 tile;
    uint at;
};

Place place_of(View view, uint index, uint batch) {
    uvec2 pixel = pixel_position(view, index);
    if (REUSE == 0u) return Place(pixel, 0u);
    pixel += tile_offset(batch);
    return Place(pixel / REUSE, pixel.y % REUSE * REUSE + pixel.x % REUSE);
}

// The part of a tile that is in the band: from the first to before the last column and row of the band. Its members are
// gone through in two loops over all of its places, as many for all pixels.
struct Tile {
    uvec2 first;
    uvec2 end;
};

bool in_band(Tile tile, uvec2 at) {
    return all(lessThan(tile.first + at, tile.end));
}

Tile tile_of(View view, Place place, uint batch) {
    ivec2 corner = ivec2(REUSE * place.tile - tile_offset(batch)) - ivec2(view.crop_x, step_.first_row);
    ivec2 size = ivec2(view.crop_width, step_.pixel_count / view.crop_width);
    return Tile(uvec2(max(corner, ivec2(0))), uvec2(clamp(corner + int(REUSE), ivec2(0), size)));
}


// The sample's first Probe::share.
uint first_share(View view) {
    return (sample_index() + 1u) * view.groups;
}

// A permutation of the places, by three rounds of a Feistel network.
uint shuffled(uint at, uint key) {
    uint x = at % REUSE, y = at / REUSE;
    x = (x + hash(key ^ y)) % REUSE;
    y = (y + hash(key ^ (REUSE + x))) % REUSE;
    x = (x + hash(key ^ (2u * REUSE + y))) % REUSE;
    return y * REUSE + x;
}

// Coordinate `k` of the (0, 2)-sequence's point of a place.
uint place_coordinate(uint at, uint k, uint key) {
    return scramble(k == 0u ? bitfieldReverse(at) : sobol1(at), key);
}

// Coordinate of the sample's point at a place.
float coordinate(Place place, uint key, uint batch, uint dimension) {
    uint v = scramble(sample_point(dimension), dimension_key(key, batch, dimension));
    if (REUSE != 0u) {
        uint place_key = dimension_key(key, batch, dimension + DIM_PLACE);
        uint at = place.at;
        if (dimension == DIM_HIT) at = shuffled(at, place_key);
        // The second pair of dimensions takes the places in the order of their digits reversed.
        else if (dimension == DIM_ANGLE || dimension == DIM_TECHNIQUE) {
            at = bitfieldReverse(at) >> (32 - findMSB(REUSE * REUSE));
        }
        v ^= place_coordinate(at, dimension == DIM_COMPONENT || dimension == DIM_TECHNIQUE ? 1u : 0u, place_key);
    }
    return unit(v);
}

// Number `index` of a place's sequence of steps by the golden ratio, alike at all places of a tile.
float golden_at(Place place, uint key, uint batch, uint dimension, uint index) {
    return unit(dimension_key(key, batch, dimension) + GOLDEN * (index * max(REUSE * REUSE, 1u) + place.at));
}

// As `random_point`, at a place.
vec2 point_at(Place place, uint key, uint batch, uint dimension, uint index) {
    if (REUSE == 0u) return random_point(key, batch, dimension, index);
    uint first = dimension_key(key, batch, dimension + DIM_PLACE);
    uint second = dimension_key(key, batch, dimension + 1u + DIM_PLACE);
    uint at = shuffled(place.at, first);
    return vec2(
        unit(scramble(bitfieldReverse(index), dimension_key(key, batch, dimension)) ^ place_coordinate(at, 0u, first)),
        unit(scramble(sobol1(index), dimension_key(key, batch, dimension + 1u)) ^ place_coordinate(at, 1u, second)));
}
