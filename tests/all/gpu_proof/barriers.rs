//! Storage that invocations of a workgroup exchange within a dispatch: between the writes of one
//! step and the reads of the next, there is a storage barrier. A device that happens to run the
//! invocations in a harmless order would not show that one is missing, so this looks at the text.

use std::collections::HashSet;

use girandole::plan::KERNELS;
use naga::{AddressSpace, Barrier, Block, Expression, Function, GlobalVariable, Handle, Module, Statement};

/// Stages in which each invocation reads only words that it writes itself.
const WITHOUT_EXCHANGE: [&str; 1] = ["sort_scan"];

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

/// Whether a storage barrier that all invocations reach follows the last write to one of `shared`.
/// `None` if none of them is written.
fn ends_with_barrier(module: &Module, function: &Function, block: &Block, shared: &Globals) -> Option<bool> {
    let mut is_safe = None;
    for statement in block {
        match statement {
            Statement::ControlBarrier(barrier) if barrier.contains(Barrier::STORAGE) => is_safe = is_safe.map(|_| true),
            Statement::Block(inner) => is_safe = ends_with_barrier(module, function, inner, shared).or(is_safe),
            other => {
                let mut effects = Effects::default();
                add(module, function, &Block::from_vec(vec![other.clone()]), &mut effects);
                if effects.writes.iter().any(|variable| shared.contains(variable)) {
                    is_safe = Some(false);
                }
            }
        }
    }
    is_safe
}

/// Checks the outermost loops of a function, in each of which the invocations of a workgroup take
/// the same steps. Returns how many of them write storage that they also read.
fn check(module: &Module, function: &Function, block: &Block, entry: &str) -> usize {
    let mut checked = 0;
    for statement in block {
        match statement {
            Statement::Block(inner) => checked += check(module, function, inner, entry),
            Statement::If { accept, reject, .. } => {
                checked += check(module, function, accept, entry) + check(module, function, reject, entry);
            }
            Statement::Loop { body, .. } => {
                let mut effects = Effects::default();
                add(module, function, body, &mut effects);
                let shared: Globals = effects.reads.intersection(&effects.writes).copied().collect();
                if let Some(is_safe) = ends_with_barrier(module, function, body, &shared) {
                    let names: Vec<_> = shared.iter().map(|v| &module.global_variables[*v].name).collect();
                    assert!(is_safe, "{entry}: a step reads what another has written into {names:?} without a barrier");
                    checked += 1;
                }
            }
            _ => {}
        }
    }
    checked
}

#[test]
fn steps_that_exchange_storage_within_a_dispatch_have_storage_barriers_between_them() {
    let mut checked = Vec::new();
    for kernel in KERNELS.into_iter().filter(|kernel| !WITHOUT_EXCHANGE.contains(&kernel.entry())) {
        let text = kernel.wgsl();
        let module = naga::front::wgsl::parse_str(&text).map_err(|e| e.emit_to_string(&text)).expect("it parses");
        let function = &module.entry_points[0].function;
        let loops = check(&module, function, &function.body, kernel.entry());
        if loops > 0 {
            checked.push((kernel.entry(), loops));
        }
    }
    // The steps are the depths of the tree.
    assert_eq!(checked, [("top_root", 1)]);
}
