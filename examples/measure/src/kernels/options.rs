//! The command line, and the whole run.

use super::driver::{CHIP_VARIABLE, MANIFEST_VARIABLE, NullDevice, manifest};
use super::limits;
use super::page;
use super::record::{COLUMNS, Row};
use super::subjects::{self, Subject};
use super::translate::{Zeroing, translate};
use clap::Parser;
use std::path::{Path, PathBuf};
use std::process::Command;
use testbed::common::progress::progress;
use testbed::common::stopwatch::thread_time;
use testbed::common::table::Table;

/// The chips for which kernels are compiled: RDNA 2, RDNA 3 and GCN 5.
pub const CHIPS: [&str; 3] = ["navi21", "gfx1100", "vega10"];

/// Compiles every kernel for GPUs that are not there, and tells what the compiler made of it.
#[derive(Clone, Debug, Parser)]
pub struct Options {
    /// The table
    #[arg(long, value_name = "FILE.csv", required_unless_present_any = ["child", "spirv", "page"])]
    pub out: Option<PathBuf>,
    /// Only this chip; may be given several times
    #[arg(long, value_name = "NAME", value_parser = CHIPS)]
    pub chip: Vec<String>,
    /// Only kernels whose name contains this
    #[arg(long, value_name = "NAME", default_value = "")]
    pub kernel: String,
    /// Who clears workgroup memory
    #[arg(long, value_enum, default_value = "none")]
    pub zeroing: Zeroing,
    /// Compiles shaders without the checks of indices and loops that wgpu adds
    #[arg(long)]
    pub trusted: bool,
    /// Writes each kernel as SPIR-V to this folder instead of compiling it
    #[arg(long, value_name = "DIR", conflicts_with_all = ["out", "check"])]
    pub spirv: Option<PathBuf>,
    /// Writes a web page that compiles each kernel in a browser, instead of compiling it
    #[arg(long, value_name = "FILE.html", conflicts_with_all = ["out", "check", "spirv"])]
    pub page: Option<PathBuf>,
    /// Fails where a kernel exceeds its limits
    #[arg(long)]
    pub check: bool,
    /// Prints the rows of the chip that the environment names
    #[arg(long, hide = true)]
    pub child: bool,
}

/// Compiles all kernels, and writes the table.
pub fn run(options: &Options) -> Result<(), String> {
    if options.child {
        return rows_of_this_chip(options);
    }
    if let Some(folder) = &options.spirv {
        return write_spirv(folder, options);
    }
    if let Some(path) = &options.page {
        return std::fs::write(path, page::html(&options.kernel))
            .map_err(|error| format!("cannot write {}: {error}", path.display()));
    }
    let Some(manifest) = manifest() else {
        testbed::say!("skipped: Mesa's driver RADV is not installed (Debian: mesa-vulkan-drivers)");
        return Ok(());
    };
    let mut table = options.out.as_deref().map(|path| Table::create(path, &COLUMNS)).transpose()?;
    let chips = if options.chip.is_empty() { CHIPS.map(str::to_owned).to_vec() } else { options.chip.clone() };
    let bar = progress("kernels", chips.len() as u64);
    let mut rows = Vec::new();
    for chip in &chips {
        let found = in_a_process(chip, &manifest, options)?;
        for row in &found {
            table.iter_mut().try_for_each(|table| table.add(row.fields()))?;
        }
        rows.extend(found);
        bar.inc(1);
    }
    bar.finish_and_clear();
    testbed::say!("{}", limits::summary(&rows));
    let exceeded = limits::exceeded(&rows);
    match exceeded.first() {
        Some(_) if options.check => Err(exceeded.join("; ")),
        _ => Ok(()),
    }
}

/// Writes the SPIR-V of every kernel, for `spirv-val`. Needs no driver.
fn write_spirv(folder: &Path, options: &Options) -> Result<(), String> {
    let failed = |path: &Path, error: std::io::Error| format!("cannot write {}: {error}", path.display());
    std::fs::create_dir_all(folder).map_err(|error| failed(folder, error))?;
    for subject in subjects::all().iter().filter(|subject| subject.kernel.contains(&options.kernel)) {
        let shader = translate(&subject.wgsl, subject.entry, options.zeroing, options.trusted)
            .map_err(|error| format!("{}: {error}", subject.kernel))?;
        let name = [subject.kernel, subject.effects].join("-");
        let path = folder.join(name.trim_end_matches('-')).with_extension("spv");
        let bytes: Vec<u8> = shader.words.iter().flat_map(|word| word.to_le_bytes()).collect();
        std::fs::write(&path, bytes).map_err(|error| failed(&path, error))?;
    }
    Ok(())
}

/// Compiles for one chip in a process of its own: the driver reads the name of the chip from the
/// environment.
fn in_a_process(chip: &str, manifest: &Path, options: &Options) -> Result<Vec<Row>, String> {
    let own = std::env::current_exe().map_err(|error| format!("cannot find this program: {error}"))?;
    let zeroing = options.zeroing.name();
    let child = Command::new(own)
        .args(["kernels", "--child", "--chip", chip, "--zeroing", zeroing, "--kernel", &options.kernel])
        .args(options.trusted.then_some("--trusted"))
        .env(CHIP_VARIABLE, chip)
        .env(MANIFEST_VARIABLE, manifest)
        // Compiled pipelines are not taken from a cache.
        .env("RADV_DEBUG", "nocache")
        .output()
        .map_err(|error| format!("cannot start this program again: {error}"))?;
    if !child.status.success() {
        return Err(format!("{chip}: {}", String::from_utf8_lossy(&child.stderr).trim()));
    }
    let text = String::from_utf8_lossy(&child.stdout).into_owned();
    text.lines().map(|line| Row::parse(line).ok_or_else(|| format!("{chip}: \"{line}\" is no row"))).collect()
}

fn rows_of_this_chip(options: &Options) -> Result<(), String> {
    let chip = options.chip.first().ok_or("a chip is missing")?;
    let device = NullDevice::open().map_err(|error| format!("RADV cannot be opened: {error}"))?;
    for subject in subjects::all().iter().filter(|subject| subject.kernel.contains(&options.kernel)) {
        testbed::say!("{}", row(&device, subject, chip, options)?.line());
    }
    Ok(())
}

fn row(device: &NullDevice, subject: &Subject, chip: &str, options: &Options) -> Result<Row, String> {
    let of = |error: String| format!("{}: {error}", subject.kernel);
    let shader = translate(&subject.wgsl, subject.entry, options.zeroing, options.trusted).map_err(of)?;
    let before = thread_time();
    let statistics = device.statistics(&shader, subject.entry).map_err(|error| of(error.to_string()))?;
    let seconds = thread_time().saturating_sub(before).as_secs_f64();
    Row::new(subject, chip, options.zeroing, &statistics, seconds).map_err(of)
}
