//! Invocations of a workgroup exchange values through workgroup memory, never through storage: where a
//! compiler caches storage, others may not see a write before the next dispatch, with a barrier or
//! without. A device without such caches would not show a fault, so this looks at the text.

use std::collections::HashSet;

use girandole::plan::KERNELS;
use naga::{AddressSpace, Block, Expression, Function, GlobalVariable, Handle, Module, Statement};

/// Kernels with a loop that reads and writes one variable, where no invocation reads what another
/// one writes.
const WITHOUT_EXCHANGE: [(&str, &str); 6] = [
    // Clusters of parts are read, those of nodes are written. Those of children are in workgroup memory.
    ("top_cells", "clusters"),
    // Each invocation reads the record of its own part, and writes the words of its own child.
    ("top_cells", "nodes"),
    // Clusters of earlier stages are read. Those of the block are in workgroup memory as well.
    ("top_blocks", "clusters"),
    // Each invocation reads and writes the words of its own child.
    ("top_blocks", "nodes"),
    // Clusters of the last pass are read. Those within a piece are in workgroup memory.
    ("refit", "clusters"),
    // What the children of a node are and how many are read, and no dispatch changes these bits.
    ("refit", "nodes"),
];

type Globals = HashSet<Handle<GlobalVariable>>;

/// The variables in storage that a function reads and writes, with the functions that it calls.
#[derive(Debug, Default)]
struct Effects {
    reads: Globals,
    writes: Globals,
}

/// The variable in storage that a pointer leads into.
fn storage(module: &Module, function: &Function, pointer: Handle<Expression>) -> Option<Handle<GlobalVariable>> {
    match function.expressions[pointer] {
        Expression::Access { base, .. } | Expression::AccessIndex { base, .. } => storage(module, function, base),
        Expression::GlobalVariable(variable) => {
            matches!(module.global_variables[variable].space, AddressSpace::Storage { .. }).then_some(variable)
        }
        _ => None,
    }
}

fn add(module: &Module, function: &Function, block: &Block, effects: &mut Effects) {
    for statement in block {
        match statement {
            Statement::Emit(range) => {
                for expression in range.clone() {
                    if let Expression::Load { pointer } = function.expressions[expression] {
                        effects.reads.extend(storage(module, function, pointer));
                    }
                }
            }
            Statement::Store { pointer, .. } | Statement::Atomic { pointer, .. } => {
                effects.writes.extend(storage(module, function, *pointer));
            }
            Statement::Call { function: called, .. } => {
                let called = &module.functions[*called];
                add(module, called, &called.body, effects);
            }
            Statement::Block(inner) => add(module, function, inner, effects),
            Statement::If { accept, reject, .. } => {
                add(module, function, accept, effects);
                add(module, function, reject, effects);
            }
            Statement::Loop { body, continuing, .. } => {
                add(module, function, body, effects);
                add(module, function, continuing, effects);
            }
            Statement::Switch { cases, .. } => cases.iter().for_each(|case| add(module, function, &case.body, effects)),
            _ => {}
        }
    }
}

/// The variables in storage that one outermost loop of a block both reads and writes. The
/// invocations of a workgroup take the steps of such a loop together.
fn exchanged(module: &Module, function: &Function, block: &Block) -> Globals {
    let mut found = Globals::new();
    for statement in block {
        match statement {
            Statement::Block(inner) => found.extend(exchanged(module, function, inner)),
            Statement::If { accept, reject, .. } => {
                found.extend(exchanged(module, function, accept));
                found.extend(exchanged(module, function, reject));
            }
            Statement::Loop { body, continuing, .. } => {
                let mut effects = Effects::default();
                add(module, function, body, &mut effects);
                add(module, function, continuing, &mut effects);
                found.extend(effects.reads.intersection(&effects.writes).copied());
            }
            Statement::Call { function: called, .. } => {
                let called = &module.functions[*called];
                found.extend(exchanged(module, called, &called.body));
            }
            _ => {}
        }
    }
    found
}

#[test]
fn no_steps_within_a_dispatch_exchange_values_through_storage() {
    let mut exceptions = Vec::new();
    for kernel in KERNELS {
        let text = kernel.wgsl();
        let entry = kernel.entry();
        assert!(!text.contains("storageBarrier"), "{entry}: not all compilers make storage coherent");
        let module = naga::front::wgsl::parse_str(&text).map_err(|e| e.emit_to_string(&text)).expect("it parses");
        let function = &module.entry_points[0].function;
        let mut names: Vec<String> = exchanged(&module, function, &function.body)
            .into_iter()
            .map(|variable| module.global_variables[variable].name.clone().expect("variables have names"))
            .collect();
        names.sort();
        exceptions.extend(names.into_iter().map(|name| (entry, name)));
    }
    let found: Vec<(&str, &str)> = exceptions.iter().map(|(entry, name)| (*entry, name.as_str())).collect();
    assert_eq!(found, WITHOUT_EXCHANGE);
}
