// A Vulkan application in C++ that gives translucent memory of its own, moves the camera between frames without a new
// renderer, reads times of every kernel, and writes the frames: turntable SCENE.glb OUT-PREFIX [SIZE [SAMPLES
// [FRAMES]]]
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <iostream>
#include <iterator>
#include <map>
#include <stdexcept>
#include <string>
#include <vector>

#include <translucent.h>
#include <vulkan/vulkan.h>

namespace {

void vk(VkResult result, const char *step) {
    if (result != VK_SUCCESS) throw std::runtime_error(std::string(step) + ": VkResult " + std::to_string(result));
}

void tl(TranslucentResult result, const char *step) {
    if (result != TRANSLUCENT_RESULT_OK) throw std::runtime_error(std::string(step) + ": " + translucent_last_error());
}

// One VkDeviceMemory for each buffer: simple, and enough for some thirty of them.
struct Memory {
    VkDevice device;
    VkPhysicalDeviceMemoryProperties types;
    std::size_t held = 0;

    static VkResult allocate(void *user, const VkMemoryRequirements *needs, TranslucentLocation location, const char *,
        TranslucentAllocation *out) {
        auto &self = *static_cast<Memory *>(user);
        VkMemoryPropertyFlags wanted = VK_MEMORY_PROPERTY_DEVICE_LOCAL_BIT;
        if (location != TRANSLUCENT_LOCATION_DEVICE) {
            wanted = VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT | VK_MEMORY_PROPERTY_HOST_COHERENT_BIT;
        }
        for (std::uint32_t type = 0; type < self.types.memoryTypeCount; type++) {
            auto has = self.types.memoryTypes[type].propertyFlags;
            if (!(needs->memoryTypeBits >> type & 1) || (has & wanted) != wanted) continue;
            VkMemoryAllocateInfo info{VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_INFO, nullptr, needs->size, type};
            VkResult result = vkAllocateMemory(self.device, &info, nullptr, &out->memory);
            if (result != VK_SUCCESS) return result;
            if (has & VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT) {
                vkMapMemory(self.device, out->memory, 0, VK_WHOLE_SIZE, 0, &out->mapped);
            }
            out->properties = has;
            self.held++;
            return VK_SUCCESS;
        }
        return VK_ERROR_FEATURE_NOT_PRESENT;
    }

    static void free(void *user, const TranslucentAllocation *given) {
        auto &self = *static_cast<Memory *>(user);
        vkFreeMemory(self.device, given->memory, nullptr);
        self.held--;
    }
};

std::vector<char> contents(const std::string &file) {
    std::ifstream in(file, std::ios::binary);
    if (!in) throw std::runtime_error(file + ": cannot be read");
    return {std::istreambuf_iterator<char>(in), {}};
}

void run(const std::vector<std::string> &arguments) {
    const auto number = [&](std::size_t i, int otherwise) {
        return static_cast<std::uint32_t>(arguments.size() > i ? std::atoi(arguments[i].c_str()) : otherwise);
    };
    const std::uint32_t size = number(2, 256), samples = number(3, 16), frames = number(4, 4);

    TranslucentRequirements requirements{};
    requirements.struct_size = sizeof requirements;
    tl(translucent_requirements(&requirements), "requirements");
    VkApplicationInfo application{VK_STRUCTURE_TYPE_APPLICATION_INFO};
    application.apiVersion = requirements.api_version;
    VkInstanceCreateInfo instance_info{VK_STRUCTURE_TYPE_INSTANCE_CREATE_INFO};
    instance_info.pApplicationInfo = &application;
    VkInstance instance;
    vk(vkCreateInstance(&instance_info, nullptr, &instance), "vkCreateInstance");
    std::uint32_t count = 0;
    vk(vkEnumeratePhysicalDevices(instance, &count, nullptr), "vkEnumeratePhysicalDevices");
    std::vector<VkPhysicalDevice> physicals(count);
    vk(vkEnumeratePhysicalDevices(instance, &count, physicals.data()), "vkEnumeratePhysicalDevices");
    VkPhysicalDevice physical = physicals.at(0);
    vkGetPhysicalDeviceQueueFamilyProperties(physical, &count, nullptr);
    std::vector<VkQueueFamilyProperties> families(count);
    vkGetPhysicalDeviceQueueFamilyProperties(physical, &count, families.data());
    std::uint32_t family = 0;
    while (!(families.at(family).queueFlags & VK_QUEUE_COMPUTE_BIT)) family++;
    float priority = 1;
    VkDeviceQueueCreateInfo queue_info{VK_STRUCTURE_TYPE_DEVICE_QUEUE_CREATE_INFO, nullptr, 0, family, 1, &priority};
    VkPhysicalDeviceVulkan13Features features13{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_3_FEATURES};
    VkPhysicalDeviceVulkan12Features features12{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_2_FEATURES, &features13};
    tl(translucent_enable_features(&features12, &features13), "features");
    VkDeviceCreateInfo device_info{VK_STRUCTURE_TYPE_DEVICE_CREATE_INFO, &features12};
    device_info.queueCreateInfoCount = 1;
    device_info.pQueueCreateInfos = &queue_info;
    VkDevice device;
    vk(vkCreateDevice(physical, &device_info, nullptr, &device), "vkCreateDevice");
    VkQueue queue;
    vkGetDeviceQueue(device, family, 0, &queue);

    Memory memory{device, {}};
    vkGetPhysicalDeviceMemoryProperties(physical, &memory.types);
    TranslucentAllocator allocator{sizeof allocator, &memory, Memory::allocate, Memory::free};
    TranslucentDeviceInfo given{};
    given.struct_size = sizeof given;
    given.get_instance_proc_addr = vkGetInstanceProcAddr;
    given.instance = instance;
    given.physical_device = physical;
    given.device = device;
    given.queue_family = family;
    given.queue = queue;
    given.created_with = &device_info;
    given.allocator = &allocator;
    TranslucentDevice *translucent = nullptr;
    tl(translucent_device_create(&given, &translucent), "device");

    // The scene comes from memory.
    const std::vector<char> bytes = contents(arguments.at(0));
    TranslucentSceneInfo file{sizeof file, arguments.at(0).c_str(), bytes.data(), bytes.size(), 1};
    TranslucentScene *scene = nullptr;
    tl(translucent_scene_create(&file, &scene), "scene");
    const double white[3] = {1, 1, 1};
    tl(translucent_scene_set_constant_environment(scene, white), "environment");
    TranslucentSettings settings{};
    settings.struct_size = sizeof settings;
    tl(translucent_settings_default(&settings), "settings");
    settings.width = settings.height = size;
    settings.model = "burley";
    TranslucentRenderer *renderer = nullptr;
    tl(translucent_renderer_create(translucent, scene, &settings, nullptr, 0, &renderer), "renderer");

    std::uint32_t dispatches = 0;
    tl(translucent_renderer_timestamp_count(renderer, 0, samples, &dispatches), "timestamps");
    VkQueryPoolCreateInfo query_info{VK_STRUCTURE_TYPE_QUERY_POOL_CREATE_INFO};
    query_info.queryType = VK_QUERY_TYPE_TIMESTAMP;
    query_info.queryCount = 2 * dispatches;
    VkQueryPool queries;
    vk(vkCreateQueryPool(device, &query_info, nullptr, &queries), "vkCreateQueryPool");
    VkCommandPoolCreateInfo pool_info{VK_STRUCTURE_TYPE_COMMAND_POOL_CREATE_INFO, nullptr, 0, family};
    VkCommandPool pool;
    vk(vkCreateCommandPool(device, &pool_info, nullptr, &pool), "vkCreateCommandPool");
    VkCommandBufferAllocateInfo commands_info{
        VK_STRUCTURE_TYPE_COMMAND_BUFFER_ALLOCATE_INFO, nullptr, pool, VK_COMMAND_BUFFER_LEVEL_PRIMARY, 1};
    VkCommandBuffer commands;
    vk(vkAllocateCommandBuffers(device, &commands_info, &commands), "vkAllocateCommandBuffers");
    VkCommandBufferBeginInfo begin{VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO};
    vk(vkBeginCommandBuffer(commands, &begin), "vkBeginCommandBuffer");
    TranslucentTimestamps times{queries, 0};
    tl(translucent_renderer_record(renderer, commands, 0, samples, &times), "record");
    vk(vkEndCommandBuffer(commands), "vkEndCommandBuffer");

    // The same command buffer for every frame; only the camera's numbers change, and halfway the matter.
    for (std::uint32_t frame = 0; frame < frames; frame++) {
        if (frame > 0 && frame == frames / 2) {
            TranslucentMaterial marble{};
            marble.struct_size = sizeof marble;
            marble.preset = "marble";
            marble.roughness = 0.3;
            tl(translucent_scene_set_material(scene, 0, &marble), "marble");
            tl(translucent_renderer_update(renderer, scene), "update");
        }
        const double angle = 6.283185307179586 * frame / frames, distance = 0.35;
        TranslucentCamera camera{};
        camera.struct_size = sizeof camera;
        camera.eye[0] = distance * std::sin(angle);
        camera.eye[2] = distance * std::cos(angle);
        camera.forward[0] = -camera.eye[0];
        camera.forward[2] = -camera.eye[2];
        camera.up[1] = 1;
        camera.yfov = 0.6;
        tl(translucent_renderer_set_camera(renderer, &camera), "camera");
        VkSubmitInfo submit{VK_STRUCTURE_TYPE_SUBMIT_INFO};
        submit.commandBufferCount = 1;
        submit.pCommandBuffers = &commands;
        vk(vkQueueSubmit(queue, 1, &submit, VK_NULL_HANDLE), "vkQueueSubmit");
        vk(vkQueueWaitIdle(queue), "vkQueueWaitIdle");
        const std::string name = arguments.at(1) + std::to_string(frame) + ".exr";
        tl(translucent_renderer_write(renderer, name.c_str()), "image");
    }

    std::vector<std::uint64_t> ticks(2 * dispatches);
    vk(vkGetQueryPoolResults(device, queries, 0, 2 * dispatches, 8 * ticks.size(), ticks.data(), 8,
           VK_QUERY_RESULT_64_BIT),
        "vkGetQueryPoolResults");
    VkPhysicalDeviceProperties properties;
    vkGetPhysicalDeviceProperties(physical, &properties);
    std::map<std::string, double> milliseconds;
    for (std::uint32_t i = 0; i < dispatches; i++) {
        const char *kernel = nullptr;
        tl(translucent_renderer_timestamp_name(renderer, 0, samples, i, &kernel), "name");
        milliseconds[kernel] += double(ticks[2 * i + 1] - ticks[2 * i]) * properties.limits.timestampPeriod * 1e-6;
    }
    for (const auto &[kernel, time] : milliseconds) std::cout << kernel << " " << time << " ms\n";

    translucent_renderer_destroy(renderer);
    translucent_scene_destroy(scene);
    translucent_device_destroy(translucent);
    if (memory.held != 0) throw std::runtime_error("memory was not given back");
    vkDestroyCommandPool(device, pool, nullptr);
    vkDestroyQueryPool(device, queries, nullptr);
    vkDestroyDevice(device, nullptr);
    vkDestroyInstance(instance, nullptr);
}

}  // namespace

int main(int count, char **arguments) {
    if (count < 3) {
        std::cerr << "usage: turntable SCENE.glb OUT-PREFIX [SIZE [SAMPLES [FRAMES]]]\n";
        return 2;
    }
    try {
        run({arguments + 1, arguments + count});
    } catch (const std::exception &error) {
        std::cerr << "turntable: " << error.what() << "\n";
        return 1;
    }
    return 0;
}
