// What the program has of Vulkan: a device with one queue, buffers, compute pipelines, and commands that are
// recorded, submitted and waited for. An engine has all this already.
#pragma once

#include <vulkan/vulkan.h>

#include <cstdint>
#include <cstring>
#include <stdexcept>
#include <string>
#include <vector>

namespace vulkan {

inline void check(VkResult result, const char *what) {
    if (result != VK_SUCCESS) throw std::runtime_error(std::string(what) + " returns " + std::to_string(result));
}
#define VK(call) vulkan::check(call, #call)

struct Buffer {
    VkBuffer buffer = VK_NULL_HANDLE;
    VkDeviceMemory memory = VK_NULL_HANDLE;
    VkDeviceSize size = 0;
};

// A buffer, or a part of it, at the binding with the index of its place in a list.
struct Bound {
    VkDescriptorType type;
    VkBuffer buffer;
    VkDeviceSize offset = 0;
    VkDeviceSize size = VK_WHOLE_SIZE;
};

struct Pipeline {
    VkShaderModule module = VK_NULL_HANDLE;
    std::vector<VkDescriptorSetLayout> sets;
    VkPipelineLayout layout = VK_NULL_HANDLE;
    VkPipeline pipeline = VK_NULL_HANDLE;
};

class Device {
public:
    Device();
    ~Device();
    Device(const Device &) = delete;
    Device &operator=(const Device &) = delete;

    const std::string &name() const { return name_; }
    uint64_t largest_storage_buffer() const { return largest_storage_buffer_; }

    Buffer make_buffer(VkDeviceSize size, VkBufferUsageFlags usage, bool is_mapped);
    void free_buffer(Buffer buffer);
    void write(const Buffer &buffer, VkDeviceSize offset, const void *bytes, VkDeviceSize size);
    void read(const Buffer &buffer, void *bytes, VkDeviceSize size);

    // sets[i][j] is the type of binding j of descriptor set i.
    Pipeline make_pipeline(const void *spirv, size_t bytes, const char *entry,
                           const std::vector<std::vector<VkDescriptorType>> &sets);
    void free_pipeline(Pipeline &pipeline);

    // Commands of one submission.
    void begin();
    // All later commands see what all earlier ones have done.
    void barrier();
    void copy(const Buffer &from, VkDeviceSize from_offset, const Buffer &to, VkDeviceSize to_offset,
              VkDeviceSize size);
    void clear(const Buffer &buffer, VkDeviceSize offset, VkDeviceSize size);
    void dispatch(const Pipeline &pipeline, const std::vector<std::vector<Bound>> &sets, const uint32_t groups[3]);
    // With as many workgroups as the first three words of a buffer say.
    void dispatch_indirect(const Pipeline &pipeline, const std::vector<std::vector<Bound>> &sets,
                           const Buffer &groups);
    void submit_and_wait();

private:
    void allocate(Buffer &made, bool is_mapped);
    void bind(const Pipeline &pipeline, const std::vector<std::vector<Bound>> &sets);
    uint32_t memory_type(uint32_t bits, VkMemoryPropertyFlags wanted) const;

    VkInstance instance_ = VK_NULL_HANDLE;
    VkPhysicalDevice physical_ = VK_NULL_HANDLE;
    VkDevice device_ = VK_NULL_HANDLE;
    VkQueue queue_ = VK_NULL_HANDLE;
    VkCommandPool command_pool_ = VK_NULL_HANDLE;
    VkCommandBuffer commands_ = VK_NULL_HANDLE;
    std::vector<VkDescriptorPool> descriptor_pools_;
    VkFence fence_ = VK_NULL_HANDLE;
    std::string name_;
    uint64_t largest_storage_buffer_ = 0;
};

}  // namespace vulkan
