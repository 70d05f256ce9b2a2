//! Builds the cuts of all cells that were marked.

use std::cmp::Reverse;

use crate::math::parallel::for_each_chunk;
use crate::sampling::cuts::build::build;
use crate::sampling::cuts::cell::{CutCell, CutGrid, POINTS};
use crate::sampling::cuts::keep::{CellNow, TURNS};
use crate::sampling::cuts::marks::Marked;
use crate::sampling::cuts::shared::SharedCut;
use crate::sampling::cuts::table::{CutReport, CutTable};
use crate::sampling::sample::LightSampler;

/// What the cells of one build have in common.
struct Build<'a> {
    sampler: LightSampler<'a>,
    grid: CutGrid,
    /// Whether nothing has changed for so long that all cells keep their cuts: matte ones, and glossy ones.
    is_calm: [bool; 2],
    /// Whether anything was learnt since the last build.
    taught: bool,
}

impl Build<'_> {
    /// Builds the cut of a cell, unless it may keep the one that it has. Returns whether it is built.
    fn run(&self, cell: &CutCell, marked: &Marked, cut: &mut SharedCut) -> bool {
        let Self { sampler, grid, taught, .. } = self;
        let (center, [_, tag]) = (grid.center(cell), cell.keys());
        let now = CellNow { toward: grid.toward(cell), tag, taught: *taught };
        let mut points = [center; POINTS];
        let mut count = 0;
        for word in marked.words() {
            points[count] = grid.point(cell, word);
            count += 1;
        }
        // It was made for at least as many points as are known now.
        if cut.count == 0 || cut.points < count {
            cut.age = 0;
        } else if self.is_calm[usize::from(cell.is_glossy())]
            || cut.is_kept(sampler.world, &sampler.view(&center), &now)
        {
            return false;
        }
        build(sampler, &points[..count], &center, cut);
        (cut.points, cut.toward) = (count, now.toward);
        true
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
    /// Cells are built on rayon's threads. The result does not depend on them, nor on the order or the threads of the
    /// marks. O(marked cells), and up to 256 evaluations of a node for each cell that is built.
    pub fn build(&mut self, sampler: LightSampler<'_>) {
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
        let is_rested = built.calm > TURNS;
        let is_calm = [is_rested, is_rested && built.eye_rest > TURNS];
        let build = Build { sampler, grid, is_calm, taught };
        let work = chosen.into_iter().map(|(cell, marked)| {
            let cut = built.cuts.remove(&cell).unwrap_or_default();
            (cell, marked, cut, false)
        });
        let mut work: Vec<(CutCell, Marked, Box<SharedCut>, bool)> = work.collect();
        for_each_chunk(&mut work, 1, |_, work| {
            for (cell, marked, cut, is_built) in work {
                *is_built = build.run(cell, marked, cut);
            }
        });
        report.built = work.iter().filter(|(.., is_built)| *is_built).count();
        report.kept = work.len() - report.built;
        built.cuts.clear();
        built.cuts.extend(work.into_iter().map(|(cell, _, cut, _)| (cell, cut)));
        (built.grid, built.world, built.learnt, built.report) = (Some(grid), sampler.top.id, learnt, report);
    }
}
