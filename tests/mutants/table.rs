//! Faults to plant in the kernels' sources, and which test must name each first.

/// One fault.
pub struct Mutant {
    /// In `glsl/`.
    pub file: &'static str,
    /// What stands there, once or first.
    pub text: &'static str,
    /// What is planted.
    pub with: &'static str,
    pub kind: &'static str,
    /// The test that must be the first to fail.
    pub named: &'static str,
}

macro_rules! mutants {
    ($($file:literal, $kind:literal, $named:literal: $text:literal => $with:literal;)*) => {
        /// Every fault. The first of each suite run with the tests of the kernels.
        pub const MUTANTS: &[Mutant] =
            &[$(Mutant { file: $file, text: $text, with: $with, kind: $kind, named: $named },)*];
    };
}

mutants! {
    "random.glsl", "constant", "random.hash": "x ^= x >> 15;" => "x ^= x >> 14;";
    "random.glsl", "lost bit", "random.scramble": "x *= (key >> 16) | 1u;" => "x *= key >> 16;";
    "random.glsl", "constant", "random.sobol": "(x & 0x0f0f0f0fu) << 4" => "(x & 0x0f0f0f0fu) << 3";
    "random.glsl", "sign", "random.key": "^ pixel.x) + pixel.y)" => "^ pixel.x) - pixel.y)";
    "random.glsl", "index", "random.point": "batch, dimension + 1u)" => "batch, dimension)";
    "math.glsl", "sign", "math.exp": "+ k * 2.12194440e-4" => "- k * 2.12194440e-4";
    "math.glsl", "sign", "math.log": "y = y - 0.5 * z2;" => "y = y + 0.5 * z2;";
    "math.glsl", "lost carry", "math.log1p": "return log_(w) + lost / w;" => "return log_(w);";
    "math.glsl", "constant", "math.one_minus_exp_over": "if (abs(x) > 0.34)" => "if (abs(x) > 3.4)";
    "math.glsl", "comparison", "math.cos_sin": "return q >= 2u ? -cs : cs;" => "return q > 2u ? -cs : cs;";
    "math.glsl", "sign", "math.atan2": "a = x < 0.0 ? PI - a : a;" => "a = x < 0.0 ? PI + a : a;";
    "math.glsl", "sign", "math.basis": "s * b, -s * n.x);" => "s * b, s * n.x);";
    "boundary.glsl", "lost factor", "boundary.fresnel": "(ior * ior * c - g)" => "(ior * c - g)";
    "rough.glsl", "index", "boundary.crossing": "boundaries[first + 1u]" => "boundaries[first]";
    "boundary.glsl", "lost factor", "boundary.ggx": "a2 / (PI * t * t)" => "a2 / (PI * t)";
    "boundary.glsl", "sign", "boundary.half_vector": "0.5 * (1.0 + v.z)" => "0.5 * (1.0 - v.z)";
    "phase.glsl", "sign", "phase.refracted": "+ sqrt(c2) * n" => "- sqrt(c2) * n";
    "phase.glsl", "swapped branch", "phase.value": "g < 0.0 ? w + d : w - d" => "g < 0.0 ? w - d : w + d";
    "phase.glsl", "constant", "phase.draw": "sqrt(t * (2.0 - t))" => "sqrt(t * (1.0 - t))";
    "texture.glsl", "index", "texture.lookup": "2 * size - 1 - i : i;" => "2 * size - i : i;";
    "light.glsl", "lost factor", "light.delta": "0.0, 1.0) / d2;" => "0.0, 1.0) / incoming.distance;";
    "light.glsl", "index", "light.environment": "x < 0 ? x + w" => "x < 0 ? x";
    "light.glsl", "lost factor", "light.environment_density": "(2.0 * PI * PI * sin_theta)" => "(2.0 * PI * sin_theta)";
    "light.glsl", "sign", "light.draw_environment": "vec2 phi = -cos_sin_2pi(s);" => "vec2 phi = cos_sin_2pi(s);";
    "light.glsl", "swapped", "light.draw_cosine": "sqrt(1.0 - u.x) * n" => "sqrt(u.x) * n";
    "emitter.glsl", "swapped", "light.draw_emitter": "vec2(s - s * u.y, s * u.y)" => "vec2(s * u.y, s - s * u.y)";
    "emitter.glsl", "comparison", "light.emitter_density":
        "emitters[middle].triangle <= triangle" => "emitters[middle].triangle < triangle";
    "profile_source.glsl", "sign", "profile.standard": "return z * (1.0 + sd)" => "return z * (1.0 - sd)";
    "profile_standard.glsl", "index", "profile.standard":
        "m.component_cdf[2]) sigma = m.sigma_tr.y" => "m.component_cdf[3]) sigma = m.sigma_tr.y";
    "profile_better.glsl", "index", "profile.better": "sources + m.fluence * line" => "sources + m.fluence.x * line";
    "profile_burley.glsl", "constant", "profile.burley": "shift - x * (1.0 / 3.0)" => "shift - x * (1.0 / 2.0)";
    "profile_directional.glsl", "sign", "profile.directional": "w_no - 2.0 * w_n * n_no" => "w_no + 2.0 * w_n * n_no";
    "profile_table.glsl", "swapped", "profile.table": "mix(low, high, t)" => "mix(high, low, t)";
    "profile_table.glsl", "off by one", "profile.table": "before ? 0u : cell + 1u" => "before ? 0u : cell";
    "profile_table.glsl", "lost term", "profile.table": "(most - 1u) | bits >> 31" => "(most - 1u)";
    "profile_table.glsl", "off by one", "kernel.sample": "profiles[cell + 1u], t)" => "profiles[cell], t)";
    "profile.glsl", "swapped branch", "profile.lambert":
        "table_obliqueness(m, m.slope, c, leaving)" => "table_obliqueness(m, m.slope, c, !leaving)";
    "mixture.glsl", "index", "profile.mixture": "x - float(k)" => "x - float(k + 1u)";
    "projection.glsl", "sign", "projection.fractions": "(3.0 - 2.0 * s)" => "(3.0 + 2.0 * s)";
    "projection.glsl", "comparison", "projection.seen":
        "s.side = dot(n, s.wo) < 0.0" => "s.side = dot(n, s.wo) > 0.0";
    "projection.glsl", "lost factor", "projection.density": "/ cos_plane * q * q" => "/ cos_plane * q";
    "projection.glsl", "sign", "projection.density": "float k = 1.0 - dot(delta" => "float k = 1.0 + dot(delta";
    "intersect.glsl", "fused multiply", "traversal.nearest":
        "    precise float area = a.x * b.y - a.y * b.x;" =>
        "    // a.x b.y in two parts (Veltkamp, Dekker), as a fused multiplication has it: not every driver fuses fma().
    precise float p = a.x * b.y, q = a.y * b.x;
    precise float u = 4097.0 * a.x, v = 4097.0 * b.y;
    precise float uh = u - (u - a.x), vh = v - (v - b.y);
    precise float ul = a.x - uh, vl = b.y - vh;
    precise float rest = ((uh * vh - p) + uh * vl + ul * vh) + ul * vl;
    precise float area = (p - q) + rest;";
    "intersect.glsl", "comparison", "traversal.nearest": "t >= ray.t_min && t <= t_max" => "t >= 0.0 && t <= t_max";
    "intersect.glsl", "lost bit", "traversal.nearest": "(meta >> 5) & 0x07070707u" => "(meta >> 5) & 0x03030303u";
    "intersect.glsl", "comparison", "traversal.nearest":
        "if (nodes_left.y > 0x00ffffffu) stack[stack_size++]" => "if (nodes_left.y > 0x01ffffffu) stack[stack_size++]";
    "intersect.glsl", "index", "traversal.all": "n <= MAX_HITS ? n - 1u" => "n <= MAX_HITS ? n";
    "sums.glsl", "lost carry", "sums.add": "(sum - (t - b)) + (x - b)" => "x - b";
    "sums.glsl", "dropped precise", "sums.add":
        "precise vec3 t = sum + x;
    precise vec3 b = t - sum;
    precise vec3 e =" => "vec3 t = sum + x;
    vec3 b = t - sum;
    vec3 e =";
    "begin.comp", "lost factor", "kernel.begin": "sobol((start + position) / BATCHES, d)" => "sobol(start + position, d)";
    "begin.comp", "comparison", "kernel.begin": "progresses[0].end == start" => "progresses[0].end >= start";
    "count.comp", "index", "kernel.count": "b < BATCHES * BATCHED; b++" => "b < BATCHES * BATCHED - 1u; b++";
    "count.comp", "lost factor", "kernel.count": "samples += step_.count" => "samples += 1u";
    "primary.comp", "sign", "kernel.primary": "- ndc.y * view.up" => "+ ndc.y * view.up";
    "primary.comp", "index", "kernel.primary": "(1u + batch) * step_.pixel_count" => "batch * step_.pixel_count";
    "primary.comp", "operator", "kernel.primary": "place % gl_WorkGroupSize.x == 0u" => "place / gl_WorkGroupSize.x == 0u";
    "primary.comp", "lost condition", "kernel.primary": "surface.triangle != MISS || " => "";
    "pixel.glsl", "index", "kernel.primary": "return batch * step_.pixel_count + index;" =>
        "return (batch + 1u) % BATCHES * step_.pixel_count + index;";
    "tile.glsl", "index", "kernel.sample": "pixel.y % REUSE * REUSE + pixel.x % REUSE" =>
        "pixel.x % REUSE * REUSE + pixel.y % REUSE";
    "tile.glsl", "lost term", "kernel.sample": "v ^= place_coordinate(" => "v += 0u * place_coordinate(";
    "tile.glsl", "off by one", "kernel.accumulate": "clamp(corner + int(REUSE), ivec2(0), size)" =>
        "clamp(corner + int(REUSE) - 1, ivec2(0), size)";
    "sample.comp", "lost factor", "kernel.sample": "2u * triangles[surface.triangle].set" => "triangles[surface.triangle].set";
    "shared_hit.glsl", "lost condition", "kernel.accumulate": "there && probes[other].lit.w == share" => "there";
    "emitter.glsl", "lost factor", "kernel.irradiance": "1.0 - 0.5 * min(ratio * ratio, 1.0)" => "1.0 - min(ratio * ratio, 1.0)";
    "arriving.glsl", "sign", "kernel.irradiance": "PI / (1.0 - share)" => "PI / (1.0 + share)";
    "arriving.glsl", "lost factor", "kernel.irradiance": "share * point.density" => "point.density";
    "single.comp", "lost factor", "kernel.single": "share * emitter_density" => "emitter_density";
    "shared_hit.glsl", "sign", "kernel.accumulate": "hit - seat.xyz" => "hit + seat.xyz";
    "shared_hit.glsl", "lost condition", "kernel.accumulate": "if (other == index || r2 <= seat.w) sum" => "sum";
    "sample.comp", "lost term", "kernel.sample": "probe.lit = uvec4(0u);" => "";
    "reuse.comp", "index", "kernel.reuse": "probes[other].hit - surface.position" => "probes[index].hit - surface.position";
    "profile_table.glsl", "lost condition", "kernel.reuse": "CURVATURE != 0 && u >= table_weight ? 1u : 0u" => "0u";
    "reuse.comp", "lost condition", "kernel.reuse": "there && lit.w == share && " => "there && ";
    "tile.glsl", "off by one", "kernel.accumulate": "lessThan(tile.first + at, tile.end)" => "lessThanEqual(tile.first + at, tile.end)";
    "accumulate.comp", "comparison", "kernel.accumulate": "u < chance" => "u > chance";
    "profile_table.glsl", "off by one", "kernel.accumulate": "table_base(m, m.table_nodes) + cell" => "table_base(m, m.table_nodes) + 1u + cell";
    "sample.comp", "sign", "kernel.sample": "probe.t_max = -b + half_chord;" => "probe.t_max = b + half_chord;";
    "sample.comp", "swapped branch", "kernel.sample":
        "technique == TECHNIQUE_U ? tangent : bitangent" => "technique == TECHNIQUE_U ? bitangent : tangent";
    "reproject.comp", "order", "kernel.reproject": "hit_t[j - 1] > t" => "hit_t[j - 1] < t";
    "reproject.comp", "swapped branch", "kernel.reproject":
        "PROJECTION == PROJECTION_CAMERA ? CLOSEST : ALL" => "PROJECTION == PROJECTION_CAMERA ? ALL : CLOSEST";
    "screen.glsl", "sign", "kernel.reproject": "(0.5 - 0.5 * y)" => "(0.5 + 0.5 * y)";
    "screen.glsl", "lost condition", "kernel.reproject": "if (triangle.set != set) return;" => "";
    "arriving.glsl", "lost factor", "kernel.irradiance":
        "light = incoming.irradiance * max(dot(shading_n, direction), 0.0);" => "light = incoming.irradiance;";
    "accumulate.comp", "lost factor", "kernel.accumulate": "if (MIXED != 0) radiance *= m.exit;" => "";
    "sums.glsl", "swapped branch", "kernel.accumulate": "covered ? 1u : 0u" => "covered ? 0u : 1u";
    "single.comp", "lost factor", "kernel.single": "over_density * scattered * exp_(exponent)" => "over_density * scattered";
    "single.comp", "sign", "kernel.single": "along = -depth * dot(d, outward)" => "along = depth * dot(d, outward)";
    "reflect.comp", "lost factor", "kernel.reflect": "mix(vec3(f0 * f0)," => "mix(vec3(f0),";
    "reflect.comp", "lost factor", "kernel.reflect": "(c * c * c * c * c)" => "(c * c * c * c)";
    "irradiance.comp", "lost factor", "kernel.irradiance": "light *= crossing(m, c, share);" => "";
    "irradiance.comp", "index", "kernel.irradiance": "uvec2(index, POINTS_ROW" => "uvec2(index + 1u, POINTS_ROW";
    "cached.glsl", "index", "kernel.accumulate": "(j == 0u ? 1u : 2u)" => "1u";
    "cached.glsl", "swapped branch", "kernel.accumulate": "uint b = upper ? above : right" => "uint b = upper ? right : above";
    "cached.glsl", "index", "kernel.accumulate": "j * (2u * n - j) + 2u * i" => "j * (2u * n - j - 1u) + 2u * i";
    "cached.glsl", "lost term", "kernel.accumulate": "return light + table_slope(m) *" => "return light + 0.0 * table_slope(m) *";
    "accumulate.comp", "swapped branch", "kernel.accumulate": "entering = cached ? cached_light" => "entering = !cached ? cached_light";
    "cluster.comp", "sign", "kernel.cluster": "c.flux = a.flux + b.flux" => "c.flux = a.flux - b.flux";
    "cluster.comp", "index", "kernel.cluster": "b = clusters[2u * node + 1u]" => "b = clusters[2u * node]";
    "gather.comp", "index", "kernel.gather": "findLSB(j + 1u)" => "findLSB(j)";
    "gather.comp", "lost factor", "kernel.gather": "(sum.mass[c] / sum.weight[c]) * (sum" => "(sum";
    "gather.comp", "sign", "kernel.gather": "sum.far += (1.0 - near)" => "sum.far += (1.0 + near)";
    "resolve.comp", "index", "kernel.resolve": "float(BATCHES - 1u)" => "float(BATCHES)";
    "resolve.comp", "index", "kernel.resolve": "(end + BATCHES - 1u - b)" => "(end + BATCHES - b)";
}
