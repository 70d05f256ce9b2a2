//! Numbers as documents show them, and small formulas over columns.

/// How a value is shown.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Format {
    /// As the program wrote it.
    Text,
    /// So many digits after the point.
    Fixed(usize),
    /// So many significant digits.
    Digits(usize),
    /// In percent with so many digits after the point.
    Percent(usize),
    /// Significant digits, and an interval between the values of two columns.
    Within(&'static str, &'static str, usize),
}

/// A dash for what was not measured.
pub const NONE: &str = "–";

/// A value with `digits` digits after the point, with commas between thousands.
pub fn fixed(value: f64, digits: usize) -> String {
    match value {
        _ if value.is_nan() => NONE.into(),
        _ if value.is_infinite() => "∞".into(),
        _ => {
            let text = format!("{:.digits$}", value.abs());
            let (whole, rest) = text.split_at(text.find('.').unwrap_or(text.len()));
            let comma = |i: usize| if i > 0 && (whole.len() - i).is_multiple_of(3) { "," } else { "" };
            let whole: String = whole.char_indices().map(|(i, digit)| format!("{}{digit}", comma(i))).collect();
            let is_zero = !text.contains(|digit: char| ('1'..='9').contains(&digit));
            format!("{}{whole}{rest}", if value < 0.0 && !is_zero { "−" } else { "" })
        }
    }
}

/// A value with so many significant digits.
pub fn digits(value: f64, count: usize) -> String {
    if !value.is_finite() || value == 0.0 {
        return fixed(value, 0);
    }
    let magnitude = |value: f64| value.abs().log10().floor() as i32;
    let unit = |value: f64| 10.0_f64.powi(magnitude(value) + 1 - count as i32);
    let rounded = (value / unit(value)).round() * unit(value);
    fixed(rounded, (count as i32 - 1 - magnitude(rounded)).max(0) as usize)
}

/// The value of a formula: columns, each with a power such as `ns^2`, and numbers, joined by ` * ` and ` / `.
/// `None` where a column has no number, or where 0 divides.
pub fn evaluate(formula: &str, column: impl Fn(&str) -> Option<f64>) -> Option<f64> {
    let mut value = 1.0;
    for factor in formula.split(" * ") {
        for (divisor, term) in factor.split(" / ").enumerate() {
            let (name, power) = term.split_once('^').unwrap_or((term, "1"));
            let base = column(name).or_else(|| name.parse().ok())?;
            let power: i32 = power.parse().ok()?;
            if divisor > 0 && base == 0.0 {
                return None;
            }
            value *= base.powi(if divisor == 0 { power } else { -power });
        }
    }
    Some(value)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_rounded_to_what_is_significant() {
        let cases =
            [(12_373.0, "12,400"), (0.80449, "0.804"), (9.9996, "10.0"), (999.6, "1,000"), (-0.00123, "−0.00123")];
        cases.iter().for_each(|(value, text)| assert_eq!(digits(*value, 3), *text));
        assert_eq!([digits(0.0, 3), digits(f64::INFINITY, 2), digits(f64::NAN, 2)], ["0", "∞", "–"]);
        assert_eq!([fixed(1_234_567.0, 0), fixed(999.95, 1), fixed(-0.001, 2)], ["1,234,567", "1,000.0", "0.00"]);
    }

    #[test]
    fn formulas_follow_columns() {
        let column = |name: &str| [("sigma", 2.0), ("ns per pick", 10.0)].iter().find(|(n, _)| *n == name).map(|c| c.1);
        assert_eq!(evaluate("sigma^2 * ns per pick", column), Some(40.0));
        assert_eq!(evaluate("ns per pick / sigma / 5 * 100", column), Some(100.0));
        assert_eq!(evaluate("other * 2", column), None);
        assert_eq!(evaluate("sigma / 0", column), None);
    }
}
