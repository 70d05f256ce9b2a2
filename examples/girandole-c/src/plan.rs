//! Plans as flat arrays of commands.

use std::ptr;

use girandole::plan::{BufferId, Command, Commands, FramePlan, Kernel, PlanCursor};

use crate::buffers::GirandoleNewBuffer;
use crate::kernels::index_of;
use crate::memory::{destroy, object, object_mut, result};
use crate::status::{Failure, GirandoleStatus, call};

/// What a command does: one of GIRANDOLE_COMMAND_*.
pub type GirandoleCommandKind = u32;
/// Overwrites size bytes of buffer, from offset on, with bytes. Offset and size are multiples of 4.
pub const GIRANDOLE_COMMAND_WRITE: GirandoleCommandKind = 0;
/// Copies the first size bytes of source to the start of buffer. The size is a multiple of 4.
pub const GIRANDOLE_COMMAND_COPY: GirandoleCommandKind = 1;
/// Sets size bytes of buffer, from offset on, to zero. Both are multiples of 4.
pub const GIRANDOLE_COMMAND_CLEAR: GirandoleCommandKind = 2;
/// Runs kernel with buffers, at uniform_offset in the first of them.
pub const GIRANDOLE_COMMAND_DISPATCH: GirandoleCommandKind = 3;
/// The same with as many workgroups as source holds: three 32-bit words from its first byte on.
pub const GIRANDOLE_COMMAND_DISPATCH_INDIRECT: GirandoleCommandKind = 4;

/// A command. Each command sees the effects of all commands before it: put a barrier between a command and
/// the next one, except between writes. Fields that the kind does not use are 0 or NULL.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct GirandoleCommand {
    /// One of GIRANDOLE_COMMAND_*.
    pub kind: GirandoleCommandKind,
    /// WRITE, COPY, CLEAR: the number of the buffer that changes.
    pub buffer: u32,
    /// COPY: the number of the buffer that is read. DISPATCH_INDIRECT: that of the buffer with the workgroups, of
    /// GIRANDOLE_BUFFER_INDIRECT.
    pub source: u32,
    /// DISPATCH, DISPATCH_INDIRECT: the index of the kernel, for girandole_kernel.
    pub kernel: u32,
    /// WRITE, COPY, CLEAR: the first byte that changes.
    pub offset: u64,
    /// WRITE, COPY, CLEAR: how many bytes.
    pub size: u64,
    /// WRITE: the new content. Belongs to the plan.
    pub bytes: *const u8,
    /// DISPATCH, DISPATCH_INDIRECT: the numbers of the buffers of the kernel's bindings, in their order. Belongs to
    /// the plan.
    pub buffers: *const u32,
    /// DISPATCH, DISPATCH_INDIRECT: how many.
    pub buffer_count: u32,
    /// DISPATCH, DISPATCH_INDIRECT: where the range of the uniform buffer starts, a multiple of 256 bytes.
    pub uniform_offset: u32,
    /// DISPATCH: the number of workgroups in each dimension, at least 1.
    pub workgroups: [u32; 3],
}

const NO_COMMAND: GirandoleCommand = GirandoleCommand {
    kind: 0,
    buffer: 0,
    source: 0,
    kernel: 0,
    offset: 0,
    size: 0,
    bytes: ptr::null(),
    buffers: ptr::null(),
    buffer_count: 0,
    uniform_offset: 0,
    workgroups: [0; 3],
};

/// The commands of one frame. It does not depend on the planner and the world, and any thread may use it.
#[derive(Debug)]
pub struct GirandolePlan {
    /// Owns the bytes of writes, with `_ahead`.
    frame: FramePlan,
    _ahead: Vec<Commands>,
    bytes: u64,
    new_buffers: Vec<GirandoleNewBuffer>,
    upload: Flat,
    top: Flat,
    freed: Vec<u32>,
}

/// Commands with the buffers of their dispatches. Neither list changes, so pointers into them stay valid.
#[derive(Debug)]
struct Flat {
    commands: Vec<GirandoleCommand>,
    _buffers: Vec<u32>,
}

impl Flat {
    fn new<'a>(lists: impl Iterator<Item = &'a Commands> + Clone) -> Result<Self, Failure> {
        let commands = || lists.clone().flat_map(Commands::iter);
        let mut buffers = Vec::new();
        for command in commands() {
            if let Command::Dispatch { buffers: ids, .. } | Command::DispatchIndirect { buffers: ids, .. } = command {
                buffers.extend(ids.iter().copied().map(BufferId::get));
            }
        }
        let mut rest = buffers.as_slice();
        let commands = commands().map(|command| flat(command, &mut rest)).collect::<Result<_, _>>()?;
        Ok(Self { commands, _buffers: buffers })
    }
}

/// What all dispatches have. Their buffers are the first of `rest`.
fn dispatch(kernel: Kernel, count: usize, uniform_offset: u32, rest: &mut &[u32]) -> Result<GirandoleCommand, Failure> {
    let (own, others) = rest.split_at(count);
    *rest = others;
    let (kernel, buffers, buffer_count) = (index_of(kernel)?, own.as_ptr(), own.len() as u32);
    Ok(GirandoleCommand { kernel, buffers, buffer_count, uniform_offset, ..NO_COMMAND })
}

/// A command whose buffers, if it is a dispatch, are the first of `rest`.
fn flat(command: Command<'_>, rest: &mut &[u32]) -> Result<GirandoleCommand, Failure> {
    Ok(match command {
        Command::Write { buffer, offset, bytes } => GirandoleCommand {
            kind: GIRANDOLE_COMMAND_WRITE,
            buffer: buffer.get(),
            offset,
            size: bytes.len() as u64,
            bytes: bytes.as_ptr(),
            ..NO_COMMAND
        },
        Command::Copy { from, to, offset, bytes } => GirandoleCommand {
            kind: GIRANDOLE_COMMAND_COPY,
            buffer: to.get(),
            source: from.get(),
            offset,
            size: bytes,
            ..NO_COMMAND
        },
        Command::Clear { buffer, offset, bytes } => {
            GirandoleCommand { kind: GIRANDOLE_COMMAND_CLEAR, buffer: buffer.get(), offset, size: bytes, ..NO_COMMAND }
        }
        Command::Dispatch { kernel, buffers, uniform_offset, workgroups } => GirandoleCommand {
            kind: GIRANDOLE_COMMAND_DISPATCH,
            workgroups,
            ..dispatch(kernel, buffers.len(), uniform_offset, rest)?
        },
        Command::DispatchIndirect { kernel, buffers, uniform_offset, workgroups } => GirandoleCommand {
            kind: GIRANDOLE_COMMAND_DISPATCH_INDIRECT,
            source: workgroups.get(),
            ..dispatch(kernel, buffers.len(), uniform_offset, rest)?
        },
        other => return Err(Failure::bad_value("command", format!("{other:?}"))),
    })
}

impl GirandolePlan {
    /// `ahead` is played before the upload of the frame, and `cuts` behind the build of its top level.
    pub(crate) fn new(
        frame: FramePlan,
        new_buffers: Vec<GirandoleNewBuffer>,
        ahead: Vec<Commands>,
        cuts: Commands,
    ) -> Result<Self, Failure> {
        let uploads = ahead.iter().chain([&frame.upload]);
        Ok(Self {
            new_buffers,
            upload: Flat::new(uploads.clone())?,
            top: Flat::new([&frame.top, &cuts].into_iter())?,
            freed: frame.freed.iter().copied().map(BufferId::get).collect(),
            bytes: uploads.map(Commands::bytes_written).sum(),
            frame,
            _ahead: ahead,
        })
    }
}

/// What a plan holds. All arrays belong to the plan.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct GirandolePlanView {
    /// Plans are numbered from 1, and must be played in this order, each exactly once.
    pub number: u64,
    /// The buffers of the reservation, which the engine has made.
    pub new_buffers: *const GirandoleNewBuffer,
    /// How many.
    pub new_buffer_count: usize,
    /// Brings the buffers up to date. Play it first.
    pub upload: *const GirandoleCommand,
    /// How many commands.
    pub upload_count: usize,
    /// Builds the top level, and the cuts of the cells that shaders have marked. Play it after upload.
    pub top: *const GirandoleCommand,
    /// How many commands.
    pub top_count: usize,
    /// The numbers of buffers to free, once the GPU has finished this frame.
    pub freed: *const u32,
    /// How many.
    pub freed_count: usize,
    /// Bytes that the writes carry.
    pub bytes: u64,
    /// Trees that wait to be sent in full; until then, shaders see stand-ins or an older version of them.
    pub waiting_trees: usize,
}

/// Stores what a plan holds. The arrays are valid until the plan is destroyed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn girandole_plan_view(
    plan: *const GirandolePlan,
    view: *mut GirandolePlanView,
) -> GirandoleStatus {
    call(|| {
        // SAFETY: see the crate's documentation.
        let (plan, view) = unsafe { (object(plan, "plan")?, result(view, "view")?) };
        view.set(GirandolePlanView {
            number: plan.frame.number,
            new_buffers: plan.new_buffers.as_ptr(),
            new_buffer_count: plan.new_buffers.len(),
            upload: plan.upload.commands.as_ptr(),
            upload_count: plan.upload.commands.len(),
            top: plan.top.commands.as_ptr(),
            top_count: plan.top.commands.len(),
            freed: plan.freed.as_ptr(),
            freed_count: plan.freed.len(),
            bytes: plan.bytes,
            waiting_trees: plan.frame.report.waiting_trees,
        });
        Ok(())
    })
}

/// Frees a plan. NULL is allowed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn girandole_plan_destroy(plan: *mut GirandolePlan) {
    // SAFETY: made by `Box::into_raw`, and see the crate's documentation.
    unsafe { destroy(plan) }
}

/// Checks that plans are played in order. Keep one for each set of buffers on which plans are played.
#[derive(Debug)]
pub struct GirandoleCursor(PlanCursor);

/// Creates a cursor that expects the plan with number 1. Destroy it with girandole_cursor_destroy.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn girandole_cursor_create(cursor: *mut *mut GirandoleCursor) -> GirandoleStatus {
    call(|| {
        // SAFETY: see the crate's documentation.
        unsafe { result(cursor, "cursor")? }.set(Box::into_raw(Box::new(GirandoleCursor(PlanCursor::default()))));
        Ok(())
    })
}

/// Call it before each plan is played. Returns GIRANDOLE_ERROR_OUT_OF_ORDER if the plan was played before, or
/// if an earlier plan was skipped; do not play the plan then.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn girandole_cursor_advance(
    cursor: *mut GirandoleCursor,
    plan: *const GirandolePlan,
) -> GirandoleStatus {
    call(|| {
        // SAFETY: see the crate's documentation.
        let (cursor, plan) = unsafe { (object_mut(cursor, "cursor")?, object(plan, "plan")?) };
        Ok(cursor.0.advance(&plan.frame)?)
    })
}

/// Lets the cursor expect this plan next, after girandole_planner_lose. Then call girandole_cursor_advance
/// for the plan.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn girandole_cursor_skip_to(
    cursor: *mut GirandoleCursor,
    plan: *const GirandolePlan,
) -> GirandoleStatus {
    call(|| {
        // SAFETY: see the crate's documentation.
        let (cursor, plan) = unsafe { (object_mut(cursor, "cursor")?, object(plan, "plan")?) };
        cursor.0.skip_to(&plan.frame);
        Ok(())
    })
}

/// Frees a cursor. NULL is allowed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn girandole_cursor_destroy(cursor: *mut GirandoleCursor) {
    // SAFETY: made by `Box::into_raw`, and see the crate's documentation.
    unsafe { destroy(cursor) }
}
