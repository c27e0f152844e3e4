// Makes one node of the cloud's tree of its two children. The mathematics is in src/reference/cluster.rs.
#version 460
#include "shared.glsl"
#include "pixel.glsl"
CLUSTERS(read_write);

void main() {
    uint index = pixel_index();
    if (index >= step_.pixel_count) return;
    uint node = step_.node + index;
    Cluster a = clusters[2u * node], b = clusters[2u * node + 1u];
    Cluster c = a;
    if (b.area > 0.0) {
        float of_a = a.flux.x + a.flux.y + a.flux.z, of_b = b.flux.x + b.flux.y + b.flux.z;
        // In the dark by area.
        if (!(of_a + of_b > 0.0)) {
            of_a = a.area;
            of_b = b.area;
        }
        float share = of_b / (of_a + of_b);
        c.position = mix(a.position, b.position, share);
        vec3 to_a = a.position - c.position, to_b = b.position - c.position;
        c.spread = mix(a.spread + dot(to_a, to_a), b.spread + dot(to_b, to_b), share);
        vec3 normal = mix(a.normal, b.normal, share);
        float length2 = dot(normal, normal);
        c.normal = length2 > 0.0 ? normal / sqrt(length2) : vec3(0.0);
        c.radius = max(length(to_a) + a.radius, length(to_b) + b.radius);
        c.flux = a.flux + b.flux;
        c.oblique = a.oblique + b.oblique;
        c.area = a.area + b.area;
        c.mass = a.mass + b.mass;
        c.set = a.set == b.set ? a.set : SEVERAL;
    }
    clusters[node] = c;
}
