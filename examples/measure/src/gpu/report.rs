//! The tables, as Markdown.

use super::checks::Check;
use super::goals::Verdict;
use super::machine::Machine;
use super::{sampling, top_level, uploads};

/// Prints the adapter and how times are taken.
pub fn head(machine: &Machine) {
    let info = &machine.info;
    let kind = if machine.is_software() { "software, tells nothing about GPUs; " } else { "" };
    testbed::say!("{} ({kind}{:?}; {} {})", info.name, info.backend, info.driver, info.driver_info.trim());
    testbed::say!("Times are {} in milliseconds: median (least – greatest).", machine.timing());
}

/// Prints what was compared.
pub fn checks(all: &[Check]) {
    testbed::say!("\nComparisons before any time is taken.\n");
    line(["comparison", "found", "result"].map(String::from));
    line(["---"; 3].map(String::from));
    for check in all {
        let result = if check.has_passed { "passed" } else { "FAILED" };
        line([check.name.to_owned(), check.found.clone(), result.to_owned()]);
    }
}

/// Prints what was measured beside the goals.
pub fn verdicts(machine: &Machine, all: &[Verdict]) {
    testbed::say!("\nGoals.\n");
    line(["goal", "at most", "measured", "outcome"].map(String::from));
    line(["---", "---:", "---:", "---"].map(String::from));
    for verdict in all {
        let measured = verdict.measured.map_or("–".to_owned(), |value| format!("{value:.2}"));
        let outcome = verdict.outcome(machine.is_software()).name().to_owned();
        line([verdict.goal.clone(), verdict.most.to_string(), measured, outcome]);
    }
}

/// Prints the table of uploads.
pub fn uploads(instances: u32, rows: &[uploads::Row]) {
    testbed::say!(
        "\nUpload of moved instances, of {}: the call on the CPU, then the transfer.\n",
        grouped(instances.into())
    );
    line(["moved", "bytes", "`upload`", "submit and wait"].map(String::from));
    line(["---"; 4].map(|rule| format!("{rule}:")));
    for row in rows {
        let moved = format!("{} ({} %)", grouped(row.moved as u64), row.percent);
        line([moved, grouped(row.bytes), row.call.to_string(), row.transfer.to_string()]);
    }
}

/// Prints the table of top-level builds, with a column for each stage.
pub fn top_levels(rows: &[top_level::Row]) {
    let mut names: Vec<&str> = Vec::new();
    for stage in rows.iter().flat_map(|row| &row.built).flat_map(|built| &built.stages) {
        if !names.contains(&stage.name) {
            names.push(stage.name);
        }
    }
    testbed::say!("\nThe top-level build by stage, each in a pass of its own.\n");
    let columns = ["instances", "dispatches"].into_iter().chain(names.iter().copied());
    let columns: Vec<_> = columns.chain(["total", "total / sort"]).map(String::from).collect();
    let count = columns.len();
    line(columns);
    line(vec!["---:".to_owned(); count]);
    for row in rows {
        let instances = grouped(row.instances.into());
        let built = match &row.built {
            Ok(built) => built,
            Err(refusal) => {
                testbed::say!("| {instances} | refused: {refusal} |");
                continue;
            }
        };
        let time = |name: &&str| {
            let stage = built.stages.iter().find(|stage| stage.name == *name);
            stage.and_then(|stage| stage.time).map_or("–".into(), |time| time.to_string())
        };
        let mut fields = vec![instances, built.dispatches.to_string()];
        fields.extend(names.iter().map(time));
        let per_sort = built.per_sort().map_or("–".into(), |ratio| format!("{ratio:.2}"));
        fields.extend([built.total.to_string(), per_sort]);
        line(fields);
    }
}

/// Prints the head of the table of sampling.
pub fn sampling_head() {
    testbed::say!(
        "\nOne sample per pixel of a picture of the city, without shadow rays; of several candidates one is chosen.\n"
    );
    let columns = ["city", "lights", "instances", "picture", "candidates", "ms", "million samples per second"];
    line(columns.map(String::from));
    line(columns.map(|column| if column == "city" { "---".into() } else { "---:".into() }));
}

/// Prints a row of the table of sampling.
pub fn sampling(row: &sampling::Row) {
    let (width, height) = row.picture;
    line([
        row.city.clone(),
        grouped(row.lights as u64),
        grouped(row.instances as u64),
        format!("{width} × {height}"),
        row.candidates.to_string(),
        row.time.to_string(),
        format!("{:.3}", row.samples_per_second() * 1e-6),
    ]);
}

fn line(fields: impl IntoIterator<Item = String>) {
    let fields: Vec<_> = fields.into_iter().collect();
    testbed::say!("| {} |", fields.join(" | "));
}

/// A number with commas between thousands.
fn grouped(number: u64) -> String {
    let digits = number.to_string();
    let mut text = String::new();
    for (i, digit) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            text.push(',');
        }
        text.push(digit);
    }
    text
}
