// Random numbers keyed by pixel, sample, dimension and seed: an Owen-scrambled Sobol sequence per pixel and batch.
// The mathematics is in src/reference/random.rs.

uint hash(uint x) {
    x ^= x >> 16;
    x *= 0x21f0aaadu;
    x ^= x >> 15;
    x *= 0xd35a2d97u;
    x ^= x >> 15;
    return x;
}

// What all random numbers of a pixel have in common.
uint pixel_key(uint seed, uvec2 pixel) {
    return hash(hash(hash(seed) ^ pixel.x) + pixel.y);
}

uint dimension_key(uint pixel_key, uint batch, uint dimension) {
    return hash(pixel_key ^ (batch << 8 | dimension));
}

uint scramble(uint v, uint key) {
    uint x = bitfieldReverse(v);
    x ^= x * 0x3d20adeau;
    x += key;
    x *= (key >> 16) | 1u;
    x ^= x * 0x05526c56u;
    x ^= x * 0x53a22864u;
    return bitfieldReverse(x);
}

// To [0, 1 - 2^-24].
float unit(uint v) {
    return float(v >> 8) * 5.9604644775390625e-8;
}

// The second dimension of Sobol's sequence: the index times Pascal's matrix mod 2, a Kronecker power, bits reversed.
uint sobol1(uint index) {
    uint x = bitfieldReverse(index);
    x ^= (x & 0x55555555u) << 1;
    x ^= (x & 0x33333333u) << 2;
    x ^= (x & 0x0f0f0f0fu) << 4;
    x ^= (x & 0x00ff00ffu) << 8;
    x ^= x << 16;
    return x;
}

// Point `index` of the scrambled (0, 2)-sequence in two dimensions from `dimension` on.
vec2 random_point(uint pixel_key, uint batch, uint dimension, uint index) {
    return vec2(unit(scramble(bitfieldReverse(index), dimension_key(pixel_key, batch, dimension))),
                unit(scramble(sobol1(index), dimension_key(pixel_key, batch, dimension + 1u))));
}
