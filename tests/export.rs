//! Models as source code: it compiles, and says what the library does.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;

use crate::c_library::{Precision, done, library};
use crate::harness::Folder;
use crate::signals::Random;

mod equations;

/// What C has to be compiled with.
const STRICT: [&str; 7] = ["-std=c99", "-Wall", "-Wextra", "-Wconversion", "-Wpedantic", "-Werror", "-O2"];

/// Whether a program is there. Where the tests must not skip anything it has to be.
fn has(program: &str) -> bool {
    let there = Command::new(program).arg("--version").output().is_ok();
    assert!(there || std::env::var_os("CI").is_none(), "{program} is missing");
    if !there {
        eprintln!("skipped: {program} is missing");
    }
    there
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

/// Links a generated module of Rust with the core, and runs it. Clippy has nothing to say of it.
fn rustc(folder: &Folder, name: &str) {
    let text = folder.read(&format!("{name}.rs"));
    let mut command = Command::new(if has("clippy-driver") { "clippy-driver" } else { "rustc" });
    command.current_dir(folder.path(".")).args(["--edition=2024", "-D", "warnings", "-C", "opt-level=1"]);
    if text.contains("thetahat_core") {
        let library = newest(core(), "libthetahat_core-").expect("the core was built for this test");
        command.arg("--extern").arg(format!("thetahat_core={}", library.display()));
        command.arg("-L").arg(format!("dependency={}", core().display()));
    }
    done(command.arg(format!("{name}_test.rs")).args(["-o", "test_of_rust"]));
    done(&mut Command::new(folder.path("test_of_rust")));
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
    for purpose in purposes {
        for precision in ["f64", "f32"] {
            goes_round_once(folder, report, log, purpose, precision);
        }
    }
}

fn goes_round_once(folder: &Folder, report: &str, log: &str, purpose: &str, precision: &str) {
    let common = format!("export {report} {log} --what {purpose} --precision {precision} --name model");
    let exported = folder.done(&format!("{common} --to rust"));
    assert!(!exported.stderr.contains("warning"), "{}", exported.stderr);
    rustc(folder, "model");
    folder.done(&format!("{common} --to c"));
    if has("gcc") {
        gcc(folder, precision);
    }
}

/// Links a generated source of C with its check, and with the core in C where it names it, and runs it.
fn gcc(folder: &Folder, precision: &str) {
    let mut command = Command::new("gcc");
    command.current_dir(folder.path(".")).args(STRICT).arg("-ffp-contract=off");
    command.args(["model.c", "model_test.c"]);
    if folder.read("model.h").contains("thetahat.h") {
        let root = Path::new(env!("CARGO_MANIFEST_DIR"));
        let of_c = if precision == "f64" {
            command.arg("-DTHETAHAT_DOUBLE");
            Precision::Double
        } else {
            Precision::Single
        };
        command.arg("-I").arg(root.join("crates/thetahat-c/include")).arg(library(root, of_c));
        command.args(["-lpthread", "-ldl"]);
    }
    done(command.args(["-lm", "-o", "test_of_c"]));
    done(&mut Command::new(folder.path("test_of_c")));
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
    // Numbers that are missing are counted.
    holes(&folder);
    goes_round(&folder, "r.json", "holes.csv --time t", &["predictor"]);
    assert!(folder.read("model_test.c").contains("if (missing != 2U)"));
}

/// The log of the motor, of which one row has no output, and one no input.
fn holes(folder: &Folder) {
    let whole = folder.read("dc_motor.csv");
    let log = whole.lines().enumerate().map(|(row, line)| {
        let mut cells: Vec<&str> = line.split(',').collect();
        match row {
            100 => cells[2] = "",
            200 => cells[1] = "",
            _ => {}
        }
        cells.join(",") + "\n"
    });
    folder.write("holes.csv", log.collect::<String>());
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
    let (mut text, mut y, mut u, mut random) = ("t,u,y\n".to_owned(), 0.0_f64, 0.0_f64, Random::new(1));
    for t in 0..400 {
        y = 0.6 * y + 0.3 * u * u - 0.1 * y * u + 0.005 * random.uniform();
        u = random.uniform();
        text += &format!("{t},{u},{y}\n");
    }
    let folder = Folder::with_log(text);
    for map in
        ["poly --degree 2", "rbf --centres kmeans:5", "spline", "local", "tanh --units 3", "relu --units 3"]
    {
        folder.done(&format!("fit log.csv --time t --narx {map} --ny 1 --nu 2 --report r.json"));
        goes_round(&folder, "r.json", "log.csv --time t", &["predictor"]);
    }
}

#[test]
fn a_map_of_one_box_and_loops_in_loops_have_names() {
    let folder = motor();
    folder.done("fit dc_motor.csv --time t --narx local --ny 1 --nu 1 --estimate 1..60 --report r.json");
    goes_round(&folder, "r.json", "dc_motor.csv --time t", &["predictor"]);
    let text =
        include_str!("data/dc_motor.toml").replace("sample_time = 0.01", "sample_time = 0.01\nsubsteps = 2");
    folder.write("motor.toml", text);
    folder.write("motor.csv", include_str!("data/dc_motor.csv"));
    folder.done("fit --grey motor.toml motor.csv --time t --estimate 1..500 --report r.json");
    goes_round_once(&folder, "r.json", "motor.csv --time t", "observer", "f32");
}

#[test]
fn numbers_beyond_single_precision_are_refused_there() {
    let folder = Folder::with_log(include_str!("data/dc_motor.csv"));
    folder.done("fit log.csv --time t -u u -y speed --model ss --order 2 --report r.json");
    let report = folder.read("r.json");
    let mut document: serde_json::Value = serde_json::from_str(&report).expect("a document");
    document["model"]["k"][0][0] = 1e308.into();
    folder.write("k.json", document.to_string());
    for language in ["c", "rust"] {
        let message = folder.refused(
            &format!("export k.json --to {language} --what predictor --precision f32 --name model"),
            2,
        );
        assert!(message.contains("e307") && message.contains("single precision"), "{message}");
        assert!(!folder.path("model.h").exists() && !folder.path("model.rs").exists());
    }
}

/// Steps one model along a sample that is infinite, another along one that is NaN: what they say afterwards is the
/// same.
const TWO_MODELS: &str = "
#include \"model.h\"
#include <math.h>
int main(void)
{
    model_state one, other;
    model_init(&one);
    model_init(&other);
    for (int k = 0; k < 50; k += 1) {
        const double given[2][1] = {{k == 9 ? INFINITY : 1.0}, {k == 9 ? NAN : 1.0}};
        const double measured[2][1] = {{k == 19 ? -INFINITY : 2.0}, {k == 19 ? NAN : 2.0}};
        double y[2][1];
        unsigned int missing = model_predict(&one, given[0], y[0]);
        if (model_predict(&other, given[1], y[1]) != missing || missing != (k == 9 ? 1U : 0U)) {
            return 2;
        }
        missing = model_update(&one, measured[0]);
        if (model_update(&other, measured[1]) != missing || missing != (k == 19 ? 1U : 0U)) {
            return 3;
        }
        if (!isfinite(y[0][0]) || !(y[0][0] >= y[1][0] && y[0][0] <= y[1][0])) {
            return 1;
        }
    }
    return 0;
}
";

#[test]
fn infinity_is_a_missing_number_and_a_compiler_that_does_not_see_it_is_refused() {
    if !has("gcc") {
        return;
    }
    let folder = motor();
    for orders in ["--na 2 --nb 2 --nk 3", "--model bj --nb 2 --nc 1 --nd 2 --nf 2", "--model ss --order 2"] {
        folder.done(&format!("fit dc_motor.csv --time t {orders} --report r.json"));
        folder.done("export r.json --to c --what predictor --precision f64 --name model");
        folder.write("model_test.c", TWO_MODELS);
        gcc(&folder, "f64");
        let mut fast = Command::new("gcc");
        fast.current_dir(folder.path(".")).args(["-std=c99", "-ffast-math", "-c", "model.c"]);
        let refused = fast.output().expect("gcc");
        assert!(!refused.status.success());
        assert!(String::from_utf8_lossy(&refused.stderr).contains("-ffast-math"));
    }
}

/// What an exported observer holds after each row of a log: the innovations, and the NIS.
fn innovations_of_an_observer(folder: &Folder, rows: &[Vec<f64>], language: &str) -> Vec<Vec<f64>> {
    let numbers = |row: &[f64]| row.iter().map(|value| format!("{value:?}")).collect::<Vec<_>>().join(", ");
    let table = |open: char, close: char| -> String {
        rows.iter()
            .map(|row| {
                format!(
                    "    {open}{open}{}{close}, {open}{}{close}{close},\n",
                    numbers(&row[..1]),
                    numbers(&row[1..])
                )
            })
            .collect()
    };
    let (count, outputs) = (rows.len(), rows[0].len() - 1);
    let printed = if language == "c" {
        let text = format!(
            "#include \"model.h\"\n#include <stdio.h>\n\
             static const struct {{ double u[1]; double y[{outputs}]; }} rows[{count}] = {{\n{}}};\n\
             int main(void)\n{{\n    model_state state;\n    double x[2];\n    model_init(&state);\n    \
             for (int k = 0; k < {count}; k += 1) {{\n        (void)model_observe(&state, rows[k].u, rows[k].y, x);\n        \
             for (int i = 0; i < {outputs}; i += 1) {{\n            printf(\"%.17g \", state.innovation[i]);\n        }}\n        \
             printf(\"%.17g\\n\", state.nis[0]);\n    }}\n    return 0;\n}}\n",
            table('{', '}')
        );
        folder.write("print.c", text);
        let mut command = Command::new("gcc");
        command.current_dir(folder.path(".")).args(STRICT).args([
            "model.c",
            "print.c",
            "-lm",
            "-o",
            "print_of_c",
        ]);
        done(&mut command);
        done(&mut Command::new(folder.path("print_of_c")))
    } else {
        let text = format!(
            "#[path = \"model.rs\"]\nmod model;\nfn main() {{\n    let mut model = model::Model::new();\n    \
             let rows: [([f64; 1], [f64; {outputs}]); {count}] = [\n{}    ];\n    for (u, y) in &rows {{\n        \
             let (_state, _missing) = model.observe(u, y);\n        \
             model.innovation.iter().for_each(|e| print!(\"{{e:?}} \"));\n        println!(\"{{:?}}\", model.nis[0]);\n    }}\n}}\n",
            table('[', ']').replace("[[", "([").replace("]],", "]),")
        );
        folder.write("print.rs", text);
        let mut command = Command::new("rustc");
        command.current_dir(folder.path(".")).args([
            "--edition=2024",
            "-A",
            "dead_code",
            "print.rs",
            "-o",
            "print_of_rust",
        ]);
        done(&mut command);
        done(&mut Command::new(folder.path("print_of_rust")))
    };
    let text = String::from_utf8(printed.stdout).expect("text");
    let line = |line: &str| line.split(' ').map(|cell| cell.parse().expect("a number")).collect();
    text.lines().map(line).collect()
}

#[test]
fn observers_hold_the_innovations_of_filter() {
    let folder = Folder::new();
    folder.write("motor.csv", include_str!("data/dc_motor.csv"));
    folder.write("spring.csv", include_str!("data/mass_spring_damper.csv"));
    folder.write("spring.toml", include_str!("data/mass_spring_damper.toml"));
    // Linear equations have an exact step. Those of the others are integrated, with noises that are not always the
    // same, and inputs that act later, or go in lines.
    let motor = include_str!("data/dc_motor.toml");
    let line = motor.replace("voltage = \"u\"", "voltage = { channel = \"u\", hold = \"linear\" }");
    let noisy = |text: &str| {
        text.replace("friction * speed)", "friction * speed - 1e-9 * speed^3)")
            .replace("speed = 0.2 }", "speed = \"0.1 + 0.01 * voltage^2\" }")
            .replace("speed = 0.3 }", "speed = \"0.2 + 1e-5 * speed^2\" }")
    };
    folder.write("motor.toml", motor);
    folder.write("line.toml", &line);
    folder.write("bent_line.toml", noisy(&line));
    folder.write("late.toml", motor.replace("(voltage -", "(voltage(t - 0.013) -"));
    folder.write("bent_late.toml", noisy(motor).replace("(voltage -", "(voltage(t - 0.02) -"));
    for (log, fit, channels, initial) in [
        ("motor.csv", "-u u -y i,speed --order 2", &["u", "i", "speed"][..], "--initial zero"),
        ("motor.csv", "-u u -y speed --model ss --order 2", &["u", "speed"], "--initial zero"),
        ("spring.csv", "--grey spring.toml", &["force", "position"], ""),
        ("motor.csv", "--grey motor.toml", &["u", "i", "speed"], ""),
        ("motor.csv", "--grey line.toml", &["u", "i", "speed"], ""),
        ("motor.csv", "--grey bent_line.toml", &["u", "i", "speed"], ""),
        ("motor.csv", "--grey late.toml", &["u", "i", "speed"], ""),
        ("motor.csv", "--grey bent_late.toml", &["u", "i", "speed"], ""),
    ] {
        folder.done(&format!("fit {log} --time t {fit} --report r.json"));
        let filtered = folder.done(&format!("filter r.json {log} --time t {initial}")).stdout;
        let filtered: Vec<serde_json::Value> =
            filtered.lines().take(200).map(|line| serde_json::from_str(line).expect("a row")).collect();
        let text = folder.read(log);
        let mut lines = text.lines().map(|line| line.split(',').collect::<Vec<&str>>());
        let header = lines.next().expect("a header");
        let places =
            channels.iter().map(|name| header.iter().position(|own| own == name).expect("a channel"));
        let places: Vec<usize> = places.collect();
        let row =
            |cells: Vec<&str>| places.iter().map(|place| cells[*place].parse().expect("a number")).collect();
        let rows: Vec<Vec<f64>> = lines.take(200).map(row).collect();
        for language in ["c", "rust"] {
            if language == "c" && !has("gcc") {
                continue;
            }
            folder
                .done(&format!("export r.json --to {language} --what observer --precision f64 --name model"));
            let held = innovations_of_an_observer(&folder, &rows, language);
            assert_eq!(held.len(), 200);
            for (number, (held, filtered)) in held.iter().zip(&filtered).enumerate() {
                let names = channels[1..].iter().map(|name| format!("innovation_{name}"));
                for (own, name) in held.iter().zip(names.chain(["nis".to_owned()])) {
                    let expected = filtered[&name].as_f64().expect("a number");
                    let apart = (own - expected).abs();
                    assert!(
                        apart <= 1e-7 * expected.abs().max(1.0),
                        "{fit}, {language}, {number}: {name} {own} {expected}"
                    );
                }
            }
        }
    }
}

#[test]
fn nearest_neighbours_are_for_rust_alone() {
    let folder = motor();
    folder.done("fit dc_motor.csv --time t --narx knn --ny 1 --nu 1 --estimate 1..100 --report r.json");
    let export =
        "export r.json dc_motor.csv --time t --rows 200..300 --what predictor --precision f64 --name model";
    folder.done(&format!("{export} --to rust"));
    rustc(&folder, "model");
    folder.assert_refused(&format!("{export} --to c"), 2, "nearest neighbours");
}

/// Takes 17 s: four estimators in Rust and C, each built with the library that it steps.
#[test]
fn estimators_go_on_from_the_fit() {
    let folder = motor();
    holes(&folder);
    for orders in [
        "-u u -y y --na 2 --nb 2 --nk 3",
        "-u u -y y --na 2 --nb 2 --nk 0",
        "-u u -y y --model armax --na 2 --nb 2 --nc 1 --nk 3",
        "-y y --model ar --na 2",
    ] {
        folder.done(&format!("fit dc_motor.csv --time t {orders} --report r.json"));
        goes_round(&folder, "r.json", "holes.csv --time t", &["recursive"]);
    }
    folder.done("fit dc_motor.csv --time t --model oe --nb 2 --nf 2 --report r.json");
    for language in ["rust", "c"] {
        folder.assert_refused(
            &format!("export r.json --to {language} --what recursive"),
            3,
            "can be tracked",
        );
    }
}

#[test]
fn estimators_in_c_have_the_sizes_of_its_header() {
    let folder = motor();
    for (orders, most) in [
        ("--na 10 --nb 2 --nk 1", "--na 10 --nb 3 --nk 1"),
        ("--na 1 --nb 1 --nk 16", "--na 1 --nb 1 --nk 17"),
    ] {
        folder.done(&format!("fit dc_motor.csv --time t {orders} --report r.json"));
        folder.done("export r.json --to c --what recursive");
        folder.done(&format!("fit dc_motor.csv --time t {most} --report r.json"));
        let message = folder.refused("export r.json --to c --what recursive", 2);
        let sizes = "--to: estimators in C have up to 12 parameters, 4 inputs, and delays that add up to 16";
        assert!(message.contains(sizes) && message.contains("take rust"), "{message}");
        folder.done("export r.json --to rust --what recursive");
    }
    let header = include_str!("../crates/thetahat-c/include/thetahat.h");
    for words in ["thetahat_arx_12;", "thetahat_armax_12;", "_MOST_INPUTS 4\n", "_MOST_DELAYS 16\n"] {
        assert!(header.contains(words), "{words}");
    }
    assert!(!header.contains("thetahat_arx_13;") && !header.contains("thetahat_armax_13;"));
}

/// The predictor of the motor on a Cortex-M4F.
#[test]
fn the_predictor_of_the_motor_is_small() {
    if !has("arm-none-eabi-gcc") {
        return;
    }
    let folder = motor();
    folder.done("fit dc_motor.csv --time t --na 2 --nb 2 --nk 3 --report r.json");
    for purpose in ["predictor", "simulator"] {
        folder.done(&format!("export r.json --to c --what {purpose} --name motor"));
        let processor =
            ["-mcpu=cortex-m4", "-mthumb", "-mfloat-abi=hard", "-mfpu=fpv4-sp-d16", "-c", "motor.c"];
        done(Command::new("arm-none-eabi-gcc").current_dir(folder.path(".")).args(STRICT).args(processor));
        let size = Command::new("arm-none-eabi-size").arg(folder.path("motor.o")).output().expect("binutils");
        let text = String::from_utf8_lossy(&size.stdout).into_owned();
        let row = text.lines().nth(1).unwrap_or_default().split_whitespace();
        let row: Vec<usize> = row.map_while(|word| word.parse().ok()).collect();
        assert!(matches!(row[..], [code, data, ..] if code + data < 1000), "{text}");
    }
}

#[test]
fn files_tell_where_they_are_from() {
    let folder = motor();
    folder.done("fit dc_motor.csv --time t --na 2 --nb 2 --nk 3 --report r.json");
    let run = folder.done("export r.json --to c --what predictor --out firmware");
    assert!(run.stderr.contains("predictor of ARX(2, 2, 3): r_predictor.h, r_predictor.c"), "{}", run.stderr);
    let header = folder.read("firmware/r_predictor.h");
    for words in [
        "u[0] is 'u', in its own unit, with the offset",
        "y[0] is 'y'",
        "Sample time 0.01 s",
        "'u' acts 3 samples later",
    ] {
        assert!(header.contains(words), "{words}: {header}");
    }
    // The same bytes each time, and another report has another digest.
    folder.done("export r.json --to c --what predictor --out again");
    assert_eq!(folder.read("again/r_predictor.h"), header);
    folder.done("fit dc_motor.csv --time t --na 2 --nb 1 --nk 3 --report r.json");
    folder.done("export r.json --to c --what predictor --out again");
    assert_ne!(folder.read("again/r_predictor.h").lines().nth(1), header.lines().nth(1));
}

#[test]
fn what_cannot_be_exported_is_refused_and_nothing_written() {
    let folder = motor();
    folder.done("fit dc_motor.csv --time t --na 2 --nb 2 --nk 3 --report r.json");
    let before = folder.names();
    for (line, code, words) in [
        (
            "r.json --to c --what observer",
            2,
            "--what: a model of polynomials is exported as no observer; take predictor, simulator",
        ),
        ("r.json --to c --what predictor --name Motor", 2, "--name: 'Motor' is no name"),
        ("r.json --to c --what recursive --name thetahat", 2, "--name: 'thetahat' is no name"),
        ("r.json --to c --what predictor --rows 1..5", 2, "LOG"),
        ("r.json dc_motor.csv --time t --to c --what predictor --rows 1..5000", 3, "rows"),
        ("r.json nowhere.csv --to c --what predictor", 5, "nowhere.csv"),
        ("dc_motor.csv --to c --what predictor", 3, "not a thetahat report"),
        ("r.json dc_motor.csv --sample-time 1 --to c --what predictor", 3, "sample time"),
    ] {
        let run = folder.run(&format!("export {line}"));
        assert_eq!(run.code, code, "{line}: {}", run.stderr);
        assert!(run.stderr.contains(words), "{line}: {}", run.stderr);
    }
    folder.done("fit dc_motor.csv --time t --na 2 --nb 2 --nk 3 --detrend linear --report line.json");
    folder.assert_refused(
        "export line.json --to rust --what simulator",
        3,
        "is a line in the time of its log",
    );
    // In a line, and later.
    let late = "sample_time = 0.01\n[states]\nx = { start = 0, sd = 10 }\n[parameters]\n\
                k = { start = 1, sd = 1, unknown = true }\n\
                [inputs]\nv = { channel = 'u', hold = 'linear' }\n[derivative]\nx = 'k * v(t - 0.02) - x'\n\
                [outputs]\ny = 'x'\n[noise]\nprocess = { x = 1 }\nmeasurement = { y = 1 }\n";
    folder.write("late.toml", late);
    folder.done("fit dc_motor.csv --time t --grey late.toml --report late.json");
    folder.assert_refused(
        "export late.json --to c --what simulator",
        3,
        "goes in straight lines and acts later cannot be exported",
    );
    let own = ["line.json", "late.json", "late.toml"];
    let after: Vec<String> =
        folder.names().into_iter().filter(|name| !own.contains(&name.as_str())).collect();
    assert_eq!(after, before);
}

#[test]
fn controllers_control() {
    // y(t) - 20 = 0.9 (y(t-1) - 20) + 0.2 (u(t-1) - 50), without noise but for a little.
    let (mut text, mut y, mut u, mut random) = ("u,y\n".to_owned(), 20.0_f64, 50.0_f64, Random::new(1));
    for _ in 0..400 {
        y = 20.0 + 0.9 * (y - 20.0) + 0.2 * (u - 50.0) + 5e-4 * random.uniform();
        u = 50.0 + 7.5 * random.uniform();
        text += &format!("{u},{y}\n");
    }
    let folder = Folder::with_log(text);
    folder.done("fit log.csv --sample-time 1 --na 1 --nb 1 --nk 1 --report r.json");
    folder.done("control r.json --poles 0.6 --limits 40..60 --document c.json");
    let run_of = folder.done("export c.json --to c --what controller --name heater");
    assert!(run_of.stderr.contains("controller of ARX(1, 1, 1): heater.h, heater.c"), "{}", run_of.stderr);
    // The loop settles at the set point, within the limits on its way.
    folder.write(
        "heater_test.c",
        "#include \"heater.h\"\nint main(void)\n{\n    heater_state state;\n    float y[1] = {20.0F};\n    float u[1];\n    \
         const float wanted[1] = {25.0F};\n    heater_init(&state);\n    for (int k = 0; k < 300; k += 1) {\n        \
         heater_control(&state, wanted, y, u);\n        if (!(u[0] >= 40.0F && u[0] <= 60.0F)) {\n            return 2;\n        }\n        \
         y[0] = 20.0F + 0.9F * (y[0] - 20.0F) + 0.2F * (u[0] - 50.0F);\n    }\n    \
         heater_applied(&state, u);\n    return !(y[0] > 24.99F && y[0] < 25.01F);\n}\n",
    );
    if has("gcc") {
        let mut command = Command::new("gcc");
        command.current_dir(folder.path(".")).args(STRICT);
        done(command.args(["heater.c", "heater_test.c", "-o", "test_of_c", "-lm"]));
        done(&mut Command::new(folder.path("test_of_c")));
    }
    folder.done("export c.json --to rust --what controller --name heater");
    folder.write(
        "heater_test.rs",
        "#[path = \"heater.rs\"]\nmod heater;\nfn main() {\n    let mut heater = heater::Heater::new().unwrap();\n    let mut y = 20.0;\n    \
         for _ in 0..300 {\n        let u = heater.control(25.0, y);\n        assert!((40.0..=60.0).contains(&u));\n        \
         y = 20.0 + 0.9 * (y - 20.0) + 0.2 * (u - 50.0);\n        heater.applied(u);\n    }\n    assert!((y - 25.0_f32).abs() < 0.01);\n}\n",
    );
    rustc(&folder, "heater");
    // With a log there is a test vector.
    goes_round(&folder, "c.json", "log.csv --sample-time 1", &["controller"]);
    assert!(folder.read("model.csv").starts_with("u1,y1,set_point1,expected1\n"));
    folder.assert_refused(
        "export c.json log.csv --sample-time 2 --to c --what controller",
        3,
        "the controller's 1 s",
    );
    for (line, words) in [
        ("c.json --to c --what predictor", "a controller is exported as no predictor; take controller"),
        ("r.json --to c --what controller", "a model is no controller"),
    ] {
        folder.assert_refused(&format!("export {line}"), 2, words);
    }
}
