// Eight independent chains of multiply-adds, step_.count times sixteen of each. Only `bench` runs it, to see what arithmetic
// gives at best.
#version 460
#include "shared.glsl"
#include "pixel.glsl"
NODES(writeonly);

// Not a loop: its end would be tested each time.
#define FOUR(x) x; x; x; x
#define ALL x0 = x0 * a + b; x1 = x1 * a + b; x2 = x2 * a + b; x3 = x3 * a + b; \
    x4 = x4 * a + b; x5 = x5 * a + b; x6 = x6 * a + b; x7 = x7 * a + b

void main() {
    uint index = pixel_index();
    if (index >= step_.pixel_count) return;
    // Known at run time alone, so that nothing is computed beforehand; all tend to b / (1 - a).
    float a = uintBitsToFloat(step_.point[0]), b = uintBitsToFloat(step_.point[1]);
    float x0 = float(index), x1 = x0 + 1.0, x2 = x0 + 2.0, x3 = x0 + 3.0;
    float x4 = x0 + 4.0, x5 = x0 + 5.0, x6 = x0 + 6.0, x7 = x0 + 7.0;
    for (uint i = 0u; i < step_.count; i++) {
        FOUR(FOUR(ALL));
    }
    float sum = ((x0 + x1) + (x2 + x3)) + ((x4 + x5) + (x6 + x7));
    // Never, but no compiler knows.
    if (sum == -1.0) nodes[index] = uvec4(floatBitsToUint(sum));
}
