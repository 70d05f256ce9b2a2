//! The example of an engine's shader comes to the same light by samples as by sums.

#[test]
fn the_example_of_an_engines_shader_agrees_with_sums() {
    let line = crate::engine_shader::run().expect("it agrees");
    assert!(line.starts_with("mean illuminance"), "{line}");
}
