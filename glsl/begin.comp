// Numbers one sample of a recording and finds its point; the first sample says whether the sums go on or start anew.
#version 460
#include "shared.glsl"
PROGRESSES(read_write);
SAMPLES(writeonly);

// Degree and inner coefficients of the polynomials of dimensions 2 to 6, and their first direction numbers.
const uint DEGREE[DIMENSIONS] = uint[](2u, 3u, 3u, 4u, 4u);
const uint INNER[DIMENSIONS] = uint[](1u, 1u, 2u, 1u, 4u);
const uvec4 INITIAL[DIMENSIONS] = uvec4[](uvec4(1u, 3u, 0u, 0u), uvec4(1u, 3u, 1u, 0u), uvec4(1u, 1u, 1u, 0u),
    uvec4(1u, 1u, 3u, 3u), uvec4(1u, 3u, 5u, 13u));

// Coordinate dimension + 2 of Sobol point `index`.
uint sobol(uint index, uint dimension) {
    uint degree = DEGREE[dimension];
    uint directions[32];
    uint sum = 0u;
    for (uint k = 0u; k < 32u; k++) {
        uint v;
        if (k < degree) {
            v = INITIAL[dimension][k] << (31u - k);
        } else {
            v = directions[k - degree] ^ (directions[k - degree] >> degree);
            for (uint i = 1u; i < degree; i++) {
                if ((INNER[dimension] >> (degree - 1u - i) & 1u) == 1u) v ^= directions[k - i];
            }
        }
        directions[k] = v;
        if ((index >> k & 1u) == 1u) sum ^= v;
    }
    return sum;
}

void main() {
    uint position = gl_WorkGroupID.y * gl_NumWorkGroups.x * gl_WorkGroupSize.x + gl_GlobalInvocationID.x;
    if (position >= step_.pixel_count) return;
    uint start = progresses[0].first + step_.sample_index;
    samples[position].index = start + position;
    for (uint d = 0u; d < DIMENSIONS; d++) samples[position].point[d] = sobol((start + position) / BATCHES, d);
    if (position != 0u) return;
    bool follows = progresses[0].end == start && progresses[0].end != NO_SAMPLES;
    progresses[0].restart = follows ? 0u : 1u;
    if (!follows) progresses[0].begin = start;
    progresses[0].end = start + step_.pixel_count;
}
