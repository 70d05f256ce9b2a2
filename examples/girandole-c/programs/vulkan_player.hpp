// Plays plans on a Vulkan device: makes and frees buffers, compiles the kernels, and records commands.
#pragma once

#include <functional>
#include <map>

#include "girandole.hpp"
#include "vulkan_device.hpp"

class Player {
public:
    explicit Player(vulkan::Device &device, const GirandoleCutOptions *cuts = nullptr) : device_(device) {
        const GirandoleLimits limits = {device.largest_storage_buffer(), GIRANDOLE_NO_LIMIT, GIRANDOLE_NO_LIMIT};
        planner_ = girandole::make<GirandolePlanner>(
            [&](GirandolePlanner **it) { return girandole_planner_create(&limits, cuts, it); });
        cursor_ = girandole::make<GirandoleCursor>(girandole_cursor_create);
        GirandoleTarget target = {};
        target.language = GIRANDOLE_LANGUAGE_SPIRV;
        for (uint32_t i = 0; i < girandole_kernel_count(); i++) {
            GirandoleKernel kernel;
            girandole::check(girandole_kernel(i, &kernel));
            const auto shader = girandole::make<GirandoleShader>(
                [&](GirandoleShader **it) { return girandole_kernel_shader(i, &target, it); });
            GirandoleShaderView view;
            girandole::check(girandole_shader_view(shader.get(), &view));
            std::vector<VkDescriptorType> types;
            for (size_t b = 0; b < kernel.binding_count; b++) {
                types.push_back(kernel.bindings[b].kind == GIRANDOLE_BINDING_UNIFORM
                                    ? VK_DESCRIPTOR_TYPE_UNIFORM_BUFFER
                                    : VK_DESCRIPTOR_TYPE_STORAGE_BUFFER);
            }
            kernels_.push_back(kernel);
            const char *entry = view.entry_points[0].name_in_code;
            pipelines_.push_back(device.make_pipeline(view.code, view.size, entry, {types}));
        }
    }

    ~Player() {
        for (auto &pipeline : pipelines_) device_.free_pipeline(pipeline);
        for (auto &buffer : buffers_) device_.free_buffer(buffer.second);
    }

    Player(const Player &) = delete;
    Player &operator=(const Player &) = delete;

    // Makes cells follow the pixels of a camera from the next frame on.
    void set_cut_view(GirandoleDVec3 eye, float pixel) {
        girandole::check(girandole_planner_set_cut_view(planner_.get(), eye, pixel));
    }

    // Brings the device up to date with the world, after girandole_world_update, and builds the cuts of the cells that
    // shaders have marked. Returns the commands played.
    // write_lights records the engine's kernels that write lights, between the upload and the build of the top
    // level.
    size_t frame(GirandoleWorld *world, const std::function<void()> &write_lights = nullptr) {
        const GirandoleNewBuffer *wanted = nullptr;
        size_t count = 0;
        girandole::check(girandole_planner_reserve(planner_.get(), world, 0, &wanted, &count));
        std::vector<vulkan::Buffer> made;
        try {
            for (size_t i = 0; i < count; i++) made.push_back(make_buffer(wanted[i]));
        } catch (...) {
            // An engine that has no memory left draws with the last frame. The next reservation may use their numbers.
            for (const auto &buffer : made) device_.free_buffer(buffer);
            girandole::check(girandole_planner_cancel(planner_.get()));
            throw;
        }
        for (size_t i = 0; i < count; i++) buffers_[wanted[i].id] = made[i];
        const auto plan = girandole::make<GirandolePlan>(
            [&](GirandolePlan **it) { return girandole_planner_plan(planner_.get(), it); });
        girandole::check(girandole_cursor_advance(cursor_.get(), plan.get()));
        return play(plan.get(), write_lights);
    }

    // The program keeps no last frame, which is the last binding.
    static constexpr uint32_t bound_buffers = GIRANDOLE_SHADER_BUFFERS - 1;

    // What shaders bind, at the group that their text was made for.
    std::vector<vulkan::Bound> bindings() {
        uint32_t ids[GIRANDOLE_SHADER_BUFFERS];
        girandole::check(girandole_planner_bindings(planner_.get(), ids));
        std::vector<vulkan::Bound> bound;
        for (uint32_t i = 0; i < bound_buffers; i++) {
            const auto type = bound.empty() ? VK_DESCRIPTOR_TYPE_UNIFORM_BUFFER : VK_DESCRIPTOR_TYPE_STORAGE_BUFFER;
            bound.push_back({type, buffers_.at(ids[i]).buffer});
        }
        return bound;
    }

    static std::vector<VkDescriptorType> binding_types() {
        std::vector<VkDescriptorType> types(bound_buffers, VK_DESCRIPTOR_TYPE_STORAGE_BUFFER);
        types[0] = VK_DESCRIPTOR_TYPE_UNIFORM_BUFFER;
        return types;
    }

    // What kernels bind that write lights, at the group that girandole_shader_sources was made for.
    std::vector<vulkan::Bound> source_bindings() {
        uint32_t ids[GIRANDOLE_SOURCE_BUFFERS];
        girandole::check(girandole_planner_source_bindings(planner_.get(), ids));
        std::vector<vulkan::Bound> bound;
        for (const uint32_t id : ids) bound.push_back({VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, buffers_.at(id).buffer});
        return bound;
    }

    // What the last refit has found out about all trees with a source.
    girandole::Owned<GirandoleReadback> measures() {
        uint32_t count = 0;
        girandole::check(girandole_planner_source_count(planner_.get(), &count));
        return girandole::make<GirandoleReadback>(
            [&](GirandoleReadback **it) { return girandole_planner_measures(planner_.get(), 0, count, it); });
    }

    // Some parts of trees with a source.
    girandole::Owned<GirandoleReadback> source_parts(uint32_t most) {
        return girandole::make<GirandoleReadback>(
            [&](GirandoleReadback **it) { return girandole_planner_source_parts(planner_.get(), most, it); });
    }

    // The lights of a tree with a source.
    girandole::Owned<GirandoleReadback> source_lights(uint64_t tree) {
        return girandole::make<GirandoleReadback>(
            [&](GirandoleReadback **it) { return girandole_planner_source_lights(planner_.get(), tree, it); });
    }

    // Waits for what a readback copies, and tells the world. An engine does so some frames later, without waiting.
    // Returns the trees whose lights should be read back.
    std::vector<uint64_t> apply(const GirandoleReadback *readback, GirandoleWorld *world) {
        GirandoleReadbackView view;
        girandole::check(girandole_readback_view(readback, &view));
        const auto copy = device_.make_buffer(view.size, VK_BUFFER_USAGE_TRANSFER_DST_BIT, true);
        device_.begin();
        device_.copy(buffers_.at(view.buffer), view.offset, copy, 0, view.size);
        device_.submit_and_wait();
        std::vector<uint8_t> bytes(view.size);
        device_.read(copy, bytes.data(), bytes.size());
        device_.free_buffer(copy);
        std::vector<uint64_t> trees(view.most_trees);
        size_t count = 0;
        girandole::check(girandole_readback_apply(readback, world, bytes.data(), bytes.size(), trees.data(),
                                                  trees.size(), &count));
        trees.resize(count);
        return trees;
    }

    GirandolePlanner *planner() { return planner_.get(); }

    uint32_t effects() {
        uint32_t effects = 0;
        girandole::check(girandole_planner_effects(planner_.get(), &effects));
        return effects;
    }

private:
    vulkan::Buffer make_buffer(const GirandoleNewBuffer &wanted) {
        const bool is_uniform = wanted.usage == GIRANDOLE_BUFFER_UNIFORM;
        VkBufferUsageFlags usage =
            is_uniform ? VK_BUFFER_USAGE_UNIFORM_BUFFER_BIT | VK_BUFFER_USAGE_TRANSFER_DST_BIT
                       : VK_BUFFER_USAGE_STORAGE_BUFFER_BIT | VK_BUFFER_USAGE_TRANSFER_SRC_BIT |
                             VK_BUFFER_USAGE_TRANSFER_DST_BIT;
        if (wanted.usage == GIRANDOLE_BUFFER_INDIRECT) usage |= VK_BUFFER_USAGE_INDIRECT_BUFFER_BIT;
        return device_.make_buffer(wanted.size, usage, false);
    }

    size_t play(const GirandolePlan *plan, const std::function<void()> &write_lights) {
        GirandolePlanView view;
        girandole::check(girandole_plan_view(plan, &view));

        vulkan::Buffer staging;
        if (view.bytes > 0) {
            staging = device_.make_buffer(view.bytes, VK_BUFFER_USAGE_TRANSFER_SRC_BIT, true);
        }
        VkDeviceSize used = 0;
        device_.begin();
        play(view.upload, view.upload_count, staging, used);
        if (write_lights) {
            write_lights();
            device_.barrier();
        }
        play(view.top, view.top_count, staging, used);
        device_.submit_and_wait();
        // The device has finished the frame.
        if (view.bytes > 0) device_.free_buffer(staging);
        for (size_t i = 0; i < view.freed_count; i++) {
            device_.free_buffer(buffers_.at(view.freed[i]));
            buffers_.erase(view.freed[i]);
        }
        return view.upload_count + view.top_count;
    }

    void play(const GirandoleCommand *commands, size_t count, const vulkan::Buffer &staging, VkDeviceSize &used) {
        bool was_write = false;
        for (size_t i = 0; i < count; i++) {
            const GirandoleCommand &command = commands[i];
            // Writes do not depend on each other.
            if (!(was_write && command.kind == GIRANDOLE_COMMAND_WRITE)) device_.barrier();
            was_write = command.kind == GIRANDOLE_COMMAND_WRITE;
            switch (command.kind) {
            case GIRANDOLE_COMMAND_WRITE:
                device_.write(staging, used, command.bytes, command.size);
                device_.copy(staging, used, buffers_.at(command.buffer), command.offset, command.size);
                used += command.size;
                break;
            case GIRANDOLE_COMMAND_COPY:
                device_.copy(buffers_.at(command.source), 0, buffers_.at(command.buffer), command.offset, command.size);
                break;
            case GIRANDOLE_COMMAND_CLEAR:
                device_.clear(buffers_.at(command.buffer), command.offset, command.size);
                break;
            case GIRANDOLE_COMMAND_DISPATCH:
            case GIRANDOLE_COMMAND_DISPATCH_INDIRECT: dispatch(command); break;
            default: throw std::runtime_error("a command of a later version");
            }
        }
        device_.barrier();
    }

    void dispatch(const GirandoleCommand &command) {
        const GirandoleKernel &kernel = kernels_.at(command.kernel);
        std::vector<vulkan::Bound> bound;
        for (uint32_t b = 0; b < command.buffer_count; b++) {
            const auto &buffer = buffers_.at(command.buffers[b]);
            if (kernel.bindings[b].kind == GIRANDOLE_BINDING_UNIFORM) {
                bound.push_back({VK_DESCRIPTOR_TYPE_UNIFORM_BUFFER, buffer.buffer, command.uniform_offset,
                                 kernel.bindings[b].uniform_size});
            } else {
                bound.push_back({VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, buffer.buffer});
            }
        }
        const auto &pipeline = pipelines_.at(command.kernel);
        if (command.kind == GIRANDOLE_COMMAND_DISPATCH_INDIRECT) {
            device_.dispatch_indirect(pipeline, {bound}, buffers_.at(command.source));
        } else {
            device_.dispatch(pipeline, {bound}, command.workgroups);
        }
    }

    vulkan::Device &device_;
    girandole::Owned<GirandolePlanner> planner_;
    girandole::Owned<GirandoleCursor> cursor_;
    std::vector<GirandoleKernel> kernels_;
    std::vector<vulkan::Pipeline> pipelines_;
    std::map<uint32_t, vulkan::Buffer> buffers_;
};
