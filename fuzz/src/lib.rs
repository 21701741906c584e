//! What is fuzzed: bytes go into all that reads them, and what was read goes into every verb of the library. Whatever
//! the bytes are, nothing panics, takes memory without a bound, or goes on for ever; errors are values.
//!
//! The targets of cargo-fuzz in `fuzz_targets` call these functions. So does `tests/fuzz.rs` of the main workspace, on
//! any Rust, with the seeds and with mutations of them.

use std::f64::consts::PI;
use std::io::Write;
use std::ops::ControlFlow;
use std::path::Path;

use tempfile::NamedTempFile;
use thetahat::Document;
use thetahat::control::{Control, ControlPlan, Design, control};
use thetahat::data::{Channel, Log};
use thetahat::design::ExperimentDesign;
use thetahat::export::{Language, Plan, Precision, Purpose, export, export_controller};
use thetahat::filter::{Estimator, FilterSummary, StateFilter, StateModel};
use thetahat::inspect::{Inspection, TopicList};
use thetahat::model::{GreyBox, Hold, LinearModel, Model};
use thetahat::optimize::Search;
use thetahat::present::{
    Transient, comparison_page, fit_page, response_page, step_test_page, transient_page, tuning_page,
    validation_page,
};
use thetahat::report::{
    Comparison, EquationsPlan, NormalEquations, Report, Validation, ValidationPlan, compare, fit_equations,
    sample, validate,
};
use thetahat::respond::{Draws, Horizon, InitialCondition, logarithmic_frequencies};
use thetahat::spectrum::MeasuredResponse;
use thetahat::step_test::StepTest;
use thetahat::track::{TrackPlan, TrackSummary, Tracker};
use thetahat::tune::{Tuning, TuningPlan, tune};
use thetahat_table::{Bound, Event, Header, Options, Reader, Selection};

/// The rows of the log that models meet.
const ROWS: usize = 60;
/// A model of more channels meets no log.
const CHANNELS: usize = 50;
/// The samples of a response.
const SAMPLES: usize = 50;

/// A log in any format: read as a whole, in parts and row by row, as it says itself and as numbers without a header.
pub fn table(bytes: &[u8]) {
    let mut file = NamedTempFile::new().expect("a place for temporary files");
    file.write_all(bytes).expect("room for a small file");
    let bound = Some(Bound::now(64));
    let plain = Options { bound, ..Options::default() };
    let bare =
        Options { header: Header::None, decimal_comma: Some(true), comment: Some(b'#'), ..plain.clone() };
    for options in [plain, bare] {
        read(file.path(), &options);
    }
}

fn read(path: &Path, options: &Options) {
    let Ok(reader) = Reader::open(path, options) else { return };
    let words = reader.words();
    let clock = reader.times().first().copied();
    let has_one = reader.topics().is_none() && words.len() > 1;
    let time = clock.map(|clock| clock.time).or(has_one.then_some(0));
    let date = clock.and_then(|clock| clock.date);
    let columns = (0..words.len()).filter(|column| ![time, date].contains(&Some(*column)) && !words[*column]);
    let selection = Selection { columns: columns.take(8).collect(), time, date };
    drop(reader.read(&selection, &mut |_, _| {}));
    if let Ok(reader) = Reader::open(path, options) {
        drop(reader.read_parts(&selection, Some(7), &mut |_, _| {}, &mut |_| ControlFlow::Continue(())));
    }
    let Ok(mut stream) =
        Reader::open_live(path, options).and_then(|reader| reader.stream(&selection, true, None))
    else {
        return;
    };
    while let Ok(Event::Row | Event::Malformed(_) | Event::Idle) = stream.advance() {}
}

/// A model in equations or matrices, written in TOML: its filters take some rows, and its unknown parameters are fitted
/// to some.
pub fn equations(bytes: &[u8]) {
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    if let Ok(model) = StateModel::from_toml(text) {
        filter(&model);
    }
    let Ok(model) = GreyBox::from_toml(text) else { return };
    let names: Vec<&str> = model.inputs().iter().chain(model.outputs()).map(String::as_str).collect();
    let Some(log) = log(&names, model.sample_time()) else { return };
    let search = Search { max_iterations: 2, starts: 0, ..Search::default() };
    let plan = EquationsPlan { search, ..EquationsPlan::default() };
    if let Ok(report) = fit_equations(&model, &log, &[], &plan, &|_| ControlFlow::Continue(())) {
        drop(report.to_json());
    }
}

fn filter(model: &StateModel) {
    for estimator in [Estimator::Kalman, Estimator::Extended] {
        let Ok(filter) = StateFilter::new(model.clone(), estimator) else { continue };
        let mut filter = filter.recording();
        for row in 0..5 {
            let inputs: Vec<f64> = (0..model.inputs().len()).map(|place| value(place, row)).collect();
            let outputs: Vec<f64> = (0..model.outputs().len()).map(|place| value(place, row + 3)).collect();
            drop(filter.step(None, &inputs, &outputs));
        }
        drop(filter.smooth());
        drop(filter.summary().to_json());
    }
}

/// A document of any kind, and what the verbs make of it.
pub fn document(bytes: &[u8]) {
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    if let Ok(report) = Report::from_json(text) {
        verbs(&report);
    }
    if let Ok(document) = Control::from_json(text) {
        for plan in plans(&[Purpose::Controller]) {
            drop(export_controller(&document, &plan, None));
        }
    }
    if let Ok(mut document) = NormalEquations::from_json(text) {
        let other = document.clone();
        drop(document.merge(&other));
        drop(document.solve());
    }
    if let Ok(document) = MeasuredResponse::from_json(text) {
        drop(response_page(&document, &[], ""));
    }
    if let Ok(document) = StepTest::from_json(text) {
        drop(step_test_page(&document, None, ""));
    }
    if let Ok(document) = Tuning::from_json(text) {
        drop(tuning_page(&document, ""));
    }
    round::<Control>(text);
    round::<MeasuredResponse>(text);
    round::<StepTest>(text);
    round::<Tuning>(text);
    round::<Validation>(text);
    round::<Comparison>(text);
    round::<ExperimentDesign>(text);
    round::<Inspection>(text);
    round::<TopicList>(text);
    round::<TrackSummary>(text);
    round::<FilterSummary>(text);
}

/// A document that is read is written.
fn round<D: Document>(text: &str) {
    if let Ok(document) = D::from_json(text) {
        drop(document.to_json());
    }
}

/// What the verbs make of a model.
fn verbs(report: &Report) {
    let model = &report.model;
    drop(report.to_json());
    if let Some(log) = log(&model.channels().collect::<Vec<_>>(), model.sample_time()) {
        let validated = validate(report, None, &log, &[], &ValidationPlan::default());
        if let Ok(validated) = validated {
            drop(validation_page(report, &validated, ""));
            let both = [validated.clone(), validated];
            drop(compare(&both));
            drop(comparison_page(&[report.clone(), report.clone()], &both, ""));
            let [one, _] = both;
            drop(fit_page(report, &[one], &[], ""));
        }
        for horizon in [Horizon::Steps { steps: 1 }, Horizon::Steps { steps: 5 }, Horizon::FreeRun] {
            for initial in [InitialCondition::Zero, InitialCondition::Drop, InitialCondition::Estimate] {
                drop(report.apply(&log, &[], None, horizon, initial));
            }
        }
        let draws = Draws { count: 3, seed: 1 };
        drop(sample(model, &log, &[], None, InitialCondition::Zero, &draws));
        for plan in plans(&[Purpose::Predictor, Purpose::Simulator, Purpose::Observer, Purpose::Recursive]) {
            drop(export(report, &plan, Some((&log, &[]))));
        }
    }
    if let Ok(mut tracker) = Tracker::from_report(report, &TrackPlan::default()) {
        for row in 0..10 {
            let inputs: Vec<f64> = (0..model.inputs().len()).map(|place| value(place, row)).collect();
            drop(tracker.log_row(value(7, row), &inputs));
        }
        drop(tracker.forecast(3));
    }
    if let Ok(model) = StateModel::from_report(report, None) {
        filter(&model);
    }
    if let Ok(models) = model.linear("a test") {
        models.iter().for_each(linear);
        let models: Vec<&LinearModel<'_>> = models.iter().collect();
        for kind in [Transient::Step, Transient::Impulse] {
            drop(transient_page(&models, kind, Some(SAMPLES), "", ""));
        }
    }
    for hold in [Hold::Zero, Hold::First, Hold::Tustin] {
        drop(model.to_continuous(hold));
        drop(model.at_sample_time(model.sample_time() / 2.0, Some(hold)));
    }
    drop(report.hankel_singular_values());
    drop(report.reduced(1));
    for design in [
        Design::Poles(Vec::new()),
        Design::Quadratic { input_weight: 1.0 },
        Design::MinimumVariance { input_weight: 0.0 },
    ] {
        if let Ok(found) = control(model, &ControlPlan { draws: 3, ..ControlPlan::new(design) }) {
            drop(found.to_json());
        }
    }
    if let Model::Process(process) = model {
        drop(tune(process, &TuningPlan { input: None, closed_loop_time: None, controller: None }));
    }
}

/// The responses of a linear model.
fn linear(model: &LinearModel<'_>) {
    for samples in [None, Some(SAMPLES)] {
        for input in 0..model.inputs().len().min(3) {
            drop(model.step_response(input, samples));
            drop(model.impulse_response(input, samples));
        }
    }
    let nyquist = PI / model.sample_time();
    if let Ok(frequencies) = logarithmic_frequencies(nyquist / 100.0, nyquist, 9) {
        drop(model.frequency_response(&frequencies));
    }
}

/// A log of the channels of a model.
fn log(names: &[&str], sample_time: f64) -> Option<Log> {
    if names.len() > CHANNELS {
        return None;
    }
    let channel = |(place, name): (usize, &&str)| Channel {
        name: (*name).to_owned(),
        values: (0..ROWS).map(|row| value(place, row)).collect(),
    };
    Log::new(names.iter().enumerate().map(channel).collect(), sample_time).ok()
}

/// A value of a channel: small, and no simple function of the row.
fn value(channel: usize, row: usize) -> f64 {
    let mixed = (row * 2_654_435_761 + channel * 40_503) % 1009;
    mixed as f64 / 504.5 - 1.0
}

/// Exports in both languages and precisions.
fn plans(purposes: &[Purpose]) -> Vec<Plan> {
    let of =
        |purpose: &Purpose| {
            [(Language::C, Precision::F32), (Language::Rust, Precision::F64)].map(|(language, precision)| {
                Plan { language, purpose: *purpose, precision, name: "model".to_owned() }
            })
        };
    purposes.iter().flat_map(of).collect()
}
