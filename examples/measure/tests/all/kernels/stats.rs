//! The tool that asks a GPU's compiler about every kernel: its rows and limits, and the translation
//! of all texts. CI asks the driver itself.

use measure::kernels::limits::{CHIP, LIMITS, MOST_SECONDS, exceeded};
use measure::kernels::record::Row;
use measure::kernels::subjects::{self, Subject};
use measure::kernels::translate::{Zeroing, translate};

fn row(vgprs: u64, instructions: u64) -> Row {
    Row {
        kernel: "sort_scatter".to_owned(),
        effects: String::new(),
        chip: CHIP.to_owned(),
        zeroing: "none".to_owned(),
        vgprs,
        spilled_vgprs: 0,
        scratch_bytes_per_lane: 0,
        waves: 16,
        instructions,
        code_bytes: 4,
        inverse_throughput: 5,
        compile_seconds: 0.5,
    }
}

#[test]
fn rows_beyond_a_limit_and_rows_without_one_are_named() {
    assert_eq!(exceeded(&[row(1, 1)]), Vec::<String>::new());
    let [one] = &exceeded(&[row(1_000, 1)])[..] else { panic!("one limit is exceeded") };
    assert!(one.starts_with("sort_scatter needs 1000 registers of "), "{one}");
    let unknown = Row { kernel: "other".to_owned(), ..row(1, 1) };
    assert_eq!(exceeded(&[unknown]), ["other has no limits in limits.rs"]);
    let elsewhere = Row { chip: "vega10".to_owned(), ..row(1_000, 1) };
    assert_eq!(exceeded(&[elsewhere]), Vec::<String>::new());
    let slow = Row { compile_seconds: 2.0 * MOST_SECONDS, ..row(1, 1) };
    assert_eq!(exceeded(&[slow]).len(), 1);
}

#[test]
fn a_line_has_all_of_a_row() {
    let row = row(12, 345);
    assert_eq!(Row::parse(&row.line()), Some(row));
    assert_eq!(Row::parse("skipped"), None);
}

#[test]
fn every_kernel_has_a_limit_and_every_limit_a_kernel() {
    let mut kernels: Vec<_> = subjects::all().iter().map(|subject| (subject.kernel, subject.effects)).collect();
    let mut limits: Vec<_> = LIMITS.iter().map(|limit| (limit.kernel, limit.effects)).collect();
    kernels.sort_unstable();
    limits.sort_unstable();
    assert_eq!(kernels, limits);
}

#[test]
fn every_kernel_becomes_spir_v_with_its_buffers() {
    for Subject { kernel, effects, entry, wgsl } in subjects::all() {
        let shader = translate(&wgsl, entry, Zeroing::None, false).expect("a valid text");
        assert_eq!(shader.words[0], 0x0723_0203, "{kernel} {effects}");
        // A world without effects has no densities to compute, and reads no lights for them. The list of cells is in
        // one table.
        let least = if kernel == "cut_list" { 1 } else { 2 };
        assert!(shader.buffers.len() >= least, "{kernel} {effects}: {:?}", shader.buffers);
    }
    let [first, ..] = &subjects::all()[..] else { panic!("there are kernels") };
    assert_eq!(
        translate(&first.wgsl, "missing", Zeroing::None, false).map(drop),
        Err("no such entry point".to_owned())
    );
    assert!(translate("fn", first.entry, Zeroing::None, false).is_err());
}
