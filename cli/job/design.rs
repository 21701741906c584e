use thetahat::design::{SignalKind, SignalPlan, Want, Waveform};
use thetahat::model::Model;

use super::parsed;
use super::range;
use crate::args::DesignArguments;
use crate::failure::Failure;

/// Test signals to make, or to compare.
#[derive(Debug)]
pub(crate) struct DesignJob {
    /// The signals; none: what is usual.
    waveforms: Vec<Waveform>,
    /// What they share. Channels and sample time are those of a model where they were not given.
    shared: SignalPlan,
    pub(crate) wants: Vec<Want>,
}

impl DesignJob {
    pub(crate) fn resolve(arguments: &DesignArguments) -> Result<Self, Failure> {
        let waveforms = arguments.signal.iter().map(|text| parsed("--signal", text));
        let waveforms: Vec<Waveform> = waveforms.collect::<Result<_, _>>()?;
        if arguments.model.is_none() && waveforms.len() > 1 {
            return Err(Failure::usage(
                "--signal: one signal is written at a time; several are compared for a model (--for)",
            ));
        }
        let usual = SignalPlan::new(SignalKind::Prbs);
        let shared = SignalPlan {
            range: range("--range", &arguments.range)?,
            rms: arguments.rms,
            band: arguments.band.as_deref().map(|text| range("--band", text)).transpose()?,
            points: arguments.points,
            length: arguments.length.unwrap_or(usual.length),
            period: arguments.period,
            channels: arguments.channels.unwrap_or(usual.channels),
            seed: arguments.seed,
            sample_time: arguments.sample_time.unwrap_or(usual.sample_time),
            ..usual
        };
        let wants = arguments.want.iter().map(|text| parsed("--want", text));
        Ok(Self { waveforms, shared, wants: wants.collect::<Result<_, _>>()? })
    }

    /// The one signal that is written.
    pub(crate) fn plan(&self) -> SignalPlan {
        let waveform = self.waveforms.first().copied().unwrap_or(self.shared.waveform);
        SignalPlan { waveform, ..self.shared.clone() }
    }

    /// The signals that are compared for a model. What only some kinds have, a band and a number of frequencies, is
    /// that of these.
    pub(crate) fn plans(
        &self,
        arguments: &DesignArguments,
        model: &Model,
    ) -> Result<Vec<SignalPlan>, Failure> {
        let all = || SignalKind::all().map(Waveform::from).collect();
        let waveforms = if self.waveforms.is_empty() { all() } else { self.waveforms.clone() };
        for (option, given, has) in [
            ("--band", self.shared.band.is_some(), SignalKind::has_band as fn(SignalKind) -> bool),
            ("--points", self.shared.points.is_some(), SignalKind::has_points),
        ] {
            if given && !waveforms.iter().any(|waveform| has(waveform.kind)) {
                return Err(Failure::usage(format!("{option}: none of these signals has one; leave it out")));
            }
        }
        if let Some(asked) = arguments.sample_time
            && asked != model.sample_time()
        {
            return Err(Failure::usage(format!(
                "--sample-time {asked}: the model's is {}; leave it out",
                model.sample_time()
            )));
        }
        let plan = |waveform: &Waveform| SignalPlan {
            waveform: *waveform,
            band: self.shared.band.filter(|_| waveform.kind.has_band()),
            points: self.shared.points.filter(|_| waveform.kind.has_points()),
            channels: arguments.channels.unwrap_or(model.inputs().len().max(1)),
            sample_time: model.sample_time(),
            ..self.shared.clone()
        };
        Ok(waveforms.iter().map(plan).collect())
    }
}
