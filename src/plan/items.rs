//! Copies functions of a WGSL text under other names.

use std::collections::{HashMap, HashSet};

/// Returns the functions and variables of a text that the function `root` needs, `root` included,
/// with `suffix` added to their names. Names that the text does not define stay as they are, and so
/// do constants and types, which the copy shares with the text.
///
/// The text has the form of this crate's files: each item begins at the start of a line and ends
/// with a line `}` or with a semicolon.
pub(super) fn renamed(text: &str, root: &str, suffix: &str) -> String {
    let items = items(text);
    let names: HashMap<&str, usize> = items.iter().enumerate().map(|(index, (name, _))| (*name, index)).collect();
    let mut needed = HashSet::from([names[root]]);
    let mut open = vec![names[root]];
    while let Some(index) = open.pop() {
        let named = words(items[index].1).filter_map(|(_, word)| names.get(word).copied());
        open.extend(named.filter(|index| needed.insert(*index)));
    }
    let mut copy = String::new();
    for (_, item) in items.iter().enumerate().filter(|(index, _)| needed.contains(index)).map(|(_, item)| item) {
        let mut end = 0;
        for (start, word) in words(item).filter(|(_, word)| names.contains_key(word)) {
            copy += &item[end..start + word.len()];
            copy += suffix;
            end = start + word.len();
        }
        copy += &item[end..];
        copy.push('\n');
    }
    copy
}

/// The functions and variables of a text, by name.
fn items(text: &str) -> Vec<(&str, &str)> {
    let mut items = Vec::new();
    let mut start = 0;
    let mut open: Option<(&str, usize)> = None;
    for line in text.split_inclusive('\n') {
        let end = start + line.len();
        if open.is_none()
            && let Some(name) = name_of(line)
        {
            open = Some((name, start));
        }
        if let Some((name, first)) =
            open.filter(|_| line.starts_with('}') || line.trim_end().ends_with(';') && is_variable(line))
        {
            items.push((name, &text[first..end]));
            open = None;
        }
        start = end;
    }
    items
}

/// Whether a line is the whole declaration of a variable.
fn is_variable(line: &str) -> bool {
    line.starts_with("@group") || line.starts_with("var<")
}

/// The name of the function or variable that a line begins to declare.
fn name_of(line: &str) -> Option<&str> {
    let rest = match line.strip_prefix("fn ") {
        Some(rest) => rest,
        None if is_variable(line) => line.split_once("> ").map(|(_, rest)| rest)?,
        None => return None,
    };
    rest.split(|c: char| !c.is_alphanumeric() && c != '_').next()
}

/// The identifiers of a text outside of comments, with their places. Members, which follow a dot,
/// are left out.
fn words(text: &str) -> impl Iterator<Item = (usize, &str)> {
    let mut place = 0;
    let lines = text.split_inclusive('\n').map(move |line| {
        let start = place;
        place += line.len();
        (start, line.split("//").next().unwrap_or_default())
    });
    lines.flat_map(|(start, code)| {
        let mut rest = 0;
        std::iter::from_fn(move || {
            loop {
                let is_word = |c: char| c.is_alphanumeric() || c == '_';
                let from = rest + code[rest..].find(is_word)?;
                let length = code[from..].find(|c| !is_word(c)).unwrap_or(code.len() - from);
                rest = from + length;
                if !code[..from].ends_with('.') {
                    return Some((start + from, &code[from..rest]));
                }
            }
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_copy_has_what_its_root_needs_under_new_names() {
        let text = "@group(1) @binding(0) var<storage, read> a: array<u32>;
var<private> b: u32;
const C: u32 = 3u;
struct S {
    a: u32,
}
// Calls g, not h.
fn f(s: S) -> u32 {
    return g(s.a) + C + b; // h
}

fn g(
    i: u32,
) -> u32 {
    return a[i] + outside(i);
}

fn h() -> u32 {
    return 1u;
}
";
        let expected = "@group(1) @binding(0) var<storage, read> a_old: array<u32>;

var<private> b_old: u32;

fn f_old(s: S) -> u32 {
    return g_old(s.a) + C + b_old; // h
}

fn g_old(
    i: u32,
) -> u32 {
    return a_old[i] + outside(i);
}

";
        assert_eq!(renamed(text, "f", "_old"), expected);
    }
}
