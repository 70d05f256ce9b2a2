//! The results of a scene, as a table for the terminal and as rows of `cases.csv`.

use testbed::common::table::{Table, markdown_head};
use testbed::scene::SceneError;

/// The columns of `cases.csv`: one row for each measured value.
pub const COLUMNS: [&str; 4] = ["scene", "variant", "measure", "value"];

/// The results of one variant of a scene.
pub trait Outcome {
    /// The name of the scene.
    const SCENE: &'static str;

    /// The name of the variant.
    fn variant(&self) -> String;

    /// The measured values with their names, the same names for all variants. Infinity stands for
    /// "never".
    fn values(&self) -> Vec<(&'static str, f64)>;
}

/// Prints a table with a row for each variant, and adds the values to `cases.csv`.
pub fn show<O: Outcome>(outcomes: &[O], table: &mut Table) -> Result<(), SceneError> {
    let Some(first) = outcomes.first() else { return Ok(()) };
    let columns: Vec<&str> =
        ["scene", "variant"].into_iter().chain(first.values().iter().map(|(name, _)| *name)).collect();
    testbed::say!("{}", markdown_head(&columns));
    for outcome in outcomes {
        let (variant, values) = (outcome.variant(), outcome.values());
        let shown: Vec<String> = values.iter().map(|(_, value)| text(*value)).collect();
        testbed::say!("| {} | {variant} | {} |", O::SCENE, shown.join(" | "));
        for ((name, _), value) in values.iter().zip(&shown) {
            table.add([O::SCENE, &variant, name, value]).map_err(SceneError)?;
        }
    }
    testbed::say!("");
    Ok(())
}

/// A number with at most three digits after the point.
fn text(value: f64) -> String {
    match value {
        value if value.is_infinite() => "never".into(),
        value if value == value.round() => format!("{value:.0}"),
        value => format!("{value:.3}"),
    }
}
