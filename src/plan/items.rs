//! Copies functions of a WGSL text under other names.

use std::collections::{HashMap, HashSet};

use super::error::ShaderNameError;

/// Returns a copy of the function `root` under another name, with `suffix` added, that works on
/// variables of its own.
///
/// `given` are the variables and functions that the caller has under the name with the suffix. Copied are the functions
/// that use these and private variables, and such variables. Everything else is shared with the text: other
/// functions, bindings, constants and types.
///
/// The text has the form of this crate's files: each item begins at the start of a line and ends
/// with a line `}` or with a semicolon.
pub(super) fn renamed(text: &str, root: &str, suffix: &str, given: &[&str]) -> String {
    let items = items(text);
    let all: HashMap<&str, usize> = items.iter().enumerate().map(|(index, item)| (item.name, index)).collect();
    let is_given = |item: &TextItem<'_>| given.contains(&item.name);
    // What is given uses nothing else of the text.
    let uses = items.iter().map(|item| match is_given(item) {
        true => Vec::new(),
        false => words(item.text).filter_map(|(_, word)| all.get(word).copied()).collect(),
    });
    let uses: Vec<Vec<usize>> = uses.collect();
    // From an item to those that it names, and from one that is named to those that name it.
    let mut users = vec![Vec::new(); items.len()];
    uses.iter().enumerate().for_each(|(user, used)| used.iter().for_each(|used| users[*used].push(user)));
    let is_own = |item: &TextItem<'_>| is_given(item) || item.text.starts_with("var<private>");
    let own = items.iter().enumerate().filter(|(_, item)| is_own(item)).map(|(index, _)| index);
    let with_variables = reached(own.collect(), &users);
    let needed: HashSet<usize> = &reached(vec![all[root]], &uses) & &with_variables;
    let names: HashSet<&str> = needed.iter().map(|index| items[*index].name).collect();
    let mut copy = String::new();
    for item in items.iter().filter(|item| names.contains(item.name) && !is_given(item)) {
        let mut end = 0;
        for (start, word) in words(item.text).filter(|(_, word)| names.contains(word)) {
            copy += &item.text[end..start + word.len()];
            copy += suffix;
            end = start + word.len();
        }
        copy += &item.text[end..];
        copy.push('\n');
    }
    copy
}

/// Returns a text of this crate in which the names of all functions, types, constants and variables begin
/// with `prefix`: for engines that use names such as `light_sample` themselves.
///
/// With the prefix `gi_`, `light_sample` becomes `gi_light_sample`, and `LightSample` becomes
/// `gi_LightSample`; members of types stay as they are.
///
/// For a `LightShader`, put the text of its field `wgsl` through this function last: its methods make the text anew,
/// without the prefix. O(text).
///
/// # Errors
/// [`ShaderNameError`] unless the prefix consists of ASCII letters, digits and `_`, and begins neither with a digit nor
/// with two `_`. WGSL allows letters beyond ASCII; here they are refused.
pub fn with_prefix(text: &str, prefix: &str) -> Result<String, ShaderNameError> {
    let is_word = |c: char| c.is_ascii_alphanumeric() || c == '_';
    let starts_well = prefix.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_') && !prefix.starts_with("__");
    if !starts_well || !prefix.chars().all(is_word) {
        return Err(ShaderNameError { prefix: prefix.to_owned() });
    }
    let names: HashSet<&str> = text.lines().filter_map(declared_name).collect();
    let mut prefixed = String::with_capacity(text.len() + text.len() / 8);
    let mut end = 0;
    for (start, _) in words(text).filter(|(_, word)| names.contains(word)) {
        prefixed += &text[end..start];
        prefixed += prefix;
        end = start;
    }
    Ok(prefixed + &text[end..])
}

/// What can be reached from some items, these included.
fn reached(mut open: Vec<usize>, next: &[Vec<usize>]) -> HashSet<usize> {
    let mut reached: HashSet<usize> = open.iter().copied().collect();
    while let Some(index) = open.pop() {
        open.extend(next[index].iter().filter(|index| reached.insert(**index)));
    }
    reached
}

/// A function or variable of a text.
struct TextItem<'a> {
    name: &'a str,
    text: &'a str,
}

/// The functions and variables of a text.
fn items(text: &str) -> Vec<TextItem<'_>> {
    let mut items = Vec::new();
    let mut start = 0;
    let mut open: Option<(&str, usize)> = None;
    for line in text.split_inclusive('\n') {
        let end = start + line.len();
        let is_variable = open.is_none() && is_variable(line);
        if open.is_none() {
            open = name_of(line).map(|name| (name, start));
        }
        if let Some((name, first)) = open.filter(|_| is_variable || line.starts_with('}')) {
            items.push(TextItem { name, text: &text[first..end] });
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

/// The name of what a line begins to declare at module scope.
fn declared_name(line: &str) -> Option<&str> {
    let rest = ["struct ", "const "].into_iter().find_map(|word| line.strip_prefix(word));
    rest.map_or_else(|| name_of(line), |rest| words(rest).next().map(|(_, name)| name))
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
@group(1) @binding(1) var<storage, read> d: array<u32>;
var<private> b: u32;
const C: u32 = 3u;
struct S {
    a: u32,
}
// Calls g, not h.
fn f(s: S) -> u32 {
    return g(s.a) + C + b + pure(1u); // h
}

fn pure(i: u32) -> u32 {
    return i * C + d[i];
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
        let expected = "var<private> b_old: u32;

fn f_old(s: S) -> u32 {
    return g_old(s.a) + C + b_old + pure(1u); // h
}

fn g_old(
    i: u32,
) -> u32 {
    return a_old[i] + outside(i);
}

";
        assert_eq!(renamed(text, "f", "_old", &["a"]), expected);
    }
}
