// A Vulkan application in C that renders a scene with translucent on a device of its own, reads the result from its own
// buffer and writes it as a PFM image: spot SCENE.glb OUT.pfm [SIZE [SAMPLES]]
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <translucent.h>
#include <vulkan/vulkan.h>

static void vk(VkResult result, const char *step) {
    if (result != VK_SUCCESS) {
        fprintf(stderr, "spot: %s: VkResult %d\n", step, result);
        exit(1);
    }
}

static void tl(TranslucentResult result, const char *step) {
    if (result != TRANSLUCENT_RESULT_OK) {
        fprintf(stderr, "spot: %s: %s\n", step, translucent_last_error());
        exit(1);
    }
}

int main(int count, char **arguments) {
    if (count < 3) {
        fprintf(stderr, "usage: spot SCENE.glb OUT.pfm [SIZE [SAMPLES]]\n");
        return 2;
    }
    uint32_t size = count > 3 ? (uint32_t)atoi(arguments[3]) : 256;
    uint32_t samples = count > 4 ? (uint32_t)atoi(arguments[4]) : 64;

    // Instance and device are the application's; the library says what they need.
    TranslucentRequirements requirements = {.struct_size = sizeof requirements};
    tl(translucent_requirements(&requirements), "requirements");
    VkApplicationInfo application = {
        .sType = VK_STRUCTURE_TYPE_APPLICATION_INFO, .apiVersion = requirements.api_version};
    VkInstanceCreateInfo instance_info = {
        .sType = VK_STRUCTURE_TYPE_INSTANCE_CREATE_INFO, .pApplicationInfo = &application};
    VkInstance instance;
    vk(vkCreateInstance(&instance_info, NULL, &instance), "vkCreateInstance");
    uint32_t one = 1;
    VkPhysicalDevice physical;
    VkResult found = vkEnumeratePhysicalDevices(instance, &one, &physical);
    vk(found == VK_INCOMPLETE ? VK_SUCCESS : found, "vkEnumeratePhysicalDevices");
    tl(translucent_check_physical_device(vkGetInstanceProcAddr, instance, physical), "the first device");
    VkQueueFamilyProperties families[16];
    uint32_t family_count = 16, family = 0;
    vkGetPhysicalDeviceQueueFamilyProperties(physical, &family_count, families);
    while (family < family_count && !(families[family].queueFlags & VK_QUEUE_COMPUTE_BIT)) family++;
    float priority = 1;
    VkDeviceQueueCreateInfo queue_info = {.sType = VK_STRUCTURE_TYPE_DEVICE_QUEUE_CREATE_INFO,
        .queueFamilyIndex = family, .queueCount = 1, .pQueuePriorities = &priority};
    VkPhysicalDeviceVulkan13Features features13 = {.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_3_FEATURES};
    VkPhysicalDeviceVulkan12Features features12 = {
        .sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_2_FEATURES, .pNext = &features13};
    tl(translucent_enable_features(&features12, &features13), "features");
    VkDeviceCreateInfo device_info = {.sType = VK_STRUCTURE_TYPE_DEVICE_CREATE_INFO, .pNext = &features12,
        .queueCreateInfoCount = 1, .pQueueCreateInfos = &queue_info};
    VkDevice device;
    vk(vkCreateDevice(physical, &device_info, NULL, &device), "vkCreateDevice");
    VkQueue queue;
    vkGetDeviceQueue(device, family, 0, &queue);

    TranslucentDeviceInfo given = {.struct_size = sizeof given, .get_instance_proc_addr = vkGetInstanceProcAddr,
        .instance = instance, .physical_device = physical, .device = device, .queue_family = family, .queue = queue,
        .created_with = &device_info};
    TranslucentDevice *translucent;
    tl(translucent_device_create(&given, &translucent), "device");
    TranslucentSceneInfo file = {.struct_size = sizeof file, .file = arguments[1]};
    TranslucentScene *scene;
    tl(translucent_scene_create(&file, &scene), "scene");
    double white[3] = {1, 1, 1};
    tl(translucent_scene_set_constant_environment(scene, white), "environment");

    // The result goes into a buffer of the application's, which the host can read.
    TranslucentSettings settings = {.struct_size = sizeof settings};
    tl(translucent_settings_default(&settings), "settings");
    settings.width = settings.height = size;
    settings.model = "standard";  // of all models the one that is ready soonest; null leaves the choice to the library
    TranslucentBuffer colors = {.slot = TRANSLUCENT_SLOT_COLORS};
    tl(translucent_buffer_size(scene, &settings, colors.slot, &colors.size), "size of the result");
    VkBufferCreateInfo buffer_info = {.sType = VK_STRUCTURE_TYPE_BUFFER_CREATE_INFO, .size = colors.size,
        .usage = VK_BUFFER_USAGE_STORAGE_BUFFER_BIT | VK_BUFFER_USAGE_TRANSFER_SRC_BIT |
            VK_BUFFER_USAGE_TRANSFER_DST_BIT};
    vk(vkCreateBuffer(device, &buffer_info, NULL, &colors.buffer), "vkCreateBuffer");
    VkMemoryRequirements needs;
    vkGetBufferMemoryRequirements(device, colors.buffer, &needs);
    VkPhysicalDeviceMemoryProperties memories;
    vkGetPhysicalDeviceMemoryProperties(physical, &memories);
    VkMemoryPropertyFlags wanted = VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT | VK_MEMORY_PROPERTY_HOST_COHERENT_BIT;
    uint32_t type = 0;
    while (!(needs.memoryTypeBits >> type & 1 && (memories.memoryTypes[type].propertyFlags & wanted) == wanted)) type++;
    VkMemoryAllocateInfo allocate = {
        .sType = VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_INFO, .allocationSize = needs.size, .memoryTypeIndex = type};
    VkDeviceMemory memory;
    vk(vkAllocateMemory(device, &allocate, NULL, &memory), "vkAllocateMemory");
    vk(vkBindBufferMemory(device, colors.buffer, memory, 0), "vkBindBufferMemory");

    TranslucentRenderer *renderer;
    tl(translucent_renderer_create(translucent, scene, &settings, &colors, 1, &renderer), "renderer");
    translucent_scene_destroy(scene);
    translucent_device_destroy(translucent);

    // One recording of four samples, submitted until there are enough: the first of them is a number in a buffer.
    VkCommandPoolCreateInfo pool_info = {
        .sType = VK_STRUCTURE_TYPE_COMMAND_POOL_CREATE_INFO, .queueFamilyIndex = family};
    VkCommandPool pool;
    vk(vkCreateCommandPool(device, &pool_info, NULL, &pool), "vkCreateCommandPool");
    VkCommandBufferAllocateInfo commands_info = {.sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_ALLOCATE_INFO,
        .commandPool = pool, .level = VK_COMMAND_BUFFER_LEVEL_PRIMARY, .commandBufferCount = 1};
    VkCommandBuffer commands;
    vk(vkAllocateCommandBuffers(device, &commands_info, &commands), "vkAllocateCommandBuffers");
    VkCommandBufferBeginInfo begin = {.sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO};
    vk(vkBeginCommandBuffer(commands, &begin), "vkBeginCommandBuffer");
    tl(translucent_renderer_record(renderer, commands, 0, 4, NULL), "record");
    vk(vkEndCommandBuffer(commands), "vkEndCommandBuffer");
    VkSubmitInfo submit = {
        .sType = VK_STRUCTURE_TYPE_SUBMIT_INFO, .commandBufferCount = 1, .pCommandBuffers = &commands};
    for (uint32_t first = 0; first < samples; first += 4) {
        tl(translucent_renderer_set_first_sample(renderer, first), "first sample");
        vk(vkQueueSubmit(queue, 1, &submit, VK_NULL_HANDLE), "vkQueueSubmit");
        vk(vkQueueWaitIdle(queue), "vkQueueWaitIdle");
    }

    float *pixels;
    vk(vkMapMemory(device, memory, 0, VK_WHOLE_SIZE, 0, (void **)&pixels), "vkMapMemory");
    FILE *out = fopen(arguments[2], "wb");
    if (!out) {
        perror(arguments[2]);
        return 1;
    }
    fprintf(out, "PF\n%u %u\n-1\n", size, size);
    for (uint32_t row = size; row-- > 0;) {
        for (uint32_t column = 0; column < size; column++) fwrite(pixels + 4 * (row * size + column), 4, 3, out);
    }
    if (fclose(out) != 0) {
        perror(arguments[2]);
        return 1;
    }

    translucent_renderer_destroy(renderer);
    vkDestroyCommandPool(device, pool, NULL);
    vkDestroyBuffer(device, colors.buffer, NULL);
    vkFreeMemory(device, memory, NULL);
    vkDestroyDevice(device, NULL);
    vkDestroyInstance(instance, NULL);
    return 0;
}
