//! The example of an engine's shader: samples on the GPU agree with sums over all lights on the
//! CPU.

#[test]
fn the_example_of_an_engines_shader_agrees_with_sums() {
    let line = crate::engine_shader::run().expect("it agrees");
    assert!(line.starts_with("mean illuminance"), "{line}");
}
