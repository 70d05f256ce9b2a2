//! The list of what a folder of baked trees holds, as text: one tree, instance or directional light
//! in each line.
//!
//! Floats are written with as many digits as they need to come back with the same bits.

use girandole::glam::{DVec3, Mat3, Vec3};
use girandole::{DirectionalLight, Placement};
use std::fmt::Write;
use std::str::{FromStr, SplitAsciiWhitespace};

/// The first line.
const TITLE: &str = "girandole scene 1";

/// The name of the file in its folder.
pub const FILE: &str = "scene.txt";

/// What a folder holds.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Manifest {
    /// The names of the files of trees.
    pub trees: Vec<String>,
    /// Indices of trees, and where their instances are.
    pub instances: Vec<(usize, Placement)>,
    pub directionals: Vec<DirectionalLight>,
}

impl Manifest {
    pub fn to_text(&self) -> String {
        let mut text = format!("{TITLE}\n");
        let mut line = |words: String| writeln!(text, "{words}").expect("text can be written to");
        self.trees.iter().for_each(|name| line(format!("tree {name}")));
        for (tree, Placement { linear, translation }) in &self.instances {
            let numbers = linear.to_cols_array().map(|v| format!(" {v:?}")).concat();
            let DVec3 { x, y, z } = translation;
            line(format!("instance {tree}{numbers} {x:?} {y:?} {z:?}"));
        }
        for DirectionalLight { direction, illuminance } in &self.directionals {
            let numbers = [direction, illuminance].map(|v| v.to_array().map(|v| format!(" {v:?}")).concat());
            line(format!("directional{}", numbers.concat()));
        }
        text
    }

    /// Reads what [`Manifest::to_text`] has written. An error names the line.
    pub fn from_text(text: &str) -> Result<Self, String> {
        let mut manifest = Self::default();
        let mut lines = (1..).zip(text.lines());
        if lines.next().is_none_or(|(_, title)| title != TITLE) {
            return Err(format!("line 1: expected {TITLE}"));
        }
        for (number, line) in lines {
            manifest.read_line(line).ok_or_else(|| format!("line {number}: cannot read {line:?}"))?;
        }
        Ok(manifest)
    }

    fn read_line(&mut self, line: &str) -> Option<()> {
        let mut words = line.split_ascii_whitespace();
        match words.next()? {
            "tree" => self.trees.push(words.next()?.to_owned()),
            "instance" => {
                let tree: usize = words.next()?.parse().ok().filter(|tree| *tree < self.trees.len())?;
                let linear = Mat3::from_cols_array(&numbers(&mut words)?);
                let translation = DVec3::from_array(numbers(&mut words)?);
                self.instances.push((tree, Placement { linear, translation }));
            }
            "directional" => {
                let [direction, illuminance] = [numbers(&mut words)?, numbers(&mut words)?].map(Vec3::from_array);
                self.directionals.push(DirectionalLight { direction, illuminance });
            }
            _ => return None,
        }
        words.next().is_none().then_some(())
    }
}

fn numbers<T: FromStr + Default + Copy, const N: usize>(words: &mut SplitAsciiWhitespace<'_>) -> Option<[T; N]> {
    let mut numbers = [T::default(); N];
    for number in &mut numbers {
        *number = words.next()?.parse().ok()?;
    }
    Some(numbers)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_list_comes_back_with_the_same_bits() {
        let linear = Mat3::from_cols_array(&[0.1, -0.0, 1.0e-30, 3.0, 1.0 / 3.0, f32::MIN_POSITIVE, 7.0e8, -2.5, 1.0]);
        let manifest = Manifest {
            trees: vec!["0000.tree".into(), "0001.tree".into()],
            instances: vec![(1, Placement { linear, translation: DVec3::new(0.1, -1.0e9 / 3.0, 1.0e-300) })],
            directionals: vec![DirectionalLight { direction: Vec3::NEG_Y, illuminance: Vec3::splat(0.3) }],
        };
        let text = manifest.to_text();
        let back = Manifest::from_text(&text).expect("a list that was just written");
        assert_eq!((&back, back.to_text()), (&manifest, text));
    }

    #[test]
    fn a_wrong_line_is_named() {
        let error = |text: &str| Manifest::from_text(text).expect_err("a wrong list");
        assert_eq!(error(""), "line 1: expected girandole scene 1");
        let with = |line: &str| error(&format!("girandole scene 1\ntree a\n{line}\n"));
        for line in
            ["sphere", "tree", "tree a b", "instance 1 1 0 0 0 1 0 0 0 1 0 0 0", "instance 0 1", "directional x"]
        {
            assert_eq!(with(line), format!("line 3: cannot read {line:?}"));
        }
    }
}
