//! Reads child modules, imports and paths from the text of a Rust file.
//!
//! A tokeniser and a few patterns are enough for this crate. Unlike a parser they also find the
//! paths in the arguments of macros. Comments, strings and items under `#[cfg(test)]` are left out.

/// A path, one name a segment.
pub type Path = Vec<String>;

/// One name that a `use` declaration brings into scope.
#[derive(Debug, PartialEq)]
pub struct Import {
    pub path: Path,
    /// The name in this file; `*` for all names of a module.
    pub name: String,
    /// `pub use`, of any visibility.
    pub is_reexport: bool,
}

/// What the text of a file says about its dependencies. Paths are as seen from the file's module.
#[derive(Debug, Default, PartialEq)]
pub struct Source {
    /// The names of `mod name;`.
    pub children: Vec<String>,
    pub imports: Vec<Import>,
    /// Paths outside of `use` declarations, single names included.
    pub paths: Vec<Path>,
}

impl Source {
    pub fn read(text: &str) -> Self {
        let tokens = without_tests(text);
        let mut source = Self::default();
        // For each open brace, whether it opened an inline module.
        let mut braces = Vec::new();
        let mut at = 0;
        while at < tokens.len() {
            let inline_modules = braces.iter().filter(|is_module| **is_module).count();
            let before = at.checked_sub(1).map_or(";", |before| tokens[before].as_str());
            match (tokens[at].as_str(), tokens.get(at + 2).map(String::as_str)) {
                ("mod", Some(";")) => {
                    source.children.push(tokens[at + 1].clone());
                    at += 2;
                }
                ("mod", Some("{")) => {
                    braces.push(true);
                    at += 2;
                }
                ("use", _) => {
                    let is_reexport = matches!(before, "pub" | ")");
                    let (tree, rest) = use_tree(&tokens[at + 1..], &Path::new());
                    let import = |(path, name)| Import { path: outside(path, inline_modules), name, is_reexport };
                    source.imports.extend(tree.into_iter().map(import));
                    at = tokens.len() - rest.len();
                }
                ("{", _) => braces.push(false),
                ("}", _) => {
                    braces.pop();
                }
                (first, _) if is_name(first) && before != "." => {
                    let mut path = vec![first.to_owned()];
                    while let [colons, name, ..] = &tokens[at + 1..]
                        && colons == "::"
                        && is_name(name)
                    {
                        path.push(name.clone());
                        at += 2;
                    }
                    source.paths.push(outside(path, inline_modules));
                }
                _ => {}
            }
            at += 1;
        }
        source
    }
}

/// A path in an inline module as seen from the file: each inline module takes one `super` away.
fn outside(mut path: Path, inline_modules: usize) -> Path {
    let supers = path.iter().take_while(|name| *name == "super").count().min(inline_modules);
    if supers > 0 {
        path.splice(..supers, ["self".to_owned()]);
    }
    path
}

fn is_name(token: &str) -> bool {
    token.starts_with(|c: char| c.is_alphabetic() || c == '_')
}

/// The paths of a use tree, each with the name that it brings into scope, and the tokens after it.
fn use_tree<'a>(mut tokens: &'a [String], parent: &Path) -> (Vec<(Path, String)>, &'a [String]) {
    let mut path = parent.clone();
    loop {
        match tokens[0].as_str() {
            "{" => {
                let mut all = Vec::new();
                while tokens[0] != "}" {
                    let (tree, rest) = use_tree(&tokens[1..], &path);
                    all.extend(tree);
                    tokens = rest;
                    if tokens[0] == "," && tokens[1] == "}" {
                        tokens = &tokens[1..];
                    }
                }
                return (all, &tokens[1..]);
            }
            "*" => return (vec![(path, "*".to_owned())], &tokens[1..]),
            "::" => {}
            "as" => return (vec![(path, tokens[1].clone())], &tokens[2..]),
            "self" if !path.is_empty() => {}
            name if is_name(name) => path.push(name.to_owned()),
            _ => {
                let name = path.last().cloned().unwrap_or_default();
                return (vec![(path, name)], tokens);
            }
        }
        tokens = &tokens[1..];
    }
}

/// The tokens of a text outside of items under `#[cfg(test)]`.
pub fn without_tests(text: &str) -> Vec<String> {
    let tokens = tokens(text);
    let mut tokens = &tokens[..];
    let mut kept = Vec::with_capacity(tokens.len());
    while let Some(first) = tokens.first() {
        if is_test_attribute(tokens) {
            tokens = &tokens[item_length(tokens)..];
        } else {
            kept.push(first.clone());
            tokens = &tokens[1..];
        }
    }
    kept
}

/// `#[cfg(test)]` and `#[cfg(all(test, ...))]`.
fn is_test_attribute(tokens: &[String]) -> bool {
    let starts: [&[&str]; 2] = [&["#", "[", "cfg", "(", "test", ")"], &["#", "[", "cfg", "(", "all", "(", "test", ","]];
    starts.iter().any(|start| tokens.len() >= start.len() && tokens.iter().zip(*start).all(|(a, b)| a == b))
}

/// The tokens of an item and its attributes, up to its semicolon, its last brace or, for a field,
/// its comma.
fn item_length(tokens: &[String]) -> usize {
    let mut at = 0;
    while tokens[at] == "#" {
        at += 1 + group_length(&tokens[at + 1..]);
    }
    let is_field = tokens[at..].iter().skip(1).take(2).any(|token| token == ":");
    while at < tokens.len() {
        match tokens[at].as_str() {
            ";" => return at + 1,
            "," if is_field => return at + 1,
            "{" => return at + group_length(&tokens[at..]),
            "(" | "[" => at += group_length(&tokens[at..]),
            // The end of the block that the item is in.
            "}" => return at,
            _ => at += 1,
        }
    }
    at
}

/// The tokens from an opening bracket to the one that closes it.
fn group_length(tokens: &[String]) -> usize {
    let mut depth = 0;
    for (at, token) in tokens.iter().enumerate() {
        match token.as_str() {
            "(" | "[" | "{" => depth += 1,
            ")" | "]" | "}" => depth -= 1,
            _ => {}
        }
        if depth == 0 {
            return at + 1;
        }
    }
    tokens.len()
}

/// Words, `::`, and all other punctuation by the character. A string is the token `"`, a character
/// or a lifetime the token `'`.
fn tokens(text: &str) -> Vec<String> {
    let is_word = |c: char| c.is_alphanumeric() || c == '_';
    let word_length = |text: &str| text.find(|c| !is_word(c)).unwrap_or(text.len());
    let mut tokens = Vec::new();
    let mut rest = text;
    while let Some(first) = rest.chars().next() {
        let (length, token) = if rest.starts_with("//") {
            (rest.find('\n').unwrap_or(rest.len()), None)
        } else if rest.starts_with("/*") {
            (rest.find("*/").map_or(rest.len(), |end| end + 2), None)
        } else if let Some(length) = raw_string_length(rest) {
            (length, Some("\""))
        } else if first == '"' {
            (literal_length(rest, '"'), Some("\""))
        } else if first == '\'' {
            let is_character = rest[1..].starts_with('\\') || rest.chars().nth(2) == Some('\'');
            let length = if is_character { literal_length(rest, '\'') } else { 1 + word_length(&rest[1..]) };
            (length, Some("'"))
        } else {
            let length = if rest.starts_with("::") { 2 } else { word_length(rest).max(first.len_utf8()) };
            (length, Some(&rest[..length]).filter(|token| !token.trim().is_empty()))
        };
        tokens.extend(token.map(str::to_owned));
        rest = &rest[length..];
    }
    tokens
}

/// The length of a literal with escapes, both quotes included.
fn literal_length(text: &str, quote: char) -> usize {
    let mut is_escaped = false;
    for (at, c) in text.char_indices().skip(1) {
        if c == quote && !is_escaped {
            return at + 1;
        }
        is_escaped = c == '\\' && !is_escaped;
    }
    text.len()
}

/// The length of a raw string, if the text starts with one.
fn raw_string_length(text: &str) -> Option<usize> {
    let rest = text.strip_prefix("br").or_else(|| text.strip_prefix('r'))?;
    let body = rest.trim_start_matches('#');
    let end = format!("\"{}", "#".repeat(rest.len() - body.len()));
    let length = body.strip_prefix('"')?.find(&end)?;
    Some(text.len() - body.len() + 1 + length + end.len())
}
