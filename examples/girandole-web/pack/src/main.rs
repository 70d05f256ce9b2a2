//! Makes the static folder of the page: the JavaScript that wasm-bindgen generates, the wasm in a
//! script, and the page's own files.
//!
//! The wasm is text in a script because browsers let a page that was opened from a file load scripts,
//! but not fetch files. Usage: `girandole-web-pack WASM PAGE FOLDER`.

use std::error::Error;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::{env, fs};

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use wasm_bindgen_cli_support::Bindgen;

/// The name of the generated files, and of the variable that holds the wasm.
const NAME: &str = "girandole_web";

fn pack(wasm: &Path, page: &Path, folder: &Path) -> Result<(), Box<dyn Error>> {
    fs::create_dir_all(folder)?;
    let mut bindgen = Bindgen::new();
    bindgen.input_path(wasm).out_name(NAME).no_modules(true)?.typescript(false);
    // The names of functions are a third of the file.
    bindgen.remove_name_section(true).remove_producers_section(true).generate(folder)?;
    let generated = folder.join(format!("{NAME}_bg.wasm"));
    let bytes = fs::read(&generated)?;
    let script = format!("const {NAME}_wasm = \"{}\";\n", STANDARD.encode(&bytes));
    fs::write(folder.join(format!("{NAME}_wasm.js")), script)?;
    fs::remove_file(generated)?;
    for entry in fs::read_dir(page)? {
        let path = entry?.path();
        if let Some(name) = path.file_name() {
            fs::copy(&path, folder.join(name))?;
        }
    }
    println!("{}: {} bytes of wasm", folder.display(), bytes.len());
    Ok(())
}

fn main() -> ExitCode {
    let arguments: Vec<PathBuf> = env::args_os().skip(1).map(PathBuf::from).collect();
    let [wasm, page, folder] = &arguments[..] else {
        eprintln!("usage: girandole-web-pack WASM PAGE FOLDER");
        return ExitCode::FAILURE;
    };
    match pack(wasm, page, folder) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("cannot make {}: {error}", folder.display());
            ExitCode::FAILURE
        }
    }
}
