#ifndef MODEL_GLSL
#define MODEL_GLSL
// Whether a material has a model. Models that no material of the scene has cost nothing; a scene with one model does
// not ask.
bool has_model(Material m, uint model) {
    uint bit = 1u << model;
    return (MODELS & bit) != 0u && (MODELS == bit || m.model == model);
}
#endif
