//! Strips along lines in the plane of the ground.

use girandole::glam::{Vec2, vec3};

use super::part::Part;

/// A corner of a strip is at most this many times as wide as the strip.
const MOST_MITRE: f32 = 3.0;

/// For each point of a line, the vector to the parallel line one metre to its left. At a corner it is
/// longer than a metre, by a factor of at most [`MOST_MITRE`].
fn sides(line: &[Vec2]) -> Vec<Vec2> {
    // North is -z, so the left of (x, z) is (z, -x).
    let left = |from: Vec2, to: Vec2| {
        let along = (to - from).normalize_or_zero();
        Vec2::new(along.y, -along.x)
    };
    (0..line.len())
        .map(|i| {
            let before = if i > 0 { left(line[i - 1], line[i]) } else { left(line[0], line[1]) };
            let after = if i + 1 < line.len() { left(line[i], line[i + 1]) } else { before };
            let middle = (before + after).normalize_or(before);
            middle / middle.dot(before).max(1.0 / MOST_MITRE)
        })
        .collect()
}

/// The parallel line at a distance to the left.
pub fn parallel(line: &[Vec2], left: f32) -> Vec<Vec2> {
    line.iter().zip(sides(line)).map(|(at, side)| *at + side * left).collect()
}

/// A strip along a line of at least two points, between two distances to its left.
pub fn strip(part: &mut Part, line: &[Vec2], [right, left]: [f32; 2], height: f32, material: u32) {
    let sides = sides(line);
    for i in 1..line.len() {
        let at = |i: usize, side: f32| {
            let at = line[i] + sides[i] * side;
            vec3(at.x, height, at.y)
        };
        part.quad([at(i - 1, right), at(i, right), at(i, left), at(i - 1, left)], material);
    }
}

/// The piece of a line between two distances from its start; empty if the line is shorter.
pub fn piece(line: &[Vec2], [from, to]: [f32; 2]) -> Vec<Vec2> {
    let (mut piece, mut walked) = (Vec::new(), 0.0);
    for ends in line.windows(2) {
        let length = ends[0].distance(ends[1]);
        let at = |distance: f32| ends[0].lerp(ends[1], (distance - walked) / length);
        if piece.is_empty() && from < walked + length {
            piece.push(at(from));
        }
        if !piece.is_empty() {
            if to <= walked + length {
                piece.push(at(to));
                return piece;
            }
            piece.push(ends[1]);
        }
        walked += length;
    }
    Vec::new()
}

/// The length of a line, metres.
pub fn length(line: &[Vec2]) -> f32 {
    line.windows(2).map(|ends| ends[0].distance(ends[1])).sum()
}

#[cfg(test)]
mod tests {
    use girandole::glam::vec2;

    use super::*;

    #[test]
    fn pieces_keep_the_corners_between_their_ends() {
        let line = [vec2(0.0, 0.0), vec2(4.0, 0.0), vec2(4.0, 3.0)];
        assert_eq!(length(&line), 7.0);
        assert_eq!(piece(&line, [1.0, 3.0]), [vec2(1.0, 0.0), vec2(3.0, 0.0)]);
        assert_eq!(piece(&line, [3.0, 5.0]), [vec2(3.0, 0.0), vec2(4.0, 0.0), vec2(4.0, 1.0)]);
        assert_eq!(piece(&line, [6.0, 8.0]), []);
    }

    #[test]
    fn the_left_of_a_line_to_the_east_is_north() {
        let line = [vec2(0.0, 0.0), vec2(10.0, 0.0)];
        assert_eq!(parallel(&line, 2.0), [vec2(0.0, -2.0), vec2(10.0, -2.0)]);
    }
}
