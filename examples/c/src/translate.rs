//! Translates WGSL to the languages of drivers, by naga.

use std::ffi::{CStr, CString, c_char};

use naga::{AddressSpace, ShaderStage, StorageAccess, TypeInner};

use crate::bindings::{
    GIRANDOLE_BINDING_OTHER, GIRANDOLE_BINDING_READ, GIRANDOLE_BINDING_READ_WRITE, GIRANDOLE_BINDING_UNIFORM,
    GirandoleBindingKind,
};
use crate::memory::{array, object, result};
use crate::shader::*;
use crate::source::{Bound, Source};
use crate::status::{Failure, GIRANDOLE_ERROR_BAD_TEXT, GIRANDOLE_ERROR_BAD_VALUE, GirandoleStatus, call};
use crate::writers::{hlsl_text, msl_text, spirv, translation_error};

/// The kind of a resource, and the letter of its register in HLSL.
fn kind_of(space: AddressSpace, inner: &TypeInner) -> (GirandoleBindingKind, u8) {
    match (space, inner) {
        (AddressSpace::Uniform, _) => (GIRANDOLE_BINDING_UNIFORM, b'b'),
        (AddressSpace::Storage { access }, _) if access.contains(StorageAccess::STORE) => {
            (GIRANDOLE_BINDING_READ_WRITE, b'u')
        }
        (AddressSpace::Storage { .. }, _) => (GIRANDOLE_BINDING_READ, b't'),
        (_, TypeInner::Sampler { .. }) => (GIRANDOLE_BINDING_OTHER, b's'),
        (_, TypeInner::Image { class: naga::ImageClass::Storage { access, .. }, .. })
            if access.contains(StorageAccess::STORE) =>
        {
            (GIRANDOLE_BINDING_OTHER, b'u')
        }
        _ => (GIRANDOLE_BINDING_OTHER, b't'),
    }
}

/// The resources that an entry point uses, or all, in the order of group and binding.
fn resources(source: &Source, entry_point: Option<usize>) -> Vec<Bound> {
    let Source { module, info, .. } = source;
    let mut bound = Vec::new();
    for (handle, variable) in module.global_variables.iter() {
        let is_used = entry_point.is_none_or(|index| !info.get_entry_point(index)[handle].is_empty());
        let Some(from) = variable.binding.filter(|_| is_used) else { continue };
        let inner = &module.types[variable.ty].inner;
        let (kind, letter) = kind_of(variable.space, inner);
        let size = if kind == GIRANDOLE_BINDING_OTHER { 0 } else { inner.size(module.to_ctx()) };
        let (space, index) = (from.group, from.binding);
        bound.push(Bound { name: variable.name.clone().unwrap_or_default(), from, kind, letter, size, space, index });
    }
    bound.sort_by_key(|bound| (bound.from.group, bound.from.binding));
    bound
}

/// Moves resources to where the caller wants them. Two at one place are the caller's choice.
fn place(bound: &mut [Bound], targets: &[GirandoleBindTarget], language: GirandoleLanguage) -> Result<(), Failure> {
    for (index, bound) in (0..).zip(bound.iter_mut()) {
        if language == GIRANDOLE_LANGUAGE_MSL {
            (bound.space, bound.index) = (0, index);
        }
        let is_own =
            |target: &&GirandoleBindTarget| (target.group, target.binding) == (bound.from.group, bound.from.binding);
        if let Some(target) = targets.iter().find(is_own) {
            (bound.space, bound.index) = (target.space, target.index);
        }
        let limits = match language {
            GIRANDOLE_LANGUAGE_HLSL => (255, u32::MAX),
            GIRANDOLE_LANGUAGE_MSL => (u32::MAX, 254),
            _ => (u32::MAX, u32::MAX),
        };
        if bound.space > limits.0 || bound.index > limits.1 {
            let message = format!(
                "{} goes to space {} and index {}; {limits:?} are the limits",
                bound.name, bound.space, bound.index
            );
            return Err(Failure::new(GIRANDOLE_ERROR_BAD_VALUE, message));
        }
    }
    Ok(())
}

/// The version of a language: the given one, or its default.
fn version(target: &GirandoleTarget) -> Result<(u32, u32), Failure> {
    let given = (target.major_version, target.minor_version);
    let (default, least, most) = match target.language {
        GIRANDOLE_LANGUAGE_WGSL => ((1, 0), (1, 0), (1, 0)),
        GIRANDOLE_LANGUAGE_SPIRV => ((1, 3), (1, 0), (1, 6)),
        GIRANDOLE_LANGUAGE_HLSL => ((6, 0), (5, 1), (6, 7)),
        GIRANDOLE_LANGUAGE_MSL => ((2, 1), (1, 0), (3, 1)),
        other => return Err(Failure::bad_value("language of shaders", other)),
    };
    let is_known =
        (least..=most).contains(&given) && (target.language != GIRANDOLE_LANGUAGE_HLSL || given.0 != 5 || given.1 == 1);
    match given {
        (0, 0) => Ok(default),
        _ if is_known => Ok(given),
        (major, minor) => {
            let what = format!("version of the language; {}.{} to {}.{} are", least.0, least.1, most.0, most.1);
            Err(Failure::bad_value(&what, format!("{major}.{minor}")))
        }
    }
}

fn stage(stage: ShaderStage) -> GirandoleStage {
    match stage {
        ShaderStage::Compute => GIRANDOLE_STAGE_COMPUTE,
        ShaderStage::Vertex => GIRANDOLE_STAGE_VERTEX,
        ShaderStage::Fragment => GIRANDOLE_STAGE_FRAGMENT,
        _ => GIRANDOLE_STAGE_OTHER,
    }
}

/// The text at a pointer of the caller.
unsafe fn text<'a>(pointer: *const c_char, what: &str) -> Result<&'a str, Failure> {
    // SAFETY: see the crate's documentation.
    unsafe { object(pointer, what)? };
    // SAFETY: not null, and ends with a zero (the crate's documentation).
    let text = unsafe { CStr::from_ptr(pointer) }.to_str();
    text.map_err(|_| Failure::new(GIRANDOLE_ERROR_BAD_TEXT, format!("{what} is not UTF-8")))
}

/// Translates a checked text.
///
/// # Safety
/// The pointers of the target are as the crate's documentation says.
pub(crate) unsafe fn translate(source: &Source, target: &GirandoleTarget) -> Result<GirandoleShader, Failure> {
    let GirandoleTarget { language, flags, entry_point, bindings, binding_count, .. } = *target;
    let version = version(target)?;
    if flags & !GIRANDOLE_TRANSLATE_UNCHECKED != 0 {
        return Err(Failure::bad_value("set of GIRANDOLE_TRANSLATE_*", format!("{flags:#x}")));
    }
    let is_unchecked = flags & GIRANDOLE_TRANSLATE_UNCHECKED != 0;
    // SAFETY: the caller's promise.
    let targets = unsafe { array(bindings, binding_count, "target.bindings")? };
    let module = &source.module;
    let mut entry = None;
    if !entry_point.is_null() {
        // SAFETY: the caller's promise.
        let name = unsafe { text(entry_point, "target.entry_point")? };
        entry = module.entry_points.iter().position(|entry| entry.name == name);
        if entry.is_none() {
            return Err(Failure::bad_value("entry point of the text", format!("{name:?}")));
        }
    }
    let mut bound = resources(source, entry);
    place(&mut bound, targets, language)?;
    let sizes_index = match language {
        GIRANDOLE_LANGUAGE_MSL if !module.entry_points.is_empty() => {
            bound.iter().map(|bound| bound.index + 1).max().unwrap_or(0)
        }
        _ => GIRANDOLE_NO_INDEX,
    };
    let same_names = || module.entry_points.iter().map(|entry| entry.name.clone()).collect::<Vec<_>>();
    let (code, names) = match language {
        GIRANDOLE_LANGUAGE_WGSL => (Err(source.text.clone()), same_names()),
        GIRANDOLE_LANGUAGE_SPIRV => (Ok(spirv(source, &bound, version, entry, is_unchecked)?), same_names()),
        GIRANDOLE_LANGUAGE_HLSL => {
            let (text, names) = hlsl_text(source, &bound, version, entry, is_unchecked)?;
            (Err(text), names)
        }
        _ => {
            let (text, names) = msl_text(source, &bound, version, entry, is_unchecked, sizes_index)?;
            (Err(text), names)
        }
    };
    let code = match code {
        Ok(words) => Code::Words(words),
        Err(text) => Code::Text(CString::new(text).map_err(translation_error)?),
    };
    let mut shader =
        GirandoleShader { code, entry_points: Vec::new(), bindings: Vec::new(), sizes_index, names: Vec::new() };
    // The back ends list the names of the selected entry points only.
    let chosen = module.entry_points.iter().enumerate().filter(|(index, _)| entry.is_none_or(|only| only == *index));
    let names: Vec<_> = if names.len() == module.entry_points.len() {
        chosen.clone().map(|(index, _)| names[index].clone()).collect()
    } else {
        names
    };
    for ((_, point), name_in_code) in chosen.zip(names) {
        let row = GirandoleEntryPoint {
            name: shader.keep(&point.name),
            name_in_code: shader.keep(&name_in_code),
            stage: stage(point.stage),
            workgroup_size: point.workgroup_size,
        };
        shader.entry_points.push(row);
    }
    for Bound { name, from, kind, letter, size, space, index } in bound {
        let register_letter = if language == GIRANDOLE_LANGUAGE_HLSL { letter as c_char } else { 0 };
        let name = shader.keep(&name);
        let (group, binding) = (from.group, from.binding);
        shader.bindings.push(GirandoleShaderBinding {
            name,
            group,
            binding,
            kind,
            space,
            index,
            register_letter,
            size,
        });
    }
    Ok(shader)
}

/// Translates a WGSL text, for example the text of girandole_shader_include and the engine's own text, one
/// after the other, to another language. Destroy the shader with girandole_shader_destroy.
///
/// wgsl: a UTF-8 text that ends with a zero. Any feature of WGSL that naga knows is allowed. Takes
/// milliseconds.
///
/// Errors: GIRANDOLE_ERROR_WGSL if the text is not valid, with the place in the message;
/// GIRANDOLE_ERROR_TRANSLATION if the language lacks something that the text needs.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn girandole_translate(
    wgsl: *const c_char,
    target: *const GirandoleTarget,
    shader: *mut *mut GirandoleShader,
) -> GirandoleStatus {
    call(|| {
        // SAFETY: see the crate's documentation.
        let (wgsl, target) = unsafe { (text(wgsl, "wgsl")?, object(target, "target")?) };
        // SAFETY: see the crate's documentation.
        let out = unsafe { result(shader, "shader")? };
        let source = Source::checked(wgsl.to_owned())?;
        // SAFETY: see the crate's documentation.
        out.set(Box::into_raw(Box::new(unsafe { translate(&source, target)? })));
        Ok(())
    })
}
