//! Builds the static library, for the tests of this crate and of whoever writes programs for it.

use std::env;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::{Mutex, OnceLock};

#[derive(Clone, Copy, Debug)]
pub(crate) enum Precision {
    Single,
    Double,
}

/// The static library of the repository with this root, built once.
pub(crate) fn library(root: &Path, precision: Precision) -> &'static Path {
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
            env::var_os("CARGO_TARGET_DIR").map_or_else(|| root.join("target"), PathBuf::from).join("c");
        let mut build = Command::new(env!("CARGO"));
        build.current_dir(root).args(["build", "--locked", "--package", "thetahat-c", "--target-dir"]);
        done(build.arg(&target).args(options));
        let kept = target.join(format!("libthetahat_c-{precision:?}.a"));
        fs::copy(target.join("debug/libthetahat_c.a"), &kept).expect("a library");
        kept
    })
}

/// Runs a command that must succeed.
pub(crate) fn done(command: &mut Command) -> Output {
    let output = command.output().expect("a command that starts");
    let [printed, errors] = [&output.stdout, &output.stderr].map(|text| String::from_utf8_lossy(text));
    assert!(output.status.success(), "{command:?}\n{printed}{errors}");
    output
}
