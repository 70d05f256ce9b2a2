//! Vehicles and people with the lights that they carry. They face -Z and stand on y = 0, and the
//! middle of their length and width is above the origin.
//!
//! Read in this order:
//!
//! 1. `body`: the shapes, their sizes and paints;
//! 2. `panels` and `lamps`: what several shapes consist of;
//! 3. `cars`, `trucks`, `people`, `cycles`, `rails` and `crafts`: the shapes;
//! 4. `fleet`: the design of each appearance.

use super::palette;
use super::part;
use super::{SceneError, assembly};

pub mod body;

pub mod panels;
pub mod lamps;

pub mod cars;
pub mod trucks;
pub mod people;
pub mod cycles;
pub mod rails;
pub mod crafts;

pub mod fleet;
