//! The options of test signals, and the plans that they make.

use super::signal::SignalPlan;
use super::want::Want;
use super::waveform::{SignalKind, Waveform};
use crate::Error;
use crate::model::Model;
use crate::options::{Ends, options, texts};

const SIGNAL: &str = "Signal";
const WORTH: &str = "Worth";

texts! {
    Waveform, List, "str", "Union[str, Sequence[str]]";
    Want, List, "str", "Sequence[str]";
}

options! {
    /// What test signals have to be, as it was given.
    ///
    /// ```
    /// use thetahat::design::{DesignOptions, SignalKind};
    ///
    /// let options: DesignOptions = serde_json::from_str(r#"{"signal": "chirp", "band": "0.1..2"}"#)?;
    /// let plan = options.signal_plan()?;
    /// assert_eq!((plan.waveform.kind, plan.band), (SignalKind::Chirp, Some([0.1, 2.0])));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    DesignOptions of "a test signal" {
        /// The signal: prbs, rbs, multisine, chirp, white, sines or steps; after a colon for how many samples each
        /// value of prbs, rbs, white or steps is held, such as prbs:4. With `for` several
        signal: Vec<Waveform>, "SIGNAL[,SIGNAL…]", "prbs, with `for` all", SIGNAL;
        /// How many samples
        length: Option<usize>, "N", "1023, a period of a PRBS; with `for` the length whose errors are told", SIGNAL;
        /// The lowest and the highest value, in units of the input
        range: Option<Ends>, "LOW..HIGH", "-1..1", SIGNAL;
        /// A power budget: give the deviations from the middle of the range this root mean square, instead of its width
        rms: Option<f64>, "R", "", SIGNAL;
        /// The lowest and the highest frequency of multisine, chirp and sines, in radians per second
        band: Option<Ends>, "LOW..HIGH", "all", SIGNAL;
        /// How many frequencies, each the same factor above the one before, of multisine and sines
        points: Option<usize>, "K", "every line of the period; of sines 10", SIGNAL;
        /// Repeat the signal after this many samples
        period: Option<usize>, "P", "of prbs the longest that fits, of multisine 4096 at most, else the length", SIGNAL;
        /// The number of uncorrelated signals
        channels: Option<usize>, "M", "1, with `for` one for each input of the model", SIGNAL;
        /// Seconds from one sample to the next
        sample_time: Option<f64>, "SECONDS", "1, with `for` that of the model", SIGNAL;
        /// The seed of random signals, or where a PRBS begins
        seed: Option<u64>, "S", "0", SIGNAL;
        /// Compute how many samples are needed for these standard errors of these figures: a parameter, dc-gain or
        /// time-constant (dc-gain2 is that of the second input), absolute or in percent of its value
        want: Vec<Want>, "FIGURE:ERROR[,…]", "", WORTH;
    }
}

impl DesignOptions {
    /// The one signal that they ask for.
    ///
    /// # Errors
    /// [`Error::Argument`] for several signals, and for what only a comparison has.
    pub fn signal_plan(&self) -> Result<SignalPlan, Error> {
        if !self.want.is_empty() {
            return Err(Error::argument("want", "it takes a model: give `for`, or leave it out"));
        }
        let waveform = match self.signal.as_slice() {
            [] => SignalKind::Prbs.into(),
            [one] => *one,
            _ => {
                return Err(Error::argument(
                    "signal",
                    "one signal is written at a time; several are compared for a model (`for`)",
                ));
            }
        };
        Ok(self.plan(waveform))
    }

    /// The signals that are compared for a model. What only some kinds have, a band and a number of frequencies, is
    /// that of these.
    ///
    /// # Errors
    /// [`Error::Argument`] for a band or a number of frequencies that none of the signals has, and a sample time that
    /// is not the model's.
    pub fn signal_plans(&self, model: &Model) -> Result<Vec<SignalPlan>, Error> {
        let all = || SignalKind::all().map(Waveform::from).collect();
        let waveforms = if self.signal.is_empty() { all() } else { self.signal.clone() };
        for (option, given, has) in [
            ("band", self.band.is_some(), SignalKind::has_band as fn(SignalKind) -> bool),
            ("points", self.points.is_some(), SignalKind::has_points),
        ] {
            if given && !waveforms.iter().any(|waveform| has(waveform.kind)) {
                return Err(Error::argument(option, "none of these signals has one; leave it out"));
            }
        }
        if let Some(asked) = self.sample_time
            && asked != model.sample_time()
        {
            return Err(Error::argument(
                "sample-time",
                format!("{asked}: the model's is {}; leave it out", model.sample_time()),
            ));
        }
        let plan = |waveform: &Waveform| {
            let plan = self.plan(*waveform);
            SignalPlan {
                band: plan.band.filter(|_| waveform.kind.has_band()),
                points: plan.points.filter(|_| waveform.kind.has_points()),
                channels: self.channels.unwrap_or(model.inputs().len().max(1)),
                sample_time: model.sample_time(),
                ..plan
            }
        };
        Ok(waveforms.iter().map(plan).collect())
    }

    fn plan(&self, waveform: Waveform) -> SignalPlan {
        let usual = SignalPlan::new(waveform);
        SignalPlan {
            range: self.range.map_or(usual.range, |Ends(ends)| ends),
            rms: self.rms,
            band: self.band.map(|Ends(ends)| ends),
            points: self.points,
            length: self.length.unwrap_or(usual.length),
            period: self.period,
            channels: self.channels.unwrap_or(usual.channels),
            seed: self.seed.unwrap_or(usual.seed),
            sample_time: self.sample_time.unwrap_or(usual.sample_time),
            ..usual
        }
    }
}
