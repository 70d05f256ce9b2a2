//! The WGSL functions as a module that shader composers import.

/// Turns a text of [`wgsl`](super::wgsl) into a module for naga_oil, the composer of Bevy 0.19, with the import path
/// `girandole`.
///
/// ```text
/// #import girandole::{light_surface_point, light_sample}
/// ```
///
/// `text` may come from [`wgsl`](super::wgsl), [`wgsl_with`](super::wgsl_with) or
/// `girandole::gpu::LightShader`. Add only one such
/// module to a composer. Its bindings belong to the group that the text was made for.
///
/// WESL, the composer of Bevy 0.20, needs no such call: every text already is a WESL module. Add it to the resolver
/// under the path `girandole`, and write `import girandole::{light_surface_point, light_sample};`.
#[must_use]
pub fn naga_oil_module(text: &str) -> String {
    format!("#define_import_path girandole\n{text}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::Effects;
    use crate::plan::{ShaderParts, wgsl_with};

    /// naga_oil reads each line with `#` as a directive or as the use of a definition, and reads names
    /// with `X_naga_oil` as its own. Its composition of these texts is tested with Bevy.
    #[test]
    fn the_only_directive_of_a_module_is_its_import_path() {
        let parts = ShaderParts::default().with_heat_map().with_previous();
        for effects in [Effects::all(), Effects::empty()] {
            let module = naga_oil_module(&wgsl_with(2, effects, &parts));
            let directives: Vec<&str> = module.lines().filter(|line| line.contains('#')).collect();
            assert_eq!(directives, ["#define_import_path girandole"], "{effects:?}");
            assert!(!module.contains("naga_oil"));
            assert!(module.contains("\nfn light_sample(") && module.contains("\nfn light_reservoir_sample_previous("));
        }
    }
}
