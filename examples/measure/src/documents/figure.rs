//! What a figure is, and what a run is that it is drawn from.

use super::view::View;

/// A table or a picture of a document.
#[derive(Clone, Copy, Debug)]
pub struct Figure {
    /// Names the block of the page, or the file of rows.
    pub name: &'static str,
    /// The page with its block, from the root of the repository. Empty if it is a file of its own.
    pub page: &'static str,
    pub body: Body,
    /// Which rows there are follows from what is measured, as in a list of losses.
    pub has_varying_rows: bool,
}

/// What a block shows.
#[derive(Clone, Copy, Debug)]
pub enum Body {
    /// Tables with the same columns, one below the other.
    Table(&'static [View]),
    /// All rows of this raw file, as the program wrote them.
    Rows(&'static str),
    /// A picture that a program drew.
    Picture {
        /// The file, below the folder of raw files.
        from: &'static str,
        /// Where it goes, from the document.
        to: &'static str,
        /// What it shows, without figures: they would go stale.
        text: &'static str,
    },
}

/// A table.
pub const fn table(name: &'static str, page: &'static str, views: &'static [View]) -> Figure {
    Figure { name, page, body: Body::Table(views), has_varying_rows: false }
}

/// A table whose rows follow from what is measured.
pub const fn selection(name: &'static str, page: &'static str, views: &'static [View]) -> Figure {
    Figure { has_varying_rows: true, ..table(name, page, views) }
}

/// A CSV file of all rows that a program wrote.
pub const fn rows(name: &'static str, from: &'static str) -> Figure {
    Figure { name, page: "", body: Body::Rows(from), has_varying_rows: true }
}

/// A picture.
pub const fn picture(
    name: &'static str,
    page: &'static str,
    (from, to): (&'static str, &'static str),
    text: &'static str,
) -> Figure {
    Figure { name, page, body: Body::Picture { from, to, text }, has_varying_rows: false }
}

impl Figure {
    /// Whether it is a CSV file of its own, and no block of a page.
    pub fn is_file(&self) -> bool {
        self.page.is_empty()
    }

    /// The file that it is in, from the root of the repository.
    pub fn document(&self) -> String {
        if self.is_file() { format!("docs/data/{}.csv", self.name) } else { self.page.to_owned() }
    }

    /// The files that it is drawn from.
    pub fn files(&self) -> Vec<&'static str> {
        match self.body {
            Body::Table(views) => views.iter().flat_map(|view| view.from.iter().copied()).collect(),
            Body::Rows(from) | Body::Picture { from, .. } => vec![from],
        }
    }

    /// The names of the runs that write these files.
    pub fn runs(&self) -> Vec<&'static str> {
        let mut runs: Vec<&str> = self.files().iter().filter_map(|file| file.split('/').next()).collect();
        runs.sort_unstable();
        runs.dedup();
        runs
    }
}

/// A call of a program.
#[derive(Clone, Copy, Debug)]
pub struct Run {
    /// Names the folder of its raw files.
    pub name: &'static str,
    /// The file name of the program: this one, or `bench_NAME`.
    pub program: &'static str,
    /// Words that follow. Those of `--gltf` and `--out` are added.
    pub arguments: &'static str,
    /// The same for a small version; `None` if there is none.
    pub quick: Option<&'static str>,
    /// The small version has other rows, which are among those of the whole one.
    pub has_fewer_rows: bool,
    /// What follows `--out`, below the folder; `None` for programs without this option.
    pub out: Option<&'static str>,
    pub scene: Scene,
    /// It measures time, so nothing else runs meanwhile.
    pub is_timed: bool,
    /// About how long it takes on two cores.
    pub seconds: u32,
}

/// Whether a run takes a glTF file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scene {
    /// It takes none.
    Own,
    /// The small version runs without it, too.
    Added,
    Needed,
}

/// A run of a program that measures no time, to be completed.
pub const RUN: Run = Run {
    name: "",
    program: "measure",
    arguments: "",
    quick: None,
    has_fewer_rows: false,
    out: Some(""),
    scene: Scene::Own,
    is_timed: false,
    seconds: 60,
};

impl Run {
    /// The call as a reader repeats it.
    pub fn call(&self) -> String {
        let gltf = if self.scene == Scene::Own { "" } else { "--gltf FILE" };
        let words = [self.program, self.arguments, gltf];
        words.into_iter().filter(|word| !word.is_empty()).collect::<Vec<_>>().join(" ")
    }
}
