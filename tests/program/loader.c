/* A Vulkan loader in front of the system's, LOADER, in which call NUMBER of one function fails, or all from there on:
 * FAULT="function number result once|always". */
#include <dlfcn.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <vulkan/vulkan.h>

static VkResult strike(const char *function)
{
    static atomic_int calls;
    char name[64], often[16];
    int number, result;
    const char *fault = getenv("FAULT");
    if (!fault || sscanf(fault, "%63s %d %d %15s", name, &number, &result, often) != 4 || strcmp(name, function) != 0)
        return VK_SUCCESS;
    int call = atomic_fetch_add(&calls, 1) + 1;
    return call == number || (call > number && strcmp(often, "always") == 0) ? result : VK_SUCCESS;
}

#define FAULTY(name, parameters, arguments) \
    static PFN_##name real_##name; \
    static VKAPI_ATTR VkResult VKAPI_CALL faulty_##name parameters \
    { \
        VkResult result = strike(#name); \
        return result == VK_SUCCESS ? real_##name arguments : result; \
    }

FAULTY(vkCreateInstance, (const VkInstanceCreateInfo *i, const VkAllocationCallbacks *a, VkInstance *o), (i, a, o))
FAULTY(vkCreateDevice, (VkPhysicalDevice d, const VkDeviceCreateInfo *i, const VkAllocationCallbacks *a, VkDevice *o),
       (d, i, a, o))
FAULTY(vkAllocateMemory, (VkDevice d, const VkMemoryAllocateInfo *i, const VkAllocationCallbacks *a, VkDeviceMemory *o),
       (d, i, a, o))
FAULTY(vkCreateBuffer, (VkDevice d, const VkBufferCreateInfo *i, const VkAllocationCallbacks *a, VkBuffer *o),
       (d, i, a, o))
FAULTY(vkCreateComputePipelines,
       (VkDevice d, VkPipelineCache c, uint32_t n, const VkComputePipelineCreateInfo *i, const VkAllocationCallbacks *a,
        VkPipeline *o),
       (d, c, n, i, a, o))
FAULTY(vkQueueSubmit2, (VkQueue q, uint32_t n, const VkSubmitInfo2 *s, VkFence f), (q, n, s, f))
FAULTY(vkWaitForFences, (VkDevice d, uint32_t n, const VkFence *f, VkBool32 a, uint64_t t), (d, n, f, a, t))

/* The function in its place, if it is one of these. */
static PFN_vkVoidFunction wrap(const char *name, PFN_vkVoidFunction real)
{
#define WRAP(function) \
    if (real && strcmp(name, #function) == 0) { \
        real_##function = (PFN_##function)real; \
        return (PFN_vkVoidFunction)faulty_##function; \
    }
    WRAP(vkCreateInstance)
    WRAP(vkCreateDevice)
    WRAP(vkAllocateMemory)
    WRAP(vkCreateBuffer)
    WRAP(vkCreateComputePipelines)
    WRAP(vkQueueSubmit2)
    WRAP(vkWaitForFences)
    return real;
}

static PFN_vkGetDeviceProcAddr get_device_function;

static VKAPI_ATTR PFN_vkVoidFunction VKAPI_CALL device_function(VkDevice device, const char *name)
{
    return wrap(name, get_device_function(device, name));
}

VKAPI_ATTR PFN_vkVoidFunction VKAPI_CALL vkGetInstanceProcAddr(VkInstance instance, const char *name)
{
    static PFN_vkGetInstanceProcAddr get;
    if (!get) {
        void *library = dlopen(getenv("LOADER"), RTLD_NOW | RTLD_LOCAL);
        if (!library) {
            fprintf(stderr, "%s\n", dlerror());
            exit(70);
        }
        get = (PFN_vkGetInstanceProcAddr)dlsym(library, "vkGetInstanceProcAddr");
    }
    PFN_vkVoidFunction real = get(instance, name);
    if (real && strcmp(name, "vkGetDeviceProcAddr") == 0) {
        get_device_function = (PFN_vkGetDeviceProcAddr)real;
        return (PFN_vkVoidFunction)device_function;
    }
    return wrap(name, real);
}
