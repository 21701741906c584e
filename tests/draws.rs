//! Runs drawn from what a model leaves open.

use crate::harness::{Answer, Folder};
use crate::signals::plain_log;

fn folder() -> Folder {
    let folder = Folder::with_log(plain_log());
    folder.done("fit log.csv --na 2 --nb 2 --estimate 1..100 --report model.json");
    folder
}

/// The columns of a CSV by name; what is empty is NaN.
fn columns(text: &str) -> (Vec<String>, Vec<Vec<f64>>) {
    let mut reader = csv::Reader::from_reader(text.as_bytes());
    let names: Vec<String> = reader.headers().expect("there is a header").iter().map(str::to_owned).collect();
    let mut columns = vec![Vec::new(); names.len()];
    for row in reader.records() {
        for (column, cell) in columns.iter_mut().zip(row.expect("columns of one length").iter()) {
            column.push(cell.parse().unwrap_or(f64::NAN));
        }
    }
    (names, columns)
}

#[test]
fn bands_are_the_mean_and_quantiles_of_the_runs_and_hold_the_output() {
    let folder = folder();
    let line = "simulate model.json log.csv --rows 101..200 --draws 400 --seed 7 --draws-file runs.csv";
    let run = folder.done(line);
    let (names, bands) = columns(&run.stdout);
    assert_eq!(names, ["row", "measured", "predicted", "mean", "quantile_0.025", "quantile_0.975"]);
    let (names, runs) = columns(&folder.read("runs.csv"));
    assert_eq!((names.len(), names[400].as_str(), runs[0].len()), (401, "draw_400", 100));
    assert_eq!(runs[0], bands[0]);
    let mut inside = 0;
    for row in 0..100 {
        let mut values: Vec<f64> = runs[1..].iter().map(|run| run[row]).collect();
        values.sort_by(f64::total_cmp);
        assert!((bands[3][row] - values.iter().sum::<f64>() / 400.0).abs() < 1e-9);
        // 0.025 * 399 = 9.975
        let quantile = values[9] + 0.975 * (values[10] - values[9]);
        assert!((bands[4][row] - quantile).abs() < 1e-9, "{row}");
        inside += usize::from((bands[4][row]..=bands[5][row]).contains(&bands[1][row]));
    }
    assert!((85..=100).contains(&inside), "{inside} of 100 outputs in their bands");
    // What simulate says stays: the run of the estimate itself.
    let plain = Answer::read(&folder.done("simulate model.json log.csv --rows 101..200").stdout);
    let predicted: Vec<f64> = plain.predicted.iter().flatten().copied().collect();
    assert_eq!(predicted, bands[2]);
    // The same seed, on one thread.
    let mut command = folder.command(line);
    command.env("RAYON_NUM_THREADS", "1");
    assert_eq!(String::from_utf8(command.output().unwrap().stdout).unwrap(), run.stdout);
    assert!(folder.done(&line.replace("--seed 7", "--seed 8")).stdout != run.stdout);
}

#[test]
fn what_the_draws_cannot_say_is_told() {
    let folder = folder();
    // No covariance: the noise alone.
    folder.done("fit log.csv --na 2 --nb 2 --norm inf --report bounded.json");
    let run = folder.done("simulate bounded.json log.csv --draws 5");
    assert!(run.stderr.contains("the draws differ in their noise alone"), "{}", run.stderr);
    // Inputs alone start from rest.
    let inputs: String =
        plain_log().lines().map(|row| format!("{}\n", row.split(',').next().unwrap())).collect();
    folder.write("inputs.csv", inputs);
    let (names, bands) = columns(&folder.done("simulate model.json inputs.csv --draws 20").stdout);
    assert_eq!((names.len(), bands[3].len()), (6, 200));
    assert!(bands[1].iter().all(|value| value.is_nan()) && bands[3].iter().all(|value| value.is_finite()));
    for (options, code) in
        [("--draws 0", 2), ("--seed 3", 2), ("--draws-file runs.csv", 2), ("--draws 200000", 2)]
    {
        assert_eq!(folder.run(&format!("simulate model.json log.csv {options}")).code, code, "{options}");
    }
    folder.done("predict model.json log.csv");
}

#[test]
fn bands_go_on_where_an_output_is_missing() {
    let folder = folder();
    let mut rows: Vec<String> = plain_log().lines().map(str::to_owned).collect();
    for row in &mut rows[120..130] {
        let (u, _) = row.split_once(',').unwrap();
        *row = format!("{u},");
    }
    folder.write("holes.csv", rows.join("\n") + "\n");
    let (_, bands) = columns(&folder.done("simulate model.json holes.csv --rows 101..200 --draws 50").stdout);
    let inside = |row: usize| bands[3][row].is_finite() && bands[4][row] < bands[5][row];
    assert!(bands[1][19].is_nan() && bands[1][28].is_nan(), "{:?}", &bands[1][15..35]);
    assert!((0..100).all(inside), "{:?}", &bands[3][10..35]);
}
