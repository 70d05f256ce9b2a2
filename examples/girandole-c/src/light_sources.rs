//! Trees whose lights a kernel of the engine writes on the GPU.

use girandole::plan::{self, LightPlanner};
use girandole::{LightWorld, TreeKey, TreeSource, WorldError};

use crate::memory::{object, result, wanted};
use crate::planner::GirandolePlanner;
use crate::planners::change;
use crate::shader::{GIRANDOLE_NO_INDEX, GirandoleShader, wgsl_target};
use crate::shader_text::LAST_GROUP;
use crate::source::Source;
use crate::status::{Failure, GirandoleStatus, call};
use crate::translate::translate;
use crate::world::GirandoleWorld;

/// Who writes the lights of a tree: one of GIRANDOLE_SOURCE_*.
pub type GirandoleLightSource = u32;
/// Calls of this interface.
pub const GIRANDOLE_SOURCE_CPU: GirandoleLightSource = 0;
/// A kernel of the engine, in each frame. The lights keep about the same neighbours, as the triangles of a
/// skinned mesh do: a refit on the GPU follows them.
pub const GIRANDOLE_SOURCE_GPU_MESH: GirandoleLightSource = 1;
/// A kernel of the engine, in each frame. The lights mingle, come and go, as particles do: each of them is a
/// leaf of the top level, which is built anew in each frame.
pub const GIRANDOLE_SOURCE_GPU_PARTICLES: GirandoleLightSource = 2;

/// The sources with their numbers in this interface.
const SOURCES: [(GirandoleLightSource, TreeSource); 3] = [
    (GIRANDOLE_SOURCE_CPU, TreeSource::Cpu),
    (GIRANDOLE_SOURCE_GPU_MESH, TreeSource::GpuMesh),
    (GIRANDOLE_SOURCE_GPU_PARTICLES, TreeSource::GpuParticles),
];

fn check_tree(world: &LightWorld, tree: TreeKey) -> Result<(), Failure> {
    Ok(world.tree(tree).map(drop).ok_or(WorldError::NoSuchTree(tree))?)
}

/// Lets a kernel of the engine write the lights of a tree on the GPU, or calls of this interface again.
///
/// The tree is added with as many lights as the kernel may write, of the kinds, ranges, sides and opening
/// angles that they keep. In each frame, the kernel runs between the commands in upload and those in top of
/// the plan, and calls the functions of girandole_shader_sources. top then refits the tree from what was
/// written.
///
/// Calls that sample on the CPU see the lights as they were last set or read back: set them where the lights
/// are about. Refused with GIRANDOLE_ERROR_PROFILE_ON_GPU if a light of the tree has a profile.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn girandole_world_set_light_source(
    world: *mut GirandoleWorld,
    tree: u64,
    source: GirandoleLightSource,
) -> GirandoleStatus {
    call(|| {
        // SAFETY: see the crate's documentation.
        let world = unsafe { object(world, "world")? };
        let known = SOURCES.iter().find(|(number, _)| *number == source);
        let (_, source) = known.ok_or_else(|| Failure::bad_value("source of lights", source))?;
        world.edit(|world| Ok(world.set_light_source(TreeKey::from(tree), *source)?))
    })
}

/// Stores who writes the lights of a tree, one of GIRANDOLE_SOURCE_*, and the number by which kernels know its
/// source: GIRANDOLE_NO_INDEX for GIRANDOLE_SOURCE_CPU. The number stays the same while the tree has a source.
/// Either pointer may be NULL.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn girandole_world_light_source(
    world: *const GirandoleWorld,
    tree: u64,
    source: *mut GirandoleLightSource,
    number: *mut u32,
) -> GirandoleStatus {
    call(|| {
        // SAFETY: see the crate's documentation.
        let world = unsafe { object(world, "world")?.read()? };
        // SAFETY: see the crate's documentation.
        let (source, number) = unsafe { (wanted(source, "source")?, wanted(number, "number")?) };
        let tree = TreeKey::from(tree);
        check_tree(world, tree)?;
        let (by, index) = world.light_source(tree).unwrap_or((TreeSource::Cpu, GIRANDOLE_NO_INDEX));
        source.set(SOURCES.iter().find(|(_, known)| *known == by).map_or(u32::MAX, |(known, _)| *known));
        number.set(index);
        Ok(())
    })
}

/// Stores how many writes of lights of a tree kernels were refused, as far as readbacks have told so far: see
/// girandole_planner_measures. 0 for a tree without a source.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn girandole_world_refused_writes(
    world: *const GirandoleWorld,
    tree: u64,
    count: *mut u64,
) -> GirandoleStatus {
    call(|| {
        // SAFETY: see the crate's documentation.
        let (world, count) = unsafe { (object(world, "world")?.read()?, result(count, "count")?) };
        let tree = TreeKey::from(tree);
        check_tree(world, tree)?;
        count.set(world.refused_writes(tree));
        Ok(())
    })
}

/// Makes the WGSL text for kernels that write lights: light_source_count, light_put_point, light_put_spot,
/// light_put_rectangle, light_put_triangle, light_put_sphere, light_put_dark and light_put_new. The text says
/// what they do. Join it with the engine's kernel, and pass both to girandole_translate. It binds the buffers of
/// girandole_planner_source_bindings at 0 and 1 of the group, 0 to 254, and must not be joined with the text of
/// girandole_shader_include. Destroy the shader with girandole_shader_destroy.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn girandole_shader_sources(group: u32, shader: *mut *mut GirandoleShader) -> GirandoleStatus {
    call(|| {
        // SAFETY: see the crate's documentation.
        let out = unsafe { result(shader, "shader")? };
        if group > LAST_GROUP {
            return Err(Failure::bad_value("group; 0 to 254 are", group));
        }
        let source = Source::checked(plan::wgsl_of_sources(group))?;
        // SAFETY: all pointers of the target are null, which is allowed.
        out.set(Box::into_raw(Box::new(unsafe { translate(&source, &wgsl_target())? })));
        Ok(())
    })
}

/// The number of buffers that kernels bind to write lights.
pub const GIRANDOLE_SOURCE_BUFFERS: usize = 2;

/// Stores the numbers of the buffers that kernels bind to write lights after the last plan, at the bindings 0
/// and 1 of their group: two storage buffers that are read and written, each bound whole. UINT32_MAX until the
/// world has a tree with a source. buffers has room for GIRANDOLE_SOURCE_BUFFERS numbers. Any plan may replace
/// the buffers.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn girandole_planner_source_bindings(
    planner: *mut GirandolePlanner,
    buffers: *mut u32,
) -> GirandoleStatus {
    call(|| {
        // SAFETY: see the crate's documentation.
        let out = unsafe { result(buffers.cast::<[u32; GIRANDOLE_SOURCE_BUFFERS]>(), "buffers")? };
        // SAFETY: see the crate's documentation.
        let ids = unsafe { change(planner, |planner| Ok(planner.source_bindings()))? };
        out.set(ids.map_or([u32::MAX; GIRANDOLE_SOURCE_BUFFERS], |ids| ids.map(|id| id.get())));
        Ok(())
    })
}

/// Stores the number of numbers of sources, in use or not, after the last plan.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn girandole_planner_source_count(
    planner: *mut GirandolePlanner,
    count: *mut u32,
) -> GirandoleStatus {
    call(|| {
        // SAFETY: see the crate's documentation.
        let out = unsafe { result(count, "count")? };
        // SAFETY: see the crate's documentation.
        out.set(unsafe { change(planner, |planner: &mut LightPlanner| Ok(planner.source_count()))? });
        Ok(())
    })
}
