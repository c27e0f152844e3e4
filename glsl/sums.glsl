// The running sums of a pixel.

RUNNING_SUMS(read_write);

void count_sample(uint index, bool covered) {
    running_sums[index].samples++;
    running_sums[index].covered += covered ? 1u : 0u;
}

// Whether a contribution may enter a sum; if not, it is counted.
bool check(uint index, vec3 radiance) {
    if (valid(radiance)) return true;
    running_sums[index].invalid++;
    return false;
}

// Adds x to the compensated sum (sum, carry): Knuth's TwoSum, exact whatever the magnitudes.
void compensated_add(inout vec3 sum, inout vec3 carry, vec3 x) {
    precise vec3 t = sum + x;
    precise vec3 b = t - sum;
    precise vec3 e = (sum - (t - b)) + (x - b);
    sum = t;
    carry += e;
}

void add_subsurface(uint index, vec3 radiance) {
    vec3 sum = running_sums[index].subsurface, carry = running_sums[index].subsurface_carry;
    compensated_add(sum, carry, radiance);
    running_sums[index].subsurface = sum;
    running_sums[index].subsurface_carry = carry;
}

void add_reflection(uint index, vec3 radiance) {
    vec3 sum = running_sums[index].reflection, carry = running_sums[index].reflection_carry;
    compensated_add(sum, carry, radiance);
    running_sums[index].reflection = sum;
    running_sums[index].reflection_carry = carry;
}
