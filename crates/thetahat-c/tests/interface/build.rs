//! Builds programs in C.

use std::env;
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::library::{Precision, done, library};

const FOLDER: &str = env!("CARGO_MANIFEST_DIR");
const WARNINGS: [&str; 4] = ["-Wall", "-Wextra", "-Wpedantic", "-Werror"];

/// The root of the repository.
fn root() -> PathBuf {
    Path::new(FOLDER).join("../..")
}

/// What a program prints, made of these files of C. `None` if there is no compiler: then the test is skipped, by name,
/// but where CI=true.
pub(crate) fn run(precision: Precision, name: &str, sources: &[&str]) -> Option<String> {
    if !is_there("gcc") {
        return None;
    }
    let library = library(&root(), precision);
    let define: &[&str] = match precision {
        Precision::Single => &[],
        Precision::Double => &["-DTHETAHAT_DOUBLE"],
    };
    let sources = sources.iter().map(|source| root().join(source));
    let program = library.with_file_name(format!("{name}-{precision:?}"));
    let mut compiler = Command::new("gcc");
    // A multiplication and an addition stay two, as in Rust.
    compiler.args(["-std=c99", "-O1", "-ffp-contract=off"]).args(WARNINGS).args(define);
    compiler.arg("-I").arg(Path::new(FOLDER).join("include")).args(sources);
    compiler.arg(library).args(["-lm", "-lpthread", "-ldl", "-o"]).arg(&program);
    done(&mut compiler);
    let output = done(&mut Command::new(&program));
    Some(String::from_utf8(output.stdout).expect("text"))
}

/// The header is read as C++ too, in both precisions.
pub(crate) fn compile_header_as_cpp() {
    if is_there("g++") {
        for define in ["-DTHETAHAT_SINGLE", "-DTHETAHAT_DOUBLE"] {
            let mut compiler = Command::new("g++");
            compiler.args(["-std=c++11", "-fsyntax-only", "-x", "c++", define]).args(WARNINGS);
            done(
                compiler
                    .arg(Path::new(FOLDER).join("tests/c/header.cpp"))
                    .arg("-I")
                    .arg(format!("{FOLDER}/include")),
            );
        }
    }
}

/// Whether there is such a compiler.
fn is_there(compiler: &str) -> bool {
    let there = Command::new(compiler).arg("--version").output().is_ok_and(|output| output.status.success());
    assert!(there || env::var_os("CI").is_none_or(|value| value != "true"), "missing: {compiler}");
    if !there {
        println!("skipped: {compiler} is not installed");
    }
    there
}
