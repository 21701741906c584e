//! What is written, and how it is checked when it is read back.

use nalgebra::Const;

use super::{Adaptation, ClosedLoop, DirectSelfTuner, Filter};
use crate::error::{check_entries, check_finite};
use crate::snapshot::snapshot;
use crate::{Dimension, Error, Lags, Real};

snapshot! {
    Snapshot<T, P, N, D> of DirectSelfTuner<T, P, N, D>
    where [T: Real, P: Dimension + Dimension<Const<1>>, N: Dimension, D: Dimension] {
        lags: Lags<T, P, D>;
        adaptation: Adaptation<T, P>;
        closed: ClosedLoop<T, N>;
        of_r: usize;
        filtered_inputs: [T; 3];
        filtered_outputs: [T; 3];
        output: T;
        known: T;
    }
}

impl<T: Real, P: Dimension + Dimension<Const<1>>, N: Dimension, D: Dimension> TryFrom<Snapshot<T, P, N, D>>
    for DirectSelfTuner<T, P, N, D>
{
    type Error = Error;

    fn try_from(read: Snapshot<T, P, N, D>) -> Result<Self, Error> {
        let Snapshot { lags, adaptation, closed, of_r, filtered_inputs, filtered_outputs, .. } = read;
        let Snapshot { output, known, .. } = read;
        let parameters = lags.size().value();
        let rest = usize::from(lags.constant(adaptation.parameters()).is_some());
        let of_s = parameters.checked_sub(of_r + rest).filter(|of_s| *of_s > 0 && of_r > 0);
        if lags.inputs() != 2 || of_s.is_none() {
            return Err(Error::OutOfRange {
                argument: "of_r",
                range: "the coefficients of R, with some of S beside them",
            });
        }
        if let Adaptation::Gradient { parameters: found, weights, gain } = &adaptation {
            check_entries("parameters", found.as_slice(), parameters)?;
            check_entries("weights", weights.as_slice(), parameters)?;
            check_finite("gain", &[*gain])?;
        }
        crate::error::check_length("adaptation", parameters, adaptation.parameters().len())?;
        for (argument, values) in [
            ("filtered_inputs", &filtered_inputs),
            ("filtered_outputs", &filtered_outputs),
            ("output", &[output, known, output]),
        ] {
            check_finite(argument, values)?;
        }
        closed.check((of_r - 1).max(of_s.unwrap_or(0)).max(1))?;
        let filter = Filter::of(&closed.settings.response);
        Ok(DirectSelfTuner {
            lags,
            adaptation,
            closed,
            of_r,
            filter,
            filtered_inputs,
            filtered_outputs,
            output,
            known,
        })
    }
}
