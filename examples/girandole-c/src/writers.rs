//! The back ends of naga, with the options of this interface.

use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind};

use naga::back::{hlsl, msl, spv};
use naga::proc::{BoundsCheckPolicies, BoundsCheckPolicy};
use naga::{Module, ShaderStage};

use crate::bindings::GIRANDOLE_BINDING_READ_WRITE;
use crate::source::{Bound, Constant, Sort, Source};
use crate::status::{Failure, GIRANDOLE_ERROR_TRANSLATION};

pub(crate) fn translation_error(error: impl std::fmt::Display) -> Failure {
    Failure::new(GIRANDOLE_ERROR_TRANSLATION, error.to_string())
}

fn checks(is_unchecked: bool) -> BoundsCheckPolicies {
    let policy = if is_unchecked { BoundsCheckPolicy::Unchecked } else { BoundsCheckPolicy::Restrict };
    BoundsCheckPolicies {
        index: policy,
        buffer: policy,
        image_load: policy,
        binding_array: BoundsCheckPolicy::Unchecked,
    }
}

/// Runs a writer. Some texts that are valid make it panic.
pub(crate) fn without_panics<R>(write: impl FnOnce() -> Result<R, Failure>) -> Result<R, Failure> {
    catch_unwind(AssertUnwindSafe(write)).unwrap_or_else(|payload| {
        // Dropping a payload could panic again.
        if let Err(again) = catch_unwind(AssertUnwindSafe(|| drop(payload))) {
            std::mem::forget(again);
        }
        Err(translation_error("naga cannot write this text in the language"))
    })
}

pub(crate) fn spirv(
    source: &Source,
    (module, info): &Constant<'_>,
    bound: &[Bound],
    version: (u32, u32),
    entry: Option<usize>,
    is_unchecked: bool,
) -> Result<Vec<u32>, Failure> {
    if module.entry_points.is_empty() {
        return Err(translation_error("SPIR-V needs an entry point: join the text with one of your own"));
    }
    let mut options = spv::Options {
        lang_version: (version.0 as u8, version.1 as u8),
        flags: spv::WriterFlags::LABEL_VARYINGS,
        fake_missing_bindings: false,
        bounds_check_policies: checks(is_unchecked),
        force_loop_bounding: false,
        zero_initialize_workgroup_memory: match source.zeroes_workgroups {
            true => spv::ZeroInitializeWorkgroupMemoryMode::Polyfill,
            false => spv::ZeroInitializeWorkgroupMemoryMode::None,
        },
        ..spv::Options::default()
    };
    let target = |bound: &Bound| {
        (bound.from, spv::BindingInfo { descriptor_set: bound.space, binding: bound.index, binding_array_size: None })
    };
    options.binding_map = bound.iter().map(target).collect();
    let pipeline = entry.map(|index| spv::PipelineOptions {
        shader_stage: module.entry_points[index].stage,
        entry_point: module.entry_points[index].name.clone(),
    });
    spv::write_vec(module, info, &options, pipeline.as_ref()).map_err(translation_error)
}

/// A text, and the names of entry points in it by their index.
type Written = (String, Vec<String>);

fn selected(module: &Module, entry: Option<usize>) -> Option<(ShaderStage, String)> {
    entry.map(|index| (module.entry_points[index].stage, module.entry_points[index].name.clone()))
}

pub(crate) fn hlsl_text(
    source: &Source,
    (module, info): &Constant<'_>,
    bound: &[Bound],
    version: (u32, u32),
    entry: Option<usize>,
    is_unchecked: bool,
) -> Result<Written, Failure> {
    let shader_model = match version {
        (5, 1) => hlsl::ShaderModel::V5_1,
        (6, 0) => hlsl::ShaderModel::V6_0,
        (6, 1) => hlsl::ShaderModel::V6_1,
        (6, 2) => hlsl::ShaderModel::V6_2,
        (6, 3) => hlsl::ShaderModel::V6_3,
        (6, 4) => hlsl::ShaderModel::V6_4,
        (6, 5) => hlsl::ShaderModel::V6_5,
        (6, 6) => hlsl::ShaderModel::V6_6,
        _ => hlsl::ShaderModel::V6_7,
    };
    let restrict_indexing = !is_unchecked;
    let target = |bound: &Bound| {
        let (space, register) = (bound.space as u8, bound.index);
        let target = hlsl::BindTarget { space, register, restrict_indexing, ..hlsl::BindTarget::default() };
        (bound.from, target)
    };
    let options = hlsl::Options {
        shader_model,
        binding_map: bound.iter().map(target).collect(),
        fake_missing_bindings: false,
        restrict_indexing,
        force_loop_bounding: false,
        zero_initialize_workgroup_memory: source.zeroes_workgroups,
        ..hlsl::Options::default()
    };
    let pipeline = hlsl::PipelineOptions { entry_point: selected(module, entry) };
    let mut text = String::new();
    let names = hlsl::Writer::new(&mut text, &options, &pipeline).write(module, info, None);
    let names = names.map_err(translation_error)?.entry_point_names;
    Ok((text, names.into_iter().collect::<Result<_, _>>().map_err(translation_error)?))
}

pub(crate) fn msl_text(
    source: &Source,
    (module, info): &Constant<'_>,
    bound: &[Bound],
    version: (u32, u32),
    entry: Option<usize>,
    is_unchecked: bool,
    sizes_index: u32,
) -> Result<Written, Failure> {
    let target = |bound: &Bound| {
        let slot = bound.index as u8;
        let mut target = msl::BindTarget { mutable: bound.kind == GIRANDOLE_BINDING_READ_WRITE, ..Default::default() };
        match bound.sort {
            Sort::Sampler => target.sampler = Some(msl::BindSamplerTarget::Resource(slot)),
            Sort::Texture => {
                target.texture = Some(slot);
                target.mutable = bound.letter == b'u';
            }
            // Arrays are argument buffers.
            Sort::Buffer | Sort::Array => target.buffer = Some(slot),
        }
        (bound.from, target)
    };
    // Two entry points may use different variables at one binding.
    let resources = |index: usize| {
        let used = |bound: &&Bound| !source.info.get_entry_point(index)[bound.variable].is_empty();
        msl::EntryPointResources {
            resources: bound.iter().filter(used).map(target).collect(),
            sizes_buffer: Some(sizes_index as u8),
            ..Default::default()
        }
    };
    let entries = module.entry_points.iter().enumerate();
    let entries = entries.map(|(index, entry)| (entry.name.clone(), resources(index)));
    let options = msl::Options {
        lang_version: (version.0 as u8, version.1 as u8),
        per_entry_point_map: entries.collect::<BTreeMap<_, _>>(),
        fake_missing_bindings: false,
        bounds_check_policies: checks(is_unchecked),
        force_loop_bounding: false,
        zero_initialize_workgroup_memory: source.zeroes_workgroups,
        ..msl::Options::default()
    };
    let pipeline = msl::PipelineOptions { entry_point: selected(module, entry), ..Default::default() };
    let (text, names) = msl::write_string(module, info, &options, &pipeline).map_err(translation_error)?;
    let names = names.entry_point_names.into_iter().collect::<Result<_, _>>();
    Ok((text, names.map_err(|error| translation_error(format!("{error:?}")))?))
}
