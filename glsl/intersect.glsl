// Rays against the compressed wide BVH (Ylitie, Karras, Laine 2017) in the node layout of obvhs: closest hit, any hit,
// or all hits of one set in a segment. A kernel has one call site of `traverse`.

NODES(readonly);
TRIANGLES(readonly);
COUNTERS(read_write);

// All points base + offset + t direction, t in [t_min, t_max]. The offset is kept apart so that a ray close to `base`
// meets triangles close to `base` without the rounding of their positions.
struct Ray {
    vec3 base;
    vec3 offset;
    vec3 direction;
    float t_min;
    float t_max;
};

const uint CLOSEST = 0;
const uint ANY = 1;
const uint ALL = 2;
const uint EVERY_SET = 0xffffffffu;
// What stands for the area of a ray through an edge.
const float EDGE = 1e-36;

// The result: CLOSEST and ANY set the first entry.
uint hit_count;
float hit_t[MAX_HITS];
uint hit_triangle[MAX_HITS];
vec2 hit_barycentric;

// From a triangle's first vertex to a point of it.
vec3 from_corner(Triangle t, vec2 barycentric) {
    precise vec3 to = barycentric.x * (t.vertices[1] - t.vertices[0]) + barycentric.y * (t.vertices[2] - t.vertices[0]);
    return to;
}

// Turns the axis along which a ray runs most to z.
vec3 turned(vec3 v, uint axis) {
    return axis == 0u ? v.yzx : (axis == 1u ? v.zxy : v);
}

// Where a point is seen along the ray, which is in the origin.
vec2 along(Ray ray, vec2 slope, uint axis, vec3 point) {
    precise vec3 to = turned((point - ray.base) - ray.offset, axis);
    precise vec2 seen = to.xy - slope * to.z;
    return seen;
}

// Twice the area of (0, a, b), whose sign says on which side of an edge the ray passes; see src/reference/intersect.rs.
float side_of_edge(vec2 a, vec2 b) {
    precise float area = a.x * b.y - a.y * b.x;
    return area != 0.0 ? area : (a.y < b.y || a.y == b.y && a.x < b.x ? EDGE : -EDGE);
}

// Bytes of a word as floats.
vec4 unpack_bytes(uint w) {
    return vec4(w & 255u, (w >> 8) & 255u, (w >> 16) & 255u, w >> 24);
}

// Bits of four children (half 0 or 1 of a node) that the ray meets, at their places in the node's hit mask.
uint children_met(uint meta, uint oct_inv4, uint x_min, uint x_max, uint y_min, uint y_max, uint z_min, uint z_max,
    bvec3 negative, vec3 scale, vec3 near, vec3 far, float t_min, float t_max) {
    vec4 t0 = unpack_bytes(negative.x ? x_max : x_min) * scale.x + near.x;
    vec4 t1 = unpack_bytes(negative.x ? x_min : x_max) * scale.x + far.x;
    t0 = max(t0, unpack_bytes(negative.y ? y_max : y_min) * scale.y + near.y);
    t1 = min(t1, unpack_bytes(negative.y ? y_min : y_max) * scale.y + far.y);
    t0 = max(t0, unpack_bytes(negative.z ? z_max : z_min) * scale.z + near.z);
    t1 = min(t1, unpack_bytes(negative.z ? z_min : z_max) * scale.z + far.z);
    t0 = max(t0, vec4(t_min));
    t1 = min(t1, vec4(t_max));
    // Inner children lie at 24 to 31 in the order of the ray's octant, leaves at their primitives' offsets.
    uint inner = ((meta & (meta << 1)) & 0x10101010u) >> 4;
    uint index = (meta ^ (oct_inv4 & (inner * 255u))) & 0x1f1f1f1fu;
    uint bits = (meta >> 5) & 0x07070707u;
    uint mask = 0u;
    if (t0.x <= t1.x) mask |= (bits & 255u) << (index & 255u);
    if (t0.y <= t1.y) mask |= ((bits >> 8) & 255u) << ((index >> 8) & 255u);
    if (t0.z <= t1.z) mask |= ((bits >> 16) & 255u) << ((index >> 16) & 255u);
    if (t0.w <= t1.w) mask |= (bits >> 24) << (index >> 24);
    return mask;
}

// `mode` is a constant. `key` orders the hits that are kept beyond MAX_HITS.
void traverse(Ray ray, uint mode, uint set, uint key) {
    hit_count = 0;
    // A zero component would make 0 * infinity; what it is replaced by is far below rounding.
    vec3 d = ray.direction;
    d = vec3(abs(d.x) < 1e-20 ? 1e-20 : d.x, abs(d.y) < 1e-20 ? 1e-20 : d.y, abs(d.z) < 1e-20 ? 1e-20 : d.z);
    vec3 inv = 1.0 / d;
    bvec3 negative = lessThan(d, vec3(0.0));
    uint oct_inv4 = (negative.x ? 0u : 0x04040404u) | (negative.y ? 0u : 0x02020202u) | (negative.z ? 0u : 0x01010101u);
    vec3 origin = ray.base + ray.offset;
    // Boxes grow by a few roundings of the origin, and of their own planes, so that none is missed.
    vec3 slack = abs(inv) * 4.76837158203125e-7 * (1.0 + max(abs(origin.x), max(abs(origin.y), abs(origin.z))));
    float t_max = ray.t_max;
    vec3 slope = abs(ray.direction);
    uint axis = slope.x >= max(slope.y, slope.z) ? 0u : (slope.y >= slope.z ? 1u : 2u);
    slope = turned(ray.direction, axis);
    slope.xy /= slope.z;

    uvec2 stack[BVH_DEPTH];
    uint stack_size = 0;
    uvec2 nodes_left = uvec2(0u, 0x80000000u);
    uint steps = 0;
    bool done = !(ray.t_min <= t_max);
    while (!done) {
        steps++;
        uvec2 triangles_left = uvec2(0u);
        if (nodes_left.y > 0x00ffffffu) {
            uint bit = uint(findMSB(nodes_left.y));
            uint slot = (bit - 24u) ^ (oct_inv4 & 255u);
            // The low byte of the group says which of its children are inner nodes.
            uint node = 5u * (nodes_left.x + uint(bitCount(nodes_left.y & ~(0xffffffffu << slot) & 255u)));
            nodes_left.y &= ~(1u << bit);
            if (nodes_left.y > 0x00ffffffu) stack[stack_size++] = nodes_left;

            uvec4 a = nodes[node], b = nodes[node + 1], x = nodes[node + 2], y = nodes[node + 3], z = nodes[node + 4];
            vec3 extent = vec3(uintBitsToFloat((a.w & 255u) << 23), uintBitsToFloat(((a.w >> 8) & 255u) << 23),
                uintBitsToFloat(((a.w >> 16) & 255u) << 23));
            vec3 scale = extent * inv;
            vec3 start = ((uintBitsToFloat(a.xyz) - ray.base) - ray.offset) * inv;
            vec3 rounding = slack + 2.384185791015625e-7 * (abs(start) + 256.0 * abs(scale));
            uint mask = children_met(b.z, oct_inv4, x.x, x.z, y.x, y.z, z.x, z.z, negative, scale, start - rounding,
                start + rounding, ray.t_min, t_max);
            mask |= children_met(b.w, oct_inv4, x.y, x.w, y.y, y.w, z.y, z.w, negative, scale, start - rounding,
                start + rounding, ray.t_min, t_max);
            nodes_left = uvec2(b.x, (mask & 0xff000000u) | (a.w >> 24));
            triangles_left = uvec2(b.y, mask & 0x00ffffffu);
        }
        while (triangles_left.y != 0u) {
            steps++;
            uint bit = uint(findLSB(triangles_left.y));
            triangles_left.y &= triangles_left.y - 1u;
            uint index = triangles_left.x + bit;
            Triangle triangle = triangles[index];
            // Woop, Benthin, Wald 2013.
            vec2 a = along(ray, slope.xy, axis, triangle.vertices[0]);
            vec2 b = along(ray, slope.xy, axis, triangle.vertices[1]);
            vec2 c = along(ray, slope.xy, axis, triangle.vertices[2]);
            vec3 area = vec3(side_of_edge(b, c), side_of_edge(c, a), side_of_edge(a, b));
            vec2 barycentric = area.yz / (area.x + area.y + area.z);
            vec3 normal = cross(triangle.vertices[1] - triangle.vertices[0], triangle.vertices[2] - triangle.vertices[0]);
            float rate = dot(normal, ray.direction);
            float t = dot(normal, (triangle.vertices[0] - ray.base) - ray.offset) / rate;
            bool hit = (min(area.x, min(area.y, area.z)) > 0.0 || max(area.x, max(area.y, area.z)) < 0.0)
                && rate != 0.0 && t >= ray.t_min && t <= t_max;
            if (has_texture(TEXTURE_ALPHA)) hit = hit && solid(index, barycentric);
            if (set != EVERY_SET) hit = hit && triangle.set == set;
            if (mode == ALL) {
                uint n = hit_count + 1u;
                // Beyond MAX_HITS each hit is kept with probability MAX_HITS / n (Vitter's algorithm R).
                uint slot = n <= MAX_HITS ? n - 1u : hash(key + n) % n;
                if (hit && slot < MAX_HITS) {
                    hit_t[slot] = t;
                    hit_triangle[slot] = index;
                }
                hit_count += hit ? 1u : 0u;
            } else if (hit) {
                t_max = t;
                hit_count = 1u;
                hit_t[0] = t;
                hit_triangle[0] = index;
                hit_barycentric = barycentric;
                if (mode == ANY) break;
            }
        }
        if (mode == ANY && hit_count != 0u) break;
        if (nodes_left.y <= 0x00ffffffu) {
            if (stack_size == 0u)
                done = true;
            else
                nodes_left = stack[--stack_size];
        }
    }
    // Once for each ray that has a segment: `bench` counts how often.
    if (COUNT_STEPS != 0 && steps != 0u) atomicMax(counters[0], steps);
}
