//! WGSL to SPIR-V, as wgpu does it.

use naga::AddressSpace;
use naga::back::spv::{self, ZeroInitializeWorkgroupMemoryMode};
use naga::proc::{BoundsCheckPolicies, BoundsCheckPolicy};
use naga::valid::{Capabilities, ValidationFlags, Validator};

/// Who clears workgroup memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Zeroing {
    /// Nobody, as the library asks for
    None,
    /// The driver
    Native,
    /// Stores at the start of the shader
    Stores,
}

impl Zeroing {
    pub fn name(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::Native => "native",
            Self::Stores => "stores",
        }
    }
}

/// A buffer that a shader binds.
#[derive(Clone, Copy, Debug)]
pub struct Bound {
    pub group: u32,
    pub binding: u32,
    pub is_uniform: bool,
}

/// A compute shader for the driver.
#[derive(Clone, Debug)]
pub struct Translated {
    pub words: Vec<u32>,
    pub buffers: Vec<Bound>,
}

/// Translates one entry point as wgpu does for this driver: reads of buffers are checked by the
/// hardware, indices of arrays are clamped, and loops are bounded. A trusted shader has no checks, as
/// from `wgpu::Device::create_shader_module_trusted`.
pub fn translate(wgsl: &str, entry: &str, zeroing: Zeroing, is_trusted: bool) -> Result<Translated, String> {
    let module = naga::front::wgsl::parse_str(wgsl).map_err(|error| error.emit_to_string(wgsl))?;
    let info = Validator::new(ValidationFlags::all(), Capabilities::all())
        .validate(&module)
        .map_err(|error| error.emit_to_string(wgsl))?;
    let index = module.entry_points.iter().position(|found| found.name == entry).ok_or("no such entry point")?;
    let options = spv::Options {
        lang_version: (1, 6),
        force_loop_bounding: !is_trusted,
        bounds_check_policies: BoundsCheckPolicies {
            index: if is_trusted { BoundsCheckPolicy::Unchecked } else { BoundsCheckPolicy::Restrict },
            buffer: BoundsCheckPolicy::Unchecked,
            image_load: BoundsCheckPolicy::Unchecked,
            binding_array: BoundsCheckPolicy::Unchecked,
        },
        zero_initialize_workgroup_memory: match zeroing {
            Zeroing::None => ZeroInitializeWorkgroupMemoryMode::None,
            Zeroing::Native => ZeroInitializeWorkgroupMemoryMode::Native,
            Zeroing::Stores => ZeroInitializeWorkgroupMemoryMode::Polyfill,
        },
        ..spv::Options::default()
    };
    let pipeline = spv::PipelineOptions { shader_stage: naga::ShaderStage::Compute, entry_point: entry.to_owned() };
    let words = spv::write_vec(&module, &info, &options, Some(&pipeline)).map_err(|error| error.to_string())?;
    let used = info.get_entry_point(index);
    let used = |handle: naga::Handle<naga::GlobalVariable>| !used[handle].is_empty();
    let globals = module.global_variables.iter().filter(|(handle, _)| used(*handle));
    let bound = |global: &naga::GlobalVariable| {
        let place = global.binding?;
        let is_uniform = global.space == AddressSpace::Uniform;
        Some(Bound { group: place.group, binding: place.binding, is_uniform })
    };
    Ok(Translated { words, buffers: globals.filter_map(|(_, global)| bound(global)).collect() })
}
