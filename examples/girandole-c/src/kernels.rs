//! The compute shaders that plans dispatch.

use std::ffi::c_char;
use std::sync::LazyLock;

use girandole::Effects;
use girandole::plan::{Binding, KERNELS, Kernel, cut_kernels, visibility_kernels};

use crate::bindings::*;
use crate::memory::{object, result};
use crate::names::c_name;
use crate::shader::{GirandoleShader, GirandoleTarget};
use crate::source::Source;
use crate::status::{Failure, GirandoleStatus, call};
use crate::translate::translate;

/// A binding of a kernel.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct GirandoleKernelBinding {
    /// One of GIRANDOLE_BINDING_*.
    pub kind: GirandoleBindingKind,
    /// UNIFORM: the bytes that the kernel reads from uniform_offset on. 0 for other kinds.
    pub uniform_size: u32,
}

/// A compute shader of the library.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct GirandoleKernel {
    /// The name of its entry point.
    pub name: *const c_char,
    /// Its bindings in group 0, by binding number. The first is always the uniform buffer.
    pub bindings: *const GirandoleKernelBinding,
    /// How many.
    pub binding_count: usize,
}

/// The kernels of frames, then those that build cuts, for all effects, and those by which cells learn.
static ALL: LazyLock<Vec<Kernel>> =
    LazyLock::new(|| [KERNELS, &cut_kernels(Effects::all()), &visibility_kernels()].concat());

static BINDINGS: LazyLock<Vec<Vec<GirandoleKernelBinding>>> = LazyLock::new(|| {
    let binding = |binding: &Binding| match *binding {
        Binding::Uniform { bytes } => GirandoleKernelBinding { kind: GIRANDOLE_BINDING_UNIFORM, uniform_size: bytes },
        Binding::Read => GirandoleKernelBinding { kind: GIRANDOLE_BINDING_READ, uniform_size: 0 },
        Binding::ReadWrite => GirandoleKernelBinding { kind: GIRANDOLE_BINDING_READ_WRITE, uniform_size: 0 },
        _ => GirandoleKernelBinding { kind: GIRANDOLE_BINDING_OTHER, uniform_size: 0 },
    };
    ALL.iter().map(|kernel| kernel.bindings().iter().map(binding).collect()).collect()
});

fn known(index: u32) -> Result<&'static Kernel, Failure> {
    let kernel = ALL.get(index as usize);
    kernel.ok_or_else(|| Failure::bad_value(&format!("index of a kernel below {}", ALL.len()), index))
}

/// The index of a kernel, whatever its effects.
pub(crate) fn index_of(kernel: Kernel) -> Result<u32, Failure> {
    let index = ALL.iter().position(|known| known.entry() == kernel.entry());
    index.map(|index| index as u32).ok_or_else(|| Failure::bad_value("kernel", kernel.entry()))
}

/// Returns the number of kernels. Indices and texts may differ between versions of the library.
#[unsafe(no_mangle)]
pub extern "C" fn girandole_kernel_count() -> u32 {
    ALL.len() as u32
}

/// Stores the name and the bindings of a kernel. Both are valid as long as the process.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn girandole_kernel(index: u32, kernel: *mut GirandoleKernel) -> GirandoleStatus {
    call(|| {
        // SAFETY: see the crate's documentation.
        let out = unsafe { result(kernel, "kernel")? };
        let (name, bindings) = (known(index)?.entry(), &BINDINGS[index as usize]);
        out.set(GirandoleKernel { name: c_name(name), bindings: bindings.as_ptr(), binding_count: bindings.len() });
        Ok(())
    })
}

/// Makes the code of a kernel in the language of a target, whose entry_point is ignored. Takes milliseconds, so do
/// it once, or when the engine is built. Destroy it with girandole_shader_destroy.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn girandole_kernel_shader(
    index: u32,
    target: *const GirandoleTarget,
    shader: *mut *mut GirandoleShader,
) -> GirandoleStatus {
    call(|| {
        // SAFETY: see the crate's documentation.
        let (target, out) = unsafe { (object(target, "target")?, result(shader, "shader")?) };
        let kernel = known(index)?;
        let source = Source::checked(kernel.wgsl())?.without_zeroing();
        // Some texts have several kernels.
        let target = GirandoleTarget { entry_point: c_name(kernel.entry()), ..*target };
        // SAFETY: see the crate's documentation.
        out.set(Box::into_raw(Box::new(unsafe { translate(&source, &target)? })));
        Ok(())
    })
}
