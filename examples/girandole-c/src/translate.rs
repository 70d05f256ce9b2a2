//! Translates WGSL to the languages of drivers, by naga.

use std::borrow::Cow;
use std::ffi::{CStr, CString, c_char};
use std::ops::RangeInclusive;

use naga::{AddressSpace, GlobalVariable, ImageClass, Module, ShaderStage, StorageAccess, TypeInner};

use crate::bindings::{
    GIRANDOLE_BINDING_OTHER, GIRANDOLE_BINDING_READ, GIRANDOLE_BINDING_READ_WRITE, GIRANDOLE_BINDING_UNIFORM,
    GirandoleBindingKind,
};
use crate::memory::{array, object, result};
use crate::shader::*;
use crate::source::{Bound, Sort, Source};
use crate::status::{Failure, GIRANDOLE_ERROR_BAD_TEXT, GIRANDOLE_ERROR_BAD_VALUE, GirandoleStatus, call};
use crate::writers::{hlsl_text, msl_text, spirv, translation_error, without_panics};

/// The sort and kind of a resource, and the letter of its register in HLSL.
fn kind_of(module: &Module, variable: &GlobalVariable) -> (Sort, GirandoleBindingKind, u8) {
    let inner = &module.types[variable.ty].inner;
    if let TypeInner::BindingArray { base, .. } = *inner {
        let (sort, _, letter) = kind_of(module, &GlobalVariable { ty: base, ..variable.clone() });
        // Arrays of samplers are refused as samplers are.
        let letter = if sort == Sort::Sampler { b's' } else { letter };
        return (Sort::Array, GIRANDOLE_BINDING_OTHER, letter);
    }
    match (variable.space, inner) {
        (AddressSpace::Uniform, _) => (Sort::Buffer, GIRANDOLE_BINDING_UNIFORM, b'b'),
        (AddressSpace::Storage { access }, _) if access.contains(StorageAccess::STORE) => {
            (Sort::Buffer, GIRANDOLE_BINDING_READ_WRITE, b'u')
        }
        (AddressSpace::Storage { .. }, _) => (Sort::Buffer, GIRANDOLE_BINDING_READ, b't'),
        (_, TypeInner::Sampler { .. }) => (Sort::Sampler, GIRANDOLE_BINDING_OTHER, b's'),
        // Storage textures are unordered access views, even if they are only read.
        (_, TypeInner::Image { class: ImageClass::Storage { .. }, .. }) => {
            (Sort::Texture, GIRANDOLE_BINDING_OTHER, b'u')
        }
        _ => (Sort::Texture, GIRANDOLE_BINDING_OTHER, b't'),
    }
}

/// The resources that an entry point uses, or all, in the order of group and binding.
fn resources(source: &Source, entry_point: Option<usize>) -> Vec<Bound> {
    let Source { module, info, .. } = source;
    let mut bound = Vec::new();
    for (handle, variable) in module.global_variables.iter() {
        let is_used = entry_point.is_none_or(|index| !info.get_entry_point(index)[handle].is_empty());
        let Some(from) = variable.binding.filter(|_| is_used) else { continue };
        let (sort, kind, letter) = kind_of(module, variable);
        let inner = &module.types[variable.ty].inner;
        let size = if kind == GIRANDOLE_BINDING_OTHER { 0 } else { inner.size(module.to_ctx()) };
        let (space, index) = (from.group, from.binding);
        let name = variable.name.clone().unwrap_or_default();
        bound.push(Bound { variable: handle, sort, name, from, kind, letter, size, space, index });
    }
    bound.sort_by_key(|bound| (bound.from.group, bound.from.binding));
    bound
}

/// Moves resources to where the caller wants them. Two at one place are the caller's choice.
fn place(bound: &mut [Bound], targets: &[GirandoleBindTarget], language: GirandoleLanguage) -> Result<(), Failure> {
    // Two entry points may use different variables at one binding, which then have one index.
    let mut distinct: Vec<_> = bound.iter().map(|bound| (bound.from.group, bound.from.binding)).collect();
    distinct.dedup();
    for bound in bound.iter_mut() {
        let from = (bound.from.group, bound.from.binding);
        if language == GIRANDOLE_LANGUAGE_MSL {
            let index = distinct.iter().position(|other| *other == from).unwrap_or(0) as u32;
            (bound.space, bound.index) = (0, index);
        }
        if let Some(target) = targets.iter().find(|target| (target.group, target.binding) == from) {
            bound.index = target.index;
            if language != GIRANDOLE_LANGUAGE_MSL {
                bound.space = target.space;
            }
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
    // Ranges of minor versions, for each major version.
    type Versions = &'static [(u32, RangeInclusive<u32>)];
    let (default, known): (_, Versions) = match target.language {
        GIRANDOLE_LANGUAGE_WGSL => ((1, 0), &[(1, 0..=0)]),
        GIRANDOLE_LANGUAGE_SPIRV => ((1, 3), &[(1, 0..=6)]),
        GIRANDOLE_LANGUAGE_HLSL => ((6, 0), &[(5, 1..=1), (6, 0..=7)]),
        GIRANDOLE_LANGUAGE_MSL => ((2, 1), &[(1, 0..=2), (2, 0..=4), (3, 0..=1)]),
        other => return Err(Failure::bad_value("language of shaders", other)),
    };
    if given == (0, 0) {
        return Ok(default);
    }
    if known.iter().any(|(major, minors)| *major == given.0 && minors.contains(&given.1)) {
        return Ok(given);
    }
    let range = |(major, minors): &(u32, RangeInclusive<u32>)| {
        format!("{major}.{} to {major}.{}", minors.start(), minors.end())
    };
    let ranges = known.iter().map(range).collect::<Vec<_>>().join(", ");
    Err(Failure::bad_value(&format!("version of the language; {ranges} are"), format!("{}.{}", given.0, given.1)))
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
    if language == GIRANDOLE_LANGUAGE_WGSL && !targets.is_empty() {
        let message = "WGSL texts are returned unchanged: they take no target.bindings";
        return Err(Failure::new(GIRANDOLE_ERROR_BAD_VALUE, message));
    }
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
    if let (GIRANDOLE_LANGUAGE_HLSL, Some(sampler)) = (language, bound.iter().find(|bound| bound.letter == b's')) {
        let message = format!(
            "{} is a sampler, which cannot be written in HLSL: naga takes samplers from a heap of its own",
            sampler.name
        );
        return Err(translation_error(message));
    }
    let constant = match language {
        GIRANDOLE_LANGUAGE_WGSL => (Cow::Borrowed(module), Cow::Borrowed(&source.info)),
        _ => without_panics(|| source.constant())?,
    };
    let sizes_index = match language {
        GIRANDOLE_LANGUAGE_MSL if !module.entry_points.is_empty() => {
            bound.iter().map(|bound| bound.index + 1).max().unwrap_or(0)
        }
        _ => GIRANDOLE_NO_INDEX,
    };
    let same_names = || module.entry_points.iter().map(|entry| entry.name.clone()).collect::<Vec<_>>();
    let (code, names) = match language {
        GIRANDOLE_LANGUAGE_WGSL => (Err(source.text.clone()), same_names()),
        GIRANDOLE_LANGUAGE_SPIRV => {
            let write = || spirv(source, &constant, &bound, version, entry, is_unchecked);
            (Ok(without_panics(write)?), same_names())
        }
        GIRANDOLE_LANGUAGE_HLSL => {
            let (text, names) = without_panics(|| hlsl_text(source, &constant, &bound, version, entry, is_unchecked))?;
            (Err(text), names)
        }
        _ => {
            let write = || msl_text(source, &constant, &bound, version, entry, is_unchecked, sizes_index);
            let (text, names) = without_panics(write)?;
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
    let chosen =
        constant.0.entry_points.iter().enumerate().filter(|(index, _)| entry.is_none_or(|only| only == *index));
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
    for Bound { name, from, kind, letter, size, space, index, .. } in bound {
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
/// milliseconds. naga reads texts recursively: expressions that are nested very deeply, such as a sum of 20,000
/// terms, may overflow the stack and so end the process. Do not pass texts of strangers.
///
/// Overrides get their default values. Without a default value, the text cannot be translated.
///
/// Errors: GIRANDOLE_ERROR_WGSL if the text is not valid, with the place in the message;
/// GIRANDOLE_ERROR_TRANSLATION if the language, or naga's writer for it, lacks something that the text needs.
/// Samplers and immediates cannot be written in HLSL, and external textures not in SPIR-V.
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shader::{GIRANDOLE_LANGUAGE_HLSL, GIRANDOLE_LANGUAGE_MSL};
    use crate::status::GIRANDOLE_ERROR_TRANSLATION;

    fn target(language: GirandoleLanguage, targets: &[GirandoleBindTarget]) -> GirandoleTarget {
        GirandoleTarget {
            language,
            major_version: 0,
            minor_version: 0,
            flags: 0,
            entry_point: std::ptr::null(),
            bindings: targets.as_ptr(),
            binding_count: targets.len(),
        }
    }

    fn made(text: &str, target: &GirandoleTarget) -> Result<GirandoleShader, Failure> {
        let source = Source::checked(text.to_owned()).expect("it is valid");
        // SAFETY: the array of the target lives.
        unsafe { translate(&source, target) }
    }

    fn text(shader: &GirandoleShader) -> &str {
        let Code::Text(text) = &shader.code else { panic!("a text is no SPIR-V") };
        text.to_str().expect("UTF-8")
    }

    #[test]
    fn variables_at_one_binding_have_one_index_in_msl() {
        let wgsl = "@group(0) @binding(0) var<storage, read_write> first: array<u32, 4>;
            @group(0) @binding(0) var<uniform> second: vec4<u32>;
            @group(0) @binding(5) var<storage, read_write> out: array<u32, 4>;
            @compute @workgroup_size(1) fn a() { out[0] = first[1]; }
            @compute @workgroup_size(1) fn b() { out[1] = second.x; }";
        let moved = [GirandoleBindTarget { group: 0, binding: 5, space: 3, index: 1 }];
        for targets in [&[][..], &moved] {
            let shader = made(wgsl, &target(GIRANDOLE_LANGUAGE_MSL, targets)).expect("it is translated");
            let rows: Vec<_> = shader.bindings.iter().map(|row| (row.binding, row.space, row.index)).collect();
            assert_eq!(rows, [(0, 0, 0), (0, 0, 0), (5, 0, 1)]);
            assert_eq!(text(&shader).matches("[[buffer(0)]]").count(), 2, "{}", text(&shader));
            assert_eq!(text(&shader).matches("[[buffer(1)]]").count(), 2, "{}", text(&shader));
        }
    }

    #[test]
    fn only_versions_that_exist_are_known() {
        let is_known = |language, major_version, minor_version| {
            let target = GirandoleTarget { major_version, minor_version, ..target(language, &[]) };
            version(&target).is_ok()
        };
        let known = |language| {
            let all = (0..10).flat_map(|major| (0..400).map(move |minor| (major, minor)));
            all.filter(|(major, minor)| is_known(language, *major, *minor)).collect::<Vec<_>>()
        };
        let msl = [(0, 0), (1, 0), (1, 1), (1, 2), (2, 0), (2, 1), (2, 2), (2, 3), (2, 4), (3, 0), (3, 1)];
        assert_eq!(known(GIRANDOLE_LANGUAGE_MSL), msl);
        let hlsl = [(0, 0), (5, 1), (6, 0), (6, 1), (6, 2), (6, 3), (6, 4), (6, 5), (6, 6), (6, 7)];
        assert_eq!(known(GIRANDOLE_LANGUAGE_HLSL), hlsl);
    }

    #[test]
    fn overrides_get_their_default_values() {
        let wgsl = "override N: u32 = 12;
            var<workgroup> kept: array<u32, N>;
            @compute @workgroup_size(N, 2) fn main() { kept[0] = N; }";
        for language in [GIRANDOLE_LANGUAGE_SPIRV, GIRANDOLE_LANGUAGE_HLSL, GIRANDOLE_LANGUAGE_MSL] {
            let shader = made(wgsl, &target(language, &[])).expect("it is translated");
            assert_eq!(shader.entry_points[0].workgroup_size, [12, 2, 1], "language {language}");
        }
        let unset = "override N: u32; @compute @workgroup_size(N) fn main() {}";
        let refused = made(unset, &target(GIRANDOLE_LANGUAGE_MSL, &[])).map(drop);
        assert_eq!(refused.map_err(|failure| failure.code), Err(GIRANDOLE_ERROR_TRANSLATION));
    }

    #[test]
    fn storage_textures_are_unordered_access_views_and_arrays_are_of_another_kind() {
        let wgsl = "@group(0) @binding(0) var picture: texture_storage_2d<r32float, read>;
            @group(0) @binding(1) var<storage, read_write> out: array<f32, 4>;
            @compute @workgroup_size(1) fn main() { out[0] = textureLoad(picture, vec2(0, 0)).x; }";
        let shader = made(wgsl, &target(GIRANDOLE_LANGUAGE_HLSL, &[])).expect("it is translated");
        assert_eq!(shader.bindings[0].register_letter as u8, b'u');
        assert!(text(&shader).contains("register(u0"), "{}", text(&shader));
        let wgsl = "enable wgpu_binding_array;
            struct Part { x: array<u32, 4> }
            @group(0) @binding(0) var<storage, read_write> parts: binding_array<Part, 3>;
            @compute @workgroup_size(1) fn main() { parts[1].x[0] = 1u; }";
        let shader = made(wgsl, &target(GIRANDOLE_LANGUAGE_SPIRV, &[])).expect("it is translated");
        assert_eq!((shader.bindings[0].kind, shader.bindings[0].size), (GIRANDOLE_BINDING_OTHER, 0));
    }
}
