//! Blocks of documents between markers, which programs write.

use std::ops::Range;

/// The line that begins a block.
fn begin(name: &str) -> String {
    format!("<!-- figure: {name} -->\n")
}

/// The line that ends a block.
const END: &str = "<!-- end -->";

/// The names of all blocks of a document. An error is one line: a block that does not end, or that is there
/// twice.
pub fn names(text: &str) -> Result<Vec<String>, String> {
    let mut names: Vec<String> = Vec::new();
    for rest in text.split("<!-- figure: ").skip(1) {
        let name = rest.split(" -->").next().unwrap_or_default().to_owned();
        if !rest.contains(END) {
            return Err(format!("the block \"{name}\" does not end"));
        }
        if names.contains(&name) {
            return Err(format!("the block \"{name}\" is there twice"));
        }
        names.push(name);
    }
    Ok(names)
}

fn place(text: &str, name: &str) -> Option<Range<usize>> {
    let start = text.find(&begin(name))? + begin(name).len();
    Some(start..start + text[start..].find(END)?)
}

/// What a block holds; `None` without such a block.
pub fn block<'a>(text: &'a str, name: &str) -> Option<&'a str> {
    place(text, name).map(|place| &text[place])
}

/// The document with another content in a block; `None` without such a block.
pub fn replaced(text: &str, name: &str, content: &str) -> Option<String> {
    let place = place(text, name)?;
    Some(format!("{}{content}{}", &text[..place.start], &text[place.end..]))
}

/// A paragraph in lines of at most 100 columns.
pub fn wrapped(text: &str) -> String {
    let mut lines = vec![String::new()];
    for word in text.split(' ') {
        let line =
            lines.last_mut().filter(|line| line.is_empty() || line.chars().count() + 1 + word.chars().count() <= 100);
        match line {
            Some(line) if line.is_empty() => line.push_str(word),
            Some(line) => *line += &format!(" {word}"),
            None => lines.push(word.to_owned()),
        }
    }
    lines.join("\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    const PAGE: &str = "a\n<!-- figure: x -->\nold\n<!-- end -->\nb\n<!-- figure: y -->\n<!-- end -->\n";

    #[test]
    fn a_block_is_replaced_and_nothing_else() {
        assert_eq!(names(PAGE).expect("a sound page"), ["x", "y"]);
        assert_eq!(block(PAGE, "x"), Some("old\n"));
        let new = replaced(PAGE, "x", "new\n").expect("a block");
        assert_eq!(new, PAGE.replace("old", "new"));
        assert_eq!(replaced(PAGE, "z", ""), None);
    }

    #[test]
    fn markers_that_are_not_sound_are_refused() {
        assert!(names("<!-- figure: x -->\n").is_err_and(|error| error.contains("does not end")));
        assert!(names(&format!("{PAGE}{PAGE}")).is_err_and(|error| error.contains("twice")));
    }

    #[test]
    fn lines_have_at_most_a_hundred_columns() {
        let text = wrapped(&["word"; 60].join(" "));
        assert!(text.lines().all(|line| line.len() <= 100) && text.lines().count() == 3, "{text}");
    }
}
