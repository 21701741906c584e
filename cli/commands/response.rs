//! From a table of points, such as an impedance spectrum, to a measured frequency response.

use std::f64::consts::TAU;
use std::path::Path;

use thetahat::spectrum::{GivenPoint, MeasuredResponse};
use thetahat_table::{Options, Reader, Selection, Table};

use super::stored;
use crate::failure::Failure;
use crate::messages::{note, warn};

/// What a column of a table is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Role {
    Hertz,
    Radians,
    Real,
    Imaginary,
    /// The imaginary part with its sign turned, as impedances are often written.
    MinusImaginary,
    Magnitude,
    Decibels,
    Degrees,
    Deviation,
}

/// The roles, their words for `--columns`, and what they are.
const ROLES: [(Role, &str, &str); 9] = [
    (Role::Hertz, "hz", "frequency in Hz"),
    (Role::Radians, "rad/s", "frequency in rad/s"),
    (Role::Real, "re", "real part"),
    (Role::Imaginary, "im", "imaginary part"),
    (Role::MinusImaginary, "-im", "minus the imaginary part"),
    (Role::Magnitude, "magnitude", "magnitude"),
    (Role::Decibels, "db", "magnitude in dB"),
    (Role::Degrees, "phase", "phase in degrees"),
    (Role::Deviation, "sd", "standard deviation of real and imaginary part"),
];

/// Names of columns, of which nothing but letters is left, and what they are.
const NAMES: [(Role, &[&str]); 8] = [
    (Role::Hertz, &["f", "freq", "frequency", "hz", "hertz", "fhz", "freqhz", "frequencyhz"]),
    (Role::Radians, &["w", "omega", "rads", "wrads", "omegarads", "frequencyrads"]),
    (
        Role::Real,
        &["re", "real", "rez", "zre", "zreal", "realz", "zr", "reohm", "realohm", "zrealohm", "datareal"],
    ),
    (
        Role::Imaginary,
        &[
            "im",
            "imag",
            "imaginary",
            "imz",
            "zim",
            "zimag",
            "imagz",
            "zi",
            "imohm",
            "imagohm",
            "zimagohm",
            "dataimag",
        ],
    ),
    (Role::Magnitude, &["magnitude", "mag", "abs", "gain", "modulus", "z", "zmod", "zohm"]),
    (Role::Decibels, &["db", "magnitudedb", "magdb", "gaindb"]),
    (Role::Deviation, &["sd", "std", "stddev", "sigma", "standarddeviation"]),
    (Role::Degrees, &["phase", "phasedeg", "deg", "degrees", "angle", "phz", "phasez", "zphz"]),
];

/// A measured response: the document that `spectrum` wrote, or a table of points of sines in continuous time. `columns`
/// says which column is which, a role of [`ROLES`] and a name each; those that it does not name go by their names. How
/// a table is written `format` says, if that was said.
/// `channels` are what input and output are called.
pub(super) fn read(
    path: &Path,
    format: Option<&Options>,
    columns: &[(String, String)],
    [input, output]: [&str; 2],
) -> Result<MeasuredResponse, Failure> {
    if stored::is_json(path)? {
        if !columns.is_empty() {
            return Err(Failure::usage("--columns is for tables and templates; the response is a document"));
        }
        if format.is_some() {
            return Err(Failure::usage(
                "options of the log format are for tables; the response is a document",
            ));
        }
        return stored::response(path);
    }
    let file = path.display().to_string();
    let bad = |message: String| Failure::data(format!("{file}: {message}"));
    let reader = Reader::open(path, format.unwrap_or(&Options::default()))?;
    let is_there = |name: &str| reader.names().iter().any(|own| own == name);
    let is_own = is_there("magnitude_standard_error") || is_there("frequency [rad/s]");
    if is_own && columns.is_empty() {
        return Err(bad("it is a table that thetahat wrote, in rad/s and without the sample time of the log; \
             fit to the document of spectrum --format json, or say with --columns rad/s=frequency that inputs were sines"
            .to_owned()));
    }
    let roles = roles(reader.names(), columns).map_err(bad)?;
    let selection =
        Selection { columns: roles.iter().map(|(_, place)| *place).collect(), ..Selection::default() };
    let named: Vec<String> = roles
        .iter()
        .map(|(role, place)| format!("{} '{}'", described(*role), reader.names()[*place]))
        .collect();
    note(&format!("{file}: read as {}; --columns says otherwise", named.join(", ")));
    let Table { columns, rows, lines, .. } = reader.read(&selection, &mut |_, _| ())?;
    let value = |role: Role, row: usize| {
        let place = roles.iter().position(|(own, _)| *own == role)?;
        Some(columns[place][row])
    };
    let complete = |row: &usize| columns.iter().all(|column| !column[*row].is_nan());
    let complete: Vec<usize> = (0..rows).filter(complete).collect();
    if complete.len() < rows {
        warn(&format!(
            "{file}: {} of {rows} rows have a missing value and are left out",
            rows - complete.len()
        ));
    }
    let point = |row: usize| {
        let frequency = value(Role::Radians, row).or(value(Role::Hertz, row).map(|hertz| TAU * hertz));
        let imaginary = value(Role::Imaginary, row).or(value(Role::MinusImaginary, row).map(|minus| -minus));
        let size = value(Role::Magnitude, row)
            .or(value(Role::Decibels, row).map(|decibels| 10.0_f64.powf(decibels / 20.0)));
        let polar = || {
            let (sine, cosine) = value(Role::Degrees, row)?.to_radians().sin_cos();
            size.map(|size| (size * cosine, size * sine))
        };
        let (re, im) = value(Role::Real, row).zip(imaginary).or_else(polar).unwrap_or((f64::NAN, f64::NAN));
        GivenPoint {
            frequency: frequency.unwrap_or(f64::NAN),
            re,
            im,
            standard_deviation: value(Role::Deviation, row),
        }
    };
    let points: Vec<GivenPoint> = complete.iter().map(|row| point(*row)).collect();
    // One by one first, so that what is wrong with a point is said with its line.
    let mut wrong = complete.iter().zip(&points).filter_map(|(row, point)| {
        let alone = [GivenPoint { frequency: 1.0, re: 1.0, im: 0.0, ..*point }, *point];
        let error = MeasuredResponse::given(input, output, &alone, None).err()?;
        let message = message(error);
        Some(Failure::data(format!(
            "{}: {}",
            lines.place(&file, *row, 0),
            message.strip_prefix(SECOND).unwrap_or(&message)
        )))
    });
    if let Some(failure) = wrong.next() {
        return Err(failure);
    }
    let found = MeasuredResponse::given(input, output, &points, None);
    Ok(found.map_err(|error| bad(message(error)))?.of_file(&file))
}

/// What is said of the second of two points.
const SECOND: &str = "point 2: ";

/// What the library says of points, which here are no argument.
fn message(error: thetahat::Error) -> String {
    match error {
        thetahat::Error::Argument { message, .. } => message,
        other => other.to_string(),
    }
}

/// Which columns are read, each with what it is.
fn roles(names: &[String], given: &[(String, String)]) -> Result<Vec<(Role, usize)>, String> {
    let mut found: Vec<(Role, usize)> = Vec::new();
    for (word, name) in given {
        let Some((role, ..)) = ROLES.iter().find(|(_, own, _)| own.eq_ignore_ascii_case(word)) else {
            let words: Vec<&str> = ROLES.iter().map(|(_, word, _)| *word).collect();
            return Err(format!("--columns {word}={name}: a column is one of {}", words.join(", ")));
        };
        let Some(place) = names.iter().position(|own| own == name) else {
            return Err(format!("there is no column '{name}', but: {}", names.join(", ")));
        };
        found.push((*role, place));
    }
    let numbered = names.iter().zip(1..).all(|(name, number)| *name == number.to_string());
    if found.is_empty() && numbered && names.len() == 3 {
        return Ok(vec![(Role::Hertz, 0), (Role::Real, 1), (Role::Imaginary, 2)]);
    }
    let taken: Vec<usize> = found.iter().map(|(_, place)| *place).collect();
    for (place, name) in names.iter().enumerate().filter(|(place, _)| !taken.contains(place)) {
        if let Some(role) = role_of(name)
            && !found.iter().any(|(own, _)| kind(*own) == kind(role))
        {
            found.push((role, place));
        }
    }
    let has = |wanted: &[Role]| found.iter().any(|(role, _)| wanted.contains(role));
    let cartesian = has(&[Role::Real]) && has(&[Role::Imaginary, Role::MinusImaginary]);
    let polar = has(&[Role::Magnitude, Role::Decibels]) && has(&[Role::Degrees]);
    if !has(&[Role::Hertz, Role::Radians]) || !(cartesian || polar) {
        return Err(format!(
            "no frequency response is known by the columns {}; name a frequency, and real and imaginary part or magnitude and phase, \
             such as --columns hz=f,re=Zr,im=Zi",
            names.join(", ")
        ));
    }
    // Of both forms the parts serve.
    found.retain(|(role, _)| !cartesian || !matches!(role, Role::Magnitude | Role::Decibels | Role::Degrees));
    Ok(found)
}

/// What a column is by its name: signs and units are known in the forms that instruments write, such as `freq/Hz` and
/// `-Im(Z)/Ohm`.
fn role_of(name: &str) -> Option<Role> {
    let low = name.trim().to_lowercase();
    let quotes = low.chars().filter(|sign| *sign == '\'').count() + 2 * low.matches('"').count();
    let is_minus = low.starts_with(['-', '\u{2212}']);
    let letters = |text: &str| text.chars().filter(char::is_ascii_alphabetic).collect::<String>();
    let whole = letters(&low);
    let before = letters(low.split(['/', '[', '(']).next().unwrap_or_default());
    let role = match (before.as_str(), quotes) {
        ("z", 1) => Some(Role::Real),
        ("z", 2) => Some(Role::Imaginary),
        _ => [whole.as_str(), before.as_str()]
            .into_iter()
            .find_map(|word| NAMES.iter().find(|(_, names)| names.contains(&word)).map(|(role, _)| *role)),
    };
    match role? {
        Role::Imaginary if is_minus => Some(Role::MinusImaginary),
        _ if is_minus => None,
        // An angle in other units is not taken for degrees.
        Role::Degrees if whole.contains("rad") => None,
        role => Some(role),
    }
}

/// Columns of one kind serve for the same.
fn kind(role: Role) -> usize {
    match role {
        Role::Hertz | Role::Radians => 0,
        Role::Real => 1,
        Role::Imaginary | Role::MinusImaginary => 2,
        Role::Magnitude | Role::Decibels => 3,
        Role::Degrees => 4,
        Role::Deviation => 5,
    }
}

fn described(role: Role) -> &'static str {
    ROLES.iter().find(|(own, ..)| *own == role).map_or("", |(_, _, what)| what)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_are_known_by_the_names_that_instruments_write() {
        let names = |list: &[&str]| list.iter().map(|name| (*name).to_owned()).collect::<Vec<_>>();
        let of = |list: &[&str]| roles(&names(list), &[]);
        for (list, minus) in [
            (&["freq/Hz", "Re(Z)/Ohm", "-Im(Z)/Ohm", "|Z|/Ohm", "Phase(Z)/deg"][..], true),
            (&["Freq", "Zreal", "Zimag", "Zmod", "Zphz"][..], false),
            (&["Frequency (Hz)", "Z' (Ohm)", "-Z'' (Ohm)"][..], true),
            (&["f", "re", "im"][..], false),
            (&["1", "2", "3"][..], false),
        ] {
            let found = of(list).unwrap_or_default();
            let third = if minus { Role::MinusImaginary } else { Role::Imaginary };
            assert_eq!(found, [(Role::Hertz, 0), (Role::Real, 1), (third, 2)], "{list:?}");
        }
        let with_errors = of(&["hz", "re", "im", "sd"]).unwrap_or_default();
        assert_eq!(with_errors.last(), Some(&(Role::Deviation, 3)));
        let polar = [(Role::Radians, 0), (Role::Decibels, 1), (Role::Degrees, 2)];
        assert_eq!(of(&["omega [rad/s]", "Magnitude (dB)", "phase"]), Ok(polar.to_vec()));
        assert!(of(&["t", "u", "y"]).is_err_and(|words| words.contains("t, u, y")));
        assert!(of(&["f", "magnitude", "phase [rad]"]).is_err());
        let own = [("re".to_owned(), "b".to_owned()), ("-im".to_owned(), "c".to_owned())];
        let found = roles(&names(&["f", "b", "c"]), &own);
        assert_eq!(found, Ok(vec![(Role::Real, 1), (Role::MinusImaginary, 2), (Role::Hertz, 0)]));
        let missing = [("re".to_owned(), "x".to_owned())];
        assert!(roles(&names(&["f"]), &missing).is_err_and(|words| words.contains("no column 'x', but: f")));
        let unknown = [("real".to_owned(), "f".to_owned())];
        assert!(roles(&names(&["f"]), &unknown).is_err_and(|words| words.contains("one of hz, rad/s, re")));
    }
}
