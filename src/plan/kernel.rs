//! The compute shaders that plans dispatch: text and bindings.

use std::fmt;
use std::hash::{Hash, Hasher};

use crate::effects::Effects;

/// Bytes from one record of a uniform to the next: WebGPU's default alignment of dynamic offsets.
/// No device of Vulkan, D3D12 or Metal requires more.
pub const UNIFORM_ALIGNMENT: u32 = 256;

/// WebGPU's default limit of workgroups along one dimension.
pub(crate) const MAX_WORKGROUPS: u32 = 65_535;

/// How a kernel binds a buffer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Binding {
    /// A uniform buffer of this many bytes, from [`Command::Dispatch`](super::Command::Dispatch)'s
    /// `uniform_offset` on.
    Uniform {
        /// Bytes that the kernel reads; at most 512.
        bytes: u32,
    },
    /// A whole storage buffer that the kernel reads.
    Read,
    /// A whole storage buffer that the kernel reads and writes.
    ReadWrite,
}

/// A compute shader of the library. Two kernels are equal if they have the same entry point and the same effects.
#[derive(Clone, Copy)]
pub struct Kernel {
    entry: &'static str,
    bindings: &'static [Binding],
    stage: &'static str,
    text: fn(Effects) -> String,
    effects: Option<Effects>,
}

impl Kernel {
    /// `stage` names what the kernel is a part of, for measurements.
    pub(crate) const fn new(
        entry: &'static str,
        stage: &'static str,
        bindings: &'static [Binding],
        text: fn(Effects) -> String,
    ) -> Self {
        Self { entry, bindings, stage, text, effects: None }
    }

    /// The same for some effects, on which its text depends.
    pub(crate) fn for_effects(self, effects: Effects) -> Self {
        Self { effects: Some(effects), ..self }
    }

    /// The effects of worlds for which the text is made; `None` if it serves all.
    pub fn effects(&self) -> Option<Effects> {
        self.effects
    }

    /// The name of the entry point, and of the kernel.
    pub fn entry(&self) -> &'static str {
        self.entry
    }

    /// What it binds in group 0: the binding with number `i` is the one with index `i`. Binding 0
    /// is always the uniform.
    pub fn bindings(&self) -> &'static [Binding] {
        self.bindings
    }

    /// What it is a part of: `"leaves"`, `"keys"`, `"sort"`, `"cells"` and `"blocks"` of the top level,
    /// `"scatter"`, `"cuts"` or `"visibility"`.
    pub fn stage(&self) -> &'static str {
        self.stage
    }

    /// The WGSL text. Joins texts, so keep the result.
    pub fn wgsl(&self) -> String {
        (self.text)(self.effects.unwrap_or(Effects::all()))
    }
}

impl fmt::Debug for Kernel {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("Kernel").field(&self.entry).finish()
    }
}

impl PartialEq for Kernel {
    fn eq(&self, other: &Self) -> bool {
        self.entry == other.entry && self.effects() == other.effects()
    }
}

impl Eq for Kernel {}

impl Hash for Kernel {
    fn hash<H: Hasher>(&self, state: &mut H) {
        self.entry.hash(state);
        self.effects().hash(state);
    }
}

/// At least `groups` workgroups, at least one, in two dimensions if one is too short.
pub(crate) fn workgroups(groups: u32) -> [u32; 3] {
    let x = groups.clamp(1, MAX_WORKGROUPS);
    [x, groups.div_ceil(x).max(1), 1]
}

/// The bytes of a uniform with one record every `stride` bytes.
pub(crate) fn pass_bytes<T: bytemuck::NoUninit>(passes: &[T], stride: u32) -> Vec<u8> {
    let mut bytes = vec![0; passes.len() * stride as usize];
    for (pass, slot) in passes.iter().zip(bytes.chunks_exact_mut(stride as usize)) {
        slot[..size_of::<T>()].copy_from_slice(bytemuck::bytes_of(pass));
    }
    bytes
}
