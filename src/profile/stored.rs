//! Profiles as a GPU stores them. Twin of `shaders/profile.wgsl`.
//!
//! A table is a quad with the numbers of angles from the pole and around it, and then words in quads: both lists of
//! angles and the intensities. Tables lie one before the other, from the place on where the map of the sky begins:
//! so a table keeps its place, counted from there, when others come, and the sky keeps it too.

use super::interned::{Table, last_end, tables_after};

/// The number of quads of the tables of all profiles that there are.
pub(crate) fn stored_quads() -> u32 {
    last_end()
}

/// Calls a function with tables that end beyond a number of quads, and with their ends. No end is above `most`.
pub(crate) fn for_each_table(after: u32, most: u32, mut write: impl FnMut(u32, &[u32])) {
    for table in tables_after(after).into_iter().take_while(|table| table.end <= most) {
        write(table.end, &words(table));
    }
}

fn words(Table { grid, .. }: &Table) -> Vec<u32> {
    let mut words = vec![grid.polar.len() as u32, grid.around.len() as u32, 0, 0];
    let numbers = grid.polar.iter().chain(&grid.around).chain(&grid.candela);
    words.extend(numbers.map(|number| number.to_bits()));
    words.resize(4 * grid.stored_quads() as usize, 0);
    words
}
