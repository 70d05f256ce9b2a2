//! The progress of long programs: a bar on a terminal, or else a line now and then. Both go to
//! stderr, so that stdout holds only results.

use indicatif::{ProgressBar, ProgressStyle};
use std::io::{IsTerminal, Write, stderr};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

/// The least time between two lines where stderr is not a terminal.
const LINE_INTERVAL: Duration = Duration::from_secs(5);

/// How far a program is, in steps.
pub struct Progress {
    /// Draws on a terminal only.
    bar: ProgressBar,
    /// Lines for a stderr that is no terminal.
    lines: Option<Mutex<Lines>>,
}

/// Shows progress with the time that is left.
pub fn progress(what: &str, steps: u64) -> Progress {
    let bar = ProgressBar::new(steps);
    let template = "{msg} [{bar:40}] {percent}% {elapsed}, {eta} left";
    bar.set_style(ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar()));
    bar.set_message(what.to_owned());
    bar.enable_steady_tick(Duration::from_millis(250));
    let lines = (!stderr().is_terminal()).then(|| Mutex::new(Lines::new(Instant::now())));
    Progress { bar, lines }
}

impl Progress {
    /// Replaces the text before the share.
    pub fn set_message(&self, message: String) {
        self.bar.set_message(message);
    }

    /// Sets the number of steps that are done.
    pub fn set_position(&self, steps: u64) {
        self.bar.set_position(steps);
        self.print_line();
    }

    /// Adds to the number of steps that are done.
    pub fn inc(&self, steps: u64) {
        self.bar.inc(steps);
        self.print_line();
    }

    /// Removes the bar.
    pub fn finish_and_clear(&self) {
        self.bar.finish_and_clear();
    }

    fn share(&self) -> f64 {
        self.bar.position() as f64 / self.bar.length().unwrap_or(0).max(1) as f64
    }

    fn print_line(&self) {
        let Some(lines) = &self.lines else { return };
        let mut lines = lines.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(line) = lines.next(Instant::now(), &self.bar.message(), self.share()) {
            // Progress that nobody can read is no reason to stop.
            let _ = writeln!(stderr(), "{line}");
        }
    }
}

/// When the next line is due, and what it says.
struct Lines {
    start: Instant,
    last: Instant,
}

impl Lines {
    fn new(start: Instant) -> Self {
        Self { start, last: start }
    }

    /// A line, if the last one is long enough ago.
    fn next(&mut self, now: Instant, message: &str, share: f64) -> Option<String> {
        if now.duration_since(self.last) < LINE_INTERVAL {
            return None;
        }
        self.last = now;
        let elapsed = now.duration_since(self.start).as_secs_f64();
        let left =
            if share > 0.0 { format!("{:.0} s", elapsed * (1.0 - share) / share) } else { "unknown time".into() };
        let message = if message.is_empty() { "progress" } else { message };
        Some(format!("{message}: {:.0} %, {elapsed:.0} s elapsed, {left} left", share * 100.0))
    }
}

#[cfg(test)]
mod tests {
    #[test]
    fn lines_come_at_most_every_five_seconds() {
        let start = super::Instant::now();
        let after = |seconds| start + super::Duration::from_secs(seconds);
        let mut lines = super::Lines::new(start);
        assert_eq!(lines.next(after(4), "frame 0", 0.1), None);
        let line = lines.next(after(5), "frame 0", 0.2).expect("five seconds have passed");
        assert_eq!(line, "frame 0: 20 %, 5 s elapsed, 20 s left");
        assert_eq!(lines.next(after(9), "frame 1", 0.5), None);
        let line = lines.next(after(30), "", 0.75).expect("many seconds have passed");
        assert_eq!(line, "progress: 75 %, 30 s elapsed, 10 s left");
    }
}
