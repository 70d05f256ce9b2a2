//! The engine's function that weighs candidates in its shader.

use super::error::ShaderNameError;

/// Names of an engine's WGSL: the function that weighs candidates, and the type of its argument.
///
/// [`ShaderParts::target`](super::ShaderParts::target) adds the function
/// `light_resample_by` to the text, which calls the engine's function for each candidate:
///
/// ```
/// use girandole::plan::TargetHook;
/// let hook = TargetHook::new("reflected_luminance", "Material")?;
/// # assert_eq!((hook.function(), hook.argument()), ("reflected_luminance", "Material"));
/// # Ok::<(), girandole::plan::ShaderNameError>(())
/// ```
///
/// ```wgsl
/// // In the text of the engine:
/// struct Material { base_color: vec3<f32>, roughness: f32, toward_eye: vec3<f32> }
/// fn reflected_luminance(shading_point: LightShadingPoint, material: Material, candidate: LightSample) -> f32
/// // In the text of the library:
/// fn light_resample_by(
///     shading_point: LightShadingPoint, argument: Material, u: vec4<f32>, choice: f32, candidates: u32,
/// ) -> LightReservoir
/// ```
///
/// The engine's function returns the target of
/// [`LightSampler::resample_by`](crate::LightSampler::resample_by): best the luminance of
/// `brdf * cosine * candidate.radiance`. The library divides it by `pmf * pdf`. A target that is
/// NaN or below 1.2e-38 means that the candidate is not wanted, so the target must be positive
/// wherever the light that the engine computes from the reservoir is.
///
/// WGSL has no order between functions, so the engine's function and type may stand anywhere in its
/// own text. The argument is passed by value. It carries what the shading point lacks, such as the
/// material and the direction towards the eye; its type is a struct, an alias or a predeclared type
/// such as `u32`. An engine that needs several targets puts a number into its struct.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct TargetHook {
    function: String,
    argument: String,
}

impl TargetHook {
    /// Names the function and the type of its argument. Whether the engine's text defines them is
    /// known when its shader is compiled.
    ///
    /// # Errors
    /// [`ShaderNameError`] for a name that is not an identifier of WGSL: ASCII letters, digits and
    /// `_`, without a digit first, without two `_` first, neither `_` alone nor a keyword or
    /// reserved word. WGSL allows letters beyond ASCII; here they are refused. Names that start
    /// with `light_` may collide with the library's own.
    pub fn new(function: &str, argument: &str) -> Result<Self, ShaderNameError> {
        for (what, name) in [("function", function), ("argument", argument)] {
            if !is_identifier(name) {
                return Err(ShaderNameError { what, name: name.to_owned() });
            }
        }
        Ok(Self { function: function.to_owned(), argument: argument.to_owned() })
    }

    /// The name of the function.
    pub fn function(&self) -> &str {
        &self.function
    }

    /// The name of the type of the argument.
    pub fn argument(&self) -> &str {
        &self.argument
    }
}

/// Whether WGSL accepts an ASCII name.
pub(super) fn is_identifier(name: &str) -> bool {
    let is_word = |c: char| c.is_ascii_alphanumeric() || c == '_';
    let starts_well = name.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_');
    let is_reserved = RESERVED.split_whitespace().any(|word| word == name);
    starts_well && name.chars().all(is_word) && name != "_" && !name.starts_with("__") && !is_reserved
}

/// The keywords and the reserved words of WGSL (W3C Candidate Recommendation Draft of 2025-08-09,
/// 16).
const RESERVED: &str = "alias break case const const_assert continue continuing default diagnostic discard else \
    enable false fn for if let loop override requires return struct switch true var while NULL \
    Self abstract active alignas alignof as asm asm_fragment async attribute auto await become \
    cast catch class co_await co_return co_yield coherent column_major common compile \
    compile_fragment concept const_cast consteval constexpr constinit crate debugger decltype \
    delete demote demote_to_helper do dynamic_cast enum explicit export extends extern external \
    fallthrough filter final finally friend from fxgroup get goto groupshared highp impl \
    implements import inline instanceof interface layout lowp macro macro_rules match mediump \
    meta mod module move mut mutable namespace new nil noexcept noinline nointerpolation \
    non_coherent noncoherent noperspective null nullptr of operator package packoffset partition \
    pass patch pixelfragment precise precision premerge priv protected pub public readonly ref \
    regardless register reinterpret_cast require resource restrict self set shared sizeof smooth \
    snorm static static_assert static_cast std subroutine super target template this thread_local \
    throw trait try type typedef typeid typename typeof union unless unorm unsafe unsized use \
    using varying virtual volatile wgsl where with writeonly yield";

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_accepted_where_they_are_identifiers() {
        for name in ["brdf_target", "Material", "u32", "_x", "a__", "A9", "targets", "light"] {
            let hook = TargetHook::new(name, name).expect("an identifier");
            assert_eq!((hook.function(), hook.argument()), (name, name));
            let text = format!("fn {name}() {{}}");
            assert!(naga::front::wgsl::parse_str(&text).is_ok(), "{name}");
        }
    }

    #[test]
    fn names_that_are_no_identifiers_are_refused_and_named() {
        let bad = ["", "_", "__x", "9a", "a b", "a-b", "a;", "vec3<f32>", "f(", "a\n", "target", "fn", "größe", "a//"];
        for name in bad {
            let error = ShaderNameError { what: "function", name: name.to_owned() };
            assert_eq!(TargetHook::new(name, "Material"), Err(error.clone()));
            let error = ShaderNameError { what: "argument", ..error };
            assert_eq!(TargetHook::new("brdf_target", name), Err(error));
        }
        let error = TargetHook::new("brdf_target", "vec3<f32>").expect_err("no identifier");
        assert_eq!(error.to_string(), "the argument is \"vec3<f32>\", which is not an ASCII identifier of WGSL");
    }

    #[test]
    fn the_reserved_words_are_those_of_the_compiler() {
        let words: Vec<_> = RESERVED.split_whitespace().collect();
        assert_eq!(words, naga::keywords::wgsl::RESERVED);
    }
}
