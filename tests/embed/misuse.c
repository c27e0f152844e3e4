// Calls that break the header's rules, and what comes back. Prints the version.
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <translucent.h>

static void expect(TranslucentResult found, TranslucentResult wanted, const char *reason) {
    const char *text = translucent_last_error();
    if (found != wanted || !strstr(text, reason)) {
        fprintf(stderr, "misuse: %d for %d: \"%s\" for \"%s\"\n", found, wanted, text, reason);
        exit(1);
    }
}

int main(void) {
    const TranslucentResult ARGUMENT = TRANSLUCENT_RESULT_ARGUMENT;
    if (strcmp(translucent_last_error(), "") != 0) return 1;
    expect(translucent_requirements(NULL), ARGUMENT, "requirements is null");
    TranslucentRequirements requirements = {.struct_size = 4};
    expect(translucent_requirements(&requirements), ARGUMENT, "requirements.struct_size is 4");
    requirements.struct_size = sizeof requirements;
    if (translucent_requirements(&requirements) != TRANSLUCENT_RESULT_OK) return 1;
    if (requirements.feature_count != 3 || strcmp(requirements.features[1], "synchronization2") != 0) return 1;
    if (strcmp(requirements.optional_extensions[0], "VK_EXT_external_memory_host") != 0) return 1;

    TranslucentDevice *device = (TranslucentDevice *)&requirements;
    expect(translucent_device_create(NULL, &device), ARGUMENT, "info is null");
    if (device) return 1;
    TranslucentDeviceInfo info = {.struct_size = sizeof info};
    expect(translucent_device_create(&info, &device), ARGUMENT, "get_instance_proc_addr is null");
    expect(translucent_device_create(&info, NULL), ARGUMENT, "out is null");

    expect(translucent_check_physical_device(NULL, NULL, NULL), ARGUMENT, "get_instance_proc_addr is null");

    TranslucentScene *scene;
    TranslucentSceneInfo file = {.struct_size = sizeof file};
    expect(translucent_scene_create(&file, &scene), ARGUMENT, "info.file is null");
    file.file = "\xff";
    expect(translucent_scene_create(&file, &scene), ARGUMENT, "info.file is not UTF-8");
    file.file = "nowhere.glb";
    expect(translucent_scene_create(&file, &scene), TRANSLUCENT_RESULT_FILE, "nowhere.glb");
    file.data = "{}";
    file.size = 2;
    expect(translucent_scene_create(&file, &scene), TRANSLUCENT_RESULT_INPUT, "nowhere.glb");
    file.data = NULL;
    file.file = "assets/spot.glb";
    if (translucent_scene_create(&file, &scene) != TRANSLUCENT_RESULT_OK) return 1;
    double dark[3] = {-1, 0, 0};
    expect(translucent_scene_set_constant_environment(scene, dark), TRANSLUCENT_RESULT_INPUT, "environment");
    uint32_t count;
    const char *name;
    if (translucent_scene_material_count(scene, &count) != TRANSLUCENT_RESULT_OK || count == 0) return 1;
    if (translucent_scene_material_name(scene, 0, &name) != TRANSLUCENT_RESULT_OK || !*name) return 1;
    expect(translucent_scene_material_name(scene, count, &name), ARGUMENT, "no material");

    TranslucentCamera camera = {.struct_size = sizeof camera, .yfov = 1};
    expect(translucent_scene_set_camera(scene, &camera), TRANSLUCENT_RESULT_INPUT, "camera `caller's`");
    TranslucentLight light = {.struct_size = sizeof light, .intensity = {-1, 0, 0}};
    expect(translucent_scene_set_lights(scene, &light, 1), TRANSLUCENT_RESULT_INPUT, "light `caller's`");
    TranslucentMaterial material = {.struct_size = sizeof material, .preset = "marbel"};
    expect(translucent_scene_set_material(scene, 0, &material), TRANSLUCENT_RESULT_INPUT, "close names: marble");
    TranslucentMatter matter = {.struct_size = sizeof matter, .ior = 1.4};
    material.matter = &matter;
    expect(translucent_scene_set_material(scene, 0, &material), ARGUMENT, "do not go together");
    material.preset = NULL;
    expect(translucent_scene_set_material(scene, 9, &material), TRANSLUCENT_RESULT_INPUT, "none has the index 9");
    if (translucent_scene_set_material(scene, 0, &material) != TRANSLUCENT_RESULT_OK) return 1;
    material.model = "clay";
    expect(translucent_scene_set_material(scene, 0, &material), ARGUMENT, "unknown model");
    material.matter = NULL;
    expect(translucent_scene_set_material(scene, 0, &material), TRANSLUCENT_RESULT_INPUT, "whether it is translucent");

    float corners[12] = {0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1};
    uint32_t faces[12] = {0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 4};
    double projection[16] = {1, 0, 0, 1, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
    TranslucentMesh mesh = {.struct_size = sizeof mesh, .name = "tetrahedron", .vertex_count = 4, .indices = faces,
        .index_count = 12};
    material = (TranslucentMaterial){.struct_size = sizeof material, .name = "stone", .preset = "marble"};
    TranslucentScene *solid;
    expect(translucent_scene_create_from_meshes(&mesh, 1, &material, 1, &solid), ARGUMENT, "mesh.positions is null");
    mesh.positions = corners;
    expect(translucent_scene_create_from_meshes(&mesh, 1, &material, 1, &solid), TRANSLUCENT_RESULT_INPUT,
        "meshes[0] (tetrahedron): index 11 is 4, but there are 4 vertices");
    faces[11] = 3;
    mesh.transform = projection;
    expect(translucent_scene_create_from_meshes(&mesh, 1, &material, 1, &solid), ARGUMENT, "last row");
    mesh.transform = NULL;
    expect(translucent_scene_create_from_meshes(&mesh, 1, NULL, 1, &solid), ARGUMENT, "materials is null");
    expect(translucent_scene_create_from_meshes(&mesh, 1, &material, 0, &solid), TRANSLUCENT_RESULT_INPUT,
        "has material 0 of 0");
    mesh.struct_size = 8;
    expect(translucent_scene_create_from_meshes(&mesh, 1, &material, 1, &solid), ARGUMENT, "mesh.struct_size is 8");
    if (solid) return 1;
    mesh.struct_size = sizeof mesh;
    if (translucent_scene_create_from_meshes(&mesh, 1, &material, 1, &solid) != TRANSLUCENT_RESULT_OK) return 1;
    if (translucent_scene_material_name(solid, 0, &name) != TRANSLUCENT_RESULT_OK || strcmp(name, "stone")) return 1;
    translucent_scene_destroy(solid);
    expect(translucent_renderer_update(NULL, scene), ARGUMENT, "renderer is null");

    TranslucentSettings settings = {.struct_size = sizeof settings};
    if (translucent_settings_default(&settings) != TRANSLUCENT_RESULT_OK || settings.width != 512) return 1;
    settings.model = "standard";
    VkDeviceSize size;
    expect(translucent_buffer_size(scene, &settings, 99, &size), ARGUMENT, "no TranslucentSlot");
    if (translucent_buffer_size(scene, &settings, TRANSLUCENT_SLOT_COLORS, &size) != TRANSLUCENT_RESULT_OK) return 1;
    if (size != 16 * 512 * 512) return 1;
    settings.model = "clay";
    expect(translucent_buffer_size(scene, &settings, TRANSLUCENT_SLOT_COLORS, &size), ARGUMENT, "unknown model");
    settings.model = "standard";
    settings.width = 0;
    expect(translucent_buffer_size(scene, &settings, TRANSLUCENT_SLOT_COLORS, &size), TRANSLUCENT_RESULT_INPUT,
        "resolution");
    TranslucentRenderer *renderer;
    expect(translucent_renderer_create(NULL, scene, &settings, NULL, 0, &renderer), ARGUMENT, "device is null");
    expect(translucent_renderer_render(NULL, 1), ARGUMENT, "renderer is null");

    translucent_scene_destroy(scene);
    translucent_scene_destroy(NULL);
    translucent_device_destroy(NULL);
    translucent_renderer_destroy(NULL);
    uint32_t version = translucent_version();
    if (version != TRANSLUCENT_VERSION) return 1;
    printf("%u.%u.%u\n", version >> 22, version >> 12 & 0x3ff, version & 0xfff);
    return 0;
}
