//! The results of a scene: every run frame by frame, and the rows of the tables with their
//! intervals.

use super::decisions::Rule;
use super::pool::Step;
use super::strategies::{Strategy, TreeKind};
use testbed::measuring::score::Estimate;

/// One frame of a run.
#[derive(Clone, Debug)]
pub struct FrameResult {
    pub step: Step,
    /// The MAPE for each seed.
    pub errors: Vec<f64>,
}

/// A strategy on a kind of tree.
#[derive(Clone, Debug)]
pub struct Run {
    pub kind: TreeKind,
    pub strategy: Strategy,
    pub frames: Vec<FrameResult>,
}

/// A scene and all runs on it.
#[derive(Clone, Debug)]
pub struct Results {
    /// The scene's name.
    pub scene: String,
    pub lights: usize,
    pub instances: usize,
    /// The mean number of lights that change from one frame to the next.
    pub changed_lights: f64,
    /// The mean over frames of the MAPE of the references themselves.
    pub reference_error: f64,
    pub runs: Vec<Run>,
}

/// A line of the tables.
#[derive(Clone, Debug)]
pub struct Row {
    pub kind: TreeKind,
    pub strategy: Strategy,
    /// The mean MAPE over all frames, with its interval over seeds.
    pub mape: Estimate,
    /// The MAPE minus that of always updating the same kind of tree, in pairs of the same seed.
    pub difference: Estimate,
    /// The part of the gap between always updating and always rebuilding that the strategy closes.
    /// `None` where always rebuilding is not better by more than the interval of the difference.
    pub gap: Option<Estimate>,
    pub rebuilds: usize,
    pub update_ms: f64,
    pub rebuild_ms: f64,
    /// The time of rebuilds over that of always rebuilding, both without the first build.
    pub cost_share: f64,
}

impl Row {
    /// What the interval of the difference says.
    pub fn verdict(&self) -> &'static str {
        if self.strategy == Strategy::Rule(Rule::Never) {
            ""
        } else if self.difference.high() < 0.0 {
            "better"
        } else if self.difference.low() > 0.0 {
            "worse"
        } else {
            "no difference"
        }
    }
}

impl Run {
    /// The mean MAPE over all frames for each seed.
    fn by_seed(&self) -> Vec<f64> {
        let seeds = self.frames.first().map_or(0, |frame| frame.errors.len());
        let mean = |seed: usize| self.frames.iter().map(|f| f.errors[seed]).sum::<f64>() / self.frames.len() as f64;
        (0..seeds).map(mean).collect()
    }

    /// The mean over seeds of the MAPE of a frame.
    pub fn mape_of(&self, frame: usize) -> f64 {
        let errors = &self.frames[frame].errors;
        errors.iter().sum::<f64>() / errors.len() as f64
    }

    /// The time of rebuilds after frame 0.
    fn later_rebuild_ms(&self) -> f64 {
        self.frames.iter().skip(1).map(|frame| frame.step.rebuild_ms).sum()
    }
}

impl Results {
    /// The run of a rule on a kind of tree.
    pub fn end(&self, kind: TreeKind, rule: Rule) -> Option<&Run> {
        self.runs.iter().find(|run| run.kind == kind && run.strategy == Strategy::Rule(rule))
    }

    /// The lines of the tables, in the order of the runs.
    pub fn rows(&self) -> Vec<Row> {
        self.runs.iter().map(|run| self.row(run)).collect()
    }

    fn row(&self, run: &Run) -> Row {
        let of = |rule: Rule| self.end(run.kind, rule).unwrap_or(run);
        let (updated, rebuilt) = (of(Rule::Never), of(Rule::Always));
        let [own, update, rebuild] = [run, updated, rebuilt].map(Run::by_seed);
        let minus = |a: &[f64], b: &[f64]| -> Vec<f64> { a.iter().zip(b).map(|(a, b)| a - b).collect() };
        let always_ms = rebuilt.later_rebuild_ms();
        let sum = |of: fn(&Step) -> f64| run.frames.iter().map(|frame| of(&frame.step)).sum::<f64>();
        Row {
            kind: run.kind,
            strategy: run.strategy,
            mape: Estimate::new(&own),
            difference: Estimate::new(&minus(&own, &update)),
            gap: gap_recovered(&minus(&update, &own), &minus(&update, &rebuild)),
            rebuilds: run.frames.iter().map(|frame| frame.step.rebuilds).sum(),
            update_ms: sum(|step| step.update_ms),
            rebuild_ms: sum(|step| step.rebuild_ms),
            cost_share: if always_ms > 0.0 { run.later_rebuild_ms() / always_ms } else { 0.0 },
        }
    }
}

/// The ratio of the means of two lists of pairs, with the interval that follows from the deviations
/// of the pairs from that ratio (the delta method). `None` unless the interval of the second mean
/// is above 0.
fn gap_recovered(gains: &[f64], gaps: &[f64]) -> Option<Estimate> {
    let gap = Estimate::new(gaps);
    if gap.low() <= 0.0 {
        return None;
    }
    // The sum makes -0 a 0.
    let ratio = Estimate::new(gains).mean / gap.mean + 0.0;
    let rest: Vec<f64> = gains.iter().zip(gaps).map(|(gain, gap)| gain - ratio * gap).collect();
    Some(Estimate { mean: ratio, half_width: Estimate::new(&rest).half_width / gap.mean })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn run(rule: Rule, errors: [[f64; 2]; 2], rebuild_ms: [f64; 2]) -> Run {
        let frame = |(errors, rebuild_ms): ([f64; 2], f64)| {
            let step = Step { rebuilds: usize::from(rebuild_ms > 0.0), rebuild_ms, update_ms: 1.5, ..Step::default() };
            FrameResult { step, errors: errors.to_vec() }
        };
        let frames = errors.into_iter().zip(rebuild_ms).map(frame).collect();
        Run { kind: TreeKind::Binary, strategy: Strategy::Rule(rule), frames }
    }

    #[test]
    fn rows_have_values_computed_by_hand() {
        let half = Rule::Ratio { attribute: girandole::Attribute::Overlap, factor: 1.1 };
        let runs = vec![
            run(Rule::Never, [[2.0, 2.2], [4.0, 4.2]], [9.0, 0.0]),
            run(Rule::Always, [[2.0, 2.2], [2.0, 2.2]], [9.0, 8.0]),
            run(half, [[2.0, 2.2], [3.0, 3.2]], [9.0, 2.0]),
        ];
        let results =
            Results { scene: "test".into(), lights: 1, instances: 1, changed_lights: 0.0, reference_error: 0.0, runs };
        let rows = results.rows();
        let near = |a: f64, b: f64| (a - b).abs() < 1.0e-9;
        assert!(near(rows[0].mape.mean, 3.1) && near(rows[0].mape.half_width, 12.706 * 0.1), "{:?}", rows[0].mape);
        // The pairs differ by the same value for both seeds, so the differences have no interval.
        assert!(near(rows[2].difference.mean, -0.5) && near(rows[2].difference.half_width, 0.0));
        assert_eq!([0, 1, 2].map(|i| rows[i].verdict()), ["", "better", "better"]);
        let gap = rows[2].gap.expect("a gap");
        assert!(near(gap.mean, 0.5) && near(gap.half_width, 0.0), "{gap:?}");
        assert!(near(rows[2].cost_share, 0.25) && near(rows[2].rebuild_ms, 11.0) && near(rows[2].update_ms, 3.0));
        assert_eq!([0, 1, 2].map(|i| rows[i].rebuilds), [1, 2, 2]);
    }

    #[test]
    fn no_gap_is_recovered_where_there_is_none() {
        assert!(gap_recovered(&[0.1, 0.2, 0.1], &[0.1, -0.1, 0.05]).is_none());
        assert!(gap_recovered(&[-0.9, -1.0, -1.0], &[-1.0, -1.0, -1.1]).is_none());
        // Ratio 0.5; what is left of the pairs is 0.05, 0, -0.05: a standard error of 0.05 / √3.
        let gap = gap_recovered(&[0.55, 0.5, 0.45], &[1.0, 1.0, 1.0]).expect("a gap");
        assert!((gap.mean - 0.5).abs() < 1e-9 && (gap.half_width - 4.303 * 0.05 / 3.0_f64.sqrt()).abs() < 1e-9);
    }
}
