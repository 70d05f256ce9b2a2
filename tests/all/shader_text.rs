//! The WGSL that engines join to their own: no compiler warns of it or renames what engines name.

use girandole::Effects;
use girandole::gpu::wgsl;
use naga::{Block, Module, Statement};
use testbed::testing::effect_sets::effect_sets;

/// The text of variants that have any four effects in every combination. Whether lights move
/// changes no text.
fn variants() -> impl Iterator<Item = (Effects, String)> {
    let all: Vec<Effects> = Effects::all().iter().collect();
    let moving = all.iter().position(|effect| *effect == Effects::MOVING).expect("an effect");
    let sets = effect_sets(all.len(), moving);
    sets.into_iter().map(move |set| {
        let effects = set.into_iter().map(|number| all[number]).collect();
        (effects, wgsl(0, effects))
    })
}

fn parsed(text: &str) -> Module {
    naga::front::wgsl::parse_str(text).map_err(|error| error.emit_to_string(text)).expect("valid WGSL")
}

/// How control may leave a block.
#[derive(Clone, Copy, Default)]
struct Exits {
    /// To the statement after it.
    next: bool,
    breaks: bool,
}

/// How control may leave a block; `unreachable` counts its statements that control never reaches.
fn exits(block: &Block, unreachable: &mut usize) -> Exits {
    let mut exits = Exits { next: true, breaks: false };
    for statement in block {
        // `naga` emits expressions where it needs them, and ends some blocks with a return of its
        // own.
        if !exits.next && !matches!(statement, Statement::Emit(_) | Statement::Return { value: None }) {
            *unreachable += 1;
        }
        let own = match statement {
            Statement::Return { .. } | Statement::Kill | Statement::Continue => Exits::default(),
            Statement::Break => Exits { next: false, breaks: true },
            Statement::Block(inner) => self::exits(inner, unreachable),
            Statement::If { accept, reject, .. } => {
                let [a, b] = [accept, reject].map(|branch| self::exits(branch, unreachable));
                Exits { next: a.next || b.next, breaks: a.breaks || b.breaks }
            }
            Statement::Switch { cases, .. } => {
                let all: Vec<_> = cases.iter().map(|case| self::exits(&case.body, unreachable)).collect();
                // A break leaves the switch and not the loop around it.
                Exits { next: all.iter().any(|case| case.next || case.breaks), breaks: false }
            }
            Statement::Loop { body, continuing, break_if } => {
                let body = self::exits(body, unreachable);
                self::exits(continuing, unreachable);
                Exits { next: body.breaks || break_if.is_some(), breaks: false }
            }
            _ => Exits { next: true, breaks: false },
        };
        exits = Exits { next: exits.next && own.next, breaks: exits.breaks || own.breaks };
    }
    exits
}

/// The functions that have statements which control never reaches.
fn functions_with_unreachable_code(module: &Module) -> Vec<String> {
    let functions = module.functions.iter().filter(|(_, function)| {
        let mut unreachable = 0;
        exits(&function.body, &mut unreachable);
        unreachable > 0
    });
    functions.map(|(_, function)| function.name.clone().unwrap_or_default()).collect()
}

#[test]
fn no_variant_has_unreachable_code() {
    for (effects, text) in variants() {
        assert_eq!(functions_with_unreachable_code(&parsed(&text)), [""; 0], "{effects:?}");
    }
}

#[test]
fn unreachable_code_is_found_after_returns_and_after_loops_without_a_way_out() {
    let text = "
        fn after_a_loop(n: u32) -> u32 { var i = n; loop { i++; if i > 9u { return i; } } return 0u; }
        fn after_both_branches(n: u32) -> u32 { if n > 1u { return 1u; } else { return 2u; } return 3u; }
        fn after_a_break(n: u32) -> u32 { var i = n; loop { i++; if i > 9u { break; } } return i; }
        fn after_an_if(n: u32) -> u32 { if n > 1u { return 1u; } return 3u; }
        fn after_a_while(n: u32) -> u32 { var i = n; while i < 9u { i++; } return i; }";
    assert_eq!(functions_with_unreachable_code(&parsed(text)), ["after_a_loop", "after_both_branches"]);
}

/// Words of HLSL and MSL that are no words of WGSL but could name a field or a function. Naga
/// appends `_` to such names, and debuggers and reflection then show names that the source does not
/// have. Naga keeps its own lists private.
const RESERVED: &str = "abort and asfloat asint asuint atomic auto bitand bitor buffer catch cbuffer char class clip \
    complex constant constexpr countbits ddx ddy decl delete device distance dot double dst enum export extern float \
    fma fmod frac fragment friend half imaginary inline int kernel length lerp line linear lit long mad matrix metal \
    mul mutable namespace new noise not operator or packoffset pass pixelfragment point precise private protected \
    public quad rcp refract register restrict round sample sampler saturate shared short sign signed sizeof snorm \
    static step string struct technique template texture this thread threadgroup throw transpose triangle try typedef \
    typename uchar uint uniform union unorm unsigned ushort using vec vector vertex virtual void volatile xor";

#[test]
fn no_name_that_engines_use_is_reserved_in_hlsl_or_msl() {
    let reserved: Vec<&str> = RESERVED.split_whitespace().collect();
    let mut names = 0;
    for (effects, text) in variants() {
        let module = parsed(&text);
        let mut check = |name: &str, place: &str| {
            assert!(!reserved.contains(&name), "{place}: `{name}` is reserved ({effects:?})");
            assert!(!naga::keywords::wgsl::RESERVED.contains(&name), "{place}: `{name}` is reserved in WGSL");
            // Naga separates a number at the end as well, to keep names apart.
            assert!(!name.ends_with(|c: char| c.is_ascii_digit()), "{place}: `{name}` ends with a digit");
            names += 1;
        };
        for (_, ty) in module.types.iter() {
            let (Some(name), naga::TypeInner::Struct { members, .. }) = (&ty.name, &ty.inner) else { continue };
            check(name, name);
            members.iter().filter_map(|member| member.name.as_ref()).for_each(|member| check(member, name));
        }
        for (_, function) in module.functions.iter() {
            let function_name = function.name.as_deref().unwrap_or_default();
            check(function_name, function_name);
        }
    }
    assert!(names > 1000, "{names} are too few");
}
