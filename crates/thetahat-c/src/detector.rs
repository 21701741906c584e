//! Change detection.

use thetahat_core::{ChangeDetector, Chart as CoreChart};

use crate::error::code;
use crate::innovation::Innovation;
use crate::memory::{self, Kind, Place, View, Word};
use crate::{Error, Number};

/// What a chart watches.
#[repr(i32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Chart {
    /// None: there is no alarm.
    None = 0,
    /// Whether the mean of the innovations has risen.
    MeanUp = 1,
    /// Whether the mean of the innovations has fallen.
    MeanDown = 2,
    /// Whether the innovations have become larger, in either direction.
    Variance = 3,
}

/// What a chart says once it has passed its threshold.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct Alarm {
    /// The chart, a `thetahat_chart`: NONE if no chart has passed its threshold.
    pub chart: i32,
    /// Since how many samples its statistic had been above 0: the most likely time since the change.
    pub samples: u32,
    /// Its statistic, before it was set back to 0.
    pub statistic: Number,
}

/// Watches innovations for a change: three CUSUM charts, two on the mean and one on the variance.
pub struct Detector {
    _opaque: [u8; 0],
}

/// A detector has one size.
pub(crate) struct DetectorSize {
    view: View<ChangeDetector<Number>>,
}

static SIZE: DetectorSize = DetectorSize { view: |body| body.cast() };

impl Kind for Detector {
    const TAG: u32 = 0x5445_4454;
    type Size = DetectorSize;
    type Body = ChangeDetector<Number>;

    fn view(size: &DetectorSize) -> View<ChangeDetector<Number>> {
        size.view
    }
}

/// Makes charts at 0.
///
/// - detector: where its handle goes. It points into the memory.
/// - memory, bytes: at least `THETAHAT_DETECTOR_WORDS` words, and their size in bytes.
/// - mean_threshold, variance_threshold: above 0. A chart with the threshold h gives at most one false alarm in exp(h)
///   samples on average; INFINITY turns it off.
///
/// Errors: MEMORY_TOO_SMALL; OUT_OF_RANGE.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn thetahat_detector_init(
    detector: *mut *mut Detector,
    memory: *mut Word,
    bytes: usize,
    mean_threshold: Number,
    variance_threshold: Number,
) -> Error {
    code(|| {
        let handle = memory::follow(detector)?.cast_mut();
        let place = Place::<Detector>::new(memory, bytes, &raw const SIZE)?;
        *handle = place.write(ChangeDetector::new(mean_threshold, variance_threshold)?)?;
        Ok(())
    })
}

/// Takes the innovation of a sample, of an estimator or filter. One that is missing, or whose variance is not known,
/// changes nothing. Of several outputs the normalised square is watched, by the chart of the variance alone.
///
/// - alarm: what the charts say. Its chart is NONE if they say nothing.
///
/// Errors: NULL_POINTER; LENGTH if the innovation has no outputs, or more than THETAHAT_MOST_OUTPUTS.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn thetahat_detector_update(
    detector: *mut Detector,
    innovation: *const Innovation,
    alarm: *mut Alarm,
) -> Error {
    code(|| {
        let charts = memory::open(detector)?;
        let innovation = *memory::follow(innovation)?;
        let place = memory::follow(alarm)?.cast_mut();
        let (one, all) = innovation.core();
        let given = match innovation.outputs as usize {
            1 => charts.update(&one),
            2..=crate::innovation::THETAHAT_MOST_OUTPUTS => charts.update_all(&all),
            _ => return Err(Error::Length),
        };
        *place = given.map_or(Alarm { chart: Chart::None as i32, samples: 0, statistic: 0.0 }, |alarm| {
            let chart = match alarm.chart {
                CoreChart::MeanUp => Chart::MeanUp,
                CoreChart::MeanDown => Chart::MeanDown,
                CoreChart::Variance => Chart::Variance,
            };
            Alarm { chart: chart as i32, samples: alarm.samples, statistic: alarm.statistic }
        });
        Ok(())
    })
}

/// Sets all charts back to 0, as after a change that is known.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn thetahat_detector_reset(detector: *mut Detector) -> Error {
    code(|| {
        memory::open(detector)?.reset();
        Ok(())
    })
}
