//! Writes the header, `include/thetahat.h`, from the sources; its test says whether it is up to date.
//!
//! ```text
//! cargo run -p thetahat-c --example header
//! ```

use std::error::Error;
use std::fs;

const FOLDER: &str = env!("CARGO_MANIFEST_DIR");

/// The header that the sources make.
fn header() -> Result<String, Box<dyn Error>> {
    let configuration = cbindgen::Config::from_file(format!("{FOLDER}/cbindgen.toml"))?;
    let source = format!("{FOLDER}/src/lib.rs");
    let builder = cbindgen::Builder::new().with_config(configuration).with_src(source);
    let mut text = Vec::new();
    builder.generate()?.write(&mut text);
    Ok(String::from_utf8(text)?)
}

fn main() -> Result<(), Box<dyn Error>> {
    Ok(fs::write(format!("{FOLDER}/include/thetahat.h"), header()?)?)
}

#[test]
fn the_header_is_what_the_sources_make() {
    let written = fs::read_to_string(format!("{FOLDER}/include/thetahat.h")).expect("the header");
    let made = header().expect("sources that cbindgen understands");
    assert!(made == written, "not up to date: cargo run -p thetahat-c --example header");
}
