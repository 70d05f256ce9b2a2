//! The progress bar of long programs.

use indicatif::{ProgressBar, ProgressStyle};
use std::time::Duration;

/// A progress bar with the time that is left. It draws on a terminal only.
pub fn progress(what: &str, steps: u64) -> ProgressBar {
    let bar = ProgressBar::new(steps);
    let template = "{msg} [{bar:40}] {percent}% {elapsed}, {eta} left";
    bar.set_style(ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar()));
    bar.set_message(what.to_owned());
    bar.enable_steady_tick(Duration::from_millis(250));
    bar
}
