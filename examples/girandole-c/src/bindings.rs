//! The kinds of bindings.

/// How a kernel binds a buffer: one of GIRANDOLE_BINDING_*.
pub type GirandoleBindingKind = u32;
/// A uniform buffer. In a kernel its offset changes from dispatch to dispatch.
pub const GIRANDOLE_BINDING_UNIFORM: GirandoleBindingKind = 0;
/// A whole storage buffer that is only read.
pub const GIRANDOLE_BINDING_READ: GirandoleBindingKind = 1;
/// A whole storage buffer that is read and written.
pub const GIRANDOLE_BINDING_READ_WRITE: GirandoleBindingKind = 2;
/// A texture, sampler or anything else. Kernels have none; an engine's own shader may.
pub const GIRANDOLE_BINDING_OTHER: GirandoleBindingKind = 3;
