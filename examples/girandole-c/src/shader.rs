//! What shaders are translated to, and what comes out: code, entry points and a table of bindings.

use std::ffi::{CString, c_char, c_void};

use crate::bindings::GirandoleBindingKind;
use crate::memory::{destroy, object, result};
use crate::status::{GirandoleStatus, call};

/// A language of shaders: one of GIRANDOLE_LANGUAGE_*.
pub type GirandoleLanguage = u32;
/// WGSL: the text is checked and returned unchanged.
pub const GIRANDOLE_LANGUAGE_WGSL: GirandoleLanguage = 0;
/// SPIR-V for Vulkan, versions 1.0 to 1.6; 1.3 by default, which Vulkan 1.1 accepts.
pub const GIRANDOLE_LANGUAGE_SPIRV: GirandoleLanguage = 1;
/// HLSL, shader models 5.1 and 6.0 to 6.7; 6.0 by default. Without samplers.
pub const GIRANDOLE_LANGUAGE_HLSL: GirandoleLanguage = 2;
/// MSL, versions 1.0 to 1.2, 2.0 to 2.4, 3.0 and 3.1; 2.1 by default.
pub const GIRANDOLE_LANGUAGE_MSL: GirandoleLanguage = 3;

/// No index.
pub const GIRANDOLE_NO_INDEX: u32 = u32::MAX;

/// Where a binding of a WGSL text goes.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct GirandoleBindTarget {
    /// The number in @group.
    pub group: u32,
    /// The number in @binding.
    pub binding: u32,
    /// SPIR-V: the descriptor set. HLSL: the space, at most 255. MSL: ignored.
    pub space: u32,
    /// SPIR-V: the binding. HLSL: the register, whose letter follows from the kind of the binding. MSL: the
    /// index of the buffer, texture or sampler, at most 254.
    pub index: u32,
}

/// Omits the checks that keep indices into buffers and arrays within bounds. Only for texts whose indices are
/// known to stay within bounds, such as the library's own texts.
pub const GIRANDOLE_TRANSLATE_UNCHECKED: u32 = 1;

/// The language of a translation, and where bindings go. Zero all fields, then set what differs.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct GirandoleTarget {
    /// One of GIRANDOLE_LANGUAGE_*.
    pub language: GirandoleLanguage,
    /// The version of the language, as in 6.0; 0 and 0 for the default.
    pub major_version: u32,
    /// See major_version.
    pub minor_version: u32,
    /// Bits of GIRANDOLE_TRANSLATE_*.
    pub flags: u32,
    /// The only entry point to translate, with everything that it uses; NULL for all entry points.
    pub entry_point: *const c_char,
    /// Overrides of the default places of bindings. By default the group is the space and the binding is the
    /// index; for MSL, bindings get the indices from 0 on in the order of group and binding. Variables with the
    /// same group and binding have the same index. None are allowed for WGSL.
    pub bindings: *const GirandoleBindTarget,
    /// How many.
    pub binding_count: usize,
}

/// WGSL as it is.
pub(crate) fn wgsl_target() -> GirandoleTarget {
    GirandoleTarget {
        language: GIRANDOLE_LANGUAGE_WGSL,
        major_version: 0,
        minor_version: 0,
        flags: 0,
        entry_point: std::ptr::null(),
        bindings: std::ptr::null(),
        binding_count: 0,
    }
}

/// The stage of an entry point: one of GIRANDOLE_STAGE_*.
pub type GirandoleStage = u32;
/// A compute shader.
pub const GIRANDOLE_STAGE_COMPUTE: GirandoleStage = 0;
/// A vertex shader.
pub const GIRANDOLE_STAGE_VERTEX: GirandoleStage = 1;
/// A fragment shader.
pub const GIRANDOLE_STAGE_FRAGMENT: GirandoleStage = 2;
/// Any other stage.
pub const GIRANDOLE_STAGE_OTHER: GirandoleStage = 3;

/// An entry point of a translated shader.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct GirandoleEntryPoint {
    /// Its name in the WGSL text.
    pub name: *const c_char,
    /// Its name in the code. It differs if the name is a word of the language.
    pub name_in_code: *const c_char,
    /// One of GIRANDOLE_STAGE_*.
    pub stage: GirandoleStage,
    /// The invocations of a workgroup in each dimension; 0 for vertex and fragment shaders. Metal needs them
    /// for each dispatch.
    pub workgroup_size: [u32; 3],
}

/// A row of the table of bindings of a translated shader.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct GirandoleShaderBinding {
    /// The name of the variable in the WGSL text.
    pub name: *const c_char,
    /// The number in @group.
    pub group: u32,
    /// The number in @binding.
    pub binding: u32,
    /// One of GIRANDOLE_BINDING_*.
    pub kind: GirandoleBindingKind,
    /// SPIR-V: the descriptor set. HLSL: the space. 0 for MSL.
    pub space: u32,
    /// SPIR-V: the binding. HLSL: the number of the register. MSL: the index of the buffer, texture or sampler.
    pub index: u32,
    /// HLSL: the letter of the register: 'b', 't' or 'u'. 0 for other languages.
    pub register_letter: c_char,
    /// The minimum size of the buffer in bytes; 0 if the binding is not a buffer.
    pub size: u32,
}

/// A translated shader. Any thread may use it.
#[derive(Debug)]
pub struct GirandoleShader {
    pub(crate) code: Code,
    /// The arrays point into `names`, whose strings do not move.
    pub(crate) entry_points: Vec<GirandoleEntryPoint>,
    pub(crate) bindings: Vec<GirandoleShaderBinding>,
    pub(crate) sizes_index: u32,
    pub(crate) names: Vec<CString>,
}

#[derive(Debug)]
pub(crate) enum Code {
    Text(CString),
    Words(Vec<u32>),
}

impl GirandoleShader {
    /// Keeps a name, and returns where it is.
    pub(crate) fn keep(&mut self, name: &str) -> *const c_char {
        self.names.push(CString::new(name).unwrap_or_default());
        self.names.last().map_or(std::ptr::null(), |name| name.as_ptr())
    }
}

/// What a shader holds. All pointers belong to the shader.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct GirandoleShaderView {
    /// The words of SPIR-V, aligned to 4 bytes; or a zero-terminated text, whose size excludes the zero.
    pub code: *const c_void,
    /// Bytes of the code.
    pub size: usize,
    /// The entry points; none in an include text.
    pub entry_points: *const GirandoleEntryPoint,
    /// How many.
    pub entry_point_count: usize,
    /// The bindings that the selected entry point uses, or all bindings if none was selected.
    pub bindings: *const GirandoleShaderBinding,
    /// How many.
    pub binding_count: usize,
    /// MSL: the index of the buffer with the sizes of bound storage buffers whose arrays have no fixed length:
    /// one u32 for each, in the order in which the text declares them. GIRANDOLE_NO_INDEX for other languages
    /// and include texts.
    pub sizes_index: u32,
}

/// Stores what a shader holds. The pointers are valid until the shader is destroyed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn girandole_shader_view(
    shader: *const GirandoleShader,
    view: *mut GirandoleShaderView,
) -> GirandoleStatus {
    call(|| {
        // SAFETY: see the crate's documentation.
        let (shader, view) = unsafe { (object(shader, "shader")?, result(view, "view")?) };
        let (code, size) = match &shader.code {
            Code::Text(text) => (text.as_ptr().cast(), text.as_bytes().len()),
            Code::Words(words) => (words.as_ptr().cast(), size_of_val(words.as_slice())),
        };
        view.set(GirandoleShaderView {
            code,
            size,
            entry_points: shader.entry_points.as_ptr(),
            entry_point_count: shader.entry_points.len(),
            bindings: shader.bindings.as_ptr(),
            binding_count: shader.bindings.len(),
            sizes_index: shader.sizes_index,
        });
        Ok(())
    })
}

/// Frees a shader. NULL is allowed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn girandole_shader_destroy(shader: *mut GirandoleShader) {
    // SAFETY: made by `Box::into_raw`, and see the crate's documentation.
    unsafe { destroy(shader) }
}
