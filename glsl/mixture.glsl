// Sets of several materials: light travels by the profile of the matter that it entered. The mathematics is in
// src/reference/mixture.rs. Without such sets all of it is left out.

MIXTURES(readonly);

// What is seen, and which media its set has.
Mixture mixture_at(Surface surface) {
    return mixtures[triangles[surface.triangle].set];
}

// Member k of the set, its tabulated profile as it is at the surface that is seen.
Material mixture_member(Mixture mixture, uint k, Surface surface) {
    Material m = materials[mixture.members[k]];
    if (has_model(m, MODEL_TABLE)) table_at(m, surface);
    m.radius_max = mixture.radius_max;
    m.camera_rate = mixture.camera_rate;
    return m;
}

// The member that a number in [0, 1) picks, each as probable; the number becomes its place within that share.
uint pick_member(Mixture mixture, inout float u) {
    float x = u * float(mixture.count);
    uint k = min(uint(x), mixture.count - 1u);
    u = min(x - float(k), 0.99999994);
    return k;
}
