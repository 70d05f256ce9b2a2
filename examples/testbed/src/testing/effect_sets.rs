//! A choice of sets of effects that stands for all of them.
//!
//! The library's own tests use it too, so it knows effects by their numbers alone.

/// The effects whose subsets are all chosen.
const FREE: u32 = 0xff;

/// The later effects: each follows from the free effects of its mask, by parity. The masks are such
/// that any four effects occur together in every way: all sums of masks, with the later effects
/// that they are for, have at least five bits.
const LATER: [(u32, u32); 4] =
    [(1 << 8, 0b1011_1111), (1 << 9, 0b0000_1111), (1 << 10, 0b0011_0011), (1 << 11, 0b1001_0101)];

/// The last effect. Five masks with as many bits do not exist, so the free effects decide by a hash:
/// multiplied by this, the set has bit 15 or not.
const LAST: (u32, u32) = (1 << 12, 0x9e37);

/// All subsets of the first eight effects, each with one choice of the later ones, and the set of
/// all effects, as the numbers of their effects. There are `count` effects, and the one with the number
/// `unused` is never chosen.
pub fn effect_sets(count: usize, unused: usize) -> Vec<Vec<usize>> {
    let numbers = |set: u32| (0..count).filter(|number| set >> number & 1 != 0).collect();
    sets((1 << count) - 1, 1 << unused).into_iter().map(numbers).collect()
}

/// The same as bits.
fn sets(all: u32, unused: u32) -> Vec<u32> {
    let free = (0..=FREE).filter(|set| set & unused == 0);
    let with_later = free.map(|set| {
        let is_on = |mask: u32| (set & mask).count_ones() % 2 == 1;
        let last = if (set * LAST.1) >> 15 & 1 == 1 { LAST.0 } else { 0 };
        LATER.iter().filter(|(_, mask)| is_on(*mask)).fold(set | last, |set, (effect, _)| set | effect) & all
    });
    with_later.chain([all & !unused]).collect()
}

#[test]
fn any_four_effects_occur_in_every_combination() {
    let (all, unused) = (FREE | LATER.iter().fold(LAST.0, |all, (effect, _)| all | effect), 1 << 6);
    let sets = sets(all, unused);
    let used: Vec<u32> = (0..16).map(|bit| 1 << bit).filter(|effect| all & !unused & effect != 0).collect();
    for four in 0..used.len().pow(4) {
        let pick = |i: u32| used[four / used.len().pow(i) % used.len()];
        let mask = pick(0) | pick(1) | pick(2) | pick(3);
        let mut seen: Vec<u32> = sets.iter().map(|set| set & mask).collect();
        seen.sort_unstable();
        seen.dedup();
        assert_eq!(seen.len(), 1 << mask.count_ones(), "{mask:#b}");
    }
}
