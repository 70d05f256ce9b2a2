//! The text of every kernel in the languages that wgpu and engines hand to drivers: HLSL, MSL and GLSL
//! ES; `stats.rs` has SPIR-V. A translation fails if a text uses what a language does not have.

use naga::ShaderStage;
use naga::back::{glsl, hlsl, msl};
use naga::proc::{BoundsCheckPolicies, BoundsCheckPolicy};
use naga::valid::{Capabilities, ModuleInfo, ValidationFlags, Validator};

use measure::kernels::subjects::{self, Subject};

/// The checks that wgpu asks for.
const CHECKS: BoundsCheckPolicies = BoundsCheckPolicies {
    index: BoundsCheckPolicy::Restrict,
    buffer: BoundsCheckPolicy::Restrict,
    image_load: BoundsCheckPolicy::Restrict,
    binding_array: BoundsCheckPolicy::Unchecked,
};

/// Translates all kernels, and hands the text of each to `check`.
fn translate_all(
    language: &str,
    translate: impl Fn(&naga::Module, &ModuleInfo, &str) -> Result<String, String>,
    check: impl Fn(&str, &str),
) {
    for Subject { kernel, effects, entry, wgsl } in subjects::all() {
        let module = naga::front::wgsl::parse_str(&wgsl).expect("kernels are valid");
        // Without capabilities: what every adapter has.
        let info = Validator::new(ValidationFlags::all(), Capabilities::empty()).validate(&module);
        let info = info.unwrap_or_else(|error| panic!("{kernel} {effects}: {}", error.emit_to_string(&wgsl)));
        let text = translate(&module, &info, entry).unwrap_or_else(|error| panic!("{kernel} {effects}: {error}"));
        assert!(text.len() > 500, "{language} of {kernel} {effects}:\n{text}");
        check(&text, entry);
    }
}

#[test]
fn every_kernel_becomes_hlsl() {
    let options = hlsl::Options {
        shader_model: hlsl::ShaderModel::V6_0,
        fake_missing_bindings: true,
        zero_initialize_workgroup_memory: false,
        ..hlsl::Options::default()
    };
    let translate = |module: &naga::Module, info: &ModuleInfo, entry: &str| {
        let mut text = String::new();
        let pipeline = hlsl::PipelineOptions { entry_point: Some((ShaderStage::Compute, entry.to_owned())) };
        let names = hlsl::Writer::new(&mut text, &options, &pipeline)
            .write(module, info, None)
            .map_err(|error| error.to_string())?;
        names.entry_point_names.into_iter().collect::<Result<Vec<_>, _>>().map_err(|error| error.to_string())?;
        Ok(text)
    };
    translate_all("HLSL", translate, |text, entry| {
        assert!(text.contains("[numthreads(") && text.contains(&format!("void {entry}(")), "{text}");
    });
}

#[test]
fn every_kernel_becomes_msl() {
    let options = msl::Options {
        lang_version: (2, 1),
        fake_missing_bindings: true,
        bounds_check_policies: CHECKS,
        zero_initialize_workgroup_memory: false,
        ..msl::Options::default()
    };
    let translate = |module: &naga::Module, info: &ModuleInfo, entry: &str| {
        let pipeline = msl::PipelineOptions {
            entry_point: Some((ShaderStage::Compute, entry.to_owned())),
            ..msl::PipelineOptions::default()
        };
        let (text, names) = msl::write_string(module, info, &options, &pipeline).map_err(|error| error.to_string())?;
        names.entry_point_names.into_iter().collect::<Result<Vec<_>, _>>().map_err(|error| format!("{error:?}"))?;
        Ok(text)
    };
    translate_all("MSL", translate, |text, entry| {
        assert!(text.contains(&format!("kernel void {entry}(")), "{text}");
    });
}

#[test]
fn every_kernel_becomes_glsl_es() {
    let translate = |module: &naga::Module, info: &ModuleInfo, entry: &str| {
        let options = glsl::Options {
            version: glsl::Version::Embedded { version: 310, is_webgl: false },
            zero_initialize_workgroup_memory: false,
            ..glsl::Options::default()
        };
        let pipeline = glsl::PipelineOptions {
            shader_stage: ShaderStage::Compute,
            entry_point: entry.to_owned(),
            multiview: None,
        };
        let mut text = String::new();
        glsl::Writer::new(&mut text, module, info, &options, &pipeline, CHECKS)
            .and_then(|mut writer| writer.write())
            .map_err(|error| error.to_string())?;
        Ok(text)
    };
    translate_all("GLSL", translate, |text, _| {
        assert!(text.starts_with("#version 310 es") && text.contains("void main()"), "{text}");
    });
}
