// Elementary functions from + - * / and integer shifts alone, so that drivers agree where their own exp, log, sin,
// cos and atan do not. Minimax polynomials of Cephes (Moshier). Errors are within 2^-21, relative but for cos
// and sin, which tests/kernels/math.rs holds.

const float PI = 3.14159265358979;
#define INFINITY uintBitsToFloat(0x7f800000u)

float exp_(float x) {
    float k = floor(x * 1.44269504088896 + 0.5);
    precise float r = (x - k * 0.693359375) + k * 2.12194440e-4;
    float p = 1.9875691500e-4;
    p = p * r + 1.3981999507e-3;
    p = p * r + 8.3334519073e-3;
    p = p * r + 4.1665795894e-2;
    p = p * r + 1.6666665459e-1;
    p = p * r + 5.0000001201e-1;
    float y = 1.0 + (r + r * r * p);
    // 2^k in two halves, so that neither overflows; results below the normal range are 0 on every driver.
    int n = int(clamp(k, -252.0, 252.0));
    int half_n = n / 2;
    y = y * uintBitsToFloat(uint(half_n + 127) << 23) * uintBitsToFloat(uint(n - half_n + 127) << 23);
    return x < -87.0 ? 0.0 : (x > 88.7 ? INFINITY : y);
}

vec3 exp_(vec3 x) {
    return vec3(exp_(x.x), exp_(x.y), exp_(x.z));
}

// For x > 0 in the normal range.
float log_(float x) {
    uint bits = floatBitsToUint(x);
    // Mantissa in [sqrt(1/2), sqrt(2)).
    int e = (int(bits) - 0x3f3504f3) >> 23;
    float m = uintBitsToFloat(bits - uint(e << 23));
    precise float z = m - 1.0;
    float p = 7.0376836292e-2;
    p = p * z - 1.1514610310e-1;
    p = p * z + 1.1676998740e-1;
    p = p * z - 1.2420140846e-1;
    p = p * z + 1.4249322787e-1;
    p = p * z - 1.6668057665e-1;
    p = p * z + 2.0000714765e-1;
    p = p * z - 2.4999993993e-1;
    p = p * z + 3.3333331174e-1;
    float z2 = z * z;
    float fe = float(e);
    precise float y = z * z2 * p + fe * -2.12194440e-4;
    y = y - 0.5 * z2;
    y = y + z;
    return y + fe * 0.693359375;
}

// log(1 + x) for x >= 0, exact to rounding for small x.
float log1p_(float x) {
    precise float w = 1.0 + x;
    precise float lost = x - (w - 1.0);
    return log_(w) + lost / w;
}

// (1 - e^{-x}) / x, 1 at 0.
float one_minus_exp_over(float x) {
    if (abs(x) > 0.34) return (1.0 - exp_(-x)) / x;
    // The polynomial of exp_, without what it adds to 1.
    float r = -x;
    float p = 1.9875691500e-4;
    p = p * r + 1.3981999507e-3;
    p = p * r + 8.3334519073e-3;
    p = p * r + 4.1665795894e-2;
    p = p * r + 1.6666665459e-1;
    p = p * r + 5.0000001201e-1;
    return 1.0 + r * p;
}

vec3 one_minus_exp_over(vec3 x) {
    return vec3(one_minus_exp_over(x.x), one_minus_exp_over(x.y), one_minus_exp_over(x.z));
}

// Cosine and sine of 2 pi u, for u in [0, 1].
vec2 cos_sin_2pi(float u) {
    float quadrant = floor(u * 4.0 + 0.5);
    precise float x = (u * 4.0 - quadrant) * (0.5 * PI);
    float x2 = x * x;
    float s = x + x * x2 * ((-1.9515295891e-4 * x2 + 8.3321608736e-3) * x2 - 1.6666654611e-1);
    float c = 1.0 - 0.5 * x2 + x2 * x2 * ((2.443315711809948e-5 * x2 - 1.388731625493765e-3) * x2 + 4.166664568298827e-2);
    uint q = uint(quadrant) & 3u;
    vec2 cs = (q & 1u) == 0u ? vec2(c, s) : vec2(-s, c);
    return q >= 2u ? -cs : cs;
}

// Angle of (x, y) in (-pi, pi]; 0 for the origin.
float atan2_(float y, float x) {
    float ax = abs(x), ay = abs(y);
    float large = max(ax, ay), small = min(ax, ay);
    if (large == 0.0) return 0.0;
    float t = small / large;
    // tan(pi/8) < t: atan(t) = pi/4 + atan((t - 1)/(t + 1)).
    bool upper = t > 0.4142135623731;
    float z = upper ? (t - 1.0) / (t + 1.0) : t;
    float z2 = z * z;
    float a = ((((8.05374449538e-2 * z2 - 1.38776856032e-1) * z2 + 1.99777106478e-1) * z2 - 3.33329491539e-1) * z2) * z + z;
    a = upper ? a + 0.25 * PI : a;
    a = ay > ax ? 0.5 * PI - a : a;
    a = x < 0.0 ? PI - a : a;
    return y < 0.0 ? -a : a;
}

// Two unit vectors that make a right-handed orthonormal frame with n (Duff et al. 2017).
void orthonormal_basis(vec3 n, out vec3 tangent, out vec3 bitangent) {
    float s = n.z >= 0.0 ? 1.0 : -1.0;
    float a = -1.0 / (s + n.z);
    float b = n.x * n.y * a;
    tangent = vec3(1.0 + s * n.x * n.x * a, s * b, -s * n.x);
    bitangent = vec3(b, s + n.y * n.y * a, -n.y);
}

bool finite_(float x) {
    return (floatBitsToUint(x) & 0x7f800000u) != 0x7f800000u;
}

// The largest finite number in place of infinity, for x >= 0.
vec3 clamp_finite(vec3 x) {
    return uintBitsToFloat(min(floatBitsToUint(x), uvec3(0x7f7fffffu)));
}

// Finite and not negative.
bool valid(vec3 x) {
    return finite_(x.x) && finite_(x.y) && finite_(x.z) && x.x >= 0.0 && x.y >= 0.0 && x.z >= 0.0;
}
