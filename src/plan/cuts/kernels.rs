//! The kernels that build the cuts of cells.

use super::super::kernel::{Binding, Kernel};
use super::super::layout::ParamsRecord;
use super::super::text::{ShaderParts, wgsl_of_cuts, wgsl_of_kernel};
use crate::effects::Effects;

/// Invocations of a workgroup of the list.
pub(super) const LANES: u32 = 64;

const PARAMS: Binding = Binding::Uniform { bytes: size_of::<ParamsRecord>() as u32 };

const LIST_BINDINGS: &[Binding] = &[PARAMS, Binding::ReadWrite, Binding::ReadWrite, Binding::ReadWrite];

/// The lights, the cuts and the marks.
const BUILD_BINDINGS: &[Binding] =
    &[PARAMS, Binding::Read, Binding::Read, Binding::Read, Binding::Read, Binding::ReadWrite, Binding::ReadWrite];

fn list_text(_: Effects) -> String {
    wgsl_of_kernel(&[], &[], &[shader!("cut_grid"), shader!("cut_list")])
}

/// The text reads any buffers.
fn keep_text(_: Effects) -> String {
    let effects = Effects::MASKS | Effects::SKY | Effects::FACTORS;
    wgsl_of_cuts(effects, ShaderParts::default(), &[shader!("row"), shader!("cut_keep")])
}

fn build_text(effects: Effects, parts: ShaderParts) -> String {
    let parts = ShaderParts { builds: true, ..parts };
    wgsl_of_cuts(effects, parts, &[shader!("row"), shader!("cut_build")])
}

/// Lists the cells to look at and to build: an invocation for each slot of the table.
pub(super) const LIST: Kernel = Kernel::new("cut_list", "cuts", LIST_BINDINGS, list_text);

/// Ends the list of cells to look at: one invocation.
pub(super) const LOOKS: Kernel = Kernel::new("cut_looks", "cuts", LIST_BINDINGS, list_text);

/// Looks at listed cells: a workgroup for each.
pub(super) const KEEP: Kernel = Kernel::new("cut_keep", "cuts", BUILD_BINDINGS, keep_text);

/// Ends the list of cells to build: one invocation.
pub(super) const DISPATCH: Kernel = Kernel::new("cut_dispatch", "cuts", LIST_BINDINGS, list_text);

/// Builds the listed cells: a workgroup for each.
pub(super) fn build(effects: Effects) -> Kernel {
    let text = |effects| build_text(effects, ShaderParts::default());
    Kernel::new("cut_build", "cuts", BUILD_BINDINGS, text).for_effects(effects)
}

/// The same by learnt visibility.
pub(super) fn build_by_visibility(effects: Effects) -> Kernel {
    let text = |effects| {
        let text = build_text(effects, ShaderParts::default().with_learning());
        text.replace("fn cut_build(", "fn cut_build_by_visibility(")
    };
    Kernel::new("cut_build_by_visibility", "cuts", BUILD_BINDINGS, text).for_effects(effects)
}

/// The kernels of [`LightPlanner::build_cuts`](super::super::LightPlanner::build_cuts) for
/// [these effects](super::super::LightPlanner::effects). Only the last two depend on the effects. The last
/// but one builds without learnt visibility, and the last with it.
pub fn cut_kernels(effects: Effects) -> [Kernel; 6] {
    [LIST, LOOKS, KEEP, DISPATCH, build(effects), build_by_visibility(effects)]
}
