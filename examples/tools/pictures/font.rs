//! A font for labels in pictures: glyphs of strokes, drawn with smooth edges at any size.
//!
//! A glyph is a list of strokes on a grid: descenders reach row 0, the baseline is row 2, small
//! letters reach row 6 and capitals row 8. A stroke is a letter for its kind and its points, each a
//! digit for the column and one for the row: `-` is a polyline, `~` a curve between both ends that
//! the other points attract, `o` a closed curve.

use girandole::glam::{Vec2, vec2};

/// The height of capitals, in units of the grid.
const CAPITAL: f32 = 6.0;
/// Space between glyphs, in the same units.
const GAP: f32 = 1.8;
/// The advance of a blank.
const BLANK: f32 = 2.6;
/// Half of the width of strokes, as a share of the height of capitals.
const HALF_STROKE: f32 = 0.065;

const GLYPHS: [(char, &str); 39] = [
    ('0', "o 02 42 48 08"),
    ('1', "- 06 28 22"),
    ('2', "~ 06 08 48 45 02,- 02 42"),
    ('3', "~ 07 08 48 45 15,~ 15 45 42 02 03"),
    ('4', "- 32 38 04 44"),
    ('5', "- 48 08 05,~ 05 16 46 42 12 03"),
    ('6', "~ 38 08 04,o 02 42 46 06"),
    ('7', "- 08 48 12"),
    ('8', "o 05 45 48 08,o 02 42 45 05"),
    ('9', "~ 46 42 12,o 04 44 48 08"),
    ('.', "- 02 02"),
    (',', "- 12 01"),
    ('-', "- 05 35"),
    ('\'', "- 18 06"),
    ('A', "- 02 28 42,- 14 34"),
    ('E', "- 48 08 02 42,- 05 35"),
    ('F', "- 48 08 02,- 05 35"),
    ('G', "~ 47 48 08 02 42 45,- 45 25"),
    ('M', "- 02 08 25 48 42"),
    ('P', "- 02 08 28,~ 28 48 44 24,- 24 04"),
    ('a', "o 02 42 46 06,- 46 42"),
    ('b', "- 08 02,o 02 42 46 06"),
    ('c', "~ 46 06 02 42"),
    ('d', "- 48 42,o 02 42 46 06"),
    ('e', "- 04 44,~ 44 46 06 02 42"),
    ('f', "~ 38 18 16,- 16 12,- 06 36"),
    ('i', "- 06 02,- 08 08"),
    ('l', "- 08 02"),
    ('m', "- 06 02,~ 04 06 36 34,- 34 32,~ 34 36 66 64,- 64 62"),
    ('n', "- 06 02,~ 04 06 46 44,- 44 42"),
    ('o', "o 02 42 46 06"),
    ('p', "- 06 00,o 02 42 46 06"),
    ('q', "- 46 40,o 02 42 46 06"),
    ('r', "- 06 02,~ 04 06 36"),
    ('s', "~ 45 46 06 04 44 42 02 03"),
    ('t', "- 18 13,~ 13 12 32,- 06 36"),
    ('u', "- 46 42,- 06 04,~ 04 02 42 44"),
    ('v', "- 06 22 46"),
    ('x', "- 06 42,- 02 46"),
];

/// A line of text as straight segments, in pixels; the origin is at the left end of the baseline,
/// and Y points down.
pub struct Text {
    segments: Vec<[Vec2; 2]>,
    half_stroke: f32,
    /// Its extent to the right.
    pub width: f32,
}

impl Text {
    /// Sets a line whose capitals are `height` pixels high. Characters that the font lacks are left
    /// blank.
    pub fn new(text: &str, height: f32) -> Self {
        let unit = height / CAPITAL;
        let (mut segments, mut x) = (Vec::new(), 0.0);
        for c in text.chars() {
            let Some(strokes) = glyph(c) else {
                x += BLANK;
                continue;
            };
            let right = strokes.iter().flatten().map(|point| point.x).fold(0.0, f32::max);
            let place = |point: &Vec2| vec2(x + point.x, 2.0 - point.y) * unit;
            segments.extend(
                strokes.iter().flat_map(|stroke| stroke.windows(2)).map(|ends| [place(&ends[0]), place(&ends[1])]),
            );
            x += right + GAP;
        }
        Self { segments, half_stroke: HALF_STROKE * height, width: (x - GAP).max(0.0) * unit }
    }

    /// The share of the pixel around a point that strokes cover.
    pub fn coverage(&self, at: Vec2) -> f32 {
        let distance = self.segments.iter().map(|ends| distance(*ends, at)).fold(f32::INFINITY, f32::min);
        (self.half_stroke + 0.5 - distance).clamp(0.0, 1.0)
    }
}

/// Whether the font has a character.
#[cfg(test)]
pub fn has(c: char) -> bool {
    c == ' ' || glyph(c).is_some()
}

/// The polylines of a glyph, on the grid.
fn glyph(c: char) -> Option<Vec<Vec<Vec2>>> {
    let (_, strokes) = GLYPHS.iter().find(|(own, _)| *own == c)?;
    Some(strokes.split(',').map(stroke).collect())
}

fn stroke(text: &str) -> Vec<Vec2> {
    let (kind, points) = text.split_once(' ').unwrap_or((text, ""));
    let number = |byte: u8| f32::from(byte - b'0');
    let mut points: Vec<Vec2> =
        points.split(' ').map(|p| vec2(number(p.as_bytes()[0]), number(p.as_bytes()[1]))).collect();
    if kind != "-" {
        let is_closed = kind == "o";
        for _ in 0..3 {
            points = cut_corners(&points, is_closed);
        }
        if is_closed {
            points.push(points[0]);
        }
    }
    points
}

/// One step of Chaikin's algorithm (1974), towards a quadratic B-spline.
fn cut_corners(points: &[Vec2], is_closed: bool) -> Vec<Vec2> {
    let count = points.len();
    let sides = if is_closed { count } else { count - 1 };
    let cuts = (0..sides).flat_map(|i| {
        let (a, b) = (points[i], points[(i + 1) % count]);
        [a.lerp(b, 0.25), a.lerp(b, 0.75)]
    });
    let mut cut: Vec<Vec2> = cuts.collect();
    if !is_closed {
        cut[0] = points[0];
        cut[2 * sides - 1] = points[count - 1];
    }
    cut
}

fn distance([a, b]: [Vec2; 2], at: Vec2) -> f32 {
    let along = b - a;
    let t = ((at - a).dot(along) / along.length_squared().max(f32::MIN_POSITIVE)).clamp(0.0, 1.0);
    at.distance(a + along * t)
}
