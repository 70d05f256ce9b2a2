//! The library of the program. Read the files in this order, in which data passes through them.

pub mod figure;
pub mod list;
pub mod options;

pub mod measure;
pub mod sheet;
pub mod number;
pub mod view;
pub mod draw;
pub mod document;
