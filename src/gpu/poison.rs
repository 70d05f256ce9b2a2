//! Fills workgroup memory with an arbitrary value at the start of a kernel, so that tests fail if the
//! kernel relies on zeros. Only unit tests do so.

use std::fmt::Write;

use naga::{AddressSpace, ArraySize, Handle, Module, Type, TypeInner};

/// The text of a kernel, with stores to all of its workgroup memory at the start.
pub(super) fn poisoned(text: &str, entry: &str) -> String {
    let module = naga::front::wgsl::parse_str(text).expect("kernels are valid");
    let mut stores = String::new();
    let in_workgroup = module.global_variables.iter().filter(|(_, v)| v.space == AddressSpace::WorkGroup);
    for (_, variable) in in_workgroup {
        let name = variable.name.as_deref().expect("variables have names");
        store(&module, &mut stores, variable.ty, name, 0);
    }
    if stores.is_empty() {
        return text.to_owned();
    }
    let function = text.find(&format!("fn {entry}(")).expect("the entry point");
    let body = function + text[function..].find(") {").expect("its body") + 3;
    format!("{}\n{stores}workgroupBarrier();\n{}", &text[..body], &text[body..])
}

/// All invocations store the same value, one after the other.
fn store(module: &Module, stores: &mut String, ty: Handle<Type>, place: &str, depth: usize) {
    const VALUE: &str = "0xdeadbeefu";
    let _ = match &module.types[ty].inner {
        TypeInner::Atomic(_) => writeln!(stores, "atomicStore(&{place}, {VALUE});"),
        TypeInner::Scalar(naga::Scalar { kind: naga::ScalarKind::Float, .. }) => {
            writeln!(stores, "{place} = bitcast<f32>({VALUE});")
        }
        TypeInner::Scalar(_) => writeln!(stores, "{place} = {VALUE};"),
        TypeInner::Vector { size, scalar } => {
            let value = if scalar.kind == naga::ScalarKind::Float { "bitcast<f32>(0xdeadbeefu)" } else { VALUE };
            writeln!(stores, "{place} = vec{}({value});", *size as u8)
        }
        TypeInner::Struct { members, .. } => {
            for member in members {
                let name = member.name.as_deref().expect("members have names");
                store(module, stores, member.ty, &format!("{place}.{name}"), depth);
            }
            Ok(())
        }
        TypeInner::Array { base, size: ArraySize::Constant(size), .. } => {
            let i = format!("poison_{depth}");
            let _ = writeln!(stores, "for (var {i} = 0u; {i} < {size}u; {i}++) {{");
            store(module, stores, *base, &format!("{place}[{i}]"), depth + 1);
            writeln!(stores, "}}")
        }
        other => panic!("{other:?} in workgroup memory"),
    };
}
