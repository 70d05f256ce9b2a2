//! What the program measures, one file for each form of its command line.

pub mod effort;
pub mod stages;
pub mod shading_points;
pub mod measure;
pub mod report;
pub mod timing;
pub mod deform;
pub mod candidates;
pub mod gloss;
pub mod segments;
pub mod torture;
pub mod shadow_oracle;
pub mod learning;
pub mod sky;
pub mod signs;
pub mod window;
pub mod kept;
