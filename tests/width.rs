//! Numbers, tables and messages have a width; what is not known has no number; a log has a size.

use std::fmt::Write;

use crate::harness::{Folder, Run};
use crate::signals::{Experiment, Random, csv, response};

/// What a person reads at once.
const WIDTH: usize = 80;
/// The widest number.
const NUMBER: usize = 12;

/// No line of a table is wider than a page, and no number in it either.
fn assert_legible(text: &str) {
    for line in text.lines() {
        // What is to be typed stays in one line.
        assert!(line.chars().count() <= WIDTH || line.starts_with("thetahat fit"), "{line}");
    }
    assert_short(text);
}

/// No number is wide, and none is a NaN.
fn assert_short(text: &str) {
    for word in text.split(|c: char| c.is_whitespace() || "(),;:%i".contains(c)) {
        match word.parse::<f64>() {
            Ok(number) => assert!(number.is_finite() && word.len() <= NUMBER, "{word}: {text}"),
            Err(_) => assert!(!["NaN", "inf", "-inf"].contains(&word), "{text}"),
        }
    }
}

/// A model of a plant that grows, fitted to its beginning, and a log so long that its free run leaves all bounds.
fn diverging() -> Folder {
    let mut random = Random::new(3);
    let u = random.signal(1500);
    let e: Vec<f64> = random.signal(1500).iter().map(|e| 0.01 * e).collect();
    let grown = response(&[1.0, -1.2], &[(&[0.0, 1.0], &u)], &e);
    let folder = Folder::with_log(csv(&[("u", &u[..60]), ("y", &grown[..60])]));
    folder.done("fit log.csv --detrend none --na 1 --nb 1 --report model.json");
    folder.write("long.csv", csv(&[("u", &u), ("y", &e)]));
    folder
}

#[test]
fn a_free_run_that_diverges_has_figures_of_twelve_characters() {
    let folder = diverging();
    let table = folder.done("validate model.json long.csv --html page.html").stdout;
    assert_legible(&table);
    let free = table.lines().find(|line| line.contains("free run")).expect("there is a free run");
    assert!(free.contains('e'), "{free}");
    assert_legible(&folder.done("compare model.json model.json long.csv").stdout);
    let said = folder.done("simulate model.json long.csv -o out.csv").stderr;
    assert_short(&said);
    let page = folder.read("page.html");
    let cells = page.split("<td").skip(1).filter_map(|cell| cell.split_once('>')?.1.split('<').next());
    for cell in cells {
        for word in cell.split_whitespace() {
            assert!(word.parse::<f64>().is_err() || word.len() <= NUMBER, "{cell}");
            assert!(!["NaN", "inf", "-inf"].contains(&word), "{cell}");
        }
    }
}

#[test]
fn every_table_fits_a_page() {
    let Experiment { u, y } = Experiment::new(300);
    let folder = Folder::with_log(csv(&[("a_long_name_of_an_input_channel", &u), ("y", &y)]));
    let channels = "-u a_long_name_of_an_input_channel";
    assert_legible(&folder.done(&format!("inspect log.csv {channels} -y y")).stdout);
    for (name, model) in
        [("one", "--model bj --nb 2 --nc 1 --nd 1 --nf 2"), ("two", "--na 2 --nb 2"), ("three", "")]
    {
        let line = format!("fit log.csv {channels} {model} --report {name}.json");
        assert_legible(&folder.done(&line).stdout);
        assert_legible(&folder.done(&format!("validate {name}.json log.csv --require stable")).stdout);
    }
    let table = folder.done("compare one.json two.json three.json one.json two.json log.csv").stdout;
    assert_legible(&table);
    // The models that did not fit beside the others stand below, by the same rows.
    assert_eq!(table.lines().filter(|line| line.starts_with("stable ")).count(), 3, "{table}");
    let tracked = folder.done(&format!("track log.csv {channels} --na 2 --nb 2 --forgetting 1,0.99 -o out"));
    assert_legible(&tracked.stderr);
}

#[test]
fn signs_and_orders_have_a_legend() {
    let folder = Folder::with_log(Experiment::new(300).csv());
    // Of the largest error there are no standard errors.
    let table = folder.done("fit log.csv --na 2 --nb 2 --norm inf").stdout;
    assert!(table.contains("\n-: the way it was estimated gives no standard error\n"), "{table}");
    let table = folder.done("fit log.csv --na 1..3 --nb 1..3 --select aic --report a.json").stdout;
    assert!(table.contains("\norders: ARX(na, nb, nk)\n"), "{table}");
    assert!(table.contains("\nAIC: for each sample, on the "), "{table}");
    assert!(table.contains("; per sample AIC "), "{table}");
    let table = folder.done("validate a.json log.csv").stdout;
    assert!(table.contains("\norders: ARX(na, nb, nk)\n"), "{table}");
}

/// A log of many columns, of which one has an outlier and one is constant.
fn wide(columns: usize, rows: usize) -> String {
    let mut random = Random::new(11);
    let names: Vec<String> = (0..columns).map(|k| format!("c{k}")).collect();
    let mut log = format!("u,y,{}\n", names.join(","));
    for row in 0..rows {
        // Writing to a string cannot fail.
        let _ = write!(log, "{:.3},{:.3}", random.uniform(), random.uniform());
        for column in 0..columns {
            let value = match (column, row) {
                (100, 7) => 1e6,
                (200, _) => 2.0,
                _ => random.uniform(),
            };
            let _ = write!(log, ",{value:.3}");
        }
        log.push('\n');
    }
    log
}

#[test]
fn of_twenty_thousand_columns_the_ten_that_matter_are_shown() {
    let folder = Folder::with_log(wide(20_000, 60));
    let run = folder.done("inspect log.csv");
    assert_legible(&run.stdout);
    assert!(run.stdout.lines().count() < 60, "{}", run.stdout);
    for name in ["u ", "y ", "c100 ", "c200 "] {
        let shown = run.stdout.lines().filter(|line| line.starts_with(name)).count();
        assert!(shown >= 2, "{name}: {}", run.stdout);
    }
    assert!(run.stdout.contains("and 19992 more channels, which the JSON document has\n"), "{}", run.stdout);
    let names = (0..30).map(|k| format!("n{k}")).collect::<Vec<_>>().join(",");
    folder.write("log.csv", format!("u,y,{names}\n1,2{}\n2,3{}\n", ",x".repeat(30), ",x".repeat(30)));
    let run = folder.done("inspect log.csv");
    assert!(run.stdout.contains("27 more columns are left out for the same reason"), "{}", run.stdout);
}

#[test]
fn a_pipe_gets_its_messages_in_one_line() {
    let folder = diverging();
    let run = folder.run("validate model.json long.csv");
    let wide = run.stderr.lines().filter(|line| line.chars().count() > WIDTH).count();
    assert!(wide > 0 && run.stderr.lines().all(|line| line.starts_with("warning: ")), "{}", run.stderr);
}

/// A log that is larger than the memory that the program may have.
#[test]
#[cfg(target_os = "linux")]
fn a_log_that_memory_does_not_hold_is_refused_with_the_number() {
    use std::io::Write;
    use std::process::Command;

    let mut packed = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
    packed.write_all(b"u,y\n").unwrap();
    (0..300).for_each(|_| packed.write_all("1,2\n3,1\n".repeat(10_000).as_bytes()).unwrap());
    let folder = Folder::with_log(packed.finish().unwrap());
    let limited = |line: &str| {
        let inner = folder.command(line);
        let mut command = Command::new("sh");
        command.arg("-c").arg("ulimit -v 500000; exec \"$0\" \"$@\"").arg(inner.get_program());
        command.args(inner.get_args()).current_dir(folder.path("")).env("RAYON_NUM_THREADS", "2");
        Run::of(command)
    };
    for (verb, more) in [("inspect", ""), ("fit", "--na 1 --nb 1 --report model.json")] {
        let run = limited(&format!("{verb} log.csv {more}"));
        assert_eq!(run.code, 3, "{}", run.stderr);
        let line = run.refusal();
        for part in ["log.csv:", "does not fit into memory", "MB at 64 bytes each", "are free", "columns"] {
            assert!(line.contains(part), "{line}");
        }
        assert_eq!(folder.names(), ["log.csv"]);
    }
    // Another time the memory may be there: such a failure is not kept.
    let each = "fit --each log.csv --na 1 --nb 1 --constant no --table t.csv --reports out";
    assert_eq!(limited(each).code, 3);
    let done = folder.run(each);
    assert!(!done.stdout.contains("earlier run"), "{}", done.stdout);
    assert!(!folder.read("t.csv").contains("does not fit into memory"));
}
