//! Builds the cuts of all cells that were marked.

use std::cmp::Reverse;
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};

use crate::sampling::cuts::build::{CellPoints, build};
use crate::sampling::cuts::cell::{CutCell, CutGrid, POINTS};
use crate::sampling::cuts::keep::TURNS;
use crate::sampling::cuts::marks::Marked;
use crate::sampling::cuts::shared::SharedCut;
use crate::sampling::cuts::table::{CutReport, CutTable};
use crate::sampling::sample::LightSampler;

/// The work of building one cell: see [`CutTable::builds`].
#[derive(Debug)]
pub struct CutBuild<'t> {
    sampler: LightSampler<'t>,
    grid: CutGrid,
    cell: CutCell,
    marked: Marked,
    cut: &'t mut SharedCut,
    /// The nodes of the cell's cut; 0 if it has none.
    nodes: usize,
    /// Counts cells that keep their cut.
    kept: &'t AtomicUsize,
    /// Whether anything was learnt since the last build.
    taught: bool,
}

impl CutBuild<'_> {
    /// Builds the cell's cut: up to 32 nodes for each of up to eight points. A cell may keep its cut, after a look at the
    /// 32 nodes.
    pub fn run(self) {
        let Self { sampler, grid, cell, marked, cut, nodes, kept, taught } = self;
        let (center, toward, [_, tag]) = (grid.center(&cell), grid.toward(&cell), cell.keys());
        if nodes == 0 {
            cut.age = 0;
        } else {
            cut.count = nodes;
            if cut.is_kept(&sampler, (&center, toward), (tag, taught)) {
                kept.fetch_add(1, Relaxed);
                return;
            }
        }
        let mut points = [center; POINTS];
        let mut count = 0;
        for word in marked.words() {
            points[count] = grid.point(&cell, word);
            count += 1;
        }
        build(&sampler, &CellPoints { points: &points[..count], center }, cut);
        (cut.points, cut.toward) = (count, toward);
    }
}

impl CutTable {
    /// Builds the cuts of all cells that were marked since the last build, for the world of the sampler as it
    /// is now, and forgets the marks. A cell keeps its cut unless more points of it are known now, the lights of a cluster
    /// that it split came or went, the brightness of a cluster jumped, or, for glossy points, the eye is elsewhere. After a
    /// change of the world, one in twelve of the others is built again in each of the next twelve builds.
    ///
    /// With a sampler that has [learnt visibility](LightSampler::with_visibility), cells choose lights by that
    /// too. Choices take no longer.
    ///
    /// The result does not depend on the order or the threads of the marks. O(marked cells), and
    /// up to 256 evaluations of a node for each cell that gets a cut.
    pub fn build(&mut self, sampler: LightSampler<'_>) {
        self.builds(sampler).for_each(CutBuild::run);
    }

    /// The same in parts, each of which may run on any thread. Cells whose part does not run have no cut.
    pub fn builds<'t>(&'t mut self, sampler: LightSampler<'t>) -> impl Iterator<Item = CutBuild<'t>> + use<'t> {
        let Self { options, camera, marks, built } = self;
        let mut report = CutReport::default();
        let mut chosen: Vec<(CutCell, Marked)> = marks.cells().inspect(|_| report.marked += 1).collect();
        chosen.retain(|(_, marked)| marked.count >= options.min_marks());
        report.rare = report.marked - chosen.len();
        report.refused = chosen.len().saturating_sub(options.cells());
        if report.refused > 0 {
            // Those with the most marks stay.
            chosen.select_nth_unstable_by_key(options.cells(), |(cell, marked)| (Reverse(marked.count), *cell));
            chosen.truncate(options.cells());
        }
        marks.clear();
        let grid = options.grid(*camera, sampler.world.origin());
        let learnt = sampler.visibility.as_ref().map_or([0; 2], |(table, _)| [table.id(), table.last_change()]);
        let (is_same, taught) = (built.world == sampler.top.id && built.learnt == learnt, built.learnt != learnt);
        built.calm = if is_same { built.calm.saturating_add(1) } else { 0 };
        let has_same_eye = built.grid.is_some_and(|built| built.has_eye_of(&grid));
        built.eye_rest = if has_same_eye { built.eye_rest.saturating_add(1) } else { 0 };
        // The number of a cut, and whether nothing has changed for it.
        let kept = |(cell, marked): &(CutCell, Marked)| {
            let is_calm = built.calm > TURNS && (built.eye_rest > TURNS || !cell.is_glossy());
            built.kept(cell, marked).map(|number| (number, is_calm))
        };
        let kept: Vec<Option<(u32, bool)>> = chosen.iter().map(kept).collect();
        report.kept = kept.iter().flatten().filter(|(_, is_calm)| *is_calm).count();
        report.built = chosen.len() - report.kept;
        if built.cuts.len() < chosen.len() {
            built.cuts.resize_with(chosen.len(), SharedCut::default);
        }
        let mut is_kept = vec![false; built.cuts.len()];
        kept.iter().flatten().for_each(|(number, _)| is_kept[*number as usize] = true);
        let mut free = (0..).zip(&is_kept).filter(|(_, is_kept)| !**is_kept).map(|(number, _)| number);
        let mut work = vec![None; built.cuts.len()];
        built.numbers.clear();
        for ((cell, marked), kept) in chosen.iter().zip(&kept) {
            let Some((number, is_calm)) = kept.or_else(|| Some((free.next()?, false))) else { continue };
            built.numbers.insert(*cell, number);
            // Cells whose part does not run have no cut.
            let cut = &mut built.cuts[number as usize];
            work[number as usize] =
                (!is_calm).then(|| (*cell, *marked, kept.map_or(0, |_| std::mem::take(&mut cut.count))));
        }
        for (cut, _) in built.cuts.iter_mut().zip(&is_kept).filter(|(_, is_kept)| !**is_kept) {
            cut.count = 0;
        }
        (built.grid, built.world, built.learnt, built.report) = (Some(grid), sampler.top.id, learnt, report);
        *built.kept_after_all.get_mut() = 0;
        let kept = &built.kept_after_all;
        built.cuts.iter_mut().zip(work).filter_map(move |(cut, work)| {
            let (cell, marked, nodes) = work?;
            Some(CutBuild { sampler, grid, cell, marked, cut, nodes, kept, taught })
        })
    }
}
