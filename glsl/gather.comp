// Gathers what the cloud sends to the surface of each pixel. The mathematics is in src/reference/gather.rs.
#version 460
#include "shared.glsl"
#include "math.glsl"
#include "random.glsl"
#include "pixel.glsl"
#include "active.glsl"
#include "profile.glsl"
#include "texture.glsl"
#include "boundary.glsl"
#include "rough.glsl"
#include "projection.glsl"
#include "sums.glsl"
TRIANGLES(readonly);
SHADINGS(readonly);
SURFACES(readonly);
CLUSTERS(readonly);
GATHERS(read_write);

// The next node in order that is not below node j.
uint after(uint j) {
    return (j + 1u) >> findLSB(j + 1u);
}

void main() {
    uint index = active_pixel();
    if (index >= step_.pixel_count) return;
    Surface surface = surfaces[surface_index(index)];
    bool covered = surface.triangle != MISS;
    if (step_.count != 0u) count_covered(index, covered);
    if (!covered) return;
    View view = views[0];
    Shading shading = shadings[surface.triangle];
    Material m = materials[shading.material];
    if ((m.flags & TRANSLUCENT) == 0u || has_model(m, MODEL_LAMBERT)) return;
    vec3 slope = vec3(0.0);
    if (has_model(m, MODEL_TABLE)) {
        table_at(m, surface);
        slope = table_slope(m);
    }
    Seen s = seen(view, surface, triangles[surface.triangle], shading);
    uint set = triangles[surface.triangle].set;

    Gather sum;
    sum.far = vec3(0.0);
    sum.near = vec3(0.0);
    sum.weight = vec3(0.0);
    sum.mass = vec3(0.0);
    if (step_.first == 0u) sum = gathers[index];
    // j is the place in the tree below the step's node, of which that node is number 1.
    uint j = 1u;
    bool left = true;
    while (left) {
        // On to the next node whose points count together, or that is one.
        uint node = 0u;
        vec3 to = vec3(0.0);
        float r2 = 0.0;
        bool stands = false;
        while (left && !stands) {
            node = ((step_.node - 1u) << findMSB(j)) + j;
            to = clusters[node].position - s.position;
            r2 = dot(to, to);
            float r = sqrt(r2);
            float radius = clusters[node].radius;
            uint of = clusters[node].set;
            bool useful = clusters[node].area > 0.0 && (of == set || of == SEVERAL) && r - radius <= m.radius_max;
            stands = useful && (node >= view.leaves || of != SEVERAL && radius < view.opening * r);
            if (!stands) {
                j = useful ? 2u * j : after(j);
                left = j != 1u;
            }
        }
        if (stands) {
            float spread = clusters[node].spread;
            float across = dot(clusters[node].normal, to);
            float apart = sqrt(2.0 * spread * max(r2 - across * across, 0.0));
            vec3 value = shape(m, r2 + spread + apart);
            if (spread > 0.0) value = 0.5 * (value + shape(m, max(r2 + spread - apart, 0.0)));
            vec3 flux = clusters[node].flux;
            if (has_model(m, MODEL_TABLE)) flux += slope * clusters[node].oblique;
            float near = 0.0;
            if (r2 < m.reach * m.reach && dot(clusters[node].normal, s.normal) * s.side > 0.0) {
                near = 1.0 - r2 / (m.reach * m.reach);
                near *= near;
                sum.near += near * value * flux;
                sum.weight += near * clusters[node].area * value;
                sum.mass += near * value * clusters[node].mass;
            }
            sum.far += (1.0 - near) * value * flux;
            j = after(j);
            left = j != 1u;
        }
    }

    if (step_.last == 0u) {
        gathers[index] = sum;
        return;
    }
    vec3 gathered = sum.far;
    for (uint c = 0u; c < 3u; c++) {
        if (sum.weight[c] > 0.0) gathered[c] += (sum.mass[c] / sum.weight[c]) * (sum.near[c] / sum.weight[c]);
    }
    float cos_eye = dot(s.shading_normal, s.wo);
    float share = roughness_share(surface.triangle, surface.barycentric);
    vec3 radiance = crossing(m, cos_eye, share) * leaving_share(m, share) * obliqueness(m, cos_eye, true)
        * m.strength * gathered;
    if (has_model(m, MODEL_TABLE)) radiance *= table_balance(m, surface);
    if (has_texture(TEXTURE_BASE_COLOR)) {
        radiance *= texture_value(TEXTURE_BASE_COLOR, surface.triangle, surface.barycentric).rgb;
    }
    add_subsurface(index, radiance);
}
