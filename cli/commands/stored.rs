//! What `fit` wrote, read back.

use std::fs::File;
use std::io::{self, BufRead, Read};
use std::path::Path;

use serde_json::Value;
use thetahat::Document;
use thetahat::model::{LinearModel, Model, PolynomialModel};
use thetahat::options::Options;
use thetahat::plan::FitOptions;
use thetahat::report::Report;
use thetahat::spectrum::MeasuredResponse;

use crate::failure::{Failure, Kind};

/// A report has this many bytes at most: beyond it the file is something else.
const LARGEST_REPORT: u64 = 1 << 30;
/// The first bytes of a file say what it is.
const HEAD: u64 = 4096;
/// UTF-8 may begin with it.
const MARK: &[u8] = b"\xef\xbb\xbf";

/// The model of a stored report.
pub(super) fn model(path: &Path) -> Result<Model, Failure> {
    Ok(report(path)?.model)
}

/// The polynomials of a stored model, of which alone `what` is known.
pub(super) fn polynomials<'m>(
    path: &Path,
    model: &'m Model,
    what: &str,
) -> Result<&'m PolynomialModel, Failure> {
    model.polynomials(what).map_err(|error| refused(path, error))
}

/// What a stored model is from its inputs to each output, if it is linear: `what` needs it to be.
pub(super) fn linear<'m>(path: &Path, model: &'m Model, what: &str) -> Result<Vec<LinearModel<'m>>, Failure> {
    model.linear(what).map_err(|error| refused(path, error))
}

/// What the library says of a stored model: the file stands for the argument.
pub(super) fn refused(path: &Path, error: thetahat::Error) -> Failure {
    let message = match error {
        thetahat::Error::Argument { message, .. } => message,
        other => other.to_string(),
    };
    Failure::data(format!("{}: {message}", path.display()))
}

/// A stored report.
pub(super) fn report(path: &Path) -> Result<Report, Failure> {
    let bad = |message: String| Failure::data(format!("{}: {message}", path.display()));
    let text = text(path).map_err(|failure| match failure.kind() {
        Kind::Data => bad("this is not a thetahat report: not UTF-8 text".to_owned()),
        _ => failure,
    })?;
    report_of(path, &text)
}

/// The report that the text of a file is.
pub(super) fn report_of(path: &Path, text: &str) -> Result<Report, Failure> {
    Report::from_json(text).map_err(|error| Failure::data(format!("{}: {error}", path.display())))
}

/// The options of a fit, as a file has them: a plan, or the report of a fit, which holds its own.
pub(crate) fn plan(path: &Path) -> Result<FitOptions, Failure> {
    let bad = |message: String| Failure::data(format!("{}: {message}", path.display()));
    let text = text(path)?;
    let value: Value =
        serde_json::from_str(&text).map_err(|error| bad(format!("this is no plan in JSON: {error}")))?;
    let plan = if value.get("schema").is_some() {
        let report = report_of(path, &text)?;
        return report.plan.ok_or_else(|| bad("the report holds no plan; fit it again".to_owned()));
    } else {
        value.as_object().ok_or_else(|| bad("a plan is an object of options in JSON".to_owned()))?
    };
    FitOptions::of(plan).map_err(|error| Failure::option(&error).of(path))
}

/// A stored response of spectrum.
pub(super) fn response(path: &Path) -> Result<MeasuredResponse, Failure> {
    response_of(path, &text(path)?)
}

/// The response that the text of a file is.
pub(super) fn response_of(path: &Path, text: &str) -> Result<MeasuredResponse, Failure> {
    MeasuredResponse::from_json(text).map_err(|error| Failure::data(format!("{}: {error}", path.display())))
}

/// The text of a file.
pub(super) fn text(path: &Path) -> Result<String, Failure> {
    let failed = |error| Failure::io(path, "cannot be read", &error);
    let mut bytes = Vec::new();
    if path == Path::new("-") {
        io::stdin().lock().take(LARGEST_REPORT).read_to_end(&mut bytes).map_err(failed)?;
    } else {
        File::open(path).map_err(failed)?.take(LARGEST_REPORT).read_to_end(&mut bytes).map_err(failed)?;
    }
    String::from_utf8(bytes).map_err(|_| Failure::data(format!("{}: this is not UTF-8 text", path.display())))
}

/// Whether a file is JSON: whether the first that is not blank is {. What comes on standard input is not used up. A
/// pipe that has a name cannot be read twice: it is taken for a document.
pub(super) fn is_json(path: &Path) -> Result<bool, Failure> {
    let failed = |error| Failure::io(path, "cannot be read", &error);
    let begins = |head: &[u8]| {
        let head = head.strip_prefix(MARK).unwrap_or(head);
        head.iter().find(|byte| !byte.is_ascii_whitespace()) == Some(&b'{')
    };
    if path == Path::new("-") {
        return Ok(begins(io::stdin().lock().fill_buf().map_err(failed)?));
    }
    let file = File::open(path).map_err(failed)?;
    let metadata = file.metadata().map_err(failed)?;
    if !(metadata.is_file() || metadata.is_dir()) {
        return Ok(true);
    }
    let mut head = Vec::new();
    file.take(HEAD).read_to_end(&mut head).map_err(failed)?;
    Ok(begins(&head))
}
