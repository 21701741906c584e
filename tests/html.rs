//! Pages as a browser shows them: charts are drawn, nothing is loaded, names do nothing.

use std::fmt::Write;
use std::fs;
use std::path::{Path, PathBuf};

use serde_json::{Value, json};
use thetahat::data::{Channel, Detrend, Log, Recording, Source, Times};
use thetahat::inspect::{Inspection, InspectionPlan, inspect};
use thetahat::model::{Model, Orders, PolynomialModel};
use thetahat::present::{comparison_page, fit_page, inspection_page, validation_page};
use thetahat::report::{Plan, Report, Validated, ValidationPlan, identify, validate};

use crate::browser::Browser;
use crate::fit_reference::folder_with;
use crate::harness::{Folder, Run};
use crate::signals::Random;

/// Names that would do harm if they were taken for anything but names.
const INPUT: &str = "</script><img src=x onerror=\"window.__hacked=1\">";
const OUTPUT: &str = "<b>speed</b> \"'&amp; 🚀";
const FILE: &str = "<img src=x onerror=window.__hacked=1>\"🚀'.csv";
const MODEL: &str = "<i>model<script>'";
/// The file's name up to where a shell wants it quoted.
const BEGINNING: &str = "<img src=x onerror=window.__hacked=1>\"🚀";

/// Input and output of a second-order system, with a gap in the output and a value that stands out of it by `peak`.
fn signals(rows: usize, peak: f64) -> [Vec<f64>; 2] {
    let (source, e) = (Random::new(1).signal(rows), Random::new(2).signal(rows));
    let u: Vec<f64> = (0..rows).map(|t| if source[t / 9 * 9] > 0.0 { 3.0 } else { 1.0 }).collect();
    let mut y = vec![20.0; rows];
    for t in 2..rows {
        let past = 1.5 * (y[t - 1] - 20.0) - 0.7 * (y[t - 2] - 20.0);
        y[t] = 20.0 + past + 0.5 * (u[t - 1] - 2.0) + 0.25 * (u[t - 2] - 2.0) + 0.2 * e[t];
    }
    y[rows / 2..rows / 2 + rows / 50].fill(f64::NAN);
    y[rows / 4] += peak;
    [u, y]
}

/// A folder with the log of such signals.
fn logged(file: &str, names: [&str; 2], rows: usize, peak: f64) -> Folder {
    let quoted = |name: &str| format!("\"{}\"", name.replace('"', "\"\""));
    let mut csv = format!("t,{},{}\n", quoted(names[0]), quoted(names[1]));
    let [u, y] = signals(rows, peak);
    for (t, (u, y)) in u.iter().zip(&y).enumerate() {
        let y = if y.is_nan() { String::new() } else { format!("{y:.4}") };
        writeln!(csv, "{:.1},{u},{y}", 0.1 * t as f64).expect("the case is sound");
    }
    let folder = Folder::new();
    folder.write(file, csv);
    folder
}

fn hostile() -> Folder {
    logged(FILE, [INPUT, OUTPUT], 900, 0.0)
}

/// Runs the program on files of any name, with a page as one of its outputs.
fn page(folder: &Folder, line: &str, files: &[&str]) -> PathBuf {
    let mut command = folder.command(&format!("{line} --html page.html"));
    command.args(files);
    let run = Run::of(command);
    assert_eq!(run.code, 0, "{line} {files:?}: {}", run.stderr);
    folder.path("page.html")
}

/// The same, for a fit of the hostile log.
fn fit_page_of(folder: &Folder, line: &str) -> PathBuf {
    page(folder, &format!("fit --time t {line}"), &["-u", INPUT, "-y", OUTPUT, FILE])
}

/// The parts of the log that a model is fitted to, and validated on.
const PARTS: &str = "--estimate 1..600 --validate 601..900";

/// Opens a page and checks what all pages promise: this many charts with curves in them, a silent console, no request.
fn opened(browser: &mut Browser, path: &Path, charts: usize) {
    browser.open(path, 1200);
    let drawn = browser.value(
        "[...document.querySelectorAll('.chart')].map((chart) => \
         chart.querySelectorAll('svg.main-svg .scatterlayer .trace path, svg.main-svg .barlayer .point path').length)",
    );
    let drawn: Vec<u64> = drawn.as_array().expect("an array").iter().filter_map(Value::as_u64).collect();
    assert_eq!(drawn.len(), charts);
    assert!(drawn.iter().all(|curves| *curves > 0), "{drawn:?}");
    assert_eq!(browser.complaints(), Vec::<String>::new());
    let address = format!("file://{}", path.display());
    assert_eq!(browser.addresses(), [address]);
    assert_eq!(browser.value("typeof window.__hacked"), json!("undefined"));
    assert_eq!(
        browser.value("document.querySelectorAll('main b, main i, main img, header script').length"),
        json!(0)
    );
}

/// Whether a text stands in some element of the page, literally.
fn stands(browser: &mut Browser, selector: &str, text: &str) {
    let found = browser.value(&format!(
        "[...document.querySelectorAll({})].map((element) => element.textContent)",
        json!(selector)
    ));
    let found: Vec<&str> = found.as_array().expect("an array").iter().filter_map(Value::as_str).collect();
    assert!(found.iter().any(|found| found.contains(text)), "{text} is not in {selector}: {found:?}");
}

/// Where one model predicts best and another simulates best, both are drawn on rows that neither was fitted to.
#[test]
fn a_choice_between_two_purposes_is_shown() {
    let folder = folder_with("hair_dryer.csv");
    let page = |line: &str| {
        folder.done(&format!("fit log.csv --estimate 1..600 {line} --html page.html --report report.json"));
        folder.read("page.html")
    };
    let of_both = page("");
    let report: Value = serde_json::from_str(&folder.read("report.json")).expect("a document");
    let orders = |purpose: &str| report["selection"]["winners"][purpose]["orders"].clone();
    assert_ne!(orders("prediction"), orders("simulation"));
    assert!(of_both.contains("Free runs on held-out rows"));
    for purpose in ["for prediction: ", "for simulation: "] {
        assert!(of_both.contains(purpose), "{purpose}");
    }
    assert!(!page("--focus prediction").contains("Free runs on held-out rows"));
    assert!(!page("--na 2 --nb 2 --nk 3").contains("Free runs on held-out rows"));
}

#[test]
fn a_fit_is_shown_with_its_names_as_they_are() {
    let Some(mut browser) = Browser::start("a_fit_is_shown_with_its_names_as_they_are") else { return };
    let folder = hostile();
    let again = || fs::read(fit_page_of(&folder, "--split 60/20/20")).expect("the case is sound");
    assert!(again() == again(), "the same input gives the same bytes");
    // Output, two times two correlations, search, delays and runs on held-out rows, Bode of input and noise, step,
    // impulse, roots.
    opened(&mut browser, &folder.path("page.html"), 13);
    stands(&mut browser, "h1", OUTPUT);
    stands(&mut browser, "h1", FILE);
    stands(&mut browser, "figure h3", INPUT);
    stands(&mut browser, "tbody th", FILE);
    stands(&mut browser, ".note li", "misses");
    stands(&mut browser, "footer code", BEGINNING);
    stands(&mut browser, ".chart .ytitle", OUTPUT);
    // As far as there is room in a chart.
    stands(&mut browser, ".chart text", &INPUT[..40]);
    assert_eq!(
        browser.value("document.querySelectorAll('.main-svg tspan[style*=bold], .main-svg a').length"),
        json!(0)
    );

    // Hover: what is under the mouse is said.
    let place = browser.value(
        "(() => { const box = document.querySelector('.chart .nsewdrag').getBoundingClientRect(); \
         return [box.x + box.width / 3, box.y + box.height / 2, box.width]; })()",
    );
    let place: Vec<f64> =
        place.as_array().expect("the case is sound").iter().filter_map(Value::as_f64).collect();
    let (x, y, width) = (place[0], place[1], place[2]);
    browser.mouse(&[(x, y), (x + 5.0, y)], false);
    browser.wait_for("document.querySelectorAll('.hoverlayer text').length > 1");
    stands(&mut browser, ".hoverlayer text", "measured");
    // Zoom: the clock of all panels shows what was dragged over.
    let range = "document.querySelector('.chart')._fullLayout.xaxis.range.map(Number)";
    let span = |value: Value| {
        value[1].as_f64().expect("the case is sound") - value[0].as_f64().expect("the case is sound")
    };
    let whole = span(browser.value(range));
    browser.mouse(&[(x, y), (x + width / 8.0, y), (x + width / 4.0, y)], true);
    let zoomed = span(browser.value(range));
    assert!((zoomed / whole - 0.25).abs() < 0.05, "{whole} s, then {zoomed} s");
    assert_eq!(browser.complaints(), Vec::<String>::new());
}

/// Takes 15 s: Chromium draws five pages and waits for their charts.
#[test]
fn other_pages_are_shown() {
    let Some(mut browser) = Browser::start("other_pages_are_shown") else { return };
    let folder = hostile();
    let models = ["oe", "armax", "series"].map(|name| format!("{MODEL}{name}.json"));
    let models = models.each_ref().map(String::as_str);
    let orders =
        ["--model oe --nb 2 --nf 2 --nk 1", "--model armax --na 2 --nb 2 --nc 1 --nk 1", "--na 3 --nb 0"];
    for (orders, model) in orders.iter().zip(&models) {
        let mut command = folder.command(&format!("fit --time t {orders} {PARTS}"));
        command.args(["-y", OUTPUT, "--report", model, FILE]);
        if !orders.ends_with("--nb 0") {
            command.args(["-u", INPUT]);
        }
        let run = Run::of(command);
        assert_eq!(run.code, 0, "{}", run.stderr);
    }

    let path = page(&folder, "validate --time t", &[models[0], FILE]);
    // Output, two correlations, Bode, step, impulse, roots: the noise is taken as white.
    opened(&mut browser, &path, 7);
    stands(&mut browser, "h1", models[0]);
    stands(&mut browser, "figure h3", INPUT);
    // Output error says nothing of the noise.
    stands(&mut browser, "main p", "not asked to be white");

    // Without an input.
    let path = page(&folder, "validate --time t", &[models[2], FILE]);
    opened(&mut browser, &path, 4);
    stands(&mut browser, "main p", "no step response");

    let path = page(&folder, "compare --time t", &[models[0], models[1], models[2], FILE]);
    // Free run, one step, autocorrelations, Bode of input and noise, step, impulse.
    opened(&mut browser, &path, 7);
    stands(&mut browser, ".legend text", models[1]);
    // One model twice.
    let path = page(&folder, "compare --time t", &[models[1], models[1], FILE]);
    opened(&mut browser, &path, 7);
    stands(&mut browser, ".legend text", &format!("{} (2)", models[1]));

    let folder = logged(FILE, [INPUT, OUTPUT], 900, 25.0);
    let path = page(&folder, "inspect --time t", &["-u", INPUT, "-y", OUTPUT, FILE]);
    // Channels, spectrum, correlation, impulse response.
    opened(&mut browser, &path, 4);
    stands(&mut browser, "main code", BEGINNING);
    stands(&mut browser, ".legend text", "outliers");
    stands(&mut browser, "tbody th", INPUT);
}

/// Takes 15 s: Chromium draws the page at three widths, and prints it.
#[test]
fn a_page_fits_a_phone_the_dark_and_paper() {
    let Some(mut browser) = Browser::start("a_page_fits_a_phone_the_dark_and_paper") else { return };
    let folder = hostile();
    let path = fit_page_of(&folder, &format!("--model bj --nb 2 --nc 1 --nd 2 --nf 2 --nk 1 {PARTS}"));
    // Output, two times two correlations, Bode of input and noise, step, impulse, roots.
    opened(&mut browser, &path, 10);

    browser.open(&path, 390);
    assert_eq!(browser.value("document.documentElement.scrollWidth <= innerWidth"), json!(true));
    let widest = "Math.max(...[...document.querySelectorAll('svg.main-svg')].map((svg) => svg.getBoundingClientRect().right))";
    assert!(browser.value(widest).as_f64().expect("the case is sound") <= 390.0);

    browser.open(&path, 1200);
    let colours = "['html', '.chart .xtick text', '.chart .bg'].map((name) => document.querySelector(name)) \
                   .map((element) => getComputedStyle(element)).map((style) => [style.backgroundColor, style.fill, style.fillOpacity])";
    for (scheme, ground, text) in [
        ("light", "rgb(255, 255, 255)", "rgb(27, 31, 36)"),
        ("dark", "rgb(21, 24, 28)", "rgb(230, 233, 236)"),
    ] {
        let features = json!({"features": [{"name": "prefers-color-scheme", "value": scheme}]});
        browser.call("Emulation.setEmulatedMedia", features);
        let found = browser.value(colours);
        assert_eq!((&found[0][0], &found[1][1]), (&json!(ground), &json!(text)), "{scheme}");
        // Charts let the ground through.
        assert_eq!(found[2][2], json!("0"), "{scheme}");
    }

    // On paper charts are as wide as it, and all there.
    browser.value("dispatchEvent(new Event('beforeprint'))");
    assert!(
        browser.value(widest).as_f64().expect("the case is sound")
            - browser.value("document.body.getBoundingClientRect().x").as_f64().expect("the case is sound")
            <= 700.0
    );
    browser.value("dispatchEvent(new Event('afterprint'))");
    let pdf = browser.call("Page.printToPDF", json!({"paperWidth": 8.27, "paperHeight": 11.69}));
    assert!(pdf["data"].as_str().expect("the case is sound").len() > 100_000);
    assert_eq!(browser.complaints(), Vec::<String>::new());
}

/// Takes 15 s: the fit of a million rows, which has to be that long to be slow if pages hold all samples.
#[test]
fn a_million_samples_open_at_once() {
    let Some(mut browser) = Browser::start("a_million_samples_open_at_once") else { return };
    let folder = logged("log.csv", ["u", "y"], 1_000_000, 25.0);
    let line = "fit --time t --na 2 --nb 2 --estimate 1..666666 --validate 666667..1000000";
    let path = page(&folder, line, &["log.csv"]);
    let size = fs::metadata(&path).expect("the case is sound").len();
    assert!(size < 8_000_000, "{size} bytes");
    // One chart more than of a short log: some rows one by one.
    opened(&mut browser, &path, 11);
    // The peak stays.
    let peak = "Math.max(...document.querySelector('.chart').data.flatMap((trace) => trace.yaxis === 'y' ? trace.y : []))";
    assert!(browser.value(peak).as_f64().expect("the case is sound") > 40.0);
    // Whatever else runs on the machine.
    let before = browser.work();
    browser.open(&path, 1200);
    let work = browser.work() - before;
    println!("{size} bytes, all charts drawn in {work:.2} s of processor time");
    assert!(work > 0.05 && work < 2.0, "{work} s");
}

#[test]
fn several_logs_stand_one_behind_the_other() {
    let folder = logged("log.csv", ["u", "y"], 300, 0.0);
    folder.write(FILE, folder.read("log.csv"));
    page(&folder, "fit --time t --na 2 --nb 2", &["log.csv", FILE]);
    let outputs = &charts(&folder.read("page.html"))[0];
    for trace in outputs["data"].as_array().expect("the case is sound") {
        let x: Vec<f64> =
            trace["x"].as_array().expect("the case is sound").iter().filter_map(Value::as_f64).collect();
        // Both begin at 0 s and end at 29.9 s.
        assert!(x.is_sorted() && x.last().is_some_and(|last| *last > 59.8), "{trace}");
    }
    let label = |position: usize| outputs["layout"]["annotations"][position]["text"].as_str();
    assert_eq!(label(0), Some("log.csv"));
    assert!(label(1).is_some_and(|text| text.starts_with("&lt;img src=x onerror")), "{:?}", label(1));
}

/// The charts' JSON, which must be such, and without what JSON does not have.
fn charts(page: &str) -> Vec<Value> {
    let parts = page.split("<script type=\"application/json\">").skip(1);
    parts
        .map(|part| {
            let json = part.split("</script>").next().unwrap_or_default();
            serde_json::from_str(json).expect("a chart is JSON")
        })
        .collect()
}

/// A short log.
fn short() -> Vec<Channel> {
    let named = ["u", "y"].into_iter().zip(signals(300, 0.0));
    named.map(|(name, values)| Channel { name: name.to_owned(), values }).collect()
}

/// A model of it, and how that does on all of it.
fn modelled(orders: Orders) -> (Report, Validated) {
    let log = Log::new(short(), 0.1).expect("the case is sound");
    let plan = Plan { detrend: Detrend::Mean, ..Plan::new(&["u"], "y", orders) };
    let report = identify(log.clone(), &[], &plan).expect("the case is sound");
    let validated =
        validate(&report, None, &log, &[], &ValidationPlan::default()).expect("the case is sound");
    (report, validated)
}

fn polynomials(report: &mut Report) -> &mut PolynomialModel {
    let own = if let Model::Polynomial(model) = &mut report.model { Some(model) } else { None };
    own.expect("the case is sound")
}

fn inspected() -> Inspection {
    let source = Source {
        file: "log.csv".to_owned(),
        rows: "1..300".parse().expect("the case is sound"),
        time: None,
        start: None,
        resampled: None,
    };
    let plan = InspectionPlan { inputs: vec!["u".to_owned()], output: Some("y".to_owned()), resample: None };
    inspect(Recording { channels: short(), times: Times::Uniform(0.1) }, &source, &plan)
        .expect("the case is sound")
}

#[test]
fn pages_do_without_what_is_missing() {
    let (complete_report, complete) = modelled(Orders::oe(&[2], &[2], &[1]).expect("the case is sound"));
    let page = validation_page(&complete_report, &complete, "");
    assert_eq!(charts(&page).len(), 7);
    // Nothing to load, whatever reads the page.
    let (own, _) = page.split_once("* plotly.js (basic").expect("the case is sound");
    assert!(!["http:", "https:", "src=\"", "@import", "url("].iter().any(|outside| own.contains(outside)));

    // No covariance, no residuals, no prediction, no free run.
    let mut report = complete_report.clone();
    let model = polynomials(&mut report);
    model.covariance = None;
    let roots = model.poles.iter_mut().chain(model.zeros.iter_mut().flatten());
    roots.for_each(|root| root.covariance = None);
    let mut poor = complete.clone();
    poor.validation.residuals.clear();
    poor.validation.fit.iter_mut().for_each(|fit| fit.percent = None);
    poor.signals.outputs[0].predicted.fill(f64::NAN);
    poor.signals.outputs[0].simulated = None;
    let page = validation_page(&report, &poor, "");
    assert_eq!(charts(&page).len(), 5);
    assert!(page.contains("There are no residuals to test") && page.contains("The uncertainty is not known"));
    assert!(!page.contains("95 % band"));

    // An unstable model, of which the free run overflows; residuals that are constant.
    let (mut report, mut poor) = modelled(Orders::arx(1, &[1], &[1]).expect("the case is sound"));
    let pole = -1.3;
    let model = polynomials(&mut report);
    model.a[1] = pole;
    model.poles[0].re = -pole;
    model.stable = false;
    let overflow = |t: usize| if t < 200 { 1e308 } else { f64::INFINITY };
    poor.signals.outputs[0].simulated = Some((0..300).map(overflow).collect());
    if let Some(residuals) = poor.validation.residuals.first_mut() {
        residuals.autocorrelation.iter_mut().skip(1).for_each(|value| *value = f64::NAN);
        residuals.independence[0].correlation.fill(f64::NAN);
    }
    let page = validation_page(&report, &poor, "");
    assert_eq!(charts(&page).len(), 6);
    assert!(page.contains("unstable") && page.contains("grows without bound"));

    // A pole on the unit circle, where the frequency response has none.
    polynomials(&mut report).a[1] = 1.0;
    let page = validation_page(&report, &poor, "");
    assert!(page.contains("the model has no finite response at"));

    // No signals, no models, no channels.
    let page = fit_page(&complete_report, &[], &[], "");
    assert!(page.contains("no signals to show"));
    assert!(comparison_page(&[], &[], "").expect("the case is sound").contains("Comparison of 0 models"));
    assert!(comparison_page(&[complete_report], &[], "").is_err());
    let mut nothing = inspected();
    nothing.delays[0].correlation.clear();
    nothing.delays[0].impulse_response.clear();
    let page = inspection_page(&nothing, &[], &[], "");
    assert_eq!(charts(&page).len(), 1);
    assert!(page.contains("There is no correlation of u"));
    (nothing.excitation, nothing.delays, nothing.feedback, nothing.command) = (vec![], vec![], vec![], None);
    nothing.channels.clear();
    assert_eq!(charts(&inspection_page(&nothing, &[], &[], "")).len(), 0);
    let flat = [("flat".to_owned(), vec![1.0; 5]), ("none".to_owned(), vec![f64::NAN; 5])];
    assert_eq!(charts(&inspection_page(&nothing, &flat, &[0.0, 1.0, 2.0, 3.0, 4.0], "")).len(), 1);
}
