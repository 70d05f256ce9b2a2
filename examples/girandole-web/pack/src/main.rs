//! Generates the JavaScript of a wasm file with wasm-bindgen.
//!
//! - `girandole-web-pack WASM PAGE FOLDER` makes the static folder of a page: the JavaScript, the wasm in a
//!   script, and the page's own files. The wasm is text in a script because browsers let a page that was opened
//!   from a file load scripts, but not fetch files.
//! - `girandole-web-pack --module NAME WASM FOLDER` makes an ES module `NAME.js` with its types, beside the wasm,
//!   which it fetches.

use std::error::Error;
use std::ffi::OsString;
use std::path::Path;
use std::process::ExitCode;
use std::{env, fs};

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use wasm_bindgen_cli_support::Bindgen;

/// The name of the page's generated files, and of the variable that holds the wasm.
const NAME: &str = "girandole_web";

/// A generator that removes the names of functions, which are a third of the file.
fn generator(wasm: &Path) -> Bindgen {
    let mut bindgen = Bindgen::new();
    bindgen.input_path(wasm).remove_name_section(true).remove_producers_section(true);
    bindgen
}

fn make_module(name: &str, wasm: &Path, folder: &Path) -> Result<(), Box<dyn Error>> {
    fs::create_dir_all(folder)?;
    generator(wasm).out_name(name).web(true)?.omit_default_module_path(false).typescript(true).generate(folder)?;
    Ok(())
}

fn make_page(wasm: &Path, page: &Path, folder: &Path) -> Result<(), Box<dyn Error>> {
    fs::create_dir_all(folder)?;
    generator(wasm).out_name(NAME).no_modules(true)?.typescript(false).generate(folder)?;
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
    let arguments: Vec<OsString> = env::args_os().skip(1).collect();
    let (folder, made) = match &arguments[..] {
        [option, name, wasm, folder] if option == "--module" => {
            (folder, make_module(&name.to_string_lossy(), wasm.as_ref(), folder.as_ref()))
        }
        [wasm, page, folder] => (folder, make_page(wasm.as_ref(), page.as_ref(), folder.as_ref())),
        _ => {
            eprintln!(
                "usage: girandole-web-pack WASM PAGE FOLDER\n       girandole-web-pack --module NAME WASM FOLDER"
            );
            return ExitCode::FAILURE;
        }
    };
    match made {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("cannot make {}: {error}", Path::new(folder).display());
            ExitCode::FAILURE
        }
    }
}
