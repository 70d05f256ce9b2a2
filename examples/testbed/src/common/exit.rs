//! The options of a program and its exit code.

use clap::Parser;
use std::fmt::Display;
use std::io::{ErrorKind, Write};
use std::process::ExitCode;

/// Turns the result of a program into its exit code. An error is printed to stderr as one line, and
/// the code is 2.
pub fn exit_code<E: Display>(result: Result<(), E>) -> ExitCode {
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            report(&error);
            ExitCode::from(2)
        }
    }
}

/// Reads the options and runs a program with them. A bad argument is printed to stderr as one line,
/// and the exit code is 2; `--help` and `--version` are printed to stdout.
pub fn run_program<T: Parser, E: Display>(run: impl FnOnce(&T) -> Result<(), E>) -> ExitCode {
    match T::try_parse() {
        Ok(options) => exit_code(run(&options)),
        Err(error) if error.use_stderr() => exit_code(Err(one_line(&error))),
        Err(help) => {
            print(&help.to_string());
            ExitCode::SUCCESS
        }
    }
}

/// Prints an error to stderr, if that is possible.
fn report(error: &impl Display) {
    let _ = writeln!(std::io::stderr(), "error: {error}");
}

/// The exit code of a program whose reader has gone, as shells report it for the signal SIGPIPE.
const READER_HAS_GONE: i32 = 141;

/// Prints a line to stdout, with the arguments of `format!`, as [`print`](crate::common::exit::print) does.
#[macro_export]
macro_rules! say {
    ($($argument:tt)*) => { $crate::common::exit::print(&(format!($($argument)*) + "\n")) };
}

/// Prints a text to stdout. If that is not possible, the program ends: without a word where the reader has
/// gone, as in `city | head -1`, and otherwise with one line, as on a full disk.
#[allow(clippy::exit, reason = "the program ends")]
pub fn print(text: &str) {
    let mut stdout = std::io::stdout().lock();
    match stdout.write_all(text.as_bytes()).and_then(|()| stdout.flush()) {
        Ok(()) => {}
        Err(error) if error.kind() == ErrorKind::BrokenPipe => std::process::exit(READER_HAS_GONE),
        Err(error) => {
            report(&format!("cannot write to stdout: {error}"));
            std::process::exit(2)
        }
    }
}

/// What is wrong with the arguments, in one line.
pub fn one_line(error: &clap::Error) -> String {
    let text = error.to_string();
    let mut lines = text.lines().map(str::trim);
    let mut line = lines.next().unwrap_or_default().trim_start_matches("error: ").to_owned();
    // clap lists missing arguments and possible values on lines of their own.
    for detail in lines.take_while(|line| !line.is_empty()) {
        line = format!("{line} {detail}");
    }
    format!("{line}; see --help")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Debug, Parser)]
    struct Options {
        #[arg(long)]
        out: String,
        #[arg(long, value_parser = ["S", "M"])]
        size: Option<String>,
    }

    #[test]
    fn a_bad_argument_is_told_in_one_line() {
        let line = |args: &[&str]| one_line(&Options::try_parse_from(args).expect_err("a bad argument"));
        let missing = line(&["program"]);
        assert!(missing.contains("--out <OUT>") && missing.ends_with("; see --help"), "{missing}");
        let value = line(&["program", "--out", "x", "--size", "L"]);
        assert!(value.contains("[possible values: S, M]"), "{value}");
        assert!(!missing.contains('\n') && !value.contains('\n'));
    }
}
