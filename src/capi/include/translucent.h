// translucent in C. Made from src/capi by cbindgen; do not edit.
//
// Pointers are valid for the call that takes them unless a comment says otherwise, and may be null only where it says
// so. Every struct with struct_size begins with its own sizeof, which tells the library what the caller knows.
// Handles come from *_create and go to *_destroy, once. A handle may move to another thread; one thread at a time may
// use it, unless its type says otherwise. There is no global state, but each thread's last error.


#pragma once

#include <stddef.h>
#include <stdint.h>
#include <vulkan/vulkan_core.h>

// Version of this header; translucent_version is that of the library.
#define TRANSLUCENT_VERSION (1 << 12)

// What a function returns. After anything but OK, translucent_last_error says why, and nothing was made or changed.
typedef enum TranslucentResult {
  TRANSLUCENT_RESULT_OK = 0,
  // A null pointer, a text that is not UTF-8, or a struct_size that this version does not know.
  TRANSLUCENT_RESULT_ARGUMENT = 1,
  // The scene or a setting is at fault.
  TRANSLUCENT_RESULT_INPUT = 2,
  // A file could not be read or written.
  TRANSLUCENT_RESULT_FILE = 3,
  // The device lacks something, or was made without it.
  TRANSLUCENT_RESULT_DEVICE = 4,
  // A Vulkan call failed.
  TRANSLUCENT_RESULT_VULKAN = 5,
  // Device memory could not be had.
  TRANSLUCENT_RESULT_MEMORY = 6,
  // A fault of this library.
  TRANSLUCENT_RESULT_PANIC = 7,
} TranslucentResult;

// Where a buffer's memory has to be.
typedef enum TranslucentLocation {
  // On the device; the host need not reach it.
  TRANSLUCENT_LOCATION_DEVICE = 0,
  // Where the host can write it: mapped and coherent.
  TRANSLUCENT_LOCATION_UPLOAD = 1,
  // Where the host can read it: mapped and coherent.
  TRANSLUCENT_LOCATION_READBACK = 2,
} TranslucentLocation;

// A buffer that may be the caller's.
typedef enum TranslucentSlot {
  // The BVH.
  TRANSLUCENT_SLOT_NODES = 1,
  // The triangles, in the order of its leaves.
  TRANSLUCENT_SLOT_TRIANGLES = 2,
  // Normals and material of each triangle.
  TRANSLUCENT_SLOT_SHADINGS = 3,
  // The result in full: see TranslucentOutput::pixels.
  TRANSLUCENT_SLOT_PIXELS = 13,
  // The result: see TranslucentOutput::colors.
  TRANSLUCENT_SLOT_COLORS = 25,
} TranslucentSlot;

// Kind of a light.
typedef enum TranslucentLightKind {
  // intensity is W/sr.
  TRANSLUCENT_LIGHT_KIND_POINT = 0,
  // As a point light, within a cone.
  TRANSLUCENT_LIGHT_KIND_SPOT = 1,
  // intensity is W/m^2 on a plane across the direction.
  TRANSLUCENT_LIGHT_KIND_DIRECTIONAL = 2,
} TranslucentLightKind;

// A device. May be used from several threads at once.
typedef struct TranslucentDevice TranslucentDevice;

// Renders one scene with one set of settings. It may move to another thread, and be used by one at a time; several may
// be used at once.
typedef struct TranslucentRenderer TranslucentRenderer;

// A checked scene, without Vulkan. May be used from several threads at once, but not while it changes.
typedef struct TranslucentScene TranslucentScene;

// What an instance and a device must have been made with, or may be. Known before there are any.
typedef struct TranslucentRequirements {
  // sizeof(TranslucentRequirements), set by the caller; the rest is filled in.
  size_t struct_size;
  // VkApplicationInfo::apiVersion and the device's must be at least this.
  uint32_t api_version;
  // Device extensions that must be enabled.
  uint32_t extension_count;
  const char *const *extensions;
  // Device extensions of which use is made if they are enabled.
  uint32_t optional_extension_count;
  const char *const *optional_extensions;
  // Instance extensions of which use is made if they are enabled.
  uint32_t optional_instance_extension_count;
  const char *const *optional_instance_extensions;
  // Names of the device features that must be enabled; translucent_enable_features sets them.
  uint32_t feature_count;
  const char *const *features;
} TranslucentRequirements;

// A piece of device memory.
typedef struct TranslucentAllocation {
  VkDeviceMemory memory;
  // Bytes from the start of memory, aligned as was asked for.
  VkDeviceSize offset;
  // Where offset is mapped; null if it is not.
  void *mapped;
  // Of the memory's type.
  VkMemoryPropertyFlags properties;
  // Whatever the allocator wants back.
  void *token;
} TranslucentAllocation;

// A caller's allocator of device memory. Its functions may be called from any thread that uses the library.
typedef struct TranslucentAllocator {
  // sizeof(TranslucentAllocator).
  size_t struct_size;
  // First argument of both functions.
  void *user;
  // Fills in memory for one buffer; VK_SUCCESS or why not.
  VkResult (*allocate)(void *user,
                       const VkMemoryRequirements *requirements,
                       enum TranslucentLocation location,
                       const char *name,
                       struct TranslucentAllocation *allocation);
  // Takes it back; the buffer is gone.
  void (*free)(void *user, const struct TranslucentAllocation *allocation);
} TranslucentAllocator;

// A Vulkan device that the caller made and keeps. It, its instance and their loader must outlive the TranslucentDevice
// and all that is made from it.
typedef struct TranslucentDeviceInfo {
  // sizeof(TranslucentDeviceInfo).
  size_t struct_size;
  // The loader's function. This library links to no Vulkan.
  PFN_vkGetInstanceProcAddr get_instance_proc_addr;
  VkInstance instance;
  VkPhysicalDevice physical_device;
  VkDevice device;
  // A family with compute, whose queues run what is recorded.
  uint32_t queue_family;
  // A queue of that family, or null. translucent_renderer_create, _render and _write submit to it and wait, and
  // nobody else may use it meanwhile; recording never does. Without one, buffers that the host fills are in memory
  // that it reaches, and _render and _write fail.
  VkQueue queue;
  // What the device was made with, so that a missing feature is named and VK_EXT_external_memory_host used where it
  // is enabled; null: the caller is trusted.
  const VkDeviceCreateInfo *created_with;
  // Used for every pipeline, from several threads at once, so not VK_PIPELINE_CACHE_CREATE_EXTERNALLY_SYNCHRONIZED;
  // may be null.
  VkPipelineCache pipeline_cache;
  // VK_TRUE if VK_EXT_debug_utils is enabled in the instance: objects get names and dispatches labels.
  VkBool32 debug_utils;
  // Where device memory comes from; null: an allocator of the library's. The struct is copied.
  const struct TranslucentAllocator *allocator;
} TranslucentDeviceInfo;

// Triangles of one material.
typedef struct TranslucentMesh {
  // sizeof(TranslucentMesh).
  size_t struct_size;
  // For messages; may be null.
  const char *name;
  // Three floats for each vertex.
  const float *positions;
  // Three floats for each vertex, of any length; null: triangles are flat.
  const float *normals;
  uint32_t vertex_count;
  // Three for each triangle, counter-clockwise seen from outside.
  const uint32_t *indices;
  uint32_t index_count;
  // Index of the material.
  uint32_t material;
  // Name of the set with whose matter it exchanges light; null: meshes of one material are one set where their
  // borders meet.
  const char *set;
  // 4 x 4 numbers, column by column, from its positions to metres; null: they are metres.
  const double *transform;
} TranslucentMesh;

// What fills a translucent material.
typedef struct TranslucentMatter {
  // sizeof(TranslucentMatter).
  size_t struct_size;
  // Reduced scattering coefficient of red, green and blue [1/m].
  double sigma_s_prime[3];
  // Absorption coefficient [1/m].
  double sigma_a[3];
  // Index of refraction.
  double ior;
} TranslucentMatter;

// A material. All that is 0 or null is black, smooth, opaque.
typedef struct TranslucentMaterial {
  // sizeof(TranslucentMaterial).
  size_t struct_size;
  // For messages; may be null.
  const char *name;
  // Name of measured matter such as "marble"; null: none.
  const char *preset;
  // What fills it, in place of a preset; null: nothing.
  const struct TranslucentMatter *matter;
  // The model of its matter, as in TranslucentSettings; null leaves the choice to the library.
  const char *model;
  // Linear colour of an opaque surface, 0 to 1.
  double base_color[3];
  // 0 to 1.
  double metallic;
  // 0 to 1.
  double roughness;
  // Emitted radiance.
  double emission[3];
  // VK_TRUE: both sides emit.
  VkBool32 two_sided;
} TranslucentMaterial;

// Everything about a render that is not the scene. translucent_settings_default fills it in.
typedef struct TranslucentSettings {
  // sizeof(TranslucentSettings).
  size_t struct_size;
  // Size of the image (pixels).
  uint32_t width;
  uint32_t height;
  // Key of all random numbers.
  uint32_t seed;
  // Incoming environment directions at each position, at least 1.
  uint32_t directions;
  // VK_TRUE keeps the sums of eight batches, from which the variance comes.
  VkBool32 variance;
  // VK_TRUE adds the environment where a camera ray hits nothing.
  VkBool32 show_environment;
  // "auto", "standard", "better", "directional", "burley", "table" or "lambert"; null is "auto".
  const char *model;
  // Name of the camera; null: the first, or one that frames the scene.
  const char *camera;
} TranslucentSettings;

// A caller's buffer in place of the library's, with the usages STORAGE_BUFFER, TRANSFER_SRC and TRANSFER_DST. It
// outlives the renderer. The scene's are written by translucent_renderer_create, which needs a queue for it: the BVH
// and the order of its triangles are made on the host.
typedef struct TranslucentBuffer {
  // A TranslucentSlot.
  uint32_t slot;
  VkBuffer buffer;
  VkDeviceSize size;
} TranslucentBuffer;

// Where the times of a recording go: the dispatch number i writes query first + 2 i before it starts and the next one
// when it has ended.
typedef struct TranslucentTimestamps {
  // A pool of VK_QUERY_TYPE_TIMESTAMP. The recording resets the queries that it writes.
  VkQueryPool pool;
  uint32_t first;
} TranslucentTimestamps;

// What recordings leave behind, valid as long as the renderer. Rows run from the top, width pixels each, without
// padding.
typedef struct TranslucentOutput {
  // sizeof(TranslucentOutput), set by the caller; the rest is filled in.
  size_t struct_size;
  uint32_t width;
  uint32_t height;
  // Four floats for each pixel: linear Rec.709 light, and alpha; not premultiplied.
  VkBuffer colors;
  // Twelve words for each pixel: subsurface light (3 floats), reflected light (3 floats), variance of the mean of
  // the former (3 floats), alpha (float), samples, samples left out (unsigned).
  VkBuffer pixels;
  // Four unsigned words: f of translucent_renderer_record, first and end of the samples in the sums (the end is
  // 0xffffffff where they are to be forgotten), and one of the library's. A transfer of the caller's may write f.
  VkBuffer progress;
} TranslucentOutput;

// A .gltf or .glb file.
typedef struct TranslucentSceneInfo {
  // sizeof(TranslucentSceneInfo).
  size_t struct_size;
  // Its name; beside it buffers and images are looked for.
  const char *file;
  // Its contents; null: they are read from the file. They are copied.
  const void *data;
  // Bytes of data.
  size_t size;
  // Metres of one unit of its geometry; 0 stands for 1.
  double unit;
} TranslucentSceneInfo;

// A camera; lengths in metres.
typedef struct TranslucentCamera {
  // sizeof(TranslucentCamera).
  size_t struct_size;
  double eye[3];
  // Where it looks, of any length but 0.
  double forward[3];
  // What is up in the image; not parallel to forward.
  double up[3];
  // Full vertical angle (radians); 0: orthographic.
  double yfov;
  // Orthographic: half width and half height.
  double xmag;
  double ymag;
} TranslucentCamera;

// A light; lengths in metres.
typedef struct TranslucentLight {
  // sizeof(TranslucentLight).
  size_t struct_size;
  // A TranslucentLightKind.
  uint32_t kind;
  // Point and spot.
  double position[3];
  // Spot and directional: where it shines, of any length but 0.
  double direction[3];
  double intensity[3];
  // Spot: angles from the axis (radians), 0 <= inner < outer <= pi/2.
  double inner;
  double outer;
  // How far it reaches, as KHR_lights_punctual has it; 0: infinitely far.
  double range;
} TranslucentLight;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

// Version of the library: major << 22 | minor << 12 | patch, as VK_MAKE_API_VERSION with variant 0.
uint32_t translucent_version(void);

// Why the last function of this thread that failed did; empty if none has. Valid until another fails in this thread.
const char *translucent_last_error(void);

// Fills in what is required. The texts last as long as the library.
enum TranslucentResult translucent_requirements(struct TranslucentRequirements *requirements);

// Sets the required features in structures that the caller chains into his VkDeviceCreateInfo, and leaves the others.
enum TranslucentResult translucent_enable_features(VkPhysicalDeviceVulkan12Features *features12,
                                                   VkPhysicalDeviceVulkan13Features *features13);

// OK for a physical device that can be used; DEVICE for one that lacks something, which translucent_last_error lists.
enum TranslucentResult translucent_check_physical_device(PFN_vkGetInstanceProcAddr get_instance_proc_addr,
                                                         VkInstance instance,
                                                         VkPhysicalDevice physical_device);

// Makes a TranslucentDevice of the caller's handles.
enum TranslucentResult translucent_device_create(const struct TranslucentDeviceInfo *info,
                                                 struct TranslucentDevice **out);

// Destroys it; scenes and renderers live on. Null is ignored.
void translucent_device_destroy(struct TranslucentDevice *device);

// Makes and checks a scene of vertices and materials, which are copied. Without lights (translucent_scene_set_lights,
// translucent_scene_set_environment) it is dark; without a camera (translucent_scene_set_camera) one frames it. The
// rules are those of glTF files, with each mesh a node: winding is repaired, triangles without area are dropped.
//
// The BVH is built on the host: vertices that only a VkBuffer holds have to be read back by the caller, once.
enum TranslucentResult translucent_scene_create_from_meshes(const struct TranslucentMesh *meshes,
                                                            uint32_t mesh_count,
                                                            const struct TranslucentMaterial *materials,
                                                            uint32_t material_count,
                                                            struct TranslucentScene **out);

// Fills in the defaults: 512 x 512 pixels, seed 0, one direction, variance, no environment behind the scene.
enum TranslucentResult translucent_settings_default(struct TranslucentSettings *settings);

// Bytes that a renderer needs in a TranslucentSlot.
enum TranslucentResult translucent_buffer_size(const struct TranslucentScene *scene,
                                               const struct TranslucentSettings *settings,
                                               uint32_t slot,
                                               VkDeviceSize *size);

// Makes the pipelines and buffers that rendering needs, and fills them from the scene; device and scene may be
// destroyed afterwards. buffers may be null if buffer_count is 0.
enum TranslucentResult translucent_renderer_create(const struct TranslucentDevice *device,
                                                   const struct TranslucentScene *scene,
                                                   const struct TranslucentSettings *settings,
                                                   const struct TranslucentBuffer *buffers,
                                                   uint32_t buffer_count,
                                                   struct TranslucentRenderer **out);

// Destroys it. No execution of what it recorded may be going on. Null is ignored.
void translucent_renderer_destroy(struct TranslucentRenderer *renderer);

// Records the samples begin to end - 1, at most 4096, and the image they make into a command buffer in the recording
// state, outside of a render pass. Never submits or waits. timestamps may be null.
//
// An execution computes the samples f + begin to f + end - 1, where f is the number of
// translucent_renderer_set_first_sample (0 at first). Where the sums hold the samples just before those, they are
// added to them; otherwise the sums start anew. So a command buffer may be submitted again and again, and nothing is
// counted twice. Camera, lights and matter are read from buffers when it executes.
//
// On entry, what compute shaders and transfers earlier on the same queue wrote is waited for and visible. On exit, all
// that was written is visible to compute shaders, transfers and the host; anything else needs a barrier of the
// caller's from the stage COMPUTE_SHADER and the access SHADER_STORAGE_WRITE. Executions of one renderer must not
// overlap. Compute pipeline, descriptor set 0 and push constants are other ones afterwards. The renderer outlives
// every execution.
enum TranslucentResult translucent_renderer_record(const struct TranslucentRenderer *renderer,
                                                   VkCommandBuffer commands,
                                                   uint32_t begin,
                                                   uint32_t end,
                                                   const struct TranslucentTimestamps *timestamps);

// Number of dispatches of such a recording: it writes twice as many queries.
enum TranslucentResult translucent_renderer_timestamp_count(const struct TranslucentRenderer *renderer,
                                                            uint32_t begin,
                                                            uint32_t end,
                                                            uint32_t *count);

// Name of the kernel of dispatch number index of such a recording; the text lasts as long as the renderer.
enum TranslucentResult translucent_renderer_timestamp_name(const struct TranslucentRenderer *renderer,
                                                           uint32_t begin,
                                                           uint32_t end,
                                                           uint32_t index,
                                                           const char **name);

// Records a copy of TranslucentOutput::colors to the upper left of an image of four floats, first level and layer,
// which is in the layout TRANSFER_DST_OPTIMAL or GENERAL when this executes.
enum TranslucentResult translucent_renderer_record_copy(const struct TranslucentRenderer *renderer,
                                                        VkCommandBuffer commands,
                                                        VkImage image,
                                                        VkImageLayout layout);

// Fills in the buffers with the result.
enum TranslucentResult translucent_renderer_output(const struct TranslucentRenderer *renderer,
                                                   struct TranslucentOutput *output);

// Adds the next samples, submitted to the device's queue, and waits for them.
enum TranslucentResult translucent_renderer_render(struct TranslucentRenderer *renderer, uint32_t samples);

// Which samples the sums hold: begin to end - 1.
enum TranslucentResult translucent_renderer_samples(const struct TranslucentRenderer *renderer,
                                                    uint32_t *begin,
                                                    uint32_t *end);

// Writes the image, recorded or rendered, with every channel to an EXR file: all of it or nothing. Submits to the
// device's queue and waits.
enum TranslucentResult translucent_renderer_write(struct TranslucentRenderer *renderer, const char *file);

// Reads and checks a scene.
enum TranslucentResult translucent_scene_create(const struct TranslucentSceneInfo *info, struct TranslucentScene **out);

// Lights the scene with the same radiance (R, G, B) from everywhere.
enum TranslucentResult translucent_scene_set_constant_environment(struct TranslucentScene *scene,
                                                                  const double *radiance);

// Lights the scene with an image: width x height x 3 floats of linear Rec.709 radiance, rows from the zenith down, the
// middle is the direction +X, columns run towards +Z. It is copied. rotation (degrees) turns it about +Y,
// counter-clockwise seen from above; scale multiplies it.
enum TranslucentResult translucent_scene_set_environment(struct TranslucentScene *scene,
                                                         uint32_t width,
                                                         uint32_t height,
                                                         const float *radiance,
                                                         double rotation,
                                                         double scale);

// Number of materials.
enum TranslucentResult translucent_scene_material_count(const struct TranslucentScene *scene, uint32_t *count);

// Name of a material; the text lasts as long as the scene.
enum TranslucentResult translucent_scene_material_name(const struct TranslucentScene *scene,
                                                       uint32_t index,
                                                       const char **name);

// Destroys it; renderers live on. Null is ignored.
void translucent_scene_destroy(struct TranslucentScene *scene);

// Renders another state of the scene from now on: the one that the renderer was made of, with other materials, lights,
// cameras or environment (translucent_scene_set_*), whose geometry stays. It is written into the buffers that there
// are; what is large and not where the host reaches it goes through the device's queue and is waited for. Sums are
// forgotten. INPUT, with the reason, for what needs a new renderer: nothing was changed then.
//
// A model that was chosen for a material stays, where neither settings nor material name one. There is room for the
// tables of any matter, as many lights, and no more of the environment than at first.
enum TranslucentResult translucent_renderer_update(struct TranslucentRenderer *renderer,
                                                   const struct TranslucentScene *scene);

// From which sample the ranges of recordings count. No execution may be going on, here and in the functions below.
enum TranslucentResult translucent_renderer_set_first_sample(struct TranslucentRenderer *renderer, uint32_t first);

// Looks through another camera. Sums are forgotten.
enum TranslucentResult translucent_renderer_set_camera(struct TranslucentRenderer *renderer,
                                                       const struct TranslucentCamera *camera);

// Replaces the scene's lights by as many others; one that is switched off has the intensity 0. Sums are forgotten.
enum TranslucentResult translucent_renderer_set_lights(struct TranslucentRenderer *renderer,
                                                       const struct TranslucentLight *lights,
                                                       uint32_t count);

// Gives a translucent material other matter, under the model that it has. Sums are forgotten.
enum TranslucentResult translucent_renderer_set_matter(struct TranslucentRenderer *renderer,
                                                       uint32_t material,
                                                       const struct TranslucentMatter *matter);

// Replaces the cameras of a scene by one.
enum TranslucentResult translucent_scene_set_camera(struct TranslucentScene *scene,
                                                    const struct TranslucentCamera *camera);

// Replaces the lights of a scene.
enum TranslucentResult translucent_scene_set_lights(struct TranslucentScene *scene,
                                                    const struct TranslucentLight *lights,
                                                    uint32_t count);

// Replaces a material of a scene by another without textures; its name stays, and whether it is translucent must.
enum TranslucentResult translucent_scene_set_material(struct TranslucentScene *scene,
                                                      uint32_t index,
                                                      const struct TranslucentMaterial *material);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus
