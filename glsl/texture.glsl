// Textures: their values at a point of a triangle, and what they make of normals and materials. The mathematics is in
// src/reference/texture.rs.

#include "model.glsl"
TEXELS(readonly);
TEXTURES(readonly);
COORDINATES(readonly);
MATERIALS(readonly);

// Whether any material has a texture of this kind: a constant.
bool has_texture(uint kind) {
    return (TEXTURED & (1u << kind)) != 0u;
}

// A coordinate without its whole periods; one that is clamped, within the texture.
float within(float u, uint wrap) {
    if (wrap == WRAP_REPEAT) return u - floor(u);
    if (wrap == WRAP_MIRROR) return u - 2.0 * floor(0.5 * u);
    return clamp(u, 0.0, 1.0);
}

// The texel that stands at place i of a row of `size`, at most one period away.
int wrapped(int i, int size, uint wrap) {
    if (wrap == WRAP_REPEAT) i = i < 0 ? i + size : (i >= size ? i - size : i);
    if (wrap == WRAP_MIRROR) {
        i = i < 0 ? -1 - i : (i >= 2 * size ? i - 2 * size : i);
        i = i >= size ? 2 * size - 1 - i : i;
    }
    // No index leaves the texture, whatever the coordinates.
    return clamp(i, 0, size - 1);
}

vec4 texel(Texture t, int x, int y) {
    uint row = uint(wrapped(y, int(t.height), t.wrap_v));
    uint word = texels[t.offset + row * t.width + uint(wrapped(x, int(t.width), t.wrap_u))];
    uvec4 bytes = uvec4(word & 255u, (word >> 8) & 255u, (word >> 16) & 255u, word >> 24);
    float alpha = float(bytes.w) / 255.0;
    if (t.srgb == 0u) return vec4(vec3(bytes.xyz) / 255.0, alpha);
    return vec4(uintBitsToFloat(uvec3(texels[bytes.x], texels[bytes.y], texels[bytes.z])), alpha);
}

vec4 texture_at(Texture t, vec2 coordinates) {
    vec2 uv = vec2(within(dot(t.row_u, vec3(coordinates, 1.0)), t.wrap_u),
        within(dot(t.row_v, vec3(coordinates, 1.0)), t.wrap_v)) * vec2(t.width, t.height);
    if (t.linear != 0u) uv -= 0.5;
    vec2 lower = floor(uv);
    vec2 f = uv - lower;
    vec4 around[4];
    [[dont_unroll]] for (int k = 0; k < (t.linear != 0u ? 4 : 1); k++) {
        around[k] = texel(t, int(lower.x) + (k & 1), int(lower.y) + (k >> 1));
    }
    if (t.linear == 0u) return around[0];
    return mix(mix(around[0], around[1], f.x), mix(around[2], around[3], f.x), f.y);
}

// Value of the triangle's texture of this kind; 1 where its material has none.
vec4 texture_value(uint kind, uint triangle, vec2 barycentric) {
    Texture t = textures[coordinates[triangle].material * TEXTURE_KINDS + kind];
    if (t.width == 0u) return vec4(1.0);
    uint first = 3u * t.set;
    vec2 at = coordinates[triangle].uv[first] * (1.0 - barycentric.x - barycentric.y)
        + coordinates[triangle].uv[first + 1u] * barycentric.x + coordinates[triangle].uv[first + 2u] * barycentric.y;
    return texture_at(t, at);
}

// Whether there is a surface: alpha reaches the cutoff.
bool solid(uint triangle, vec2 barycentric) {
    if (!has_texture(TEXTURE_ALPHA)) return true;
    float scale = textures[coordinates[triangle].material * TEXTURE_KINDS + TEXTURE_ALPHA].scale;
    return scale == 0.0 || texture_value(TEXTURE_ALPHA, triangle, barycentric).w * scale >= 1.0;
}

// The unit normal n as the triangle's normal map turns it.
vec3 mapped_normal(vec3 n, uint triangle, vec2 barycentric) {
    if (!has_texture(TEXTURE_NORMAL)) return n;
    Texture t = textures[coordinates[triangle].material * TEXTURE_KINDS + TEXTURE_NORMAL];
    if (t.width == 0u) return n;
    vec3 along = coordinates[triangle].tangent[0] * (1.0 - barycentric.x - barycentric.y)
        + coordinates[triangle].tangent[1] * barycentric.x + coordinates[triangle].tangent[2] * barycentric.y;
    along -= n * dot(n, along);
    float length2 = dot(along, along);
    if (!(length2 > 0.0)) return n;
    vec3 tangent = along / sqrt(length2);
    vec3 bitangent = coordinates[triangle].handedness * cross(n, tangent);
    vec3 v = 2.0 * texture_value(TEXTURE_NORMAL, triangle, barycentric).xyz - 1.0;
    vec3 turned = t.scale * (v.x * tangent + v.y * bitangent) + v.z * n;
    length2 = dot(turned, turned);
    return length2 > 0.0 ? turned / sqrt(length2) : n;
}

// The texture's share of the roughness at a point, for boundaries.
float roughness_share(uint triangle, vec2 barycentric) {
    if (ROUGH < 2 || !has_texture(TEXTURE_METALLIC_ROUGHNESS)) return 1.0;
    return texture_value(TEXTURE_METALLIC_ROUGHNESS, triangle, barycentric).g;
}

// The material with its surface as the textures have it at a point.
Material textured_surface(Material m, uint triangle, vec2 barycentric) {
    if (has_texture(TEXTURE_BASE_COLOR)) m.base_color *= texture_value(TEXTURE_BASE_COLOR, triangle, barycentric).rgb;
    if (has_texture(TEXTURE_METALLIC_ROUGHNESS)) {
        vec4 v = texture_value(TEXTURE_METALLIC_ROUGHNESS, triangle, barycentric);
        m.metallic *= v.b;
        m.alpha *= v.g * v.g;
        if (m.alpha < MIRROR_ALPHA) m.alpha = 0.0;
    }
    if (has_texture(TEXTURE_EMISSION)) m.emission *= texture_value(TEXTURE_EMISSION, triangle, barycentric).rgb;
    return m;
}

// The material with its medium as the textures have it where light enters: between two nodes of its ramp.
Material textured_medium(Material m, uint triangle, vec2 barycentric) {
    if (!has_texture(TEXTURE_SCATTER_COLOR) && !has_texture(TEXTURE_SCATTER_STRENGTH)) return m;
    if (m.ramp == 0u) return m;
    vec3 share = vec3(1.0);
    if (has_texture(TEXTURE_SCATTER_COLOR)) share *= texture_value(TEXTURE_SCATTER_COLOR, triangle, barycentric).rgb;
    if (has_texture(TEXTURE_SCATTER_STRENGTH)) share *= texture_value(TEXTURE_SCATTER_STRENGTH, triangle, barycentric).a;
    vec3 at = clamp(share, 0.0, 1.0) * float(RAMP);
    vec3 node = min(floor(at), vec3(float(RAMP - 1u)));
    vec3 f = at - node;
    for (int c = 0; c < 3; c++) {
        uint i = m.ramp + uint(node[c]);
#define BETWEEN(field) m.field[c] = mix(materials[i].field[c], materials[i + 1u].field[c], f[c])
        BETWEEN(sigma_tr);
        BETWEEN(z_real);
        BETWEEN(z_virtual);
        BETWEEN(strength);
        if (has_model(m, MODEL_BETTER)) BETWEEN(fluence);
        if (has_model(m, MODEL_DIRECTIONAL)) {
            BETWEEN(height);
            BETWEEN(free_path);
            BETWEEN(floor);
            BETWEEN(beam);
        }
    }
    return m;
}
