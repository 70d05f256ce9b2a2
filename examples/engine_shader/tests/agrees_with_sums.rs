//! Samples on the GPU agree with sums over all lights on the CPU.

use std::process::Command;

#[test]
fn the_program_finds_that_samples_agree_with_sums() {
    let output = Command::new(env!("CARGO_BIN_EXE_engine_shader")).output().expect("a binary that starts");
    let (line, error) = (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    assert!(output.status.success() && line.starts_with("mean illuminance"), "{line}{error}");
}
