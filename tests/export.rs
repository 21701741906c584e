//! Models as source code: it compiles, and says what the library does.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;

use crate::harness::Folder;

/// What C has to be compiled with.
const STRICT: [&str; 6] = ["-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Werror", "-O2"];

/// Whether a program is there. Where the tests must not skip anything it has to be.
fn has(program: &str) -> bool {
    let there = Command::new(program).arg("--version").output().is_ok();
    assert!(there || std::env::var_os("CI").is_none(), "{program} is missing");
    if !there {
        eprintln!("skipped: {program} is missing");
    }
    there
}

fn run(command: &mut Command) {
    let output = command.output().expect("a program that starts");
    assert!(
        output.status.success(),
        "{command:?}: {}{}",
        String::from_utf8_lossy(&output.stdout),
        String::from_utf8_lossy(&output.stderr)
    );
}

/// The core as a library that a generated module is linked with, compiled once.
fn core() -> &'static Path {
    static CORE: OnceLock<PathBuf> = OnceLock::new();
    CORE.get_or_init(|| {
        // Beside the binary of this test.
        let own = std::env::current_exe().expect("a test has a file");
        own.parent().expect("a folder").to_owned()
    })
}

/// Links a generated module of Rust with the core, and runs it.
fn rustc(folder: &Folder, name: &str) {
    let text = folder.read(&format!("{name}.rs"));
    let mut command = Command::new("rustc");
    command.current_dir(folder.path(".")).args(["--edition=2024", "-D", "warnings", "-C", "opt-level=1"]);
    if text.contains("thetahat_core") {
        let library = newest(core(), "libthetahat_core-").expect("the core was built for this test");
        command.arg("--extern").arg(format!("thetahat_core={}", library.display()));
        command.arg("-L").arg(format!("dependency={}", core().display()));
    }
    run(command.arg(format!("{name}_test.rs")).args(["-o", "test_of_rust"]));
    run(&mut Command::new(folder.path("test_of_rust")));
}

/// The library that was built last.
fn newest(folder: &Path, begins: &str) -> Option<PathBuf> {
    let entries = fs::read_dir(folder).ok()?.filter_map(Result::ok);
    let libraries = entries.filter(|entry| {
        let name = entry.file_name().to_string_lossy().into_owned();
        name.starts_with(begins) && name.ends_with(".rlib")
    });
    libraries
        .max_by_key(|entry| entry.metadata().and_then(|data| data.modified()).ok())
        .map(|entry| entry.path())
}

/// Exports a model in every way, compiles it, and steps it along a log.
fn goes_round(folder: &Folder, report: &str, log: &str, purposes: &[&str]) {
    for (purpose, precision) in purposes.iter().flat_map(|purpose| [(purpose, "f64"), (purpose, "f32")]) {
        let common = format!("export {report} {log} --what {purpose} --precision {precision} --name model");
        let exported = folder.done(&format!("{common} --to rust"));
        assert!(!exported.stderr.contains("warning"), "{}", exported.stderr);
        rustc(folder, "model");
        folder.done(&format!("{common} --to c"));
        if has("gcc") {
            let mut command = Command::new("gcc");
            command.current_dir(folder.path(".")).args(STRICT).arg("-ffp-contract=off");
            run(command.args(["model.c", "model_test.c", "-o", "test_of_c", "-lm"]));
            run(&mut Command::new(folder.path("test_of_c")));
        }
    }
}

fn motor() -> Folder {
    let folder = Folder::new();
    folder.done("demo .");
    folder
}

#[test]
fn models_of_polynomials_say_what_the_library_does() {
    let folder = motor();
    for (orders, purposes) in [
        ("--na 2 --nb 2 --nk 3", ["predictor", "simulator"]),
        ("--model bj --nb 2 --nc 1 --nd 2 --nf 2", ["predictor", "simulator"]),
    ] {
        folder.done(&format!("fit dc_motor.csv --time t {orders} --report r.json"));
        goes_round(&folder, "r.json", "dc_motor.csv --time t", &purposes);
    }
}

#[test]
fn models_of_other_kinds_say_what_the_library_does() {
    let folder = motor();
    let both = ["predictor", "simulator"];
    folder.write("two.csv", include_str!("data/dc_motor.csv"));
    folder.done("fit two.csv --time t -u u -y i,speed --order 2 --report r.json");
    goes_round(&folder, "r.json", "two.csv --time t", &["predictor", "simulator", "observer"]);
    folder.done("convert r.json --to continuous --out c.json");
    goes_round(&folder, "c.json", "two.csv --time t", &both);
    folder.write("heater.csv", include_str!("data/public/tclab_siso_step.csv"));
    folder.done("fit heater.csv --time t -u q1 -y t1 --structure p2d --report r.json");
    goes_round(&folder, "r.json", "heater.csv --time t", &both);
}

#[test]
fn nonlinear_models_say_what_the_library_does() {
    // y(t) = 0.6 y(t-1) + 0.3 u(t-1)^2 - 0.1 y(t-1) u(t-1), and a little of what looks like noise.
    let (mut text, mut y, mut u, mut random) = ("t,u,y\n".to_owned(), 0.0_f64, 0.0_f64, 1_u32);
    for t in 0..400 {
        random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        y = 0.6 * y + 0.3 * u * u - 0.1 * y * u + 0.01 * f64::from(random >> 16 & 0xff) / 256.0;
        u = f64::from(random >> 8) / f64::from(1 << 23) - 1.0;
        text += &format!("{t},{u},{y}\n");
    }
    let folder = Folder::with_log(text);
