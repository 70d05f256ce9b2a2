//! Reuse has the mean of sums over all lights, and less noise than samples without reuse.

use std::process::Command;

#[test]
fn the_program_finds_no_bias_and_less_noise() {
    let output = Command::new(env!("CARGO_BIN_EXE_reuse")).output().expect("a binary that starts");
    let (line, error) = (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    assert!(output.status.success() && line.starts_with("| what changes"), "{line}{error}");
}
