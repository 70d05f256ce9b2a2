//! Builds the cuts of all cells that were marked.

use std::cmp::Reverse;

use crate::sampling::cuts::build::{CellPoints, build};
use crate::sampling::cuts::cell::{CutGrid, POINTS};
use crate::sampling::cuts::marks::Marked;
use crate::sampling::cuts::shared::SharedCut;
use crate::sampling::cuts::table::{CutReport, CutTable};
use crate::sampling::sample::LightSampler;

/// The work of building one cell: see [`CutTable::builds`].
#[derive(Debug)]
pub struct CutBuild<'t> {
    sampler: LightSampler<'t>,
    grid: CutGrid,
    marked: Marked,
    cut: &'t mut SharedCut,
}

impl CutBuild<'_> {
    /// Builds the cell's cut: up to 32 nodes for each of up to eight points.
    pub fn run(self) {
        let Self { sampler, grid, marked, cut } = self;
        let center = grid.center(&marked.cell);
        let mut points = [center; POINTS];
        let mut count = 0;
        for word in marked.points.into_iter().filter(|word| *word != 0) {
            points[count] = grid.point(&marked.cell, word);
            count += 1;
        }
        build(&sampler, &CellPoints { points: &points[..count], center }, cut);
        cut.points = count;
        cut.learnt = learnt(&sampler, &grid, &marked);
    }
}

/// What tells whether more has been learnt about the points of a cell.
fn learnt(sampler: &LightSampler<'_>, grid: &CutGrid, marked: &Marked) -> [u64; 2] {
    let Some((table, cells)) = &sampler.visibility else { return [0; 2] };
    let points = marked.points.iter().filter(|word| **word != 0).map(|word| grid.point(&marked.cell, *word));
    let last = points.map(|point| table.last_change(&cells.cell(&point))).max();
    [table.id(), last.unwrap_or(0)]
}

impl CutTable {
    /// Builds the cuts of all cells that were marked since the last build, for the world of the sampler as it
    /// is now, and forgets the marks. Cells keep their cuts while the world does not change, unless more
    /// points of them are known now.
    ///
    /// With a sampler that has [learnt visibility](LightSampler::with_visibility), cells choose lights by that
    /// too, and are built again after frames that have taught something about them. Choices take no longer.
    ///
    /// The result does not depend on the order or the threads of the marks. O(cells of the table), and
    /// up to 256 evaluations of a node for each cell that gets a cut.
    pub fn build(&mut self, sampler: LightSampler<'_>) {
        self.builds(sampler).for_each(CutBuild::run);
    }

    /// The same in parts, each of which may run on any thread. Cells whose part does not run have no cut.
    pub fn builds<'t>(&'t mut self, sampler: LightSampler<'t>) -> impl Iterator<Item = CutBuild<'t>> + use<'t> {
        let Self { options, camera, marks, lost_marks, built } = self;
        let lost_marks = std::mem::take(lost_marks.get_mut());
        let (mut report, mut chosen) = (CutReport { lost_marks, ..CutReport::default() }, Vec::new());
        for (slot, marked) in marks.cells() {
            report.marked += 1;
            if marked.count < options.min_marks() {
                report.rare += 1;
            } else {
                chosen.push((slot, marked));
            }
        }
        if chosen.len() > options.cells() {
            report.refused = chosen.len() - options.cells();
            let rank = |(_, marked): &(usize, Marked)| (Reverse(marked.count), marked.tag);
            chosen.select_nth_unstable_by_key(options.cells(), rank);
            chosen.truncate(options.cells());
        }
        marks.clear();
        let grid = options.grid(*camera, sampler.world.origin());
        let kept = |(_, marked): &(usize, Marked)| {
            let number = built.kept(marked, &grid, sampler.top.id)?;
            let knows_all = built.cuts[number as usize].learnt == learnt(&sampler, &grid, marked);
            knows_all.then_some(number)
        };
        let kept: Vec<Option<u32>> = chosen.iter().map(kept).collect();
        report.kept = kept.iter().flatten().count();
        report.built = chosen.len() - report.kept;
        if built.cuts.len() < chosen.len() {
            built.cuts.resize_with(chosen.len(), SharedCut::default);
        }
        let mut is_kept = vec![false; built.cuts.len()];
        kept.iter().flatten().for_each(|number| is_kept[*number as usize] = true);
        let mut free = (0..).zip(&is_kept).filter(|(_, is_kept)| !**is_kept).map(|(number, _)| number);
        let mut work = vec![None; built.cuts.len()];
        built.tags.fill((0, 0));
        for ((slot, marked), kept) in chosen.iter().zip(&kept) {
            let Some(number) = kept.or_else(|| free.next()) else { continue };
            built.tags[*slot] = (marked.tag, number);
            work[number as usize] = kept.is_none().then_some(*marked);
        }
        for (cut, _) in built.cuts.iter_mut().zip(&is_kept).filter(|(_, is_kept)| !**is_kept) {
            cut.count = 0;
        }
        (built.grid, built.world, built.report) = (Some(grid), sampler.top.id, report);
        let cuts = built.cuts.iter_mut().zip(work);
        cuts.filter_map(move |(cut, marked)| Some(CutBuild { sampler, grid, marked: marked?, cut }))
    }
}
