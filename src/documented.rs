//! For tests that documentation names the numbers that the code has.

/// Asserts that the comments of a source file say something, however their lines are broken.
#[track_caller]
pub(crate) fn assert_says(source: &str, sentence: &str) {
    let words =
        source.lines().map(|line| line.trim_start().trim_start_matches(['/', '!'])).flat_map(str::split_whitespace);
    let text = words.collect::<Vec<_>>().join(" ");
    assert!(text.contains(sentence), "the documentation does not say: {sentence}");
}

/// A number with commas.
pub(crate) fn grouped(number: usize) -> String {
    match number {
        0..1000 => number.to_string(),
        _ => format!("{},{:03}", grouped(number / 1000), number % 1000),
    }
}
