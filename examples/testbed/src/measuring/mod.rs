//! What measuring tools share: charts, errors of pictures, lights one by one, the exact noise of a sample, and
//! published samplers to compare with.
//!
//! Read the files in the order of the list below, in which data
//! passes through them.

pub mod charts;
pub mod log_log;

pub mod score;
pub mod shared_cuts;
pub mod crops;

pub mod emitter;
pub mod irradiance;
pub mod in_scattering;
pub mod reflection;
pub mod lights;
pub mod sigma;

pub mod reference;
pub mod baselines;
pub mod samplers;
pub mod street;
pub mod street_samplers;

pub mod torture;
