//! The kernels that build the cuts of cells.

use super::super::kernel::{Binding, Kernel};
use super::super::layout::ParamsRecord;
use super::super::text;
use crate::effects::Effects;

/// Invocations of a workgroup of the list.
pub(super) const LANES: u32 = 64;

const PARAMS: Binding = Binding::Uniform { bytes: size_of::<ParamsRecord>() as u32 };

const LIST_BINDINGS: &[Binding] = &[PARAMS, Binding::ReadWrite, Binding::ReadWrite, Binding::ReadWrite];

/// The lights, the cuts and the marks.
const BUILD_BINDINGS: &[Binding] =
    &[PARAMS, Binding::Read, Binding::Read, Binding::Read, Binding::Read, Binding::ReadWrite, Binding::ReadWrite];

/// Lists the cells to look at and to build: an invocation for each slot of the table.
pub(super) const LIST: Kernel = Kernel::new("cut_list", "cuts", LIST_BINDINGS, text::wgsl_of_cut_list);

/// Ends the list of cells to look at: one invocation.
pub(super) const LOOKS: Kernel = Kernel::new("cut_looks", "cuts", LIST_BINDINGS, text::wgsl_of_cut_list);

/// Looks at listed cells: a workgroup for each.
pub(super) const KEEP: Kernel = Kernel::new("cut_keep", "cuts", BUILD_BINDINGS, text::wgsl_of_cut_keep);

/// Ends the list of cells to build: one invocation.
pub(super) const DISPATCH: Kernel = Kernel::new("cut_dispatch", "cuts", LIST_BINDINGS, text::wgsl_of_cut_list);

/// Builds the listed cells: a workgroup for each.
pub(super) fn build(effects: Effects) -> Kernel {
    Kernel::with_effects("cut_build", "cuts", BUILD_BINDINGS, (text::wgsl_of_cut_build, effects))
}

/// The same by learnt visibility.
pub(super) fn build_by_visibility(effects: Effects) -> Kernel {
    let text = text::wgsl_of_cut_build_by_visibility;
    Kernel::with_effects("cut_build_by_visibility", "cuts", BUILD_BINDINGS, (text, effects))
}

/// The kernels of [`LightPlanner::build_cuts`](super::super::LightPlanner::build_cuts) for
/// [these effects](super::super::LightPlanner::effects). Only the last two depend on the effects. The last
/// but one builds without learnt visibility, and the last with it.
pub fn cut_kernels(effects: Effects) -> [Kernel; 6] {
    [LIST, LOOKS, KEEP, DISPATCH, build(effects), build_by_visibility(effects)]
}
