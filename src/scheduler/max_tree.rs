//! A list of integers whose maximum is found quickly.

/// Integers per node.
const WIDTH: usize = 16;

/// Integers in a list, with the maxima of each [`WIDTH`] integers, the maxima of each [`WIDTH`]
/// maxima, and so on.
///
/// To set an integer or to find the greatest takes O(log n): 100,000 integers have five levels.
/// Most changes touch one or two of them.
#[derive(Debug, Default)]
pub(super) struct MaxTree {
    len: usize,
    /// The integers, then the levels of maxima; the last level has one. The levels are filled up
    /// with [`i32::MIN`] to whole nodes.
    levels: Vec<Vec<i32>>,
}

impl MaxTree {
    pub fn get(&self, index: usize) -> i32 {
        self.levels[0][index]
    }

    pub fn push(&mut self, value: i32) {
        let index = self.len;
        self.len += 1;
        // Every level but the last consists of whole nodes, so a level is added once the last one
        // has more than one node.
        let mut nodes = index + 1;
        for level in 0.. {
            if level == self.levels.len() {
                let values = self.levels.last().map_or(&[][..], Vec::as_slice);
                let maxima = values.chunks(WIDTH).map(max_of).collect();
                self.levels.push(maxima);
            }
            let len = nodes.next_multiple_of(WIDTH);
            if self.levels[level].len() < len {
                self.levels[level].resize(len, i32::MIN);
            }
            if nodes <= WIDTH {
                break;
            }
            nodes = nodes.div_ceil(WIDTH);
        }
        self.set(index, value);
    }

    pub fn set(&mut self, index: usize, value: i32) {
        let (mut index, mut value) = (index, value);
        for level in 0..self.levels.len() {
            let former = std::mem::replace(&mut self.levels[level][index], value);
            let Some(above) = self.levels.get(level + 1) else { return };
            let max = above[index / WIDTH];
            if value > max {
                // The maximum rises.
            } else if former == max && value < former {
                value = max_of(&self.levels[level][index / WIDTH * WIDTH..][..WIDTH]);
            } else {
                return;
            }
            index /= WIDTH;
        }
    }

    /// Adds to all integers.
    pub fn shift(&mut self, by: i32) {
        for level in &mut self.levels {
            level.iter_mut().filter(|value| **value > i32::MIN).for_each(|value| *value = value.saturating_add(by));
        }
    }

    /// Removes the integer at an index; the last one takes its index.
    pub fn swap_remove(&mut self, index: usize) {
        self.len -= 1;
        let last = self.get(self.len);
        self.set(self.len, i32::MIN);
        if index < self.len {
            self.set(index, last);
        }
    }

    /// The index of the greatest integer, the first of equal ones; `None` if there is none above
    /// [`i32::MIN`].
    pub fn max(&self) -> Option<usize> {
        let top = self.levels.last()?;
        let max = max_of(top);
        let mut node = 0;
        for level in self.levels.iter().rev() {
            let values = &level[node * WIDTH..][..WIDTH];
            node = node * WIDTH + values.iter().position(|value| *value == max)?;
        }
        (max > i32::MIN).then_some(node)
    }
}

fn max_of(values: &[i32]) -> i32 {
    values.iter().fold(i32::MIN, |max, value| max.max(*value))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_maximum_is_that_of_a_plain_list_after_random_operations() {
        let (mut tree, mut list) = (MaxTree::default(), Vec::<i32>::new());
        let mut state = 1_u32;
        let mut random_below = move |end: usize| {
            state = state.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
            (state >> 8) as usize % end
        };
        let mut longest = 0;
        for step in 0..20_000 {
            let is_growing = step / 2000 % 2 == 0;
            match random_below(8) {
                0 | 1 if !list.is_empty() => {
                    let index = random_below(list.len());
                    list[index] = random_below(50) as i32 - 25;
                    tree.set(index, list[index]);
                }
                2 if step % 50 == 0 => {
                    tree.shift(7);
                    list.iter_mut().for_each(|value| *value += 7);
                }
                3..6 if !list.is_empty() && !is_growing => {
                    let index = random_below(list.len());
                    tree.swap_remove(index);
                    list.swap_remove(index);
                }
                _ => {
                    let value = random_below(1000) as i32 - 500;
                    tree.push(value);
                    list.push(value);
                }
            }
            longest = longest.max(list.len());
            assert!(list.iter().enumerate().all(|(index, value)| tree.get(index) == *value));
            let max = list.iter().max();
            assert_eq!(tree.max(), max.and_then(|max| list.iter().position(|value| value == max)));
        }
        assert!(longest > 2 * WIDTH * WIDTH, "{longest}");
    }
}
