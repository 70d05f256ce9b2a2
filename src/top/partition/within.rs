//! Counts the lights within a box.

use super::{Bounds, Content, PartId, Partition, ROOT};
use crate::tree::WIDTH;

/// The most nodes whose children are looked at. Of further nodes, the share of their boxes within the box decides.
const LOOKED_INTO: usize = 64;

impl Partition {
    /// About how many lights of other slots lie within the box of a slot. For a part whose node is not wholly inside,
    /// `count` is given the number of its lights and returns how many of them to count. O(1).
    pub fn lights_within(&self, slot: u32, bounds: &Bounds, count: impl Fn(PartId, f64) -> f64) -> f64 {
        let (mut nodes, mut end, mut lights) = ([ROOT; 1 + WIDTH * LOOKED_INTO], 1, 0.0);
        let (mut next, mut looked_into) = (0, 0);
        // Nodes come after those above them, so that what is left out at the end are small ones.
        while next < end {
            let node = &self.nodes[nodes[next] as usize];
            next += 1;
            if node.count == 0 || bounds.is_apart_from(&node.reach) {
                continue;
            }
            match &node.content {
                _ if bounds.contains(&node.reach) => lights += node.lights as f64,
                Content::Divided(divided) if looked_into < LOOKED_INTO => {
                    looked_into += 1;
                    for child in divided.children() {
                        nodes[end] = *child;
                        end += 1;
                    }
                }
                Content::Cell(parts) => {
                    lights += parts.iter().fold(0.0, |sum, part| {
                        let lights = self.filed[part.slot as usize][part.index as usize].lights.into();
                        sum + if part.slot == slot { lights } else { count(*part, lights) }
                    });
                }
                _ => lights += node.lights as f64 * bounds.share_of(&node.reach),
            }
        }
        let own = self.lights.get(slot as usize).copied().unwrap_or(0);
        (lights - own as f64).max(0.0)
    }
}
