//! The text with light_sample and the other functions, for an engine's own shaders.

use girandole::Effects;
use girandole::plan::{self, ShaderParts};

use std::ffi::CString;
use std::fmt::Write;

use crate::memory::{object, result};
use crate::shader::*;
use crate::source::Source;
use crate::status::{Failure, GIRANDOLE_ERROR_BAD_VALUE, GirandoleStatus, call};
use crate::translate::translate;

/// A light emits into less than all directions: a spot, or a surface with one emitting side.
pub const GIRANDOLE_EFFECT_CONES: u32 = 1;
/// A light has a finite range.
pub const GIRANDOLE_EFFECT_RANGES: u32 = 2;
/// A light is a surface.
pub const GIRANDOLE_EFFECT_AREAS: u32 = 4;
/// There is a directional light.
pub const GIRANDOLE_EFFECT_DIRECTIONAL: u32 = 8;
/// An instance is scaled, sheared or mirrored.
pub const GIRANDOLE_EFFECT_NON_RIGID: u32 = 16;
/// GIRANDOLE_SAMPLING_SOLID_ANGLE is set.
pub const GIRANDOLE_EFFECT_SOLID_ANGLES: u32 = 32;
/// GIRANDOLE_SAMPLING_GLOSSY is set.
pub const GIRANDOLE_EFFECT_GLOSSY: u32 = 64;
/// GIRANDOLE_SAMPLING_SEGMENTS is set.
pub const GIRANDOLE_EFFECT_SEGMENTS: u32 = 128;
/// An instance has a factor other than 1.
pub const GIRANDOLE_EFFECT_FACTORS: u32 = 256;
/// An instance has a mask with a bit that is not set.
pub const GIRANDOLE_EFFECT_MASKS: u32 = 512;
/// The world has a sky.
pub const GIRANDOLE_EFFECT_SKY: u32 = 1024;
/// A light has a profile.
pub const GIRANDOLE_EFFECT_PROFILES: u32 = 2048;
/// The world has portals: see girandole_world_set_portals.
pub const GIRANDOLE_EFFECT_PORTALS: u32 = 4096;
/// All effects: a shader for them reads the buffers of any world, and is the longest.
pub const GIRANDOLE_ALL_EFFECTS: u32 = 0x1fff;

/// The effects with their bits in this interface.
const EFFECTS: [(u32, Effects); 13] = [
    (GIRANDOLE_EFFECT_CONES, Effects::CONES),
    (GIRANDOLE_EFFECT_RANGES, Effects::RANGES),
    (GIRANDOLE_EFFECT_AREAS, Effects::AREAS),
    (GIRANDOLE_EFFECT_DIRECTIONAL, Effects::DIRECTIONAL),
    (GIRANDOLE_EFFECT_NON_RIGID, Effects::NON_RIGID),
    (GIRANDOLE_EFFECT_SOLID_ANGLES, Effects::SOLID_ANGLES),
    (GIRANDOLE_EFFECT_GLOSSY, Effects::GLOSSY),
    (GIRANDOLE_EFFECT_SEGMENTS, Effects::SEGMENTS),
    (GIRANDOLE_EFFECT_FACTORS, Effects::FACTORS),
    (GIRANDOLE_EFFECT_MASKS, Effects::MASKS),
    (GIRANDOLE_EFFECT_SKY, Effects::SKY),
    (GIRANDOLE_EFFECT_PROFILES, Effects::PROFILES),
    (GIRANDOLE_EFFECT_PORTALS, Effects::PORTALS),
];

/// The bits of effects.
pub fn effect_bits(effects: Effects) -> u32 {
    EFFECTS.iter().filter(|(_, effect)| effects.contains(*effect)).map(|(bit, _)| bit).sum()
}

fn known_effects(bits: u32) -> Result<Effects, Failure> {
    if bits & !GIRANDOLE_ALL_EFFECTS != 0 {
        let message = format!("effects {bits:#x} have other bits than {GIRANDOLE_ALL_EFFECTS:#x}");
        return Err(Failure::new(GIRANDOLE_ERROR_BAD_VALUE, message));
    }
    Ok(EFFECTS.iter().filter(|(bit, _)| bits & bit != 0).map(|(_, effect)| *effect).collect())
}

/// The text has light_reservoir_sample_previous, which reads the last frame at binding 7.
pub const GIRANDOLE_SHADER_PREVIOUS: u32 = 1;
/// The text has light_record_visibility, by which cells learn: see GirandoleCutOptions.
pub const GIRANDOLE_SHADER_LEARNS: u32 = 2;

fn known_parts(bits: u32) -> Result<ShaderParts, Failure> {
    if bits & !(GIRANDOLE_SHADER_PREVIOUS | GIRANDOLE_SHADER_LEARNS) != 0 {
        return Err(Failure::bad_value("parts; bits of GIRANDOLE_SHADER_* are", bits));
    }
    let has = |bit: u32| bits & bit != 0;
    let parts = ShaderParts::default();
    let parts = if has(GIRANDOLE_SHADER_PREVIOUS) { parts.with_previous() } else { parts };
    Ok(if has(GIRANDOLE_SHADER_LEARNS) { parts.with_learning() } else { parts })
}

/// The last number that the group may have.
pub(crate) const LAST_GROUP: u32 = 254;

/// Makes the text that an engine's shader includes: the functions light_sample, light_resample, light_pmf,
/// light_mark and others, without an entry point. docs/integration.md describes them. Destroy the shader with
/// girandole_shader_destroy.
///
///   effects  bits of GIRANDOLE_EFFECT_*: at least those of girandole_planner_effects
///   group    the group of the bindings in WGSL, and by default the space in HLSL: 0 to 254
///   parts    bits of GIRANDOLE_SHADER_*: what the text has in addition
///   target   WGSL, HLSL or MSL; its entry_point must be NULL. SPIR-V has no texts to include: join the
///            WGSL text with your own and pass both to girandole_translate
///
/// HLSL: the space is a macro, GIRANDOLE_SPACE, which a program may define
/// before it includes the text. A binding that target moves to another space than the first one
/// gets a space of its own instead of the macro. MSL: functions take the buffers that they read as further arguments.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn girandole_shader_include(
    effects: u32,
    group: u32,
    parts: u32,
    target: *const GirandoleTarget,
    shader: *mut *mut GirandoleShader,
) -> GirandoleStatus {
    call(|| {
        // SAFETY: see the crate's documentation.
        let (target, out) = unsafe { (object(target, "target")?, result(shader, "shader")?) };
        // SAFETY: see the crate's documentation.
        out.set(Box::into_raw(Box::new(unsafe { include(effects, group, parts, target)? })));
        Ok(())
    })
}

/// # Safety
/// The pointers of the target are as the crate's documentation says.
unsafe fn include(effects: u32, group: u32, parts: u32, target: &GirandoleTarget) -> Result<GirandoleShader, Failure> {
    let effects = known_effects(effects)?;
    if group > LAST_GROUP {
        return Err(Failure::bad_value("group; 0 to 254 are", group));
    }
    if !target.entry_point.is_null() {
        let message = "target.entry_point is not NULL, but an include text has no entry points";
        return Err(Failure::new(GIRANDOLE_ERROR_BAD_VALUE, message));
    }
    let parts = known_parts(parts)?;
    let source = Source::checked(plan::wgsl_with(group, effects, &parts))?;
    // SAFETY: the caller's promise.
    let mut made = unsafe { translate(&source, target)? };
    if let (GIRANDOLE_LANGUAGE_HLSL, Code::Text(text)) = (target.language, &made.code) {
        made.code = Code::Text(hlsl_include(text, &made));
    }
    Ok(made)
}

/// The text of naga with include guards, a table of bindings and macros for the spaces.
fn hlsl_include(text: &CString, made: &GirandoleShader) -> CString {
    let mut head = String::from("// Made by girandole_shader_include. Do not edit.\n//\n");
    head.push_str("// register  space                      name\n");
    let mut macros = String::new();
    let mut body = text.to_string_lossy().into_owned();
    for (index, row) in made.bindings.iter().enumerate() {
        let letter = row.register_letter as u8 as char;
        let own_space = format!("space{}", row.space);
        // The macro is for the space of the first binding.
        let has_macro = made.bindings[0].space == row.space;
        let space = if has_macro { "GIRANDOLE_SPACE" } else { &own_space };
        // Two names are kept for each entry point, of which there are none.
        let name = made.names[index].to_string_lossy();
        let _ = writeln!(head, "// {letter}{:<8} {space:<26} {name}", row.index);
        if !has_macro {
            continue;
        }
        let define = format!("#ifndef {space}\n#define {space} {own_space}\n#endif\n");
        if !macros.contains(&define) {
            macros.push_str(&define);
        }
        let register = format!("register({letter}{}", row.index);
        let plain = if row.space == 0 { format!("{register})") } else { format!("{register}, space{})", row.space) };
        body = body.replace(&plain, &format!("{register}, {space})"));
    }
    // naga puts every condition in two pairs of parentheses.
    let quiet = "#ifdef __hlsl_dx_compiler\n#pragma dxc diagnostic push\n\
        #pragma dxc diagnostic ignored \"-Wparentheses-equality\"\n#endif\n";
    let end = "#ifdef __hlsl_dx_compiler\n#pragma dxc diagnostic pop\n#endif\n#endif\n";
    let all = format!("{head}#ifndef GIRANDOLE_HLSLI\n#define GIRANDOLE_HLSLI\n{macros}{quiet}{body}{end}");
    CString::new(all).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    const BOTH: u32 = GIRANDOLE_SHADER_PREVIOUS | GIRANDOLE_SHADER_LEARNS;

    fn text(effects: u32, group: u32, parts: u32, language: GirandoleLanguage) -> String {
        let (entry_point, bindings) = (std::ptr::null(), std::ptr::null());
        let target = GirandoleTarget {
            language,
            major_version: 0,
            minor_version: 0,
            flags: 0,
            entry_point,
            bindings,
            binding_count: 0,
        };
        // SAFETY: both pointers are null, which is allowed.
        let made = unsafe { include(effects, group, parts, &target) }.expect("it is translated");
        assert_eq!(made.bindings.len(), if parts & GIRANDOLE_SHADER_PREVIOUS == 0 { 7 } else { 8 });
        let Code::Text(text) = made.code else { panic!("a text is no SPIR-V") };
        text.into_string().expect("UTF-8")
    }

    #[test]
    fn public_names_are_the_same_in_every_language() {
        for language in [GIRANDOLE_LANGUAGE_WGSL, GIRANDOLE_LANGUAGE_HLSL, GIRANDOLE_LANGUAGE_MSL] {
            for effects in [0, GIRANDOLE_ALL_EFFECTS] {
                let text = text(effects, 1, BOTH, language);
                for name in [
                    "surface_point",
                    "sample",
                    "resample",
                    "pmf",
                    "pdf",
                    "hash",
                    "reservoir_sample",
                    "reservoir_sample_previous",
                    "mark",
                    "record_visibility",
                ] {
                    assert!(text.contains(&format!(" light_{name}(")), "light_{name} in language {language}");
                }
                for name in ["Sample", "ShadingPoint", "Reservoir"] {
                    assert!(text.contains(&format!("struct Light{name} {{")), "Light{name} in language {language}");
                }
            }
        }
    }

    #[test]
    fn every_register_of_an_include_text_has_the_macro_of_its_space() {
        for (group, parts) in [(0, 0), (0, BOTH), (1, 0), (3, GIRANDOLE_SHADER_PREVIOUS), (11, GIRANDOLE_SHADER_LEARNS)]
        {
            let text = text(GIRANDOLE_ALL_EFFECTS, group, parts, GIRANDOLE_LANGUAGE_HLSL);
            let registers: Vec<_> = text.lines().filter(|line| line.contains("register(")).collect();
            let of = |space: &str| registers.iter().filter(|line| line.contains(&format!(", {space})"))).count();
            let count = if parts & GIRANDOLE_SHADER_PREVIOUS == 0 { 7 } else { 8 };
            assert_eq!([of("GIRANDOLE_SPACE"), registers.len()], [count; 2], "{registers:#?}");
            assert!(text.contains(&format!("#define GIRANDOLE_SPACE space{group}\n")));
        }
    }

    #[test]
    fn a_binding_in_a_space_of_its_own_keeps_it_in_the_text() {
        let moved = [
            GirandoleBindTarget { group: 1, binding: 2, space: 7, index: 4 },
            GirandoleBindTarget { group: 1, binding: 3, space: 0, index: 9 },
        ];
        let target = GirandoleTarget {
            language: GIRANDOLE_LANGUAGE_HLSL,
            major_version: 0,
            minor_version: 0,
            flags: 0,
            entry_point: std::ptr::null(),
            bindings: moved.as_ptr(),
            binding_count: moved.len(),
        };
        // SAFETY: the array lives.
        let made = unsafe { include(GIRANDOLE_ALL_EFFECTS, 1, 0, &target) }.expect("it is translated");
        let Code::Text(text) = made.code else { panic!("a text is no SPIR-V") };
        let text = text.into_string().expect("UTF-8");
        for register in ["(b0, GIRANDOLE_SPACE)", "(t1, GIRANDOLE_SPACE)", "(t4, space7)", "(t9)"] {
            assert_eq!(text.matches(&format!("register{register}")).count(), 1, "{register}");
        }
        assert_eq!(text.matches("#define GIRANDOLE_SPACE ").count(), 1);
        assert!(text.contains("#define GIRANDOLE_SPACE space1\n"));
        for row in ["// t4        space7 ", "// t9        space0 ", "// t1        GIRANDOLE_SPACE "] {
            assert!(text.contains(row), "{row}");
        }
    }

    #[test]
    fn effects_are_those_of_the_library() {
        for effect in (Effects::all() - Effects::MOVING).iter() {
            let bits = effect_bits(effect);
            assert_eq!(bits.count_ones(), 1, "{effect:?}");
            assert_eq!(known_effects(bits).ok(), Some(effect));
        }
        assert_eq!(GIRANDOLE_ALL_EFFECTS, effect_bits(Effects::all()));
        assert!(known_effects(1 << 13).is_err() && known_effects(1 << 31).is_err());
    }
}
