//! What a compiler may make of a shader if it assumes that no float is NaN.

/// The text with every `a > b` as `!(a <= b)`, and the other three comparisons likewise. For numbers
/// that is the same, and for NaN the opposite. Metal's fast math and drivers of Vulkan may make
/// such changes.
///
/// Relies on the form of the text: binary operators have spaces around them, and template lists
/// have none.
pub fn comparisons_negated(text: &str) -> String {
    let code: String = text.lines().flat_map(|line| [line.split("//").next().unwrap_or_default(), "\n"]).collect();
    let mut changes: Vec<(usize, usize, &str)> = Vec::new();
    for (operator, negated) in [(" > ", " <= "), (" < ", " >= "), (" >= ", " < "), (" <= ", " > ")] {
        for (at, _) in code.match_indices(operator) {
            let end = at + operator.len();
            changes.push((start_of_operand(&code[..at]), 0, "!("));
            changes.push((at, operator.len(), negated));
            changes.push((end + end_of_operand(&code[end..]), 0, ")"));
        }
    }
    changes.sort_by_key(|(at, _, _)| *at);
    let (mut changed, mut copied) = (String::with_capacity(code.len() + 4 * changes.len()), 0);
    for (at, removed, added) in changes {
        changed += &code[copied..at];
        changed += added;
        copied = at + removed;
    }
    changed + &code[copied..]
}

/// Where the operand that `before` ends with begins.
fn start_of_operand(before: &str) -> usize {
    let mut depth = 0;
    let stop = before.char_indices().rev().find(|(_, c)| {
        match c {
            ')' | ']' => depth += 1,
            '(' | '[' if depth > 0 => depth -= 1,
            '(' | '[' => return true,
            ',' | ';' | '{' | '}' | '=' | '&' | '|' | '!' => return depth == 0,
            _ => {}
        }
        false
    });
    let mut start = stop.map_or(0, |(at, _)| at + 1);
    loop {
        let rest = &before[start..];
        let word = ["else ", "if ", "return ", "while "].into_iter().find(|word| rest.starts_with(word));
        start += match word {
            Some(word) => word.len(),
            None if rest.starts_with(char::is_whitespace) => 1,
            None => return start,
        };
    }
}

/// Where the operand that `after` begins with ends.
fn end_of_operand(after: &str) -> usize {
    let mut depth = 0;
    let stop = after.char_indices().find(|(_, c)| {
        match c {
            '(' | '[' => depth += 1,
            ')' | ']' if depth > 0 => depth -= 1,
            ')' | ']' => return true,
            ',' | ';' | '{' | '&' | '|' => return depth == 0,
            _ => {}
        }
        false
    });
    after[..stop.map_or(after.len(), |(at, _)| at)].trim_end().len()
}

#[test]
fn comparisons_are_negated_with_their_operands() {
    for (text, expected) in [
        ("if a > b {", "if !(a <= b) {\n"),
        ("return f(x, y) >= 2.0 * z && c < d;", "return !(f(x, y) < 2.0 * z) && !(c >= d);\n"),
        ("let v = select(a, b, c <= d) > e[i < 2u];", "let v = !(select(a, b, !(c > d)) <= e[!(i >= 2u)]);\n"),
        ("x = (four.gap > vec4(0.0)) & !(y < z); // a > b", "x = (!(four.gap <= vec4(0.0))) & !(!(y >= z)); \n"),
        ("var a: array<u32, 8>; b = a >> 2u;", "var a: array<u32, 8>; b = a >> 2u;\n"),
    ] {
        assert_eq!(comparisons_negated(text), expected);
    }
}
