//! Builds the library and programs in C.

use std::env;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::{Mutex, OnceLock};

const FOLDER: &str = env!("CARGO_MANIFEST_DIR");
const WARNINGS: [&str; 4] = ["-Wall", "-Wextra", "-Wpedantic", "-Werror"];

#[derive(Clone, Copy, Debug)]
pub(crate) enum Precision {
    Single,
    Double,
}

/// The root of the repository.
fn root() -> PathBuf {
    Path::new(FOLDER).join("../..")
}

/// What a program prints, made of these files of C. `None` if there is no compiler: then the test is skipped, by name, but
/// where CI=true.
pub(crate) fn run(precision: Precision, name: &str, sources: &[&str]) -> Option<String> {
    if !is_there("gcc") {
        return None;
    }
    let library = library(precision);
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

/// The static library, built once.
fn library(precision: Precision) -> &'static Path {
    static LIBRARIES: [OnceLock<PathBuf>; 2] = [OnceLock::new(), OnceLock::new()];
    static ONE_AT_A_TIME: Mutex<()> = Mutex::new(());
    let [single, double] = &LIBRARIES;
    let (library, options): (_, &[&str]) = match precision {
        Precision::Single => (single, &[]),
        Precision::Double => (double, &["--features", "double"]),
    };
    library.get_or_init(|| {
        // Both are built in one place, as they have all but one crate in common.
        let _lock = ONE_AT_A_TIME.lock();
        let target =
            env::var_os("CARGO_TARGET_DIR").map_or_else(|| root().join("target"), PathBuf::from).join("c");
        let mut build = Command::new(env!("CARGO"));
        build.current_dir(root()).args(["build", "--locked", "--package", "thetahat-c", "--target-dir"]);
        done(build.arg(&target).args(options));
        let kept = target.join(format!("libthetahat_c-{precision:?}.a"));
        fs::copy(target.join("debug/libthetahat_c.a"), &kept).expect("a library");
        kept
    })
}

/// Runs a command that must succeed.
fn done(command: &mut Command) -> Output {
    let output = command.output().expect("a command that starts");
    let [printed, errors] = [&output.stdout, &output.stderr].map(|text| String::from_utf8_lossy(text));
    assert!(output.status.success(), "{command:?}\n{printed}{errors}");
    output
}
