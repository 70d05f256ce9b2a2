//! Calls the programs that measure.

use super::figure::{Run, Scene};
use serde_json::{Value, json};
use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use testbed::common::origin;
use testbed::common::progress::{Progress, progress};

/// The name of the run whose raw file comes from another machine.
pub const GPU: &str = "gpu";

/// The file that a run leaves when it has ended well.
const ORIGIN: &str = "origin.json";

/// Where programs are, and where their files go.
pub struct Workshop<'a> {
    pub programs: &'a Path,
    pub out: &'a Path,
    pub gltf: Option<&'a Path>,
    pub commit: &'a str,
    pub is_quick: bool,
}

/// Calls all runs: first those that measure no time, then the others, with so many of each at once. Returns
/// one line for each that failed.
pub fn all(workshop: &Workshop<'_>, runs: &[&Run], [jobs, timed_jobs]: [usize; 2]) -> Vec<String> {
    let bar = progress("figures", runs.iter().map(|run| u64::from(run.seconds)).sum());
    let failed = Mutex::new(Vec::new());
    let (timed, others): (Vec<&Run>, Vec<&Run>) = runs.iter().copied().partition(|run| run.is_timed);
    for (list, jobs) in [(longest_first(others), jobs), (longest_first(timed), timed_jobs)] {
        let next = AtomicUsize::new(0);
        std::thread::scope(|scope| {
            for _ in 0..jobs.min(list.len()) {
                scope.spawn(|| {
                    while let Some(run) = list.get(next.fetch_add(1, Ordering::Relaxed)) {
                        if let Err(error) = one(workshop, run, &bar) {
                            let mut failed = failed.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
                            failed.push(format!("{}: {error}", run.name));
                        }
                    }
                });
            }
        });
    }
    bar.finish_and_clear();
    failed.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner)
}

fn longest_first(mut runs: Vec<&Run>) -> Vec<&Run> {
    runs.sort_by_key(|run| std::cmp::Reverse(run.seconds));
    runs
}

fn one(workshop: &Workshop<'_>, run: &Run, bar: &Progress) -> Result<(), String> {
    bar.set_message(run.name.to_owned());
    let folder = workshop.out.join(run.name);
    let failed = |path: &Path, error: std::io::Error| format!("cannot write {}: {error}", path.display());
    if folder.exists() {
        fs::remove_dir_all(&folder).map_err(|error| failed(&folder, error))?;
    }
    fs::create_dir_all(&folder).map_err(|error| failed(&folder, error))?;
    let (stdout, stderr) = (folder.join("stdout.md"), folder.join("stderr.txt"));
    let file = |path: &PathBuf| File::create(path).map_err(|error| failed(path, error));
    let program = workshop.programs.join(run.program);
    let words = if workshop.is_quick { run.quick.unwrap_or(run.arguments) } else { run.arguments };
    let mut command = Command::new(&program);
    command.args(words.split_whitespace());
    if let (Some(gltf), true) = (workshop.gltf, run.scene != Scene::Own) {
        command.arg("--gltf").arg(gltf);
    }
    if let Some(out) = run.out {
        command.arg("--out").arg(if out.is_empty() { folder.clone() } else { folder.join(out) });
    }
    command.env("CRITERION_HOME", folder.join("criterion")).stdin(Stdio::null());
    let status = command.stdout(file(&stdout)?).stderr(file(&stderr)?).status();
    let status = status.map_err(|error| format!("cannot start {}: {error}", program.display()))?;
    if !status.success() {
        let text = fs::read_to_string(&stderr).unwrap_or_default();
        return Err(format!("{} {words}: {}", run.program, text.lines().last().unwrap_or("it failed without a word")));
    }
    write_origin(&folder, &origin::machine(), &origin::date(), workshop.commit)?;
    bar.inc(u64::from(run.seconds));
    Ok(())
}

fn write_origin(folder: &Path, machine: &str, date: &str, commit: &str) -> Result<(), String> {
    let path = folder.join(ORIGIN);
    let text = json!({ "machine": machine, "date": date, "commit": commit }).to_string();
    fs::write(&path, text).map_err(|error| format!("cannot write {}: {error}", path.display()))
}

/// Takes the file of `measure gpu` from another machine. It must tell the device, the date and the commit.
pub fn take_gpu(out: &Path, file: &Path) -> Result<(), String> {
    let failed = |error: &dyn std::fmt::Display| format!("{}: {error}", file.display());
    let text = fs::read_to_string(file).map_err(|error| failed(&error))?;
    let value: Value = serde_json::from_str(&text).map_err(|error| failed(&error))?;
    let said = |pointer: &str| {
        let text = value.pointer(pointer).and_then(Value::as_str).filter(|text| !text.is_empty());
        text.ok_or_else(|| failed(&format!("it does not say {pointer}")))
    };
    let machine = format!("{}, driver {}", said("/adapter/name")?, said("/adapter/driver_info")?);
    let folder = out.join(GPU);
    let write = fs::create_dir_all(&folder).and_then(|()| fs::write(folder.join("gpu.json"), &text));
    write.map_err(|error| format!("cannot write into {}: {error}", folder.display()))?;
    write_origin(&folder, &machine, said("/date")?, said("/commit")?)
}

/// The machine, the date and the commit of a run; `None` if it has not ended well.
pub fn origin_of(out: &Path, run: &str) -> Option<[String; 3]> {
    let text = fs::read_to_string(out.join(run).join(ORIGIN)).ok()?;
    let value: Value = serde_json::from_str(&text).ok()?;
    let said = |name: &str| value.get(name).and_then(Value::as_str).map(str::to_owned);
    Some([said("machine")?, said("date")?, said("commit")?])
}
