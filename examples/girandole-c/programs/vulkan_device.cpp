#include "vulkan_device.hpp"

namespace vulkan {

Device::Device() {
    VkApplicationInfo app = {};
    app.sType = VK_STRUCTURE_TYPE_APPLICATION_INFO;
    app.apiVersion = VK_API_VERSION_1_1;  // reads SPIR-V 1.3
    VkInstanceCreateInfo instance_info = {};
    instance_info.sType = VK_STRUCTURE_TYPE_INSTANCE_CREATE_INFO;
    instance_info.pApplicationInfo = &app;
    VK(vkCreateInstance(&instance_info, nullptr, &instance_));

    uint32_t count = 0;
    VK(vkEnumeratePhysicalDevices(instance_, &count, nullptr));
    std::vector<VkPhysicalDevice> devices(count);
    VK(vkEnumeratePhysicalDevices(instance_, &count, devices.data()));
    if (devices.empty()) throw std::runtime_error("no Vulkan device");
    physical_ = devices[0];
    VkPhysicalDeviceProperties properties;
    vkGetPhysicalDeviceProperties(physical_, &properties);
    name_ = properties.deviceName;
    largest_storage_buffer_ = properties.limits.maxStorageBufferRange;

    vkGetPhysicalDeviceQueueFamilyProperties(physical_, &count, nullptr);
    std::vector<VkQueueFamilyProperties> families(count);
    vkGetPhysicalDeviceQueueFamilyProperties(physical_, &count, families.data());
    uint32_t family = 0;
    while (family < count && !(families[family].queueFlags & VK_QUEUE_COMPUTE_BIT)) family++;
    if (family == count) throw std::runtime_error("no queue that computes");

    const float priority = 1.0f;
    VkDeviceQueueCreateInfo queue_info = {};
    queue_info.sType = VK_STRUCTURE_TYPE_DEVICE_QUEUE_CREATE_INFO;
    queue_info.queueFamilyIndex = family;
    queue_info.queueCount = 1;
    queue_info.pQueuePriorities = &priority;
    VkDeviceCreateInfo device_info = {};
    device_info.sType = VK_STRUCTURE_TYPE_DEVICE_CREATE_INFO;
    device_info.queueCreateInfoCount = 1;
    device_info.pQueueCreateInfos = &queue_info;
    VK(vkCreateDevice(physical_, &device_info, nullptr, &device_));
    vkGetDeviceQueue(device_, family, 0, &queue_);

    VkCommandPoolCreateInfo pool_info = {};
    pool_info.sType = VK_STRUCTURE_TYPE_COMMAND_POOL_CREATE_INFO;
    pool_info.flags = VK_COMMAND_POOL_CREATE_RESET_COMMAND_BUFFER_BIT;
    pool_info.queueFamilyIndex = family;
    VK(vkCreateCommandPool(device_, &pool_info, nullptr, &command_pool_));
    VkCommandBufferAllocateInfo buffer_info = {};
    buffer_info.sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_ALLOCATE_INFO;
    buffer_info.commandPool = command_pool_;
    buffer_info.level = VK_COMMAND_BUFFER_LEVEL_PRIMARY;
    buffer_info.commandBufferCount = 1;
    VK(vkAllocateCommandBuffers(device_, &buffer_info, &commands_));
    VkFenceCreateInfo fence_info = {};
    fence_info.sType = VK_STRUCTURE_TYPE_FENCE_CREATE_INFO;
    VK(vkCreateFence(device_, &fence_info, nullptr, &fence_));
}

Device::~Device() {
    vkDeviceWaitIdle(device_);
    for (auto pool : descriptor_pools_) vkDestroyDescriptorPool(device_, pool, nullptr);
    vkDestroyFence(device_, fence_, nullptr);
    vkDestroyCommandPool(device_, command_pool_, nullptr);
    vkDestroyDevice(device_, nullptr);
    vkDestroyInstance(instance_, nullptr);
}

uint32_t Device::memory_type(uint32_t bits, VkMemoryPropertyFlags wanted) const {
    VkPhysicalDeviceMemoryProperties memory;
    vkGetPhysicalDeviceMemoryProperties(physical_, &memory);
    for (uint32_t i = 0; i < memory.memoryTypeCount; i++) {
        if ((bits >> i & 1) && (memory.memoryTypes[i].propertyFlags & wanted) == wanted) return i;
    }
    throw std::runtime_error("no fitting kind of memory");
}

Buffer Device::make_buffer(VkDeviceSize size, VkBufferUsageFlags usage, bool is_mapped) {
    Buffer made;
    made.size = size;
    VkBufferCreateInfo info = {};
    info.sType = VK_STRUCTURE_TYPE_BUFFER_CREATE_INFO;
    info.size = size;
    info.usage = usage;
    VK(vkCreateBuffer(device_, &info, nullptr, &made.buffer));
    try {
        allocate(made, is_mapped);
    } catch (...) {
        free_buffer(made);
        throw;
    }
    return made;
}

void Device::allocate(Buffer &made, bool is_mapped) {
    VkMemoryRequirements needs;
    vkGetBufferMemoryRequirements(device_, made.buffer, &needs);
    VkMemoryAllocateInfo memory = {};
    memory.sType = VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_INFO;
    memory.allocationSize = needs.size;
    memory.memoryTypeIndex = memory_type(
        needs.memoryTypeBits, is_mapped ? VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT | VK_MEMORY_PROPERTY_HOST_COHERENT_BIT
                                        : VK_MEMORY_PROPERTY_DEVICE_LOCAL_BIT);
    VK(vkAllocateMemory(device_, &memory, nullptr, &made.memory));
    VK(vkBindBufferMemory(device_, made.buffer, made.memory, 0));
}

void Device::free_buffer(Buffer buffer) {
    vkDestroyBuffer(device_, buffer.buffer, nullptr);
    vkFreeMemory(device_, buffer.memory, nullptr);
}

void Device::write(const Buffer &buffer, VkDeviceSize offset, const void *bytes, VkDeviceSize size) {
    void *mapped = nullptr;
    VK(vkMapMemory(device_, buffer.memory, offset, size, 0, &mapped));
    std::memcpy(mapped, bytes, size);
    vkUnmapMemory(device_, buffer.memory);
}

void Device::read(const Buffer &buffer, void *bytes, VkDeviceSize size) {
    void *mapped = nullptr;
    VK(vkMapMemory(device_, buffer.memory, 0, size, 0, &mapped));
    std::memcpy(bytes, mapped, size);
    vkUnmapMemory(device_, buffer.memory);
}

Pipeline Device::make_pipeline(const void *spirv, size_t bytes, const char *entry,
                               const std::vector<std::vector<VkDescriptorType>> &sets) {
    Pipeline made;
    VkShaderModuleCreateInfo module = {};
    module.sType = VK_STRUCTURE_TYPE_SHADER_MODULE_CREATE_INFO;
    module.codeSize = bytes;
    module.pCode = static_cast<const uint32_t *>(spirv);
    VK(vkCreateShaderModule(device_, &module, nullptr, &made.module));
    for (const auto &types : sets) {
        std::vector<VkDescriptorSetLayoutBinding> bindings;
        for (uint32_t i = 0; i < types.size(); i++) {
            bindings.push_back({i, types[i], 1, VK_SHADER_STAGE_COMPUTE_BIT, nullptr});
        }
        VkDescriptorSetLayoutCreateInfo info = {};
        info.sType = VK_STRUCTURE_TYPE_DESCRIPTOR_SET_LAYOUT_CREATE_INFO;
        info.bindingCount = static_cast<uint32_t>(bindings.size());
        info.pBindings = bindings.data();
        VkDescriptorSetLayout layout;
        VK(vkCreateDescriptorSetLayout(device_, &info, nullptr, &layout));
        made.sets.push_back(layout);
    }
    VkPipelineLayoutCreateInfo layout = {};
    layout.sType = VK_STRUCTURE_TYPE_PIPELINE_LAYOUT_CREATE_INFO;
    layout.setLayoutCount = static_cast<uint32_t>(made.sets.size());
    layout.pSetLayouts = made.sets.data();
    VK(vkCreatePipelineLayout(device_, &layout, nullptr, &made.layout));
    VkComputePipelineCreateInfo pipeline = {};
    pipeline.sType = VK_STRUCTURE_TYPE_COMPUTE_PIPELINE_CREATE_INFO;
    pipeline.stage.sType = VK_STRUCTURE_TYPE_PIPELINE_SHADER_STAGE_CREATE_INFO;
    pipeline.stage.stage = VK_SHADER_STAGE_COMPUTE_BIT;
    pipeline.stage.module = made.module;
    pipeline.stage.pName = entry;
    pipeline.layout = made.layout;
    VK(vkCreateComputePipelines(device_, VK_NULL_HANDLE, 1, &pipeline, nullptr, &made.pipeline));
    return made;
}

void Device::free_pipeline(Pipeline &pipeline) {
    vkDestroyPipeline(device_, pipeline.pipeline, nullptr);
    vkDestroyPipelineLayout(device_, pipeline.layout, nullptr);
    for (auto set : pipeline.sets) vkDestroyDescriptorSetLayout(device_, set, nullptr);
    vkDestroyShaderModule(device_, pipeline.module, nullptr);
    pipeline = Pipeline();
}

void Device::begin() {
    VkCommandBufferBeginInfo info = {};
    info.sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO;
    info.flags = VK_COMMAND_BUFFER_USAGE_ONE_TIME_SUBMIT_BIT;
    VK(vkBeginCommandBuffer(commands_, &info));
}

void Device::barrier() {
    VkMemoryBarrier all = {};
    all.sType = VK_STRUCTURE_TYPE_MEMORY_BARRIER;
    all.srcAccessMask = VK_ACCESS_MEMORY_WRITE_BIT;
    all.dstAccessMask = VK_ACCESS_MEMORY_READ_BIT | VK_ACCESS_MEMORY_WRITE_BIT;
    const auto stages = VK_PIPELINE_STAGE_ALL_COMMANDS_BIT;
    vkCmdPipelineBarrier(commands_, stages, stages, 0, 1, &all, 0, nullptr, 0, nullptr);
}

void Device::copy(const Buffer &from, VkDeviceSize from_offset, const Buffer &to, VkDeviceSize to_offset,
                  VkDeviceSize size) {
    const VkBufferCopy region = {from_offset, to_offset, size};
    vkCmdCopyBuffer(commands_, from.buffer, to.buffer, 1, &region);
}

void Device::clear(const Buffer &buffer, VkDeviceSize offset, VkDeviceSize size) {
    vkCmdFillBuffer(commands_, buffer.buffer, offset, size, 0);
}

void Device::dispatch(const Pipeline &pipeline, const std::vector<std::vector<Bound>> &sets,
                      const uint32_t groups[3]) {
    bind(pipeline, sets);
    vkCmdDispatch(commands_, groups[0], groups[1], groups[2]);
}

void Device::dispatch_indirect(const Pipeline &pipeline, const std::vector<std::vector<Bound>> &sets,
                               const Buffer &groups) {
    bind(pipeline, sets);
    vkCmdDispatchIndirect(commands_, groups.buffer, 0);
}

void Device::bind(const Pipeline &pipeline, const std::vector<std::vector<Bound>> &sets) {
    // A pool for each dispatch keeps this short. Engines reuse their sets.
    const VkDescriptorPoolSize sizes[] = {{VK_DESCRIPTOR_TYPE_UNIFORM_BUFFER, 4},
                                          {VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, 16}};
    VkDescriptorPoolCreateInfo pool = {};
    pool.sType = VK_STRUCTURE_TYPE_DESCRIPTOR_POOL_CREATE_INFO;
    pool.maxSets = static_cast<uint32_t>(sets.size());
    pool.poolSizeCount = 2;
    pool.pPoolSizes = sizes;
    descriptor_pools_.push_back(VK_NULL_HANDLE);
    VK(vkCreateDescriptorPool(device_, &pool, nullptr, &descriptor_pools_.back()));
    std::vector<VkDescriptorSet> made(sets.size());
    VkDescriptorSetAllocateInfo allocate = {};
    allocate.sType = VK_STRUCTURE_TYPE_DESCRIPTOR_SET_ALLOCATE_INFO;
    allocate.descriptorPool = descriptor_pools_.back();
    allocate.descriptorSetCount = static_cast<uint32_t>(sets.size());
    allocate.pSetLayouts = pipeline.sets.data();
    VK(vkAllocateDescriptorSets(device_, &allocate, made.data()));
    for (size_t set = 0; set < sets.size(); set++) {
        for (uint32_t i = 0; i < sets[set].size(); i++) {
            const Bound &bound = sets[set][i];
            const VkDescriptorBufferInfo buffer = {bound.buffer, bound.offset, bound.size};
            VkWriteDescriptorSet write = {};
            write.sType = VK_STRUCTURE_TYPE_WRITE_DESCRIPTOR_SET;
            write.dstSet = made[set];
            write.dstBinding = i;
            write.descriptorCount = 1;
            write.descriptorType = bound.type;
            write.pBufferInfo = &buffer;
            vkUpdateDescriptorSets(device_, 1, &write, 0, nullptr);
        }
    }
    vkCmdBindPipeline(commands_, VK_PIPELINE_BIND_POINT_COMPUTE, pipeline.pipeline);
    vkCmdBindDescriptorSets(commands_, VK_PIPELINE_BIND_POINT_COMPUTE, pipeline.layout, 0,
                            static_cast<uint32_t>(made.size()), made.data(), 0, nullptr);
}

void Device::submit_and_wait() {
    // The host reads what the commands have written.
    VkMemoryBarrier host = {};
    host.sType = VK_STRUCTURE_TYPE_MEMORY_BARRIER;
    host.srcAccessMask = VK_ACCESS_MEMORY_WRITE_BIT;
    host.dstAccessMask = VK_ACCESS_HOST_READ_BIT;
    vkCmdPipelineBarrier(commands_, VK_PIPELINE_STAGE_ALL_COMMANDS_BIT, VK_PIPELINE_STAGE_HOST_BIT, 0, 1, &host, 0,
                         nullptr, 0, nullptr);
    VK(vkEndCommandBuffer(commands_));
    VkSubmitInfo submit = {};
    submit.sType = VK_STRUCTURE_TYPE_SUBMIT_INFO;
    submit.commandBufferCount = 1;
    submit.pCommandBuffers = &commands_;
    VK(vkQueueSubmit(queue_, 1, &submit, fence_));
    VK(vkWaitForFences(device_, 1, &fence_, VK_TRUE, UINT64_MAX));
    VK(vkResetFences(device_, 1, &fence_));
    for (auto pool : descriptor_pools_) vkDestroyDescriptorPool(device_, pool, nullptr);
    descriptor_pools_.clear();
}

}  // namespace vulkan
