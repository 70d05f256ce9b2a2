//! The measurements in a few lines.

use super::measure::Measured;
use super::sweep::Sweep;

/// A line for each sweep and sampler.
pub fn summary(rows: &[Measured]) -> String {
    let mut lines = Vec::new();
    for sweep in Sweep::ALL {
        let of_sweep: Vec<&Measured> = rows.iter().filter(|row| row.sweep == sweep).collect();
        let mut samplers: Vec<&str> = of_sweep.iter().map(|row| row.sampler).collect();
        samplers.dedup();
        samplers.truncate(of_sweep.iter().filter(|row| row.value == of_sweep[0].value).count());
        for sampler in samplers {
            let own: Vec<&Measured> = of_sweep.iter().copied().filter(|row| row.sampler == sampler).collect();
            lines.push(format!("{:9} {sampler:15} {}", sweep.name(), line(&own, sweep.base())));
        }
    }
    lines.join("\n")
}

/// The least and the greatest sigma, where sigma is infinite, and the errors.
fn line(rows: &[&Measured], base: f64) -> String {
    let sigma = |row: &&&Measured| row.sigma.unwrap_or(f64::INFINITY);
    let at_base = rows.iter().find(|row| row.value == base).map_or(f64::NAN, |row| sigma(&row));
    let least = rows.iter().map(|row| sigma(&row)).fold(f64::INFINITY, f64::min);
    let most = rows.iter().map(|row| sigma(&row)).fold(0.0, f64::max);
    let mut line = format!("sigma {at_base:.3} at {base}, {least:.3} to {most:.3}");
    let lost: Vec<f64> = rows.iter().filter(|row| row.infinite > 0.0).map(|row| row.value).collect();
    match (lost.first(), lost.last()) {
        (Some(first), Some(last)) => {
            let share = rows.iter().map(|row| row.infinite).fold(0.0, f64::max);
            line += &format!(
                "; infinite from {first:.0e} to {last:.0e}, at up to {:.1} % of the shading points",
                100.0 * share
            );
        }
        _ => line += "; finite everywhere",
    }
    let nan = rows.iter().map(|row| row.nan).fold(0.0, f64::max);
    if nan > 0.0 {
        line += &format!("; NaN at up to {:.1} %", 100.0 * nan);
    }
    let errors: Vec<f64> = rows.iter().filter_map(|row| Some(row.error?.mean)).collect();
    if !errors.is_empty() {
        let range = [errors.iter().copied().fold(f64::INFINITY, f64::min), errors.iter().copied().fold(0.0, f64::max)];
        line += &format!("; mean error {:.1e} to {:.1e}", range[0], range[1]);
    }
    line
}
