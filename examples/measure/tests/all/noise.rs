//! What the variance example says about oracles that know which lights are visible.

use measure::noise::shadow_oracle::measure::{Knowledge, Measured, measure};
use measure::noise::shadow_oracle::{places, table};

/// Few shading points: the test looks for order, not for values.
const SHADING_POINTS: usize = 24;

fn ten_rooms() -> Measured {
    measure(&places::rooms().expect("a valid scene"), SHADING_POINTS).expect("lit surfaces")
}

fn mean(measured: &Measured, knowledge: Knowledge) -> f64 {
    let row = measured.rows.iter().find(|row| row.knowledge == knowledge).expect("a row");
    row.sigma.mean
}

#[test]
fn an_oracle_for_each_light_has_less_noise_than_the_library_in_ten_rooms() {
    let measured = ten_rooms();
    let [library, normalised, lights] =
        [Knowledge::Library, Knowledge::Normalised, Knowledge::Lights].map(|knowledge| mean(&measured, knowledge));
    assert!(library.is_finite() && lights > 0.0, "{library} {lights}");
    // Normalising removes the draws without a light, and walls hide much of the light.
    assert!(normalised <= library, "{normalised} {library}");
    assert!(lights < normalised, "{lights} {normalised}");
    assert!((0.1..0.9).contains(&measured.shadowed), "{}", measured.shadowed);

    // One group of rows for each partition, at the shading point and in cells of three sizes.
    let clusters: Vec<Knowledge> = measured.rows[3..7].iter().map(|row| row.knowledge).collect();
    let cells: Vec<Knowledge> = measured.rows[7..].iter().map(|row| row.knowledge).collect();
    let partitions: Vec<(&str, usize)> = clusters
        .iter()
        .map(|knowledge| match *knowledge {
            Knowledge::Clusters { kind, count } => (kind, count),
            other => panic!("{other:?}"),
        })
        .collect();
    assert_eq!(partitions[..3], [("position", 32), ("position", 100), ("position", 300)]);
    assert_eq!(partitions[3].0, "instance");
    let expected = [0.5, 1.0, 2.0]
        .into_iter()
        .flat_map(|edge| partitions.iter().map(move |&(kind, count)| Knowledge::Cells { kind, count, edge }));
    assert_eq!(cells, expected.collect::<Vec<_>>());

    let rows = table::rows(&measured);
    assert_eq!(rows.len(), measured.rows.len());
    for row in &rows {
        assert!(row.iter().all(|field| !field.is_empty()), "{row:?}");
        // All columns of numbers, except the three that only some rows have.
        for (column, field) in table::COLUMNS.iter().zip(row) {
            let is_text = ["scene", "knows", "clusters", "cell_m", "neighbours"].contains(column);
            let is_number = field.parse::<f64>().is_ok_and(f64::is_finite);
            assert!(is_text || is_number, "{column}: {field}");
        }
    }
}
