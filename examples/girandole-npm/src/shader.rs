//! WGSL: the kernels of plans, and the functions for the page's own shaders.

use girandole::Effects;
use girandole::plan::{self, Binding};
use wasm_bindgen::prelude::wasm_bindgen;

use crate::failure::Failure;

/// A compute shader that plans dispatch. All its bindings are in group 0.
#[wasm_bindgen]
pub struct Kernel(plan::Kernel);

#[wasm_bindgen]
impl Kernel {
    /// The name of the kernel, and of its entry point.
    #[wasm_bindgen(getter)]
    pub fn entry(&self) -> String {
        self.0.entry().to_owned()
    }

    /// The WGSL text.
    #[wasm_bindgen(getter)]
    pub fn wgsl(&self) -> String {
        self.0.wgsl()
    }

    /// The kinds of its bindings from number 0 on, as in `GPUBufferBindingLayout`. Number 0 is a uniform
    /// buffer with a dynamic offset.
    #[wasm_bindgen(getter, unchecked_return_type = "GPUBufferBindingType[]")]
    pub fn bindings(&self) -> Vec<String> {
        let name = |binding: &Binding| match binding {
            Binding::Uniform { .. } => "uniform",
            Binding::Read => "read-only-storage",
            _ => "storage",
        };
        self.0.bindings().iter().map(|binding| name(binding).to_owned()).collect()
    }

    /// The bytes of the uniform buffer that it reads, from the dynamic offset on.
    #[wasm_bindgen(getter, js_name = uniformBytes)]
    pub fn uniform_bytes(&self) -> u32 {
        let bytes = |binding: &Binding| match binding {
            Binding::Uniform { bytes } => Some(*bytes),
            _ => None,
        };
        self.0.bindings().iter().find_map(bytes).unwrap_or(0)
    }
}

/// All kernels that plans dispatch.
#[wasm_bindgen]
pub fn kernels() -> Vec<Kernel> {
    let [cuts @ .., _] = plan::cut_kernels(Effects::all());
    plan::KERNELS.iter().copied().chain(cuts).map(Kernel).collect()
}

/// The names of effects: features that lights and instances may have, for which shaders are made.
pub fn names(effects: Effects) -> Vec<String> {
    effects.names().map(str::to_owned).collect()
}

fn effect(name: &str) -> Result<Effects, Failure> {
    let named = |effect: &Effects| effect.names().eq([name]);
    Effects::all().iter().find(named).ok_or_else(|| Failure::Plain(format!("there is no effect named \"{name}\"")))
}

/// The text that a page puts before its own WGSL, after its directives. It binds a uniform buffer at 0 and six
/// storage buffers at 1 to 6 of the group, of which it writes the last. Without `effects` it is right for all lights;
/// with the effects of the planner it is shorter.
#[wasm_bindgen]
pub fn wgsl(group: u32, effects: Option<Vec<String>>) -> Result<String, Failure> {
    let mut chosen = Effects::empty();
    for name in effects.iter().flatten() {
        chosen |= effect(name)?;
    }
    Ok(plan::wgsl(group, if effects.is_some() { chosen } else { Effects::all() }))
}
