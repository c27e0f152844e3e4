// Copies sixteen bytes from the first half of a buffer to the second. Only `bench` runs it, to see what memory gives at best.
#version 460
#include "shared.glsl"
#include "pixel.glsl"
NODES(read_write);

void main() {
    uint index = pixel_index();
    if (index >= step_.pixel_count) return;
    nodes[step_.pixel_count + index] = nodes[index];
}
