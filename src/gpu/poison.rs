//! Fills workgroup memory with nonsense before a kernel begins, so that tests fail where a kernel
//! expects zeros. Only unit tests play kernels with this text.

use std::fmt::Write;

use naga::{AddressSpace, ArraySize, Handle, Module, Type, TypeInner};

/// The text of a kernel that begins with nonsense in its workgroup memory.
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
    const NONSENSE: &str = "0xdeadbeefu";
    let _ = match &module.types[ty].inner {
        TypeInner::Atomic(_) => writeln!(stores, "atomicStore(&{place}, {NONSENSE});"),
        TypeInner::Scalar(_) => writeln!(stores, "{place} = {NONSENSE};"),
        TypeInner::Vector { .. } => writeln!(stores, "{place} = vec2({NONSENSE});"),
        TypeInner::Array { base, size: ArraySize::Constant(size), .. } => {
            let i = format!("poison_{depth}");
            let _ = writeln!(stores, "for (var {i} = 0u; {i} < {size}u; {i}++) {{");
            store(module, stores, *base, &format!("{place}[{i}]"), depth + 1);
            writeln!(stores, "}}")
        }
        other => panic!("{other:?} in workgroup memory"),
    };
}
