//! Makes an ES module of a wasm file: its JavaScript with types, beside the wasm, which it fetches.
//!
//! `girandole-npm-pack NAME WASM FOLDER` writes `NAME.js`, `NAME.d.ts` and `NAME_bg.wasm` into the folder.

use std::env;
use std::process::ExitCode;

use wasm_bindgen_cli_support::Bindgen;

fn main() -> ExitCode {
    let arguments: Vec<String> = env::args().skip(1).collect();
    let [name, wasm, folder] = &arguments[..] else {
        eprintln!("usage: girandole-npm-pack NAME WASM FOLDER");
        return ExitCode::FAILURE;
    };
    let mut bindgen = Bindgen::new();
    // The names of functions are a third of the file.
    bindgen.input_path(wasm).remove_name_section(true).remove_producers_section(true);
    bindgen.out_name(name).omit_default_module_path(false).typescript(true);
    match bindgen.web(true).and_then(|bindgen| bindgen.generate(folder)) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("cannot make {folder}: {error}");
            ExitCode::FAILURE
        }
    }
}
