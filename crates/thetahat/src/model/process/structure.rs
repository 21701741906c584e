use std::fmt;
use std::str::FromStr;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use thetahat_core::Number;

use super::chain::{Chain, MOST_COLUMNS, MOST_STATES};
use crate::Error;

/// Lags of a process at most, and poles of a transfer function.
const MOST_LAGS: usize = 3;
pub(crate) const MOST_POLES: usize = 6;
/// Parameters of a structure at most: as many zeros as poles, and a dead time.
pub(crate) const MOST_PARAMETERS: usize = 2 * MOST_POLES + 2;

/// Powers of 1/s, and a gain times these.
const RATES: [[&str; 2]; MOST_POLES + 1] = [
    ["", "y/u"],
    ["1/s", "y/u/s"],
    ["1/s^2", "y/u/s^2"],
    ["1/s^3", "y/u/s^3"],
    ["1/s^4", "y/u/s^4"],
    ["1/s^5", "y/u/s^5"],
    ["1/s^6", "y/u/s^6"],
];

/// What a process is from an input to the output, as a word.
///
/// ```text
/// p1d  p2du  p0i …   K (1 + tau_z s) / (s (1 + tau1 s)(1 + tau2 s)(1 + tau3 s)) e^(-theta s)
/// rc1  rc2  rc3      R0 + R1/(1 + tau1 s) + R2/(1 + tau2 s) + R3/(1 + tau3 s)
/// tf21  tf42d …      (b1 s + b0)/(s^2 + a1 s + a0), (b2 s^2 + b1 s + b0)/(s^4 + a3 s^3 + … + a0) e^(-theta s), …
/// ```
///
/// After `p` stands the number of lags, 0 … 3, then letters: `d` with a dead time theta, `z` with a zero at -1/tau_z,
/// `i` with an integrator, the factor 1/s; `u` for two of the lags that may be underdamped, 1/(1 + 2 zeta s/omega +
/// s²/omega²) in their place. `rc` are as many lags side by side with a direct term, as the voltage of a battery has
/// them. After `tf` stand the number of poles, 1 … 6, and of zeros, no more than poles, then `d` and `i`: an integrator
/// is one of the poles, and the others lie left of the imaginary axis.
///
/// ```
/// use thetahat::model::ProcessStructure;
///
/// let structure: ProcessStructure = "p2du".parse()?;
/// assert_eq!(structure.names(), ["K", "omega", "zeta", "theta"]);
/// assert_eq!("P1DZ".parse::<ProcessStructure>()?.to_string(), "p1dz");
/// assert!("p4d".parse::<ProcessStructure>().is_err());
/// # Ok::<(), thetahat::Error>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(try_from = "String", into = "String")]
#[schemars(with = "String")]
pub struct ProcessStructure {
    pub(crate) lags: usize,
    pub(crate) kind: Kind,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Kind {
    /// One lag after the other.
    Series(Series),
    /// Lags side by side, with a direct term.
    Parallel,
    /// Polynomials in s, of which the lower one has as many coefficients as there are lags.
    Rational(Rational),
}

/// What a transfer function has beside its poles.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Rational {
    pub(crate) zeros: usize,
    pub(crate) integrator: bool,
    pub(crate) dead_time: bool,
}

/// What a process has beside its lags.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct Series {
    pub(crate) underdamped: bool,
    pub(crate) zero: bool,
    pub(crate) integrator: bool,
    pub(crate) dead_time: bool,
}

impl ProcessStructure {
    /// A transfer function with so many poles and zeros.
    ///
    /// # Errors
    /// [`Error::Argument`] for no pole, more than 6, or more zeros than poles.
    pub fn transfer_function(poles: usize, zeros: usize, dead_time: bool) -> Result<Self, Error> {
        Self::rational(poles, Rational { zeros, integrator: false, dead_time })
    }

    fn rational(poles: usize, own: Rational) -> Result<Self, Error> {
        let wrong = |what: String| Err(Error::argument("structure", what));
        if !(1..=MOST_POLES).contains(&poles) {
            return wrong(format!("{poles} poles: a transfer function has 1 to {MOST_POLES} of them"));
        }
        let lags = poles - usize::from(own.integrator);
        if lags == 0 {
            return wrong("an integrator alone is p0i, or p0di with a dead time".to_owned());
        }
        if own.zeros > lags {
            let integrator = if own.integrator { " beside the integrator" } else { "" };
            return wrong(format!(
                "{} zeros of {lags} poles{integrator}: a transfer function has no more zeros than these",
                own.zeros
            ));
        }
        debug_assert!(own.zeros < MOST_COLUMNS);
        Ok(Self { lags, kind: Kind::Rational(own) })
    }

    /// The names of the parameters, in their order: gain, lags, zero, dead time. Times are in seconds, `omega` in
    /// rad/s.
    pub fn names(&self) -> Vec<String> {
        let numbered = |name: &str, count: usize| -> Vec<String> {
            match count {
                1 => vec![name.to_owned()],
                _ => (1..=count).map(|number| format!("{name}{number}")).collect(),
            }
        };
        match self.kind {
            Kind::Parallel => {
                let each = (1..=self.lags).map(|number| [format!("R{number}"), format!("tau{number}")]);
                std::iter::once("R0".to_owned()).chain(each.flatten()).collect()
            }
            Kind::Rational(own) => {
                let above = (0..=own.zeros).rev().map(|power| format!("b{power}"));
                let below = (0..self.lags).rev().map(|power| format!("a{power}"));
                above.chain(below).chain(own.dead_time.then(|| "theta".to_owned())).collect()
            }
            Kind::Series(series) => {
                let mut names = vec!["K".to_owned()];
                if series.underdamped {
                    names.extend(["omega".to_owned(), "zeta".to_owned()]);
                }
                names.extend(numbered("tau", self.real_lags()));
                names.extend(series.zero.then(|| "tau_z".to_owned()));
                names.extend(series.dead_time.then(|| "theta".to_owned()));
                names
            }
        }
    }

    /// The transfer function in words, such as `K e^(-theta s)/(1 + tau s)`.
    pub fn equation(&self) -> String {
        let names = self.names();
        match self.kind {
            Kind::Parallel => {
                let lag = |number: usize| format!("R{number}/(1 + tau{number} s)");
                std::iter::once("R0".to_owned())
                    .chain((1..=self.lags).map(lag))
                    .collect::<Vec<_>>()
                    .join(" + ")
            }
            Kind::Rational(own) => {
                let power = |power: usize| match power {
                    0 => String::new(),
                    1 => " s".to_owned(),
                    _ => format!(" s^{power}"),
                };
                let term = |name: &str, k: usize| format!("{name}{k}{}", power(k));
                let above: Vec<String> = (0..=own.zeros).rev().map(|k| term("b", k)).collect();
                let below = (0..self.lags).rev().map(|k| term("a", k));
                let below: Vec<String> =
                    std::iter::once(power(self.lags).trim().to_owned()).chain(below).collect();
                let above = above.join(" + ");
                let above = if own.zeros > 0 { format!("({above})") } else { above };
                let late = if own.dead_time { " e^(-theta s)" } else { "" };
                let below = format!("({})", below.join(" + "));
                if own.integrator {
                    format!("{above}{late}/(s {below})")
                } else {
                    format!("{above}{late}/{below}")
                }
            }
            Kind::Series(series) => {
                let mut top = "K".to_owned();
                if series.zero {
                    top += " (1 + tau_z s)";
                }
                if series.dead_time {
                    top += " e^(-theta s)";
                }
                let mut below: Vec<String> = Vec::new();
                below.extend(series.integrator.then(|| "s".to_owned()));
                below.extend(series.underdamped.then(|| "(1 + 2 zeta s/omega + s^2/omega^2)".to_owned()));
                let lags = names.iter().filter(|name| name.starts_with("tau") && *name != "tau_z");
                below.extend(lags.map(|name| format!("(1 + {name} s)")));
                match &*below {
                    [one] => format!("{top}/{one}"),
                    several => format!("{top}/({})", several.join(" ")),
                }
            }
        }
    }

    /// The unit of a parameter of this name: s, rad/s, or what the gains are in; of coefficients with the power of 1/s
    /// that they have.
    pub fn unit(&self, name: &str) -> &'static str {
        let bare = name.split('[').next().unwrap_or(name);
        match bare {
            "omega" => "rad/s",
            "zeta" => "",
            _ if self.is_transfer_function() && bare != "theta" => {
                let power: usize = bare[1..].parse().unwrap_or(0);
                if bare.starts_with('a') {
                    RATES.get(self.lags.saturating_sub(power)).map_or("", |[rate, _]| rate)
                } else {
                    RATES.get(self.states().saturating_sub(power)).map_or("", |[_, rate]| rate)
                }
            }
            "K" if self.integrates() => "y/u/s",
            _ if bare.starts_with('K') || bare.starts_with('R') => "y/u",
            _ => "s",
        }
    }

    /// How many parameters there are.
    pub fn parameters(&self) -> usize {
        match self.kind {
            Kind::Parallel => 1 + 2 * self.lags,
            Kind::Rational(own) => 1 + own.zeros + self.lags + usize::from(own.dead_time),
            Kind::Series(series) => 1 + self.lags + usize::from(series.zero) + usize::from(series.dead_time),
        }
    }

    /// Whether it integrates its input, so that it has no static gain.
    pub fn integrates(&self) -> bool {
        match self.kind {
            Kind::Parallel => false,
            Kind::Series(own) => own.integrator,
            Kind::Rational(own) => own.integrator,
        }
    }

    /// Whether it has a dead time.
    pub fn has_dead_time(&self) -> bool {
        match self.kind {
            Kind::Parallel => false,
            Kind::Series(own) => own.dead_time,
            Kind::Rational(own) => own.dead_time,
        }
    }

    /// The states: a lag or an integrator has one.
    pub fn states(&self) -> usize {
        self.lags + usize::from(self.integrates())
    }

    /// Whether the output follows the input in the same instant, but for the dead time.
    pub(crate) fn acts_at_once(&self) -> bool {
        match self.kind {
            Kind::Parallel => true,
            Kind::Series(series) => series.zero && self.states() == 1,
            Kind::Rational(own) => own.zeros == self.states(),
        }
    }

    pub(crate) fn is_underdamped(&self) -> bool {
        matches!(self.kind, Kind::Series(Series { underdamped: true, .. }))
    }

    /// Whether it is one of polynomials in s (`tf`): its shape is the coefficients of one, not time constants.
    pub fn is_transfer_function(&self) -> bool {
        matches!(self.kind, Kind::Rational(_))
    }

    /// The same with every derivative for a column, behind an integrator or not, and no dead time: what filters with
    /// 1/A(s).
    pub(crate) fn derivatives(&self, integrator: bool) -> Self {
        let own = Rational { zeros: self.lags, integrator, dead_time: false };
        Self { lags: self.lags, kind: Kind::Rational(own) }
    }

    pub(crate) fn is_parallel(&self) -> bool {
        self.kind == Kind::Parallel
    }

    /// The lags that are not those of a pair.
    fn real_lags(&self) -> usize {
        self.lags - if self.is_underdamped() { 2 } else { 0 }
    }

    /// The columns that the output is a sum of: the state at the end of the chain, with a zero its derivative, with
    /// more zeros as many derivatives; side by side the input and each lag.
    pub(crate) fn columns(&self) -> usize {
        match self.kind {
            Kind::Parallel => 1 + self.lags,
            Kind::Series(series) => 1 + usize::from(series.zero),
            Kind::Rational(own) => 1 + own.zeros,
        }
    }

    /// The parameters taken apart: the weights of the columns, the shape that the lags have, and the dead time.
    pub(crate) fn taken_apart<S: Number<f64>>(&self, parameters: &[S]) -> Parts<S> {
        let zero: S = 0.0.into();
        let mut parts = Parts { weights: Vec::new(), shape: Vec::new(), dead_time: zero };
        match self.kind {
            Kind::Parallel => {
                parts.weights.extend(parameters.iter().step_by(2));
                parts.weights.splice(1.., parameters[1..].iter().step_by(2).copied());
                parts.shape.extend(parameters[1..].iter().skip(1).step_by(2));
            }
            Kind::Rational(own) => {
                let (above, below) = parameters.split_at(1 + own.zeros);
                parts.weights.extend(above.iter().rev());
                parts.shape.extend(&below[..self.lags]);
                if let (true, Some(seconds)) = (own.dead_time, below.get(self.lags)) {
                    parts.dead_time = *seconds;
                }
            }
            Kind::Series(series) => {
                let gain = parameters[0];
                parts.weights.push(gain);
                parts.shape.extend(&parameters[1..=self.lags]);
                let mut rest = parameters[1 + self.lags..].iter().copied();
                if series.zero {
                    parts.weights.push(gain * rest.next().unwrap_or(zero));
                }
                if series.dead_time {
                    parts.dead_time = rest.next().unwrap_or(zero);
                }
            }
        }
        parts
    }

    /// The parameters of these parts.
    pub(crate) fn put_together(&self, parts: &Parts<f64>) -> Vec<f64> {
        match self.kind {
            Kind::Parallel => {
                let lags = parts.weights[1..].iter().zip(&parts.shape).flat_map(|(gain, tau)| [*gain, *tau]);
                std::iter::once(parts.weights[0]).chain(lags).collect()
            }
            Kind::Rational(own) => {
                let dead_time = own.dead_time.then_some(parts.dead_time);
                parts.weights.iter().rev().chain(&parts.shape).copied().chain(dead_time).collect()
            }
            Kind::Series(series) => {
                let gain = parts.weights[0];
                let mut values = vec![gain];
                values.extend(&parts.shape);
                values.extend(series.zero.then(|| parts.weights[1] / gain));
                values.extend(series.dead_time.then_some(parts.dead_time));
                values
            }
        }
    }

    /// The slopes of the output by the parameters, from those of the sum of the columns by the shape and by the dead
    /// time.
    pub(crate) fn own_slopes(
        &self,
        parts: &Parts<f64>,
        columns: &[f64],
        shape: &[f64],
        dead_time: f64,
        slopes: &mut [f64],
    ) {
        match self.kind {
            Kind::Parallel => {
                slopes[0] = columns[0];
                for lag in 0..self.lags {
                    slopes[1 + 2 * lag] = columns[1 + lag];
                    slopes[2 + 2 * lag] = shape[lag];
                }
            }
            Kind::Rational(own) => {
                let (above, below) = slopes.split_at_mut(1 + own.zeros);
                above.iter_mut().rev().zip(columns).for_each(|(slope, column)| *slope = *column);
                below[..self.lags].copy_from_slice(&shape[..self.lags]);
                if own.dead_time {
                    below[self.lags] = dead_time;
                }
            }
            Kind::Series(series) => {
                let gain = parts.weights[0];
                slopes[0] = columns[0];
                slopes[1..=self.lags].copy_from_slice(&shape[..self.lags]);
                let mut place = 1 + self.lags;
                if series.zero {
                    // y = K (c0 + tau_z c1)
                    slopes[0] += parts.weights[1] / gain * columns[1];
                    slopes[place] = gain * columns[1];
                    place += 1;
                }
                if series.dead_time {
                    slopes[place] = dead_time;
                }
            }
        }
    }

    /// The lags in state space.
    pub(crate) fn chain<S: Number<f64>>(&self, shape: &[S]) -> Chain<S> {
        match self.kind {
            Kind::Parallel => Chain::parallel(shape),
            Kind::Rational(own) => Chain::rational(shape, 1 + own.zeros, own.integrator),
            Kind::Series(series) => Chain::series(shape, series.underdamped, series.zero, series.integrator),
        }
    }

    /// A structure to start the search for this one from: without the pair, then without the zero, then with one lag
    /// less.
    pub(crate) fn simpler(&self) -> Option<Self> {
        match self.kind {
            Kind::Series(series) if series.underdamped => {
                Some(Self { kind: Kind::Series(Series { underdamped: false, ..series }), ..*self })
            }
            Kind::Series(series) if series.zero && self.lags > 1 => {
                Some(Self { kind: Kind::Series(Series { zero: false, ..series }), ..*self })
            }
            Kind::Rational(_) => None,
            _ if self.lags > 1 => Some(Self { lags: self.lags - 1, ..*self }),
            _ => None,
        }
    }
}

/// The parameters of a process taken apart.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Parts<S> {
    /// A weight for each column: the gain, and with a zero the gain times tau_z; side by side R0, R1, …; b0, b1, … of a
    /// transfer function.
    pub(crate) weights: Vec<S>,
    /// The time constants; before them omega and zeta of a pair. Of a transfer function the coefficients of its
    /// denominator.
    pub(crate) shape: Vec<S>,
    /// theta, in seconds.
    pub(crate) dead_time: S,
}

impl FromStr for ProcessStructure {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self, Error> {
        let wrong = || {
            Error::argument(
                "structure",
                format!(
                    "{text} is no structure of a process: write p, the number of lags from 0 to 3, and the letters of what it has beside \
                     them (d a dead time, z a zero, i an integrator, u two lags that may be underdamped), such as p1d or p2du; or rc1, rc2 \
                     or rc3; or tf, the numbers of poles and zeros, and d or i, such as tf42d"
                ),
            )
        };
        let word = text.trim().to_ascii_lowercase();
        if let Some(rest) = word.strip_prefix("tf") {
            let mut letters = rest.chars();
            let mut number = || letters.next().and_then(|digit| digit.to_digit(10)).ok_or_else(wrong);
            let (poles, zeros) = (number()? as usize, number()? as usize);
            let mut own = Rational { zeros, integrator: false, dead_time: false };
            for letter in letters {
                let has = match letter {
                    'd' => &mut own.dead_time,
                    'i' => &mut own.integrator,
                    _ => return Err(wrong()),
                };
                if std::mem::replace(has, true) {
                    return Err(wrong());
                }
            }
            return Self::rational(poles, own);
        }
        let rest = word.strip_prefix("rc").or_else(|| word.strip_prefix('p')).ok_or_else(wrong)?;
        let mut letters = rest.chars();
        let lags = letters.next().and_then(|digit| digit.to_digit(10)).ok_or_else(wrong)? as usize;
        if lags > MOST_LAGS {
            return Err(wrong());
        }
        if word.starts_with("rc") {
            let found = Self { lags, kind: Kind::Parallel };
            return if lags > 0 && letters.next().is_none() { Ok(found) } else { Err(wrong()) };
        }
        let mut series = Series::default();
        for letter in letters {
            let has = match letter {
                'd' => &mut series.dead_time,
                'z' => &mut series.zero,
                'i' => &mut series.integrator,
                'u' => &mut series.underdamped,
                _ => return Err(wrong()),
            };
            if std::mem::replace(has, true) {
                return Err(wrong());
            }
        }
        let found = Self { lags, kind: Kind::Series(series) };
        if series.underdamped && lags < 2 {
            return Err(Error::argument("structure", format!("{text}: u is two lags; write p2u or p3u")));
        }
        if found.states() == 0 || series.zero && lags == 0 {
            return Err(Error::argument(
                "structure",
                format!("{text} has no lag to find: take p1, p0i for an integrator alone, or p1z for a zero"),
            ));
        }
        debug_assert!(found.states() <= MOST_STATES);
        Ok(found)
    }
}

impl fmt::Display for ProcessStructure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.kind {
            Kind::Parallel => write!(f, "rc{}", self.lags),
            Kind::Rational(own) => {
                let letters = [(own.dead_time, "d"), (own.integrator, "i")];
                let letters = letters.map(|(has, letter)| if has { letter } else { "" });
                write!(f, "tf{}{}{}", self.states(), own.zeros, letters.concat())
            }
            Kind::Series(series) => {
                write!(f, "p{}", self.lags)?;
                let letters = [
                    (series.dead_time, 'd'),
                    (series.zero, 'z'),
                    (series.integrator, 'i'),
                    (series.underdamped, 'u'),
                ];
                letters.iter().filter(|(has, _)| *has).try_for_each(|(_, letter)| write!(f, "{letter}"))
            }
        }
    }
}

impl TryFrom<String> for ProcessStructure {
    type Error = Error;

    fn try_from(text: String) -> Result<Self, Error> {
        text.parse()
    }
}

impl From<ProcessStructure> for String {
    fn from(structure: ProcessStructure) -> Self {
        structure.to_string()
    }
}
