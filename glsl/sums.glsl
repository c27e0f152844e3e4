// The running sums of a pixel. What would make one of them infinite is left out and counted.

RUNNING_SUMS(read_write);
BATCH_SUMS(read_write);

void count_covered(uint index, bool covered) {
    running_sums[index].covered += covered ? 1u : 0u;
}

void count_invalid(uint index) {
    running_sums[index].invalid++;
}

// Adds x to the compensated sum (sum, carry): Knuth's TwoSum, exact whatever the magnitudes.
void compensated_add(inout vec3 sum, inout vec3 carry, vec3 x) {
    precise vec3 t = sum + x;
    precise vec3 b = t - sum;
    precise vec3 e = (sum - (t - b)) + (x - b);
    sum = t;
    carry += e;
}

// Whether radiance is finite and not negative, and the sum with it finite.
bool addable(vec3 radiance, vec3 sum) {
    return valid(radiance) && valid(sum + radiance);
}

// Adds light that passed through matter to the sums of the pixel and, where they are kept, of the sample's batch.
void add_subsurface(uint index, vec3 radiance) {
    vec3 sum = running_sums[index].subsurface, carry = running_sums[index].subsurface_carry;
    uint batch_index = sample_index() % BATCHES * step_.pixel_count + index;
    vec3 batch_sum = vec3(0.0);
    if (BATCHED != 0) batch_sum = batch_sums[batch_index];
    // The batch's sum rounds otherwise, so that it may overflow alone.
    if (!addable(radiance, sum) || !addable(radiance, batch_sum)) {
        count_invalid(index);
        return;
    }
    if (BATCHED != 0) batch_sums[batch_index] = batch_sum + radiance;
    compensated_add(sum, carry, radiance);
    running_sums[index].subsurface = sum;
    running_sums[index].subsurface_carry = carry;
}

// Adds light of the first surface to the sums of the pixel and, where they are kept, of the sample's batch.
void add_reflection(uint index, vec3 radiance) {
    vec3 sum = running_sums[index].reflection, carry = running_sums[index].reflection_carry;
    uint batch_index = (BATCHES + sample_index() % BATCHES) * step_.pixel_count + index;
    vec3 batch_sum = vec3(0.0);
    if (BATCHED > 1) batch_sum = batch_sums[batch_index];
    if (!addable(radiance, sum) || !addable(radiance, batch_sum)) {
        count_invalid(index);
        return;
    }
    if (BATCHED > 1) batch_sums[batch_index] = batch_sum + radiance;
    compensated_add(sum, carry, radiance);
    running_sums[index].reflection = sum;
    running_sums[index].reflection_carry = carry;
}
