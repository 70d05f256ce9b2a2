//! Neon signs: words in a font of 5 by 7 dots, each stroke one emissive bar, on blades and on
//! boards.

use girandole::glam::{Vec3, vec3};

use super::palette::{Glow, NEON, Palette};
use super::part::Part;
use super::rng::Rng;

const COLUMNS: usize = 5;
const ROWS: usize = 7;

fn glyph(letter: char) -> [&'static str; ROWS] {
    match letter {
        'A' => [" ### ", "#   #", "#   #", "#####", "#   #", "#   #", "#   #"],
        'B' => ["#### ", "#   #", "#   #", "#### ", "#   #", "#   #", "#### "],
        'C' => [" ####", "#    ", "#    ", "#    ", "#    ", "#    ", " ####"],
        'D' => ["#### ", "#   #", "#   #", "#   #", "#   #", "#   #", "#### "],
        'E' => ["#####", "#    ", "#    ", "#### ", "#    ", "#    ", "#####"],
        'F' => ["#####", "#    ", "#    ", "#### ", "#    ", "#    ", "#    "],
        'H' => ["#   #", "#   #", "#   #", "#####", "#   #", "#   #", "#   #"],
        'I' => [" ### ", "  #  ", "  #  ", "  #  ", "  #  ", "  #  ", " ### "],
        'J' => ["    #", "    #", "    #", "    #", "    #", "#   #", " ### "],
        'K' => ["#   #", "#  # ", "# #  ", "##   ", "# #  ", "#  # ", "#   #"],
        'L' => ["#    ", "#    ", "#    ", "#    ", "#    ", "#    ", "#####"],
        'M' => ["#   #", "## ##", "# # #", "# # #", "#   #", "#   #", "#   #"],
        'N' => ["#   #", "##  #", "##  #", "# # #", "#  ##", "#  ##", "#   #"],
        'O' => [" ### ", "#   #", "#   #", "#   #", "#   #", "#   #", " ### "],
        'P' => ["#### ", "#   #", "#   #", "#### ", "#    ", "#    ", "#    "],
        'R' => ["#### ", "#   #", "#   #", "#### ", "#  # ", "#   #", "#   #"],
        'S' => [" ####", "#    ", "#    ", " ### ", "    #", "    #", "#### "],
        'T' => ["#####", "  #  ", "  #  ", "  #  ", "  #  ", "  #  ", "  #  "],
        'U' => ["#   #", "#   #", "#   #", "#   #", "#   #", "#   #", " ### "],
        'Z' => ["#####", "    #", "   # ", "  #  ", " #   ", "#    ", "#####"],
        '2' => [" ### ", "#   #", "    #", "  ## ", " #   ", "#    ", "#####"],
        '4' => ["#   #", "#   #", "#   #", "#####", "    #", "    #", "    #"],
        _ => ["     ", "     ", "     ", "     ", "     ", "     ", "     "],
    }
}

/// A bar of a letter, in dots: x and y of its lower left dot, then its width and height.
type Bar = [usize; 4];

/// Covers a letter with few bars. Each is the longest horizontal or vertical run of dots that are
/// not covered yet.
fn bars(letter: char) -> Vec<Bar> {
    let rows = glyph(letter);
    let mut open = [[false; COLUMNS]; ROWS];
    for (row, text) in rows.iter().enumerate() {
        for (column, dot) in text.bytes().enumerate() {
            open[ROWS - 1 - row][column] = dot == b'#';
        }
    }
    let run = |open: &[[bool; COLUMNS]; ROWS], x: usize, y: usize, down: bool| {
        let (limit, step) = if down { (ROWS - y, (0, 1)) } else { (COLUMNS - x, (1, 0)) };
        (0..limit).take_while(|i| open[y + step.1 * i][x + step.0 * i]).count()
    };
    let mut bars = Vec::new();
    loop {
        let mut best: (usize, Bar) = (0, [0; 4]);
        for (y, x, down) in (0..ROWS).flat_map(|y| (0..COLUMNS).flat_map(move |x| [(y, x, false), (y, x, true)])) {
            let length = run(&open, x, y, down);
            if length > best.0 {
                best = (length, if down { [x, y, 1, length] } else { [x, y, length, 1] });
            }
        }
        let [x, y, width, height] = best.1;
        if best.0 == 0 {
            return bars;
        }
        open.iter_mut().skip(y).take(height).for_each(|row| row[x..x + width].fill(false));
        bars.push(best.1);
    }
}

/// A letter with its lower left corner at `origin`; `dot` is the distance between dots in metres.
fn letter(part: &mut Part, letter: char, origin: Vec3, right: Vec3, dot: f32, glow: Glow) {
    // Bars are thinner than the distance between dots, so that they look like tubes.
    let inset = dot * 0.14;
    for [x, y, width, height] in bars(letter) {
        let half = [width as f32 * dot * 0.5 - inset, height as f32 * dot * 0.5 - inset];
        let center = origin
            + right * ((x as f32 + width as f32 * 0.5) * dot)
            + Vec3::Y * ((y as f32 + height as f32 * 0.5) * dot);
        part.glow(center, right * half[0], Vec3::Y * half[1], glow);
    }
}

/// The words on blades and boards.
pub const WORDS: [&str; 14] = [
    "HOTEL", "BAR", "CAFE", "PIZZA", "24H", "CINEMA", "JAZZ", "SUSHI", "DINER", "CLUB", "RAMEN", "BOOKS", "MOTEL",
    "FOOD",
];

/// A vertical blade with a word on both faces, which face +Z and -Z. It reaches from x = 0.25 m to
/// about 1.3 m, and its lower edge is at y = 0. Place it with +X pointing away from the wall.
pub fn blade(word: &str, palette: &mut Palette, rng: &mut Rng) -> Part {
    let mut part = Part::default();
    let color = rng.below(NEON.len());
    let glow = palette.glow(NEON[color], rng.pick(&[80.0, 110.0, 150.0]));
    let rim = palette.glow(NEON[(color + 1 + rng.below(NEON.len() - 1)) % NEON.len()], 60.0);
    let board = palette.glossy([0.03, 0.03, 0.035], 0.35);
    let dot = 0.14;
    let (pitch, width) = (dot * (ROWS as f32 + 1.3), dot * (COLUMNS as f32 + 2.0));
    let height = pitch * word.len() as f32 + dot * 2.0;
    part.cuboid(vec3(0.25, 0.0, -0.11), vec3(0.25 + width, height, 0.11), board);
    for y in [0.4, height - 0.4] {
        part.beam(vec3(-0.1, y, 0.0), vec3(0.25, y, 0.0), 0.04, board);
    }
    for (face, right) in [(0.13, Vec3::X), (-0.13, Vec3::NEG_X)] {
        for (index, symbol) in word.chars().enumerate() {
            let y = height - dot * 1.2 - pitch * (index as f32 + 1.0) + dot * 1.2;
            let x = 0.25 + width * 0.5;
            let origin = vec3(x, y, face) - right * (dot * COLUMNS as f32 * 0.5);
            letter(&mut part, symbol, origin, right, dot, glow);
        }
        for x in [0.25 + dot * 0.3, 0.25 + width - dot * 0.3] {
            part.glow(vec3(x, height * 0.5, face), right * 0.03, Vec3::Y * (height * 0.5 - 0.1), rim);
        }
    }
    part
}

/// A board along a wall that faces +Z, with its lower edge at y = 0 and its middle at x = 0.
pub fn board(word: &str, palette: &mut Palette, rng: &mut Rng) -> Part {
    let mut part = Part::default();
    let glow = palette.glow(rng.pick(&NEON), rng.pick(&[80.0, 110.0, 150.0]));
    let back = palette.glossy([0.03, 0.03, 0.035], 0.35);
    let dot = 0.17;
    let pitch = dot * (COLUMNS as f32 + 1.3);
    let width = pitch * word.len() as f32 + dot;
    part.cuboid(vec3(-width * 0.5, 0.0, 0.05), vec3(width * 0.5, dot * (ROWS as f32 + 2.0), 0.25), back);
    for (index, symbol) in word.chars().enumerate() {
        let x = -width * 0.5 + dot * 1.15 + pitch * index as f32;
        letter(&mut part, symbol, vec3(x, dot, 0.28), Vec3::X, dot, glow);
    }
    part
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bars_cover_each_dot_of_each_letter_once() {
        for symbol in WORDS.iter().flat_map(|word| word.chars()) {
            let dots: usize = glyph(symbol).iter().map(|row| row.matches('#').count()).sum();
            let covered: usize = bars(symbol).iter().map(|bar| bar[2] * bar[3]).sum();
            assert!(dots > 0, "{symbol} has no glyph");
            assert_eq!(dots, covered, "{symbol}");
        }
    }
}
