/* girandole.h: the C interface of Girandole, which chooses lights for shading points.
 *
 * This file is generated from the sources of girandole-c. Do not edit it.
 *
 * Rules for all calls, unless the comment of a call says otherwise:
 *
 *   Status     Calls that can fail return a GirandoleStatus: 0, or a code. A call that returns a code has
 *              changed nothing and stored nothing. girandole_last_error_message returns a sentence about it.
 *   Pointers   NULL, pointers that are not aligned and impossible lengths are refused. Other pointers cannot
 *              be checked: each must point to as many values as the call says. An array of no elements may be
 *              NULL. The memory that a call writes must not overlap the memory that it reads.
 *   Ownership  Objects (GirandoleWorld, GirandolePlanner, GirandolePlan, ...) are created by a call, and
 *              destroyed by their destroy function. After that, neither the object nor pointers into it may be
 *              used. Everything else is copied during the call. Returned strings are UTF-8 and zero-terminated.
 *   Keys       Trees, instances and directional lights have keys, which are never 0. The key of something that
 *              was removed is refused. A key of another world may name something else.
 *   Threads    Calls that take a const object may run on any number of threads at once, while no other call
 *              uses that object. Other calls need exclusive access to the object, on any thread.
 *   Panics     A panic in the library does not leave the call: it becomes GIRANDOLE_ERROR_PANIC. Running out
 *              of memory aborts the process.
 *   Units      Metres, radians, candela, nits and lux. Colours are linear Rec. 709. Axes are right-handed.
 */


#ifndef GIRANDOLE_H
#define GIRANDOLE_H

#include <stddef.h>
#include <stdint.h>

// The version of this header: major * 0x10000 + minor * 0x100 + patch.
#define GIRANDOLE_VERSION 256

// Sampling of large and near surfaces by solid angle, which has less noise and costs more.
#define GIRANDOLE_SAMPLING_SOLID_ANGLE 1

// Shaders that are made for the world's effects choose lights by the gloss of surfaces.
#define GIRANDOLE_SAMPLING_GLOSSY 2

// Shaders that are made for the world's effects choose lights for segments of rays.
#define GIRANDOLE_SAMPLING_SEGMENTS 4

// No limit.
#define GIRANDOLE_NO_LIMIT UINT64_MAX

// The number of buffers that shaders bind.
#define GIRANDOLE_SHADER_BUFFERS 8

// The number of buffers that kernels bind to write lights.
#define GIRANDOLE_SOURCE_BUFFERS 2

// No index.
#define GIRANDOLE_NO_INDEX UINT32_MAX

// Omits the checks that keep indices into buffers and arrays within bounds. Only for texts whose indices are
// known to stay within bounds, such as the library's own texts.
#define GIRANDOLE_TRANSLATE_UNCHECKED 1

// A light emits into less than all directions: a spot, or a surface with one emitting side.
#define GIRANDOLE_EFFECT_CONES 1

// A light has a finite range.
#define GIRANDOLE_EFFECT_RANGES 2

// A light is a surface.
#define GIRANDOLE_EFFECT_AREAS 4

// There is a directional light.
#define GIRANDOLE_EFFECT_DIRECTIONAL 8

// An instance is scaled, sheared or mirrored.
#define GIRANDOLE_EFFECT_NON_RIGID 16

// GIRANDOLE_SAMPLING_SOLID_ANGLE is set.
#define GIRANDOLE_EFFECT_SOLID_ANGLES 32

// GIRANDOLE_SAMPLING_GLOSSY is set.
#define GIRANDOLE_EFFECT_GLOSSY 64

// GIRANDOLE_SAMPLING_SEGMENTS is set.
#define GIRANDOLE_EFFECT_SEGMENTS 128

// An instance has a factor other than 1.
#define GIRANDOLE_EFFECT_FACTORS 256

// An instance has a mask with a bit that is not set.
#define GIRANDOLE_EFFECT_MASKS 512

// The world has a sky.
#define GIRANDOLE_EFFECT_SKY 1024

// A light has a profile.
#define GIRANDOLE_EFFECT_PROFILES 2048

// The world has portals: see girandole_world_set_portals.
#define GIRANDOLE_EFFECT_PORTALS 4096

// All effects: a shader for them reads the buffers of any world, and is the longest.
#define GIRANDOLE_ALL_EFFECTS 8191

// The text has light_reservoir_sample_previous, which reads the last frame at binding 7.
#define GIRANDOLE_SHADER_PREVIOUS 1

// The text has light_record_visibility, by which cells learn: see GirandoleCutOptions.
#define GIRANDOLE_SHADER_LEARNS 2

// The bytes of a baked tree, which the interface owns.
typedef struct GirandoleBlob GirandoleBlob;

// Checks that plans are played in order. Keep one for each set of buffers on which plans are played.
typedef struct GirandoleCursor GirandoleCursor;

// The commands of one frame. It does not depend on the planner and the world, and any thread may use it.
typedef struct GirandolePlan GirandolePlan;

// Tracks what the GPU holds of one world, and plans the work that brings it up to date. Keep one for each
// world and device. It owns no GPU objects.
//
// Threads: one thread at a time.
typedef struct GirandolePlanner GirandolePlanner;

// A range of a buffer that the engine copies after a plan, and whose bytes it passes to the world once they are
// there, some frames later. It does not depend on the planner.
typedef struct GirandoleReadback GirandoleReadback;

// Follows the changes of one world, for renderers that keep samples from frame to frame. Any number of readers
// may follow a world. Planners follow it by themselves.
//
// Threads: one thread at a time.
typedef struct GirandoleReader GirandoleReader;

// Trees and instances that are to be added to a world as a whole, for example a block of houses.
//
// Threads: one thread at a time, which need not be the thread that uses the world. After
// GIRANDOLE_ERROR_PANIC, destroy it.
typedef struct GirandoleRegion GirandoleRegion;

// A translated shader. Any thread may use it.
typedef struct GirandoleShader GirandoleShader;

// All lights of a scene: trees, instances of them, and directional lights.
//
// Threads: any number of threads may be in calls that take a const world, as long as no thread is in a call
// that takes a world that is not const. Different worlds are independent of each other.
typedef struct GirandoleWorld GirandoleWorld;

// The kind of a light: one of GIRANDOLE_LIGHT_*.
typedef uint32_t GirandoleLightKind;

// Three numbers: a position or vector in metres, or a colour in linear Rec. 709.
typedef struct GirandoleVec3 {
    float x;
    float y;
    float z;
} GirandoleVec3;

// The shape of a GIRANDOLE_LIGHT_POINT, in the space of its tree.
typedef struct GirandolePointShape {
    // Metres.
    struct GirandoleVec3 position;
} GirandolePointShape;

// The shape of a GIRANDOLE_LIGHT_SPOT, in the space of its tree.
typedef struct GirandoleSpotShape {
    // Metres.
    struct GirandoleVec3 position;
    // The axis of the cone: a unit vector, to within 0.001.
    struct GirandoleVec3 direction;
    // The angle from the axis up to which the intensity is full, in radians: 0 to outer_angle.
    float inner_angle;
    // The angle from the axis at and beyond which the intensity is 0, in radians: 0 to pi.
    float outer_angle;
} GirandoleSpotShape;

// The shape of a GIRANDOLE_LIGHT_PARALLELOGRAM, in the space of its tree.
typedef struct GirandoleParallelogramShape {
    // Metres.
    struct GirandoleVec3 center;
    // From the centre to the middle of one edge.
    struct GirandoleVec3 half_u;
    // From the centre to the middle of the next edge.
    struct GirandoleVec3 half_v;
} GirandoleParallelogramShape;

// The shape of a GIRANDOLE_LIGHT_TRIANGLE, in the space of its tree.
typedef struct GirandoleTriangleShape {
    // Metres.
    struct GirandoleVec3 vertices[3];
} GirandoleTriangleShape;

// The shape of a GIRANDOLE_LIGHT_SPHERE, in the space of its tree.
typedef struct GirandoleSphereShape {
    // Metres.
    struct GirandoleVec3 center;
    // Metres, at least 0.
    float radius;
} GirandoleSphereShape;

// Four numbers, such as a quaternion.
typedef struct GirandoleVec4 {
    float x;
    float y;
    float z;
    float w;
} GirandoleVec4;

// The shape of a GIRANDOLE_LIGHT_PROFILE, in the space of its tree.
typedef struct GirandoleProfileShape {
    // Metres.
    struct GirandoleVec3 position;
    // The unit quaternion that turns the lamp. Before, it points along -Z, with the plane C0
    // along +X.
    struct GirandoleVec4 rotation;
    // The profile: see girandole_profile_from_ies.
    uint64_t profile;
} GirandoleProfileShape;

// The shape of a light. The kind of the light decides which member is used.
typedef union GirandoleShape {
    struct GirandolePointShape point;
    struct GirandoleSpotShape spot;
    struct GirandoleParallelogramShape parallelogram;
    struct GirandoleTriangleShape triangle;
    struct GirandoleSphereShape sphere;
    struct GirandoleProfileShape profile;
} GirandoleShape;

// A light. The functions girandole_point_light to girandole_sphere_light make one.
typedef struct GirandoleLight {
    // One of GIRANDOLE_LIGHT_*.
    GirandoleLightKind kind;
    // 1 if a parallelogram or triangle emits from its back too, else 0. Other kinds ignore it.
    uint32_t two_sided;
    // Linear Rec. 709, in candela for points and spots, a factor for profiles and in nits for the others; 0 to
    // 1e15.
    struct GirandoleVec3 emission;
    // The distance in metres at and beyond which the light is exactly 0. Above 0; INFINITY for no limit.
    float range;
    // The member that the kind names.
    union GirandoleShape shape;
} GirandoleLight;

// A position or vector of the world in double precision, in metres.
typedef struct GirandoleDVec3 {
    double x;
    double y;
    double z;
} GirandoleDVec3;

// Where an instance is: an affine map from the space of its tree to the world.
typedef struct GirandolePlacement {
    // The images of the three axes: the columns of a matrix. Either the matrix has an inverse, with scales
    // from 1e-9 to 1e9, or all axes are exactly 0, which hides the instance.
    struct GirandoleVec3 axes[3];
    // Metres. Along each axis at most 1e9 from zero.
    struct GirandoleDVec3 translation;
} GirandolePlacement;

// What a light is chosen for: a point on a surface, a point in a volume, or a segment of a ray. The
// functions girandole_surface_point, girandole_volume_point and girandole_segment make one.
//
// Numbers that are not finite are allowed: such a point counts as far from all lights.
typedef struct GirandoleShadingPoint {
    // Metres, relative to the world's origin; for a segment, its middle.
    struct GirandoleVec3 position;
    // Unit normal of the side that is shaded; zero for a point in a volume and for a segment.
    struct GirandoleVec3 normal;
    // From the start of a segment to its end, in metres; zero for a point.
    struct GirandoleVec3 segment;
    // Only lights of instances whose mask shares a bit with this mask reach the point. All bits by default.
    uint32_t mask;
    // 1 if the surface is glossy, else 0. The following four fields are used only if it is 1.
    uint32_t is_glossy;
    // The direction to the viewer. Need not be of unit length.
    struct GirandoleVec3 view;
    // Perceptual roughness, whose square is the alpha of GGX.
    float roughness;
    // Specular reflectance at normal incidence.
    float specular;
    // Diffuse reflectance.
    float diffuse;
} GirandoleShadingPoint;

// The result of a call: 0 (`GIRANDOLE_OK`), a code below 100 of this interface, or a code from 100 on of
// the library.
//
// A code keeps its meaning in all later versions, and later versions may add codes. A call that returns
// anything but 0 has changed nothing, unless its documentation says otherwise.
// girandole_last_error_message returns a sentence about it.
//
// Codes of the library:
//   100         a number is not allowed; the message says what is
//   200 to 299  the world refuses a call, for example because of a stale key
//   600 to 699  plans for the GPU
//   700         a file is not valid, or an image or its place on a surface; the message names the line of a profile
//   1100 to 1199  bytes are no baked tree, or not a sound one
//   1300 to 1399  the pixels of a sky are refused, there is none, or portals are refused
typedef int32_t GirandoleStatus;

// The sizes of a world.
typedef struct GirandoleCounts {
    // Trees, with or without instances.
    size_t trees;
    // Instances, hidden ones included.
    size_t instances;
    // All lights: the lights of a tree count once for each of its instances, and directional lights count
    // too.
    size_t lights;
    // Directional lights.
    size_t directionals;
    // The effects that shaders should be made for: bits of GIRANDOLE_EFFECT_*.
    uint32_t effects;
    // Bytes of CPU memory that the world uses.
    size_t memory;
} GirandoleCounts;

// What an update did.
typedef struct GirandoleUpdateReport {
    // Instances that were added, moved, shown, hidden or removed since the last update.
    size_t moved_instances;
    // Trees that were refitted because their lights changed.
    size_t refit_trees;
    // Lights of these trees.
    size_t refit_lights;
    // Trees that were rebuilt.
    size_t rebuilt_trees;
    // Trees that wait for a rebuild in a later update.
    size_t waiting_trees;
    // The longest wait of a tree, in updates.
    uint64_t longest_wait;
    // The measured time of the rebuilds, in microseconds.
    double spent_us;
    // The time by which rebuilds exceeded the budget, in microseconds.
    double overrun_us;
    // The time of the refits, which are not part of the budget, in microseconds.
    double refit_us;
} GirandoleUpdateReport;

// A light at infinity, such as the moon.
typedef struct GirandoleDirectionalLight {
    // Unit vector along which the light travels.
    struct GirandoleVec3 direction;
    // Lux on a surface that faces it, linear Rec. 709.
    struct GirandoleVec3 illuminance;
} GirandoleDirectionalLight;

// A window or another opening of a room.
typedef struct GirandolePortal {
    // The middle of a parallelogram, in metres.
    struct GirandoleDVec3 center;
    // From the middle to that of one edge.
    struct GirandoleVec3 half_u;
    // From the middle to that of the next edge.
    struct GirandoleVec3 half_v;
    // The room: what the placement makes of the cube from -1 to 1 along each axis. Let it reach into the walls.
    struct GirandolePlacement room;
} GirandolePortal;

// What a texture shows beyond the sides of its image: one of GIRANDOLE_WRAP_*.
typedef uint32_t GirandoleWrap;

// An image that surfaces emit: that of a sign, or a frame of a film on a screen. Its rows go from the top
// down. Either linear or srgb is NULL.
typedef struct GirandoleTexture {
    // width * height linear colours, each channel from 0 to 1e15; or NULL.
    const struct GirandoleVec3 *linear;
    // 4 * width * height bytes; or NULL. Red, green and blue are sRGB-encoded. Alpha is ignored: texels that
    // are cut out have to be black.
    const uint8_t *srgb;
    // Columns, 1 to 32768.
    uint32_t width;
    // Rows, 1 to 32768.
    uint32_t height;
    // What lies beyond the sides, along rows and along columns: GIRANDOLE_WRAP_*.
    GirandoleWrap wrap[2];
} GirandoleTexture;

// Two numbers, such as texture coordinates.
typedef struct GirandoleVec2 {
    float x;
    float y;
} GirandoleVec2;

// A surface that emits an image or a part of one.
typedef struct GirandoleTexturedSurface {
    // The light for a texture that is white: a GIRANDOLE_LIGHT_PARALLELOGRAM or GIRANDOLE_LIGHT_TRIANGLE.
    struct GirandoleLight white;
    // Texture coordinates of three corners: the vertices of a triangle; of a parallelogram the corners at
    // -half_u - half_v, at half_u - half_v and at half_v - half_u. (0, 0) is the upper left corner of the image,
    // (1, 1) the lower right one. So {0, 1}, {1, 1}, {0, 0} is the whole image, upright if half_u points to the
    // right and half_v up.
    struct GirandoleVec2 tex_coords[3];
} GirandoleTexturedSurface;

// A light of a tree.
typedef struct GirandoleTreeLight {
    // The key of the tree.
    uint64_t tree;
    // The index of the light.
    uint32_t light;
} GirandoleTreeLight;

// When an instance requests a rebuild of its tree: one of GIRANDOLE_POLICY_*.
typedef uint32_t GirandolePolicyKind;

// A policy and its parameters.
typedef struct GirandolePolicy {
    // One of GIRANDOLE_POLICY_*.
    GirandolePolicyKind kind;
    // BOUNDED: the floor. DEVIATION: the standard deviation. RATIO: the factor. Others ignore it.
    float a;
    // BOUNDED: the ceiling. DEVIATION: the factor. Others ignore it.
    float b;
} GirandolePolicy;

// An instance of a region. girandole_region_instance makes one.
typedef struct GirandoleRegionInstance {
    // Where it is.
    struct GirandolePlacement placement;
    // When it requests rebuilds of its tree.
    struct GirandolePolicy policy;
    // The index of its tree in the region.
    uint32_t tree;
    // See girandole_world_set_enabled.
    uint32_t is_enabled;
    // See girandole_world_set_factor.
    struct GirandoleVec3 factor;
    // See girandole_world_set_mask.
    uint32_t mask;
    // See girandole_world_set_user_data.
    uint32_t user_data;
} GirandoleRegionInstance;

// What a GirandoleLightId names: one of GIRANDOLE_ID_*.
typedef uint32_t GirandoleIdKind;

// Identifies a light that can be sampled.
typedef struct GirandoleLightId {
    // The key of the instance or of the directional light; 0 for GIRANDOLE_ID_NONE.
    uint64_t key;
    // One of GIRANDOLE_ID_*.
    GirandoleIdKind kind;
    // The index in the instance's tree; 0 for other kinds.
    uint32_t light;
} GirandoleLightId;

// A light, a point on it, and the light that arrives from there without shadows.
//
// Unless a shadow ray to the point is blocked, brdf * cosine * radiance * weight estimates the reflected
// light of all lights. A blocked sample counts as black, and so does a sample without a light, whose weight
// is 0.
typedef struct GirandoleSample {
    // The light.
    struct GirandoleLightId light;
    // Unit vector from the shading point to the point on the light.
    struct GirandoleVec3 direction;
    // Metres to the light; INFINITY for a directional light.
    float dist;
    // Nits; if is_delta is 1, lux on a surface that faces the light.
    struct GirandoleVec3 radiance;
    // Density of the direction per steradian; 1 if is_delta is 1.
    float pdf;
    // The probability of the light, in (0, 1]; 0 without a light, and 1 for girandole_world_sample_lights.
    float pmf;
    // 1 / (pmf * pdf), or after resampling the weight of the sample that was kept.
    float weight;
    // For a segment, metres from its start to the point at which the light arrives.
    float along;
    // 1 for lights without size (point, spot, directional), which rays cannot hit; else 0.
    uint32_t is_delta;
    // What girandole_world_set_user_data has set for the instance.
    uint32_t user_data;
} GirandoleSample;

// What changed in a world since a reader read it last. The arrays belong to the reader, and are valid until its
// next call.
typedef struct GirandoleChanges {
    // By how much the origin moved, in metres: subtract it from positions that are kept relative to the
    // origin. 0 if it did not move, and in the first call.
    struct GirandoleDVec3 origin_shift;
    // Slots of instances that were moved, ascending.
    const uint32_t *moved_instances;
    // The number of these slots.
    size_t moved_count;
    // Slots of instances that were added, ascending.
    const uint32_t *added_instances;
    // The number of these slots.
    size_t added_count;
    // Slots that an instance was removed from, ascending.
    const uint32_t *removed_instances;
    // The number of these slots.
    size_t removed_count;
    // 1 if nothing changed, else 0.
    uint32_t is_empty;
} GirandoleChanges;

// What a buffer is bound as: one of GIRANDOLE_BUFFER_*.
typedef uint32_t GirandoleBufferUsage;

// A buffer that the engine must create.
typedef struct GirandoleNewBuffer {
    // Its number in all later plans. A planner never reuses a number.
    uint32_t id;
    // One of GIRANDOLE_BUFFER_*.
    GirandoleBufferUsage usage;
    // Bytes, a multiple of 4. The content may be undefined at first.
    uint64_t size;
    // A name for graphics debuggers, which says what the buffer holds. Valid until the process ends.
    const char *what;
} GirandoleNewBuffer;

// What a command does: one of GIRANDOLE_COMMAND_*.
typedef uint32_t GirandoleCommandKind;

// A command. Each command sees the effects of all commands before it: put a barrier between a command and
// the next one, except between writes. Fields that the kind does not use are 0 or NULL.
typedef struct GirandoleCommand {
    // One of GIRANDOLE_COMMAND_*.
    GirandoleCommandKind kind;
    // WRITE, COPY, CLEAR: the number of the buffer that changes.
    uint32_t buffer;
    // COPY: the number of the buffer that is read. DISPATCH_INDIRECT: that of the buffer with the workgroups, of
    // GIRANDOLE_BUFFER_INDIRECT.
    uint32_t source;
    // DISPATCH, DISPATCH_INDIRECT: the index of the kernel, for girandole_kernel.
    uint32_t kernel;
    // WRITE, COPY, CLEAR: the first byte that changes.
    uint64_t offset;
    // WRITE, COPY, CLEAR: how many bytes.
    uint64_t size;
    // WRITE: the new content. Belongs to the plan.
    const uint8_t *bytes;
    // DISPATCH, DISPATCH_INDIRECT: the numbers of the buffers of the kernel's bindings, in their order. Belongs to
    // the plan.
    const uint32_t *buffers;
    // DISPATCH, DISPATCH_INDIRECT: how many.
    uint32_t buffer_count;
    // DISPATCH, DISPATCH_INDIRECT: where the range of the uniform buffer starts, a multiple of 256 bytes.
    uint32_t uniform_offset;
    // DISPATCH: the number of workgroups in each dimension, at least 1.
    uint32_t workgroups[3];
} GirandoleCommand;

// What a plan holds. All arrays belong to the plan.
typedef struct GirandolePlanView {
    // Plans are numbered from 1, and must be played in this order, each exactly once.
    uint64_t number;
    // The buffers of the reservation, which the engine has made.
    const struct GirandoleNewBuffer *new_buffers;
    // How many.
    size_t new_buffer_count;
    // Brings the buffers up to date. Play it first.
    const struct GirandoleCommand *upload;
    // How many commands.
    size_t upload_count;
    // Builds the top level, and the cuts of the cells that shaders have marked. Play it after upload.
    const struct GirandoleCommand *top;
    // How many commands.
    size_t top_count;
    // The numbers of buffers to free, once the GPU has finished this frame.
    const uint32_t *freed;
    // How many.
    size_t freed_count;
    // Bytes that the writes carry.
    uint64_t bytes;
    // Trees that wait to be sent in full; until then, shaders see stand-ins or an older version of them.
    size_t waiting_trees;
} GirandolePlanView;

// The limits of a planner.
typedef struct GirandoleLimits {
    // Bytes of the largest storage buffer that the device can make and bind whole. Values below 131,072
    // count as 131,072, and values above 16 GiB as 16 GiB.
    uint64_t largest_buffer;
    // The most bytes that the buffers of nodes and lights may take together, or GIRANDOLE_NO_LIMIT.
    uint64_t tree_memory;
    // The most bytes of new trees that one frame may send, or GIRANDOLE_NO_LIMIT.
    uint64_t frame_bytes;
} GirandoleLimits;

// The cells of a planner. The shading points of a cell choose lights from a cut that they share.
typedef struct GirandoleCutOptions {
    // The edge of cells in metres, 0.01 to 10,000. After girandole_planner_set_cut_view, edges are an eighth to 32
    // times of that.
    float edge;
    // The number of cells that may have cuts, 1 to 65,536. Each takes about 2 kB of GPU memory. Where a buffer would be
    // larger than GirandoleLimits allows, half as many are made, or a quarter and so on.
    uint32_t cells;
    // How often shaders must mark a cell between two frames before it gets a cut.
    uint32_t min_marks;
    // How many larger cells learn from shadow rays which lights are visible: a power of two from 4 to 16,384, of 7.5 kB
    // each, or 0. Shaders record rays by light_record_visibility (GIRANDOLE_SHADER_LEARNS), and the next plan learns
    // from them.
    uint32_t learning_cells;
    // The edge of these cells in metres, 0.01 to 10,000.
    float learning_edge;
} GirandoleCutOptions;

// Who writes the lights of a tree: one of GIRANDOLE_SOURCE_*.
typedef uint32_t GirandoleLightSource;

// What a readback copies.
typedef struct GirandoleReadbackView {
    // The number of the buffer.
    uint32_t buffer;
    // The first byte, a multiple of 4.
    uint64_t offset;
    // How many bytes: more than 0, and a multiple of 4.
    uint64_t size;
    // The most trees that girandole_readback_apply may store.
    size_t most_trees;
} GirandoleReadbackView;

// The stage of an entry point: one of GIRANDOLE_STAGE_*.
typedef uint32_t GirandoleStage;

// An entry point of a translated shader.
typedef struct GirandoleEntryPoint {
    // Its name in the WGSL text.
    const char *name;
    // Its name in the code. It differs if the name is a word of the language.
    const char *name_in_code;
    // One of GIRANDOLE_STAGE_*.
    GirandoleStage stage;
    // The invocations of a workgroup in each dimension; 0 for vertex and fragment shaders. Metal needs them
    // for each dispatch.
    uint32_t workgroup_size[3];
} GirandoleEntryPoint;

// How a kernel binds a buffer: one of GIRANDOLE_BINDING_*.
typedef uint32_t GirandoleBindingKind;

// A row of the table of bindings of a translated shader.
typedef struct GirandoleShaderBinding {
    // The name of the variable in the WGSL text.
    const char *name;
    // The number in @group.
    uint32_t group;
    // The number in @binding.
    uint32_t binding;
    // One of GIRANDOLE_BINDING_*.
    GirandoleBindingKind kind;
    // SPIR-V: the descriptor set. HLSL: the space. 0 for MSL.
    uint32_t space;
    // SPIR-V: the binding. HLSL: the number of the register. MSL: the index of the buffer, texture or sampler.
    uint32_t index;
    // HLSL: the letter of the register: 'b', 't' or 'u'. 0 for other languages.
    char register_letter;
    // The minimum size of the buffer in bytes; 0 if the binding is not a buffer.
    uint32_t size;
} GirandoleShaderBinding;

// What a shader holds. All pointers belong to the shader.
typedef struct GirandoleShaderView {
    // The words of SPIR-V, aligned to 4 bytes; or a zero-terminated text, whose size excludes the zero.
    const void *code;
    // Bytes of the code.
    size_t size;
    // The entry points; none in an include text.
    const struct GirandoleEntryPoint *entry_points;
    // How many.
    size_t entry_point_count;
    // The bindings that the selected entry point uses, or all bindings if none was selected.
    const struct GirandoleShaderBinding *bindings;
    // How many.
    size_t binding_count;
    // MSL: the index of the buffer with the sizes of bound storage buffers whose arrays have no fixed length:
    // one u32 for each, in the order in which the text declares them. GIRANDOLE_NO_INDEX for other languages
    // and include texts.
    uint32_t sizes_index;
} GirandoleShaderView;

// A language of shaders: one of GIRANDOLE_LANGUAGE_*.
typedef uint32_t GirandoleLanguage;

// Where a binding of a WGSL text goes.
typedef struct GirandoleBindTarget {
    // The number in @group.
    uint32_t group;
    // The number in @binding.
    uint32_t binding;
    // SPIR-V: the descriptor set. HLSL: the space, at most 255. MSL: ignored.
    uint32_t space;
    // SPIR-V: the binding. HLSL: the register, whose letter follows from the kind of the binding. MSL: the
    // index of the buffer, texture or sampler, at most 254.
    uint32_t index;
} GirandoleBindTarget;

// The language of a translation, and where bindings go. Zero all fields, then set what differs.
typedef struct GirandoleTarget {
    // One of GIRANDOLE_LANGUAGE_*.
    GirandoleLanguage language;
    // The version of the language, as in 6.0; 0 and 0 for the default.
    uint32_t major_version;
    // See major_version.
    uint32_t minor_version;
    // Bits of GIRANDOLE_TRANSLATE_*.
    uint32_t flags;
    // The only entry point to translate, with everything that it uses; NULL for all entry points.
    const char *entry_point;
    // Overrides of the default places of bindings. By default the group is the space and the binding is the
    // index; for MSL, bindings get the indices from 0 on in the order of group and binding. Variables with the
    // same group and binding have the same index. None are allowed for WGSL.
    const struct GirandoleBindTarget *bindings;
    // How many.
    size_t binding_count;
} GirandoleTarget;

// A binding of a kernel.
typedef struct GirandoleKernelBinding {
    // One of GIRANDOLE_BINDING_*.
    GirandoleBindingKind kind;
    // UNIFORM: the bytes that the kernel reads from uniform_offset on. 0 for other kinds.
    uint32_t uniform_size;
} GirandoleKernelBinding;

// A compute shader of the library.
typedef struct GirandoleKernel {
    // The name of its entry point.
    const char *name;
    // Its bindings in group 0, by binding number. The first is always the uniform buffer.
    const struct GirandoleKernelBinding *bindings;
    // How many.
    size_t binding_count;
} GirandoleKernel;

// The call has succeeded.
#define GIRANDOLE_OK 0

// A pointer that must not be NULL is NULL.
#define GIRANDOLE_ERROR_NULL 1

// A number is not a valid kind, flag or index for the call.
#define GIRANDOLE_ERROR_BAD_VALUE 2

// A number of elements is larger than memory can hold.
#define GIRANDOLE_ERROR_BAD_LENGTH 3

// A pointer is not aligned for its type.
#define GIRANDOLE_ERROR_MISALIGNED 4

// The caller's array is too short. The call has stored the number of elements that it needs.
#define GIRANDOLE_ERROR_NO_SPACE 5

// A text is not UTF-8.
#define GIRANDOLE_ERROR_BAD_TEXT 6

// The library has panicked: this is a bug in it. The call has not finished. If it was given a world or a
// planner that it may change, later calls refuse that object with GIRANDOLE_ERROR_BROKEN.
#define GIRANDOLE_ERROR_PANIC 10

// An earlier call on this object has panicked: the object can only be destroyed. Also returned while another
// thread is in a call that changes the object, which the rules for threads forbid.
#define GIRANDOLE_ERROR_BROKEN 11

// The planner has a reservation: end it with girandole_planner_plan or
// girandole_planner_cancel first.
#define GIRANDOLE_ERROR_RESERVED 12

// The planner has no reservation: call girandole_planner_reserve first.
#define GIRANDOLE_ERROR_NOT_RESERVED 13

// The planner or the reader follows another world.
#define GIRANDOLE_ERROR_OTHER_WORLD 14

// A shader text is not valid WGSL. The message contains the line.
#define GIRANDOLE_ERROR_WGSL 20

// A valid shader cannot be written in the language that was asked for.
#define GIRANDOLE_ERROR_TRANSLATION 21

// The tree has no light with this index.
#define GIRANDOLE_ERROR_NO_SUCH_LIGHT 201

// No tree has this key: it was removed, or never existed.
#define GIRANDOLE_ERROR_NO_SUCH_TREE 202

// No instance has this key.
#define GIRANDOLE_ERROR_NO_SUCH_INSTANCE 203

// No directional light has this key.
#define GIRANDOLE_ERROR_NO_SUCH_DIRECTIONAL 204

// The tree still has instances.
#define GIRANDOLE_ERROR_TREE_IN_USE 205

// All instances of the tree have the policy STATIC, so its lights cannot change.
#define GIRANDOLE_ERROR_STATIC_TREE 206

// The light with this index was removed.
#define GIRANDOLE_ERROR_REMOVED_LIGHT 210

// No region has this key.
#define GIRANDOLE_ERROR_NO_SUCH_REGION 211

// A tree of the region has instances outside of it.
#define GIRANDOLE_ERROR_REGION_IN_USE 213

// A light of the tree has a profile, so no kernel can write its lights.
#define GIRANDOLE_ERROR_PROFILE_ON_GPU 216

// A buffer would outgrow the limits of the planner. The changes are kept for the next call.
#define GIRANDOLE_ERROR_FULL 600

// A plan was played twice, or an earlier plan was skipped.
#define GIRANDOLE_ERROR_OUT_OF_ORDER 604

// A point that emits equally in all directions. Emission in candela.
#define GIRANDOLE_LIGHT_POINT 0

// A point that emits into a cone, with the falloff of KHR_lights_punctual. Emission in candela.
#define GIRANDOLE_LIGHT_SPOT 1

// A parallelogram that emits evenly from the side to which half_u x half_v points. Emission in nits.
#define GIRANDOLE_LIGHT_PARALLELOGRAM 2

// A triangle that emits evenly from the side on which its vertices appear counter-clockwise. Emission in
// nits.
#define GIRANDOLE_LIGHT_TRIANGLE 3

// A sphere that emits evenly outward. Emission in nits.
#define GIRANDOLE_LIGHT_SPHERE 4

// A point with a photometric profile. Emission as a factor of its candela.
#define GIRANDOLE_LIGHT_PROFILE 5

// Once the tree has become noisy, its rebuild shares the budget with the rebuilds of all other trees. The
// default.
#define GIRANDOLE_POLICY_BUDGETED 0

// The lights never change: edits of them are refused.
#define GIRANDOLE_POLICY_STATIC 1

// The tree is refitted and never rebuilt.
#define GIRANDOLE_POLICY_REFIT_ONLY 2

// As BUDGETED, with bounds on the excess noise: a is the floor and b the ceiling.
#define GIRANDOLE_POLICY_BOUNDED 3

// Requests a rebuild when the splitting cost exceeds its minimum since the last rebuild by more than a * b.
#define GIRANDOLE_POLICY_DEVIATION 4

// Requests a rebuild when the splitting cost exceeds a times its minimum since the last rebuild.
#define GIRANDOLE_POLICY_RATIO 5

// Requests an urgent rebuild whenever the lights change.
#define GIRANDOLE_POLICY_ALWAYS_REBUILD 6

// The image again.
#define GIRANDOLE_WRAP_REPEAT 0

// The image again, each copy mirrored.
#define GIRANDOLE_WRAP_MIRROR 1

// The texels at its sides.
#define GIRANDOLE_WRAP_CLAMP 2

// No light: a sample that counts as black.
#define GIRANDOLE_ID_NONE 0

// A light of an instance.
#define GIRANDOLE_ID_INSTANCE 1

// A directional light.
#define GIRANDOLE_ID_DIRECTIONAL 2

// A uniform buffer that plans also write. Vulkan: UNIFORM_BUFFER, TRANSFER_DST.
#define GIRANDOLE_BUFFER_UNIFORM 0

// A storage buffer that plans also write, copy from, copy to and clear. Vulkan: STORAGE_BUFFER,
// TRANSFER_SRC, TRANSFER_DST.
#define GIRANDOLE_BUFFER_STORAGE 1

// A storage buffer that also holds the workgroups of dispatches. Vulkan: INDIRECT_BUFFER too.
#define GIRANDOLE_BUFFER_INDIRECT 2

// Overwrites size bytes of buffer, from offset on, with bytes. Offset and size are multiples of 4.
#define GIRANDOLE_COMMAND_WRITE 0

// Copies the first size bytes of source to the start of buffer. The size is a multiple of 4.
#define GIRANDOLE_COMMAND_COPY 1

// Sets size bytes of buffer, from offset on, to zero. Both are multiples of 4.
#define GIRANDOLE_COMMAND_CLEAR 2

// Runs kernel with buffers, at uniform_offset in the first of them.
#define GIRANDOLE_COMMAND_DISPATCH 3

// The same with as many workgroups as source holds: three 32-bit words from its first byte on.
#define GIRANDOLE_COMMAND_DISPATCH_INDIRECT 4

// Calls of this interface.
#define GIRANDOLE_SOURCE_CPU 0

// A kernel of the engine, in each frame. The lights keep about the same neighbours, as the triangles of a
// skinned mesh do: a refit on the GPU follows them.
#define GIRANDOLE_SOURCE_GPU_MESH 1

// A kernel of the engine, in each frame. The lights mingle, come and go, as particles do: each of them is a
// leaf of the top level, which is built anew in each frame.
#define GIRANDOLE_SOURCE_GPU_PARTICLES 2

// A uniform buffer. In a kernel its offset changes from dispatch to dispatch.
#define GIRANDOLE_BINDING_UNIFORM 0

// A whole storage buffer that is only read.
#define GIRANDOLE_BINDING_READ 1

// A whole storage buffer that is read and written.
#define GIRANDOLE_BINDING_READ_WRITE 2

// A texture, sampler or anything else. Kernels have none; an engine's own shader may.
#define GIRANDOLE_BINDING_OTHER 3

// WGSL: the text is checked and returned unchanged.
#define GIRANDOLE_LANGUAGE_WGSL 0

// SPIR-V for Vulkan, versions 1.0 to 1.6; 1.3 by default, which Vulkan 1.1 accepts.
#define GIRANDOLE_LANGUAGE_SPIRV 1

// HLSL, shader models 5.1 and 6.0 to 6.7; 6.0 by default. Without samplers.
#define GIRANDOLE_LANGUAGE_HLSL 2

// MSL, versions 1.0 to 1.2, 2.0 to 2.4, 3.0 and 3.1; 2.1 by default.
#define GIRANDOLE_LANGUAGE_MSL 3

// A compute shader.
#define GIRANDOLE_STAGE_COMPUTE 0

// A vertex shader.
#define GIRANDOLE_STAGE_VERTEX 1

// A fragment shader.
#define GIRANDOLE_STAGE_FRAGMENT 2

// Any other stage.
#define GIRANDOLE_STAGE_OTHER 3

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

// Returns a sentence about the last call of this thread that returned anything but 0: what was given, and
// what is allowed. Empty if there was none.
//
// The text is UTF-8, and is valid until the next call of this thread that returns anything but 0, or until
// the thread ends. Calls that succeed leave it as it is.
const char *girandole_last_error_message(void);

// Returns a point light without a range. candela: intensity per channel. Checks nothing.
struct GirandoleLight girandole_point_light(struct GirandoleVec3 position, struct GirandoleVec3 candela);

// Returns a spot light without a range. direction: unit vector; angles in radians from it. Checks nothing.
struct GirandoleLight girandole_spot_light(struct GirandoleVec3 position,
                                           struct GirandoleVec3 direction,
                                           float inner_angle,
                                           float outer_angle,
                                           struct GirandoleVec3 candela);

// Returns a one-sided parallelogram with the edges 2 * half_u and 2 * half_v. nits: radiance per channel.
// Checks nothing.
struct GirandoleLight girandole_parallelogram_light(struct GirandoleVec3 center,
                                                    struct GirandoleVec3 half_u,
                                                    struct GirandoleVec3 half_v,
                                                    struct GirandoleVec3 nits);

// Returns a one-sided triangle. nits: radiance per channel. Checks nothing.
struct GirandoleLight girandole_triangle_light(struct GirandoleVec3 a,
                                               struct GirandoleVec3 b,
                                               struct GirandoleVec3 c,
                                               struct GirandoleVec3 nits);

// Returns a sphere. radius in metres. nits: radiance per channel. Checks nothing.
struct GirandoleLight girandole_sphere_light(struct GirandoleVec3 center,
                                             float radius,
                                             struct GirandoleVec3 nits);

// Returns a point light with a profile. rotation: unit quaternion. factor: of the candela of the
// profile, per channel. Checks nothing.
struct GirandoleLight girandole_profile_light(struct GirandoleVec3 position,
                                              struct GirandoleVec4 rotation,
                                              uint64_t profile,
                                              struct GirandoleVec3 factor);

// Returns a placement that only translates, in metres. Checks nothing.
struct GirandolePlacement girandole_placement_at(double x, double y, double z);

// Returns a point on a matte surface. normal: unit vector to the side that is shaded. Checks nothing.
struct GirandoleShadingPoint girandole_surface_point(struct GirandoleVec3 position,
                                                     struct GirandoleVec3 normal);

// Returns a point in a volume, which light may reach from all sides. Checks nothing.
struct GirandoleShadingPoint girandole_volume_point(struct GirandoleVec3 position);

// Returns the segment of a ray from start along direction, a unit vector, of a length in metres. Checks
// nothing.
struct GirandoleShadingPoint girandole_segment(struct GirandoleVec3 start,
                                               struct GirandoleVec3 direction,
                                               float length);

// Stores where the bytes of a blob are, and how many. They are valid until the blob is destroyed.
GirandoleStatus girandole_blob_bytes(const struct GirandoleBlob *blob, const uint8_t **bytes, size_t *size);

// Frees a blob. NULL is allowed.
void girandole_blob_destroy(struct GirandoleBlob *blob);

// Returns the version of the library. A program should compare it with GIRANDOLE_VERSION, the version of the
// header that it was compiled with.
uint32_t girandole_version(void);

// Creates an empty world. Destroy it with girandole_world_destroy.
GirandoleStatus girandole_world_create(struct GirandoleWorld **world);

// Destroys a world and everything in it. NULL is allowed.
void girandole_world_destroy(struct GirandoleWorld *world);

// Stores the sizes of a world. Cheap.
GirandoleStatus girandole_world_counts(const struct GirandoleWorld *world, struct GirandoleCounts *counts);

// Brings trees up to date with the edits since the last call, and rebuilds noisy trees within a time budget.
// Call it once a frame.
//
// budget_us: microseconds for rebuilds. 0 rebuilds nothing, INFINITY rebuilds every tree that would gain
// from it; negative values and NaN are refused. report may be NULL.
GirandoleStatus girandole_world_update(struct GirandoleWorld *world,
                                       double budget_us,
                                       struct GirandoleUpdateReport *report);

// Sets whether trees that do not fit into a frame may be built on another thread: 1 for yes, 0 for no.
GirandoleStatus girandole_world_set_background_builds(struct GirandoleWorld *world, uint32_t are_allowed);

// Sets the kinds of sampling that the world uses: bits of GIRANDOLE_SAMPLING_*. None at first.
GirandoleStatus girandole_world_set_sampling(struct GirandoleWorld *world, uint32_t bits);

// Keeps the origin, which shading points are relative to, near a position in metres: once it is more than 1024 m away
// along an axis, the origin moves to the nearest multiple of 1024 m. Call it with the camera before the reservation of
// each frame.
GirandoleStatus girandole_world_set_origin_near(struct GirandoleWorld *world,
                                                struct GirandoleDVec3 position);

// Stores the origin, in metres.
GirandoleStatus girandole_world_origin(const struct GirandoleWorld *world, struct GirandoleDVec3 *origin);

// Sets the position of the camera, in metres. Call it before the reservation of a frame. Rebuilds of
// nearby trees get more weight.
GirandoleStatus girandole_world_set_viewpoint(struct GirandoleWorld *world, struct GirandoleDVec3 viewpoint);

// Adds a directional light and stores its key.
GirandoleStatus girandole_world_add_directional(struct GirandoleWorld *world,
                                                const struct GirandoleDirectionalLight *light,
                                                uint64_t *directional);

// Changes a directional light.
GirandoleStatus girandole_world_set_directional(struct GirandoleWorld *world,
                                                uint64_t directional,
                                                const struct GirandoleDirectionalLight *light);

// Removes a directional light.
GirandoleStatus girandole_world_remove_directional(struct GirandoleWorld *world, uint64_t directional);

// Reads an IES file (LM-63 of 1986 to 2019) and stores its profile: a number that is the same for equal profiles in
// all processes. The profile is kept as long as the process runs, once for equal files. Baked trees
// with such lamps are loaded after their profiles.
GirandoleStatus girandole_profile_from_ies(const uint8_t *bytes,
                                           size_t size,
                                           uint64_t *profile);

// Reads a EULUMDAT file, as girandole_profile_from_ies does.
GirandoleStatus girandole_profile_from_eulumdat(const uint8_t *bytes, size_t size, uint64_t *profile);

// Makes an equirectangular map the sky of the world and stores the key of its instance, which stays the same when
// another map comes. pixels: rows from the zenith (+Y) to the nadir, in nits; the middle of the map is at +X. The
// placement of the instance turns the map, a factor makes it brighter or darker, a mask chooses who sees it, and
// girandole_world_remove_instance removes it.
GirandoleStatus girandole_world_set_sky(struct GirandoleWorld *world,
                                        uint32_t width,
                                        uint32_t height,
                                        const struct GirandoleVec3 *map,
                                        uint64_t *instance);

// As girandole_world_set_sky, but from the bytes of a Radiance HDR file, whose numbers count as nits. Bytes of any
// origin are safe: damaged ones are refused with 700. Takes at most some 400 bytes of memory for each byte of
// the file.
GirandoleStatus girandole_world_set_sky_hdr(struct GirandoleWorld *world,
                                            const uint8_t *bytes,
                                            size_t size,
                                            uint64_t *instance);

// Changes a part of the map: width columns from column on, and height rows from row on. part: its pixels in nits, in
// rows from the top down. Returns 1301 for a pixel that is refused, 1302 for a part that leaves the map, and 1303 for
// a world without a sky.
GirandoleStatus girandole_world_set_sky_part(struct GirandoleWorld *world,
                                             uint32_t column,
                                             uint32_t row,
                                             uint32_t width,
                                             uint32_t height,
                                             const struct GirandoleVec3 *part);

// Sets the openings through which alone the sky reaches the points of their rooms, in place of those that were set
// before. At most 32; 0 removes them. Returns 1304 for more, and 1305 for a portal that is refused.
GirandoleStatus girandole_world_set_portals(struct GirandoleWorld *world,
                                            const struct GirandolePortal *portals,
                                            size_t count);

// Cuts surfaces into parts, smaller where the texels differ. Parts are surfaces too, and
// girandole_texture_lights makes their lights. Dark parts are among them, so a film can light them later.
//
// Surfaces are cut by four, the noisiest part first. The call ends when the texels within parts add a relative
// standard deviation of at most noise to a sample of all that the surfaces emit, or when another cut would need
// more than capacity parts. A noise of 0.3 is little beside the noise of shadows and of distances.
//
// parts has room for capacity elements. count gets the number of parts. If the surfaces alone are more than
// capacity, count gets their number, and the call stores nothing else and returns GIRANDOLE_ERROR_NO_SPACE.
// Returns 700 for an image without texels or with more than 32768 rows or columns, for a texel that is
// refused, and for texture coordinates that are not finite. Takes O(texels * log(parts)).
GirandoleStatus girandole_texture_split(const struct GirandoleTexture *image,
                                        const struct GirandoleTexturedSurface *surface_list,
                                        size_t surface_count,
                                        float noise,
                                        struct GirandoleTexturedSurface *parts,
                                        size_t capacity,
                                        size_t *count);

// Stores a light for each part, which emits the average of the part's texels. The parts may come from another
// image, for example from another frame of a film, and they may be surfaces that were not cut.
//
// lights has room for count elements. The codes are those of girandole_texture_split. Takes O(texels).
GirandoleStatus girandole_texture_lights(const struct GirandoleTexture *image,
                                         const struct GirandoleTexturedSurface *parts,
                                         size_t count,
                                         struct GirandoleLight *lights);

// Builds a tree over lights, adds it and stores its key, which is never 0. The lights have the indices 0 to
// count - 1. A tree without instances contributes no light. Takes O(n log n).
GirandoleStatus girandole_world_add_tree(struct GirandoleWorld *world,
                                         const struct GirandoleLight *light_list,
                                         size_t count,
                                         uint64_t *tree);

// Adds a tree from the bytes of girandole_world_bake_tree, without a build, and stores its key. Bytes of any
// origin are safe: damaged ones are refused.
GirandoleStatus girandole_world_add_baked(struct GirandoleWorld *world,
                                          const uint8_t *bytes,
                                          size_t size,
                                          uint64_t *tree);

// Stores a tree as bytes that girandole_world_add_baked reads, about 100 bytes per light. The bytes are the
// same on every machine. Destroy the blob with girandole_blob_destroy.
GirandoleStatus girandole_world_bake_tree(const struct GirandoleWorld *world,
                                          uint64_t tree_key,
                                          struct GirandoleBlob **blob);

// Removes a tree that has no instances.
GirandoleStatus girandole_world_remove_tree(struct GirandoleWorld *world, uint64_t tree);

// Builds a tree anew at once, regardless of budgets.
GirandoleStatus girandole_world_rebuild_tree(struct GirandoleWorld *world, uint64_t tree);

// Stores two counts for a tree as of the last update: the lights that exist, and the indices, which include
// the indices of removed lights. Either pointer may be NULL.
GirandoleStatus girandole_world_tree_lights(const struct GirandoleWorld *world,
                                            uint64_t tree_key,
                                            size_t *existing,
                                            size_t *indices);

// Changes lights of a tree in place, at the next update: light indices[i] becomes light_list[i], for i below
// count. If a light is given twice, its last change counts. All instances of the tree change.
GirandoleStatus girandole_world_set_lights(struct GirandoleWorld *world,
                                           uint64_t tree,
                                           const uint32_t *indices,
                                           const struct GirandoleLight *light_list,
                                           size_t count);

// Adds lights to a tree at the next update, without a build, and stores their indices. The array has room
// for count indices, which may be passed to girandole_world_set_lights immediately.
GirandoleStatus girandole_world_add_lights(struct GirandoleWorld *world,
                                           uint64_t tree,
                                           const struct GirandoleLight *light_list,
                                           size_t count,
                                           uint32_t *indices);

// Removes lights from a tree at the next update. The indices of other lights do not change. An index that
// is given twice, or that has no light, is refused.
GirandoleStatus girandole_world_remove_lights(struct GirandoleWorld *world,
                                              uint64_t tree,
                                              const uint32_t *indices,
                                              size_t count);

// Replaces all lights of a tree at once and builds it. Samples of the tree that were kept from earlier
// frames become invalid.
GirandoleStatus girandole_world_replace_lights(struct GirandoleWorld *world,
                                               uint64_t tree,
                                               const struct GirandoleLight *light_list,
                                               size_t count);

// Lists the lights that the last update removed from trees. Discard kept samples of these lights.
//
// light_list has room for capacity elements, and may be NULL if capacity is 0. count gets the number of
// elements; if it is above capacity, the call stores nothing else and returns GIRANDOLE_ERROR_NO_SPACE.
GirandoleStatus girandole_world_removed_lights(const struct GirandoleWorld *world,
                                               struct GirandoleTreeLight *light_list,
                                               size_t capacity,
                                               size_t *count);

// Adds an instance of a tree and stores its key, which is never 0. policy may be NULL for
// GIRANDOLE_POLICY_BUDGETED.
GirandoleStatus girandole_world_add_instance(struct GirandoleWorld *world,
                                             uint64_t tree,
                                             const struct GirandolePlacement *placement,
                                             const struct GirandolePolicy *policy,
                                             uint64_t *instance);

// Removes an instance.
GirandoleStatus girandole_world_remove_instance(struct GirandoleWorld *world, uint64_t instance);

// Moves an instance, at once. Axes that are all 0 hide it.
GirandoleStatus girandole_world_move_instance(struct GirandoleWorld *world,
                                              uint64_t instance,
                                              const struct GirandolePlacement *placement);

// Moves instances[i] to placements[i], for i below count: all of them or, if one move is refused, none. If
// an instance is given several times, its last move counts. Large batches are moved by several threads.
GirandoleStatus girandole_world_move_instances(struct GirandoleWorld *world,
                                               const uint64_t *instances,
                                               const struct GirandolePlacement *placements,
                                               size_t count);

// Switches all lights of an instance on (1) or off (0).
GirandoleStatus girandole_world_set_enabled(struct GirandoleWorld *world,
                                            uint64_t instance,
                                            uint32_t is_enabled);

// Multiplies the emission of an instance by a linear colour: 0 to 10,000 per channel.
GirandoleStatus girandole_world_set_factor(struct GirandoleWorld *world,
                                           uint64_t instance,
                                           struct GirandoleVec3 factor);

// Limits the lights of an instance to shading points whose mask shares a bit with this mask.
GirandoleStatus girandole_world_set_mask(struct GirandoleWorld *world, uint64_t instance, uint32_t mask);

// Sets the number that light_user_data returns in shaders, and that samples have as user_data.
GirandoleStatus girandole_world_set_user_data(struct GirandoleWorld *world,
                                              uint64_t instance,
                                              uint32_t user_data);

// Sets when an instance requests a rebuild of its tree.
GirandoleStatus girandole_world_set_policy(struct GirandoleWorld *world,
                                           uint64_t instance,
                                           const struct GirandolePolicy *policy);

// Stores the slot of an instance, which is its number in shaders.
GirandoleStatus girandole_world_instance_slot(const struct GirandoleWorld *world,
                                              uint64_t instance,
                                              uint32_t *slot);

// Stores the key of the instance in a slot; 0 if there is none.
GirandoleStatus girandole_world_instance_at(const struct GirandoleWorld *world,
                                            uint32_t slot,
                                            uint64_t *instance);

// Returns an instance of the tree with this index in a region. The instance is enabled and has a factor of
// 1, all bits of the mask, and GIRANDOLE_POLICY_BUDGETED. Checks nothing.
struct GirandoleRegionInstance girandole_region_instance(uint32_t tree, struct GirandolePlacement placement);

// Creates an empty region. Destroy it with girandole_region_destroy.
GirandoleStatus girandole_region_create(struct GirandoleRegion **region);

// Builds a tree on the calling thread, adds it to the region, and stores its index there.
GirandoleStatus girandole_region_add_tree(struct GirandoleRegion *region,
                                          const struct GirandoleLight *light_list,
                                          size_t count,
                                          uint32_t *tree);

// As girandole_region_add_tree, but from the bytes of girandole_world_bake_tree and without a build.
GirandoleStatus girandole_region_add_baked(struct GirandoleRegion *region,
                                           const uint8_t *bytes,
                                           size_t size,
                                           uint32_t *tree);

// Adds a tree that is in the world already, by its key, and stores its index in the region. The key is
// checked when the region is added.
GirandoleStatus girandole_region_add_world_tree(struct GirandoleRegion *region, uint64_t key, uint32_t *tree);

// Adds an instance to a region.
GirandoleStatus girandole_region_add_instance(struct GirandoleRegion *region,
                                              const struct GirandoleRegionInstance *instance);

// Adds everything in a region to a world, and stores the key that the region has in the world. The region
// object is empty afterwards, and may be filled again. If the call is refused, it keeps its content.
GirandoleStatus girandole_world_add_region(struct GirandoleWorld *world,
                                           struct GirandoleRegion *region,
                                           uint64_t *key);

// Removes all trees and instances that were added with a region, except any that were removed earlier.
// Refused if an instance outside of the region uses one of its trees.
GirandoleStatus girandole_world_remove_region(struct GirandoleWorld *world, uint64_t region);

// Lists the keys of the trees of a region, in the order of their indices.
//
// keys has room for capacity elements, and may be NULL if capacity is 0. count gets the number of elements; if
// it is above capacity, the call stores nothing else and returns GIRANDOLE_ERROR_NO_SPACE.
GirandoleStatus girandole_world_region_trees(const struct GirandoleWorld *world,
                                             uint64_t region,
                                             uint64_t *keys,
                                             size_t capacity,
                                             size_t *count);

// Lists the keys of the instances of a region, in the order in which they were added to it. The arguments
// are as for girandole_world_region_trees.
GirandoleStatus girandole_world_region_instances(const struct GirandoleWorld *world,
                                                 uint64_t region,
                                                 uint64_t *keys,
                                                 size_t capacity,
                                                 size_t *count);

// Frees a region object. What it has added to a world stays in the world. NULL is allowed.
void girandole_region_destroy(struct GirandoleRegion *region);

// Chooses a light and a point on it for each shading point.
//
// Lights are as of the last update. The first call after a change builds the top level, in O(n log n) for n
// instances. Any number of threads may sample one world at once. The arrays:
//
//   points   count shading points
//   u        4 * count random numbers, uniform in [0, 1): two choose the light, two the point. The same numbers
//            give the same light. Numbers outside are clamped, and NaN counts as 0.
//   samples  room for count samples
//
// A sample takes one to two microseconds.
GirandoleStatus girandole_world_sample(const struct GirandoleWorld *world,
                                       const struct GirandoleShadingPoint *shading_points,
                                       const float *u,
                                       size_t count,
                                       struct GirandoleSample *samples);

// As girandole_world_sample, and keeps one of several candidates in proportion to its unshadowed light. A
// single shadow ray then gives about as little noise as several. The estimate is brdf * cosine * radiance *
// weight.
//
// Of 0 candidates none is kept. u: 5 * count random numbers, of which the fifth of each sample chooses among
// the candidates.
GirandoleStatus girandole_world_resample(const struct GirandoleWorld *world,
                                         uint32_t candidates,
                                         const struct GirandoleShadingPoint *shading_points,
                                         const float *u,
                                         size_t count,
                                         struct GirandoleSample *samples);

// Stores the probability with which girandole_world_sample chooses light_ids[i] for
// shading_points[i]. 0 for a light that does not exist, is dark or cannot reach the point.
GirandoleStatus girandole_world_pmf(const struct GirandoleWorld *world,
                                    const struct GirandoleShadingPoint *shading_points,
                                    const struct GirandoleLightId *light_ids,
                                    size_t count,
                                    float *pmf);

// Stores numbers that change when the names of light_ids[i] come to mean other lights, as light_generation
// returns them in shaders: at least 1, or 0 for a stale key, an instance that is not shown, and an index
// beyond those of the tree.
GirandoleStatus girandole_world_generations(const struct GirandoleWorld *world,
                                            const struct GirandoleLightId *light_ids,
                                            size_t count,
                                            uint32_t *generations);

// Stores the density with which girandole_world_sample chooses light_ids[i] and the direction to hits[i], a
// point on that light in metres relative to the origin: pmf * pdf, per steradian. For multiple importance
// sampling of rays that hit lights.
GirandoleStatus girandole_world_pdf(const struct GirandoleWorld *world,
                                    const struct GirandoleShadingPoint *shading_points,
                                    const struct GirandoleLightId *light_ids,
                                    const struct GirandoleVec3 *hits,
                                    size_t count,
                                    float *pdf);

// Chooses a point on light_ids[i] as seen from shading_points[i], for sums over all lights: the pmf of these
// samples is 1. u: 2 * count random numbers. If no light arrives from the chosen point, the sample has no
// light and a weight of 0.
GirandoleStatus girandole_world_sample_lights(const struct GirandoleWorld *world,
                                              const struct GirandoleShadingPoint *shading_points,
                                              const struct GirandoleLightId *light_ids,
                                              const float *u,
                                              size_t count,
                                              struct GirandoleSample *samples);

// Lists all lights that can be sampled. The lights of a tree are listed once for each of its instances.
//
// light_ids has room for capacity elements, and may be NULL if capacity is 0. count gets the number of
// elements; if it is above capacity, the call stores nothing else and returns GIRANDOLE_ERROR_NO_SPACE.
GirandoleStatus girandole_world_lights(const struct GirandoleWorld *world,
                                       struct GirandoleLightId *light_ids,
                                       size_t capacity,
                                       size_t *count);

// Creates a reader that has seen nothing. Destroy it with girandole_reader_destroy.
GirandoleStatus girandole_reader_create(struct GirandoleReader **reader);

// Stores what changed in the world since the last call for this reader; in the first call, that all instances
// were added. Once a frame, after girandole_world_update, or in any frames.
GirandoleStatus girandole_reader_read(struct GirandoleReader *reader,
                                      const struct GirandoleWorld *world,
                                      struct GirandoleChanges *changes);

// Frees a reader. NULL is allowed.
void girandole_reader_destroy(struct GirandoleReader *reader);

// Stores what a plan holds. The arrays are valid until the plan is destroyed.
GirandoleStatus girandole_plan_view(const struct GirandolePlan *plan, struct GirandolePlanView *view);

// Frees a plan. NULL is allowed.
void girandole_plan_destroy(struct GirandolePlan *plan);

// Creates a cursor that expects the plan with number 1. Destroy it with girandole_cursor_destroy.
GirandoleStatus girandole_cursor_create(struct GirandoleCursor **cursor);

// Call it before each plan is played. Returns GIRANDOLE_ERROR_OUT_OF_ORDER if the plan was played before, or
// if an earlier plan was skipped; do not play the plan then.
GirandoleStatus girandole_cursor_advance(struct GirandoleCursor *cursor, const struct GirandolePlan *plan);

// Lets the cursor expect this plan next, after girandole_planner_lose. Then call girandole_cursor_advance
// for the plan.
GirandoleStatus girandole_cursor_skip_to(struct GirandoleCursor *cursor, const struct GirandolePlan *plan);

// Frees a cursor. NULL is allowed.
void girandole_cursor_destroy(struct GirandoleCursor *cursor);

// Makes cells follow the pixels of a camera from the next plan on. Call it in each frame in which the camera has
// moved. Without it, or with a pixel of 0, all cells have the same size. Views of several cameras may share the
// cells of one.
//
// eye is the position of the camera as for girandole_world_set_viewpoint, in metres. pixel is the size of a pixel at a
// distance of one metre, in metres.
GirandoleStatus girandole_planner_set_cut_view(struct GirandolePlanner *planner,
                                               struct GirandoleDVec3 eye,
                                               float pixel);

// Forgets what cells have learnt from shadow rays, from the next plan on: for another scene.
GirandoleStatus girandole_planner_forget_visibility(struct GirandolePlanner *planner);

// Creates a planner for a device that holds nothing yet. limits may be NULL for a largest buffer of 128 MiB
// and no other limits. cuts may be NULL for 32,768 cells of 0.25 m that need 8 marks and learn nothing, which take 67 MB
// of GPU memory. Returns 100 for a wrong edge or number of cells. Destroy it with girandole_planner_destroy.
GirandoleStatus girandole_planner_create(const struct GirandoleLimits *limits,
                                         const struct GirandoleCutOptions *cuts,
                                         struct GirandolePlanner **planner);

// Destroys a planner, and its reservation if it has one. NULL is allowed.
void girandole_planner_destroy(struct GirandolePlanner *planner);

// Sets the limits of memory and of bytes per frame from the next plan on: bytes, or GIRANDOLE_NO_LIMIT.
GirandoleStatus girandole_planner_set_limits(struct GirandolePlanner *planner,
                                             uint64_t tree_memory,
                                             uint64_t frame_bytes);

// Sets whether the buffers of the last frame are kept for light_reservoir_sample_previous (1) or dropped (0), from the
// next plan on.
GirandoleStatus girandole_planner_keep_previous(struct GirandolePlanner *planner,
                                                uint32_t is_kept);

// Reports that a plan was not played, or only in part, so that the device may lack some of what was planned.
// The next plan sends everything again, into the same buffers; pass it to girandole_cursor_skip_to.
GirandoleStatus girandole_planner_lose(struct GirandolePlanner *planner);

// Reports that of the last plan only the commands in top were not played. The next plan then builds the top
// level again.
GirandoleStatus girandole_planner_lose_top(struct GirandolePlanner *planner);

// Stores the numbers of the buffers that the engine's shaders bind after the last plan, at the bindings 0 to
// 7 of their group: a uniform buffer of 64 bytes, five storage buffers that are only read, one that is also
// written, and the lights of the last frame, which are only read; each is bound whole. UINT32_MAX before the first plan,
// and for a last frame that is not kept. buffers has room for GIRANDOLE_SHADER_BUFFERS numbers.
GirandoleStatus girandole_planner_bindings(struct GirandolePlanner *planner,
                                           uint32_t *buffers);

// Stores the effects that shaders must support to read the buffers of the last plan: bits of
// GIRANDOLE_EFFECT_*. All before the first plan.
GirandoleStatus girandole_planner_effects(struct GirandolePlanner *planner, uint32_t *effects);

// Stores the total size of all buffers, in bytes.
GirandoleStatus girandole_planner_memory(struct GirandolePlanner *planner, uint64_t *bytes);

// Lets a kernel of the engine write the lights of a tree on the GPU, or calls of this interface again.
//
// The tree is added with as many lights as the kernel may write, of the kinds, ranges, sides and opening
// angles that they keep. In each frame, the kernel runs between the commands in upload and those in top of
// the plan, and calls the functions of girandole_shader_sources. top then refits the tree from what was
// written.
//
// Calls that sample on the CPU see the lights as they were last set or read back: set them where the lights
// are about. Refused with GIRANDOLE_ERROR_PROFILE_ON_GPU if a light of the tree has a profile.
GirandoleStatus girandole_world_set_light_source(struct GirandoleWorld *world,
                                                 uint64_t tree,
                                                 GirandoleLightSource source);

// Stores who writes the lights of a tree, one of GIRANDOLE_SOURCE_*, and the number by which kernels know its
// source: GIRANDOLE_NO_INDEX for GIRANDOLE_SOURCE_CPU. The number stays the same while the tree has a source.
// Either pointer may be NULL.
GirandoleStatus girandole_world_light_source(const struct GirandoleWorld *world,
                                             uint64_t tree,
                                             GirandoleLightSource *source,
                                             uint32_t *number);

// Stores how many writes of lights of a tree kernels were refused, as far as readbacks have told so far: see
// girandole_planner_measures. 0 for a tree without a source.
GirandoleStatus girandole_world_refused_writes(const struct GirandoleWorld *world,
                                               uint64_t tree,
                                               uint64_t *count);

// Makes the WGSL text for kernels that write lights: light_source_count, light_put_point, light_put_spot,
// light_put_rectangle, light_put_triangle, light_put_sphere, light_put_dark and light_put_new. The text says
// what they do. Join it with the engine's kernel, and pass both to girandole_translate. It binds the buffers of
// girandole_planner_source_bindings at 0 and 1 of the group, 0 to 254, and must not be joined with the text of
// girandole_shader_include. Destroy the shader with girandole_shader_destroy.
GirandoleStatus girandole_shader_sources(uint32_t group,
                                         struct GirandoleShader **shader);

// Stores the numbers of the buffers that kernels bind to write lights after the last plan, at the bindings 0
// and 1 of their group: two storage buffers that are read and written, each bound whole. UINT32_MAX until the
// world has a tree with a source. buffers has room for GIRANDOLE_SOURCE_BUFFERS numbers. Any plan may replace
// the buffers.
GirandoleStatus girandole_planner_source_bindings(struct GirandolePlanner *planner, uint32_t *buffers);

// Stores the number of numbers of sources, in use or not, after the last plan.
GirandoleStatus girandole_planner_source_count(struct GirandolePlanner *planner, uint32_t *count);

// Makes a readback of what the refit in the last plan finds out about trees with a source: the numbers from
// first on, at most most of them, 32 bytes each. Stores NULL if there are none. Copy the range after the commands
// in top. Destroy the readback with girandole_readback_destroy.
GirandoleStatus girandole_planner_measures(struct GirandolePlanner *planner,
                                           uint32_t first,
                                           uint32_t most,
                                           struct GirandoleReadback **readback);

// Makes a readback of where kernels have moved some parts of a tree with a source, at most most of them, 80 bytes each:
// each time those that follow on the last ones, of all trees in turn. Stores NULL if the GPU holds no such tree. Copy
// the range after the commands in top. Destroy the readback with girandole_readback_destroy.
GirandoleStatus girandole_planner_source_parts(struct GirandolePlanner *planner,
                                               uint32_t most,
                                               struct GirandoleReadback **readback);

// Makes a readback of the lights of a tree with a source, for a rebuild: of the trees that
// girandole_readback_apply stores. Stores NULL if the tree has no source, or if the GPU does not hold it whole.
// Copy the range after the kernel of the engine has run. Destroy the readback with girandole_readback_destroy.
GirandoleStatus girandole_planner_source_lights(struct GirandolePlanner *planner,
                                                uint64_t tree,
                                                struct GirandoleReadback **readback);

// Stores the range that a readback copies.
GirandoleStatus girandole_readback_view(const struct GirandoleReadback *readback,
                                        struct GirandoleReadbackView *view);

// Tells the world what the bytes of a readback say, before girandole_world_update. What was removed or rebuilt
// meanwhile is left out.
//
// Measures: policies and the scheduler of the world learn how good the trees are. Stores the keys of trees whose
// policies request a rebuild, and in count how many. Read the lights of these trees back too, unless such a
// readback is under way. trees has room for capacity keys: at least most_trees of the view, or the call is
// refused with GIRANDOLE_ERROR_NO_SPACE and stores this number in count.
//
// Parts: the top level has nodes where they are from the next update on. Stores no tree.
//
// Lights: the tree's lights are set as the bytes say, so that it is rebuilt from these. Stores no tree.
//
// size is that of the view. Bytes that no GPU has written do no harm.
GirandoleStatus girandole_readback_apply(const struct GirandoleReadback *readback,
                                         struct GirandoleWorld *world,
                                         const uint8_t *bytes,
                                         size_t size,
                                         uint64_t *trees,
                                         size_t capacity,
                                         size_t *count);

// Frees a readback. NULL is allowed.
void girandole_readback_destroy(struct GirandoleReadback *readback);

// Determines which buffers the GPU needs for the current state of the world, however many frames lie between
// this call and the last plan. Changes nothing that shaders read.
//
// exactly: 0 for buffers with room to grow, 1 for buffers no larger than needed. new_buffers and count get
// the buffers to make; the array belongs to the planner and is valid until the reservation ends.
//
// The reservation ends with girandole_planner_plan, or, if there is no memory for a buffer, with
// girandole_planner_cancel. Until then, other calls that use the planner are refused with
// GIRANDOLE_ERROR_RESERVED. The world may change; the plan has it as it is now.
//
// On GIRANDOLE_ERROR_FULL the next call has the changes too.
GirandoleStatus girandole_planner_reserve(struct GirandolePlanner *planner,
                                          const struct GirandoleWorld *world,
                                          uint32_t exactly,
                                          const struct GirandoleNewBuffer **new_buffers,
                                          size_t *count);

// Ends the reservation with a plan: the commands of the frame. Destroy it with girandole_plan_destroy.
GirandoleStatus girandole_planner_plan(struct GirandolePlanner *planner, struct GirandolePlan **plan);

// Ends the reservation without a plan. Its changes become part of the next reservation, which lists all buffers
// again and may give their numbers to others: free the buffers of this reservation that were already made.
GirandoleStatus girandole_planner_cancel(struct GirandolePlanner *planner);

// Stores what a shader holds. The pointers are valid until the shader is destroyed.
GirandoleStatus girandole_shader_view(const struct GirandoleShader *shader, struct GirandoleShaderView *view);

// Frees a shader. NULL is allowed.
void girandole_shader_destroy(struct GirandoleShader *shader);

// Translates a WGSL text, for example the text of girandole_shader_include and the engine's own text, one
// after the other, to another language. Destroy the shader with girandole_shader_destroy.
//
// wgsl: a UTF-8 text that ends with a zero. Any feature of WGSL that naga knows is allowed. Takes
// milliseconds. naga reads texts recursively: expressions that are nested very deeply, such as a sum of 20,000
// terms, may overflow the stack and so end the process. Do not pass texts of strangers.
//
// Overrides get their default values. Without a default value, the text cannot be translated.
//
// Errors: GIRANDOLE_ERROR_WGSL if the text is not valid, with the place in the message;
// GIRANDOLE_ERROR_TRANSLATION if the language, or naga's writer for it, lacks something that the text needs.
// Samplers and immediates cannot be written in HLSL, and external textures not in SPIR-V.
GirandoleStatus girandole_translate(const char *wgsl,
                                    const struct GirandoleTarget *target,
                                    struct GirandoleShader **shader);

// Returns the number of kernels. Indices and texts may differ between versions of the library.
uint32_t girandole_kernel_count(void);

// Stores the name and the bindings of a kernel. Both are valid as long as the process.
GirandoleStatus girandole_kernel(uint32_t index, struct GirandoleKernel *kernel);

// Makes the code of a kernel in the language of a target, whose entry_point is ignored. Takes milliseconds, so do
// it once, or when the engine is built. Destroy it with girandole_shader_destroy.
GirandoleStatus girandole_kernel_shader(uint32_t index,
                                        const struct GirandoleTarget *target,
                                        struct GirandoleShader **shader);

// Makes the text that an engine's shader includes: the functions light_sample, light_resample, light_pmf,
// light_mark and others, without an entry point. docs/integration.md describes them. Destroy the shader with
// girandole_shader_destroy.
//
//   effects  bits of GIRANDOLE_EFFECT_*: at least those of girandole_planner_effects
//   group    the group of the bindings in WGSL, and by default the space in HLSL: 0 to 254
//   parts    bits of GIRANDOLE_SHADER_*: what the text has in addition
//   target   WGSL, HLSL or MSL; its entry_point must be NULL. SPIR-V has no texts to include: join the
//            WGSL text with your own and pass both to girandole_translate
//
// HLSL: the space is a macro, GIRANDOLE_SPACE, which a program may define
// before it includes the text. A binding that target moves to another space than the first one
// gets a space of its own instead of the macro. MSL: functions take the buffers that they read as further arguments.
GirandoleStatus girandole_shader_include(uint32_t effects,
                                         uint32_t group,
                                         uint32_t parts,
                                         const struct GirandoleTarget *target,
                                         struct GirandoleShader **shader);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* GIRANDOLE_H */
