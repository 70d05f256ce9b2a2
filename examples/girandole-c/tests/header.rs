//! The header is what cbindgen makes of the sources.
//!
//! `GIRANDOLE_WRITE=1 cargo test --test header` writes it.

use std::path::Path;

#[test]
fn the_header_is_up_to_date() {
    let package = Path::new(env!("CARGO_MANIFEST_DIR"));
    let config = cbindgen::Config::from_file(package.join("cbindgen.toml")).expect("the settings are valid");
    // Only the sources of this package count, so nothing is asked of Cargo.
    let bindings = cbindgen::Builder::new().with_config(config).with_src(package.join("src/lib.rs"));
    let mut made = Vec::new();
    bindings.generate().expect("the sources are valid").write(&mut made);
    let made = String::from_utf8(made).expect("headers are text");
    let path = package.join("include/girandole.h");
    if std::env::var_os("GIRANDOLE_WRITE").is_some() {
        std::fs::write(&path, &made).expect("the header can be written");
    }
    let present = std::fs::read_to_string(&path).unwrap_or_default();
    assert!(present == made, "include/girandole.h is out of date: see how to write it in header.rs");
}
