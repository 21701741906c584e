//! The options of recursive identification, and the trackers that they make.

use super::plan::{PerChannel, Policy, TrackMethod, TrackOutliers, TrackPlan, TrackStart};
use super::tracker::Tracker;
use crate::Error;
use crate::estimate::Coupling;
use crate::model::{Map, Model, Orders, Signal};
use crate::options::{
    ColumnName, Kind, NamedValue, OptionText, Options, Word, none_of, options, texts, words,
};
use crate::report::Report;

const CHANNELS: &str = "Channels";
const MODEL: &str = "Model";
const ADAPTATION: &str = "Adaptation";
const WATCH: &str = "Watch";

/// What the orders are of: polynomials, or the regressors of a map.
const LINEAR: Kind = Kind::new("models of polynomials");
const NARX: Kind = Kind::new("`narx`");
/// What is taken of a report, and not of options.
const OF_A_REPORT: [&str; 6] = ["model", "na", "nb", "nc", "nk", "narx"];
/// The default number of factors of a product, and of lags.
const USUAL: usize = 2;

/// The structure of a model that is tracked.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TrackModel {
    /// A y = B u + e.
    Arx,
    /// A y = B u + C e.
    Armax,
}

words! { of TrackModel {
    Arx "arx" "A y = B u + e",
    Armax "armax" "A y = B u + C e",
}}

/// The functions of a nonlinear ARX model that is tracked.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TrackMap {
    /// Products.
    Poly,
}

words! { of TrackMap {
    Poly "poly" "Products of regressors up to a degree",
}}

words! { of TrackMethod {
    Rls "rls" "Recursive least squares (arx)",
    Els "els" "Extended least squares (armax): quick, and not always right",
    Rpem "rpem" "Recursive prediction error method (armax)",
}}

texts! {
    Policy, List, "str", "Union[str, Sequence[str]]";
    TrackStart, Repeated, "str", "Sequence[str]";
    TrackOutliers, Repeated, "str", "Sequence[str]";
}

/// Which past outputs each of several outputs depends on.
impl OptionText for Coupling {
    const PYTHON: &'static str = "";

    fn words() -> Vec<Word> {
        let word = |word, help| Word { word, alias: None, help };
        vec![word("full", "Those of all outputs"), word("none", "Its own")]
    }

    fn of(text: &str) -> Result<Self, String> {
        text.parse().map_err(|_| none_of(text, &Self::words()))
    }

    fn text(&self) -> String {
        self.word().to_owned()
    }
}

options! {
    /// What is tracked and how, as it was given.
    ///
    /// ```
    /// use thetahat::track::TrackOptions;
    ///
    /// let options: TrackOptions = serde_json::from_str(r#"{"na": 2, "nb": 2, "forgetting": [1, 0.99]}"#)?;
    /// options.check(false)?;
    /// assert_eq!(options.trackers(&["u".into()], &["y".into()], None)?.len(), 2);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    TrackOptions of "a tracker" {
        /// Input columns; a name that holds a comma stands between double quotes, as in CSV
        input: Vec<ColumnName>, "NAME[,NAME…]", "u, u1, u2, …; those of `warm`", CHANNELS;
        /// Output columns; with `model` arx more than one, an equation for each
        output: Vec<ColumnName>, "NAME[,NAME…]", "y; those of `warm`", CHANNELS;
        /// Subtract this from a channel
        offset: Vec<NamedValue>, "NAME=VALUE", "0; the offsets of `warm`", CHANNELS;
        /// The typical magnitude of a channel; a factor of 3 does not matter
        scale: Vec<NamedValue>, "NAME=VALUE", "the largest of the first rows, from which then nothing is predicted", CHANNELS;
        /// The model structure
        model: Option<TrackModel>, "MODEL", "arx; that of `warm`", MODEL, [LINEAR];
        /// Coefficients of A: past outputs
        na: Option<usize>, "N", "", MODEL, [LINEAR];
        /// Which past outputs an output depends on, where there are several
        couple: Option<Coupling>, "COUPLE", "full", MODEL, [LINEAR];
        /// Coefficients of B: inputs; one value for each input or one for all, 0 for a model without inputs
        nb: Vec<usize>, "N[,…]", "", MODEL, [LINEAR];
        /// Coefficients of C: past disturbances
        nc: Option<usize>, "N", "", MODEL, [LINEAR];
        /// Samples from input to first effect, one value for each input or one for all
        nk: Vec<usize>, "N[,…]", "1", MODEL;
        /// Track y(k) = g(past outputs and inputs) + e(k) instead: all products of lags up to a degree (poly).
        /// Functions that a fit has chosen come from its report, with `warm`
        narx: Option<TrackMap>, "MAP", "", MODEL, [NARX];
        /// Past outputs that g reads: y(k-1), …, y(k-N)
        ny: Option<usize>, "N", "2", MODEL, [NARX];
        /// Values of each input that g reads, from `nk` on; one number for each input or one for all, 0 for a model
        /// without inputs
        nu: Vec<usize>, "N[,…]", "2", MODEL, [NARX];
        /// The largest number of factors of a product
        degree: Option<usize>, "D", "2", MODEL, [NARX];
        /// Estimate a constant too, for channels whose offsets are not known; without `offset` the first value of each
        /// is subtracted
        constant: bool, "", "", MODEL, [LINEAR];
        /// The estimation method
        method: Option<TrackMethod>, "METHOD", "rls; with C rpem", ADAPTATION, [LINEAR];
        /// The forgetting policy; several run in parallel: FACTOR for exponential:FACTOR, or none, exponential:FACTOR,
        /// selective:FACTOR, random-walk:VARIANCE, variable:FACTOR:MINIMUM:NOISE_VARIANCE
        forgetting: Vec<Policy>, "HOW[,HOW…]", "exponential:0.99", ADAPTATION;
        /// The start of the recursion: standard (from a wide prior), exact (without prior, once the samples determine
        /// the parameters), or mixed, mixed:SAMPLES (standard, then blended into exact)
        start: Option<TrackStart>, "HOW", "standard", ADAPTATION;
        /// Do not adapt where the innovation is smaller than this, in units of the output
        dead_zone: Option<f64>, "WIDTH", "0", ADAPTATION;
        /// The treatment of outliers, rows whose innovations are far larger than the noise: used; huber:THRESHOLD (an
        /// innovation above THRESHOLD standard deviations counts as THRESHOLD of them); gate:NIS:RELEASE (a row whose
        /// normalised innovation squared is above NIS is not used; after RELEASE such rows in a row the next ones are).
        /// huber is huber:3, gate is gate:25:20
        outliers: Option<TrackOutliers>, "HOW", "used", ADAPTATION;
        /// Add to each row a forecast of the output this many rows later, inputs held at their last value
        horizon: Option<usize>, "T", "", WATCH;
        /// Watch the innovations for changes of their mean and variance (CUSUM), with this many samples between two
        /// false alarms on average
        alarm: Option<f64>, "SAMPLES", "", WATCH;
    }
}

/// What trackers start from.
enum Source<'r> {
    Report(&'r Report),
    /// These orders; and of lags of these orders functions, if the model is nonlinear.
    Nothing(Orders, Option<Map>),
}

/// Orders as far as they were given.
struct Given<'o> {
    na: Option<usize>,
    nb: &'o [usize],
    nk: &'o [usize],
}

impl TrackOptions {
    /// Checks the options, whatever the channels; `warm`: the model is that of a report.
    ///
    /// # Errors
    /// [`Error::Argument`] for options that do not go together, or are missing.
    pub fn check(&self, warm: bool) -> Result<(), Error> {
        match self.narx {
            Some(_) => self.check_kind(NARX, Some("`narx`"))?,
            None => self.check_kind(LINEAR, None)?,
        }
        let given = self.given();
        if let Some((foreign, _)) =
            given.iter().find(|(option, _)| warm && OF_A_REPORT.contains(&option.field))
        {
            return Err(Error::argument(
                &foreign.name(),
                "does not work with `warm`; leave one of the two out",
            ));
        }
        let policies = &self.forgetting;
        if let Some(twice) = (1..policies.len()).find(|&index| policies[..index].contains(&policies[index])) {
            let message = format!("{} is there twice; give it once", policies[twice]);
            return Err(Error::argument("forgetting", message));
        }
        for (option, values) in [("offset", &self.offset), ("scale", &self.scale)] {
            let twice =
                |index: &usize| values[..*index].iter().any(|other| other.name == values[*index].name);
            if let Some(index) = (1..values.len()).find(twice) {
                let message = format!("'{}' has two; give one", values[index].name);
                return Err(Error::argument(option, message));
            }
        }
        if let Some(own) = self.scale.iter().find(|own| !(1e-98..=1e98).contains(&own.value)) {
            let message = format!(
                "{}={}: give the typical magnitude of the channel, from 1e-98 to 1e98",
                own.name, own.value
            );
            return Err(Error::argument("scale", message));
        }
        if self.horizon.is_some_and(|steps| !(1..=10_000).contains(&steps)) {
            return Err(Error::argument("horizon", "it is outside of 1..10000"));
        }
        if warm || self.narx.is_some() {
            return Ok(());
        }
        if self.na.is_none() && self.nb.is_empty() {
            let message =
                "the orders are missing: give `na` and `nb`, or `warm` REPORT to take up those of a fit";
            return Err(Error::argument("na", message));
        }
        if self.nb.is_empty() {
            return Err(Error::argument("nb", "missing: give it, 0 for a model without inputs"));
        }
        match (self.model, self.nc.unwrap_or(0)) {
            (Some(TrackModel::Arx), 1..) => {
                Err(Error::argument("nc", "an arx model has no C; leave it out, or give `model` armax"))
            }
            (Some(TrackModel::Armax), 0) => {
                Err(Error::argument("model", "armax needs `nc`, the number of coefficients of C"))
            }
            _ => Ok(()),
        }
    }

    /// The names of input channels that were given, if any were.
    pub fn inputs(&self) -> Option<Vec<String>> {
        ColumnName::all(&self.input)
    }

    /// The names of output channels that were given, if any were.
    pub fn outputs(&self) -> Option<Vec<String>> {
        ColumnName::all(&self.output)
    }

    /// Whether the model has inputs, as far as the options say.
    pub fn has_inputs(&self) -> bool {
        self.orders().nb.iter().any(|&nb| nb > 0)
    }

    /// Trackers for each way to forget: one for each output. `report` is where they start from.
    ///
    /// # Errors
    /// [`Error::Argument`] for options that do not go with the channels or with the report, and as for the
    /// constructors of [`Tracker`].
    pub fn trackers(
        &self,
        inputs: &[String],
        outputs: &[String],
        report: Option<&Report>,
    ) -> Result<Vec<Tracker>, Error> {
        let model = report.map(|report| &report.model);
        self.check_outputs(outputs, model)?;
        let source = match report {
            Some(report) => Source::Report(report),
            None => {
                let orders = self.orders().of(inputs.len(), self.nc)?;
                let degree = self.narx.map(|_| self.degree.unwrap_or(USUAL));
                let map = degree.map(|degree| Map::polynomial(orders.parameters(), degree)).transpose()?;
                Source::Nothing(orders, map)
            }
        };
        let noise = match &source {
            Source::Nothing(orders, _) => orders.nc,
            Source::Report(report) => report.model.as_polynomial().map_or(0, |model| model.orders.nc),
        };
        let usual = if noise > 0 { TrackMethod::Rpem } else { TrackMethod::Rls };
        let shared = TrackPlan {
            method: self.method.unwrap_or(usual),
            start: self.start.unwrap_or_default(),
            dead_zone: self.dead_zone.unwrap_or(0.0),
            outliers: self.outliers.unwrap_or_default(),
            constant: self.constant,
            alarm_interval: self.alarm,
            ..TrackPlan::default()
        };
        let known = |name: &String| inputs.contains(name) || outputs.contains(name);
        for (option, values) in [("offset", &self.offset), ("scale", &self.scale)] {
            if let Some(own) = values.iter().find(|own| !known(&own.name)) {
                return Err(Error::argument(option, format!("'{}' is no channel of the model", own.name)));
            }
        }
        // What each of several equations has of the outputs, as inputs in front of the others.
        let coupling = report.map_or(self.couple, coupling_of);
        let coupled = if outputs.len() > 1 && coupling != Some(Coupling::None) { outputs } else { &[] };
        let offsets = |output: usize| {
            let level = |name: &str, stored: Option<&Signal>| {
                let stored = stored.map_or(0.0, |signal| signal.offset.level);
                value(&self.offset, name).unwrap_or(stored)
            };
            let of_input = |index: usize| model.and_then(|model| model.inputs().get(index));
            let of_output = |index: usize| model.and_then(|model| model.outputs().get(index));
            let inputs = inputs.iter().enumerate().map(|(index, name)| level(name, of_input(index)));
            let past = coupled.iter().enumerate().map(|(index, name)| level(name, of_output(index)));
            (!self.offset.is_empty()).then(|| PerChannel {
                inputs: past.chain(inputs).collect(),
                output: level(&outputs[output], of_output(output)),
            })
        };
        let scale = |name: &str| {
            let none = || format!("'{name}' has none; give one for each channel, or none at all");
            value(&self.scale, name).ok_or_else(|| Error::argument("scale", none()))
        };
        let scales = |output: &str| {
            let of =
                |names: &[String]| names.iter().map(|name| scale(name)).collect::<Result<Vec<_>, Error>>();
            let all = || {
                Ok::<_, Error>(PerChannel {
                    inputs: [of(coupled)?, of(inputs)?].concat(),
                    output: scale(output)?,
                })
            };
            (!self.scale.is_empty()).then(all).transpose()
        };
        let track = |policy: Policy, place: usize| {
            let output = &outputs[place];
            let plan = TrackPlan {
                forgetting: policy,
                offsets: offsets(place),
                scales: scales(output)?,
                ..shared.clone()
            };
            match &source {
                Source::Report(report) => Tracker::from_report_of(report, place, &plan),
                Source::Nothing(orders, None) if !coupled.is_empty() => {
                    Tracker::coupled(orders, coupled.len(), &plan)
                }
                Source::Nothing(orders, None) => Tracker::new(orders, &plan),
                Source::Nothing(orders, Some(map)) => {
                    Tracker::nonlinear(orders, map, &orders.lag_names(inputs, output), &plan)
                }
            }
        };
        let usual = [Policy::default()];
        let policies = if self.forgetting.is_empty() { &usual[..] } else { &self.forgetting };
        let each = policies.iter().flat_map(|policy| (0..outputs.len()).map(move |place| (*policy, place)));
        each.map(|(policy, place)| track(policy, place)).collect()
    }

    fn orders(&self) -> Given<'_> {
        match self.narx {
            None => Given { na: self.na, nb: &self.nb, nk: &self.nk },
            Some(_) => Given {
                na: Some(self.ny.unwrap_or(USUAL)),
                nb: if self.nu.is_empty() { &[USUAL] } else { &self.nu },
                nk: &self.nk,
            },
        }
    }

    /// That the model can have these outputs.
    fn check_outputs(&self, outputs: &[String], stored: Option<&Model>) -> Result<(), Error> {
        let count = outputs.len();
        if count == 0 {
            return Err(Error::argument("output", "there is none; name one"));
        }
        if let Some(model) = stored.filter(|model| model.outputs().len() != count) {
            let all = model.outputs().len();
            return Err(Error::argument(
                "output",
                format!("{count} of the {all} outputs of `warm`; name all of them, or none"),
            ));
        }
        match self.couple {
            Some(_) if stored.is_some() => {
                return Err(Error::argument("couple", "that of `warm` is taken; leave it out"));
            }
            Some(_) if count == 1 => {
                return Err(Error::argument(
                    "couple",
                    "it is for several outputs, such as `output` y1,y2; leave it out",
                ));
            }
            _ if count == 1 => return Ok(()),
            _ => {}
        }
        let option = if self.narx.is_some() {
            "narx"
        } else if self.nc.is_some_and(|nc| nc > 0) {
            "nc"
        } else {
            return Ok(());
        };
        Err(Error::argument(
            option,
            "several outputs are tracked as ARX models; leave it out, or track one output",
        ))
    }
}

fn value(values: &[NamedValue], name: &str) -> Option<f64> {
    values.iter().find(|own| own.name == name).map(|own| own.value)
}

/// Which past outputs each output of a stored ARX model depends on; none of other models.
fn coupling_of(report: &Report) -> Option<Coupling> {
    report.estimation.procedure.vector_arx().map(|outcome| outcome.coupling)
}

impl Given<'_> {
    /// The orders for this many inputs.
    fn of(&self, inputs: usize, nc: Option<usize>) -> Result<Orders, Error> {
        let each = |option: &str, given: &[usize], usual: usize| match given {
            [] => Ok(vec![usual; inputs]),
            [one] => Ok(vec![*one; inputs]),
            all if all.len() == inputs => Ok(all.to_vec()),
            all => Err(Error::argument(
                option,
                format!("{} values for {inputs} inputs; give one for each, or one for all", all.len()),
            )),
        };
        let (nb, nk) = (each("nb", self.nb, 0)?, each("nk", self.nk, 1)?);
        Orders::new(self.na.unwrap_or(0), &nb, nc.unwrap_or(0), 0, &vec![0; inputs], &nk)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_help_names_every_way_to_forget() {
        let forgetting =
            TrackOptions::TABLE.iter().find(|option| option.field == "forgetting").expect("an option");
        let written: Vec<String> = Policy::all_written().collect();
        assert!(forgetting.help.ends_with(&format!("or {}", written.join(", "))), "{}", forgetting.help);
    }
}
