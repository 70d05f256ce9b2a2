//! The exit code of a program.

use std::fmt::Display;
use std::process::ExitCode;

/// Turns the result of a program into its exit code. An error is printed to stderr as one line, and
/// the code is 2.
#[allow(clippy::print_stderr, reason = "a program talks to its user")]
pub fn exit_code<E: Display>(result: Result<(), E>) -> ExitCode {
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::from(2)
        }
    }
}
