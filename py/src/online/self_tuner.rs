//! A controller that learns its plant.

use numpy::PyArray1;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use thetahat_core::nalgebra::Dyn;
use thetahat_core::{
    Fallback, IndirectSelfTuner, Probing, RecursiveArmax, ResponseWanted, RlsStart, Sensor, Supervision,
    TunerOrders, TunerSettings, TunerState,
};

use super::argument::{self, Whole, count, failed};
use super::controller::RstController;
use super::forgetting::{Memory, STANDARD};
use super::innovation::Innovation;
use super::{Reduced, snapshot};

/// Without noise parameters that of an ARX model, to the bit.
type Stepper = IndirectSelfTuner<f64, Dyn, Dyn, RecursiveArmax<f64, Dyn>>;

/// A controller that estimates a model of its plant, and is designed anew for it while it runs.
///
/// Parameters
/// ----------
/// na, nb : int
///     The orders of the model. 2 coefficients of B for a plant of second order, and one more for each sample of dead
///     time that there may be.
/// nc : int, default 0
///     The order of C: above 0 where the noise is not white. Then C is a factor of the observer's polynomial.
/// frequency : float
///     The natural frequency of the response that is wanted, in rad a sample: it settles in about 4 / (damping
///     frequency) samples.
/// damping : float, default 0.8
///     Its damping, above 0 and at most 1.
/// observer : float, default 0.3
///     How fast loads and errors are forgotten: a pole, 0 or more and below 1.
/// limits : (lower, upper)
///     The range of the actuator.
/// input : float, optional
///     What it starts with: 0, or the nearest limit.
/// output_scale, input_scale : float, default 1.0
///     The usual sizes of output and input.
/// gain_sign : {-1, 0, 1}, default 0
///     The sign of the plant's static gain, where it is known.
/// forgetting : float, Forgetting or None, default 0.99
///     How old samples are forgotten.
/// constant : bool, default True
///     Whether the model has a constant, for signals that are no deviations and for loads.
/// integrator : bool, default True
///     Whether the controller integrates.
/// probing : (first, largest), optional
///     The amplitudes with which the plant is excited until there is a controller: a tenth of the input's scale,
///     doubled up to twice.
/// sensor_range : (lower, upper), optional
///     What the sensor can measure. What is beyond is taken as the end of the range.
/// stuck_after : int, default 0
///     So many equal measurements in a row are those of a sensor that is stuck; 0 if a working one repeats itself.
/// fallback : {"hold", "last good"} or float, default "hold"
///     What acts while the tuner is not trusted: the mean input of the latest 64 sound samples, the controller of
///     these, or this input.
/// excitation : float, optional
///     The amplitude that excites the plant then: a tenth of the input's scale. With 0 trust may not come back by
///     itself.
/// start : {"standard", "exact"}, default "standard"
///     As for `RecursiveLeastSquares`; only "standard" with `nc` above 0.
///
/// Raises
/// ------
/// ValueError
///     For a setting out of its range.
///
/// Notes ----- The model is A y = B u + constant + C e, and the closed loop has the poles A_m A_o of the response that
/// is wanted, with A_o = C (1 - observer q^-1). Noise that is not white biases the model with `nc` = 0; with it, the
/// noise passes through the loop without the factor C. It takes more samples to know more parameters: where the noise
/// is nearly white, `nc` = 0 is better.
///
/// A measurement that is NaN is missing: the controller goes on with what its model predicts, for 100 samples, and then
/// holds the input. A design is taken only where the peaks of its sensitivities with the model are below 2; slower
/// responses are tried in turn, and the last good controller stays otherwise.
///
/// Where designs are refused for long, the input goes from limit to limit, or the model predicts worse than the latest
/// measurement does, the tuner is not trusted: `distrust` says why, the fallback acts (the last controller, where it is
/// only old), and the model goes on learning. It controls again by itself where that makes it good again; a sign that
/// is wrong is given anew by `set_gain_sign`.
///
/// The margins are those with the model: where the plant is of a higher order, disturbances can make the loop burst up
/// to the limits.
///
/// References
/// ----------
/// Åström and Wittenmark, Adaptive Control, 2nd ed., 1995, section 3.4 and chapter 11.
///
/// Examples -------- >>> from thetahat import SelfTuner >>> tuner = SelfTuner(1, 2, frequency=0.3, limits=(0.0, 100.0),
/// input=20.0, output_scale=50.0, input_scale=10.0, gain_sign=1) >>> temperature, power = 20.0, 20.0 >>> for _ in
/// range(300): ... temperature = 0.95 * temperature + 0.08 * power + 0.5 ... power = tuner.control(60.0,
/// temperature) >>> tuner.state, round(temperature, 3) ('controlling', 60.0)
#[pyclass(module = "thetahat")]
pub(crate) struct SelfTuner {
    pub(super) tuner: Stepper,
}

fn sign_of(sign: Whole) -> PyResult<f64> {
    match sign.0 {
        -1 => Ok(-1.0),
        0 => Ok(0.0),
        1 => Ok(1.0),
        _ => Err(PyValueError::new_err("gain_sign: expected -1, 0 or 1")),
    }
}

fn fallback_of(given: &Bound<'_, PyAny>) -> PyResult<Fallback<f64>> {
    if let Ok(input) = given.extract::<f64>() {
        return Ok(Fallback::Input(input));
    }
    match given.extract::<String>().as_deref() {
        Ok("hold") => Ok(Fallback::Hold),
        Ok("last good") => Ok(Fallback::LastGood),
        _ => Err(PyValueError::new_err("fallback: expected 'hold', 'last good' or an input")),
    }
}

#[pymethods]
#[pyo3(crate = "crate::in_use")]
impl SelfTuner {
    #[new]
    #[pyo3(signature = (na, nb, *, nc = Whole(0), frequency, limits, damping = 0.8, observer = 0.3, input = None, output_scale = 1.0, input_scale = 1.0,
        gain_sign = Whole(0), forgetting = STANDARD, constant = true, integrator = true, probing = None, sensor_range = None,
        stuck_after = Whole(0), fallback = None, excitation = None, start = "standard"))]
    #[pyo3(
        text_signature = "(na, nb, *, nc=0, frequency, limits, damping=0.8, observer=0.3, input=None, output_scale=1.0, input_scale=1.0, gain_sign=0, forgetting=0.99, constant=True, integrator=True, probing=None, sensor_range=None, stuck_after=0, fallback='hold', excitation=None, start='standard')"
    )]
    #[expect(clippy::too_many_arguments, reason = "most are options, given by name")]
    fn new(
        py: Python<'_>,
        na: Whole,
        nb: Whole,
        nc: Whole,
        frequency: f64,
        limits: (f64, f64),
        damping: f64,
        observer: f64,
        input: Option<f64>,
        output_scale: f64,
        input_scale: f64,
        gain_sign: Whole,
        forgetting: Memory,
        constant: bool,
        integrator: bool,
        probing: Option<(f64, f64)>,
        sensor_range: Option<(f64, f64)>,
        stuck_after: Whole,
        fallback: Option<&Bound<'_, PyAny>>,
        excitation: Option<f64>,
        start: &str,
    ) -> PyResult<Self> {
        let (na, nb, nc) = (count("na", na, 0, 64)?, count("nb", nb, 1, 64)?, count("nc", nc, 0, 64)?);
        let gain_sign = sign_of(gain_sign)?;
        let start = match start {
            "standard" => RlsStart::Standard,
            "exact" => RlsStart::Exact,
            _ => {
                return Err(PyValueError::new_err(format!(
                    "start: expected 'standard' or 'exact', found {start:?}"
                )));
            }
        };
        let orders = TunerOrders { na, nb, nc, constant, integrator };
        let response = ResponseWanted { frequency, damping, observer };
        let usual = TunerSettings::new(response, limits.0..=limits.1, input_scale);
        let probing = probing.map_or(usual.probing, |(amplitude, largest)| Probing {
            amplitude,
            largest,
            ..usual.probing
        });
        let (lowest, highest) = sensor_range.unwrap_or((f64::NEG_INFINITY, f64::INFINITY));
        let stuck_after =
            u16::try_from(count("stuck_after", stuck_after, 0, u16::MAX.into())?).unwrap_or(u16::MAX);
        let sensor = Sensor { range: lowest..=highest, stuck_after, ..Sensor::default() };
        let supervision = Supervision {
            fallback: fallback.map_or(Ok(Fallback::Hold), fallback_of)?,
            excitation: excitation.unwrap_or(usual.supervision.excitation),
            ..usual.supervision
        };
        let settings = TunerSettings {
            input: input.unwrap_or(usual.input),
            gain_sign,
            probing,
            sensor,
            supervision,
            ..usual.clone()
        };
        let tuner = Stepper::new(&orders, &settings, output_scale, input_scale, forgetting.0)
            .and_then(|tuner| tuner.with_start(start))
            .map_err(|error| failed(py, error))?;
        Ok(Self { tuner })
    }

    /// The input from now on, within the limits: the model learns from the measurement, and the controller acts.
    ///
    /// Parameters
    /// ----------
    /// set_point, y : float
    ///     What the output shall be, and what was measured. NaN is a missing measurement.
    ///
    /// Returns
    /// -------
    /// float
    fn control(&mut self, set_point: f64, y: f64) -> f64 {
        self.tuner.control(set_point, y)
    }

    /// Tell that the actuator did something else than the latest `control` asked for.
    ///
    /// Parameters
    /// ----------
    /// u : float
    ///     What it did. A number that is not finite is not taken.
    fn applied(&mut self, u: f64) {
        self.tuner.applied(u);
    }

    /// Excite the plant around what the controller wants: u = share u_c + (1 - share) u_f, u_c being u_f plus or minus
    /// the largest amplitude of probing.
    ///
    /// Parameters
    /// ----------
    /// share : float
    ///     From 0 to 1.
    /// samples : int
    ///     For so many samples.
    fn probe(&mut self, py: Python<'_>, share: f64, samples: Whole) -> PyResult<()> {
        let samples = count("samples", samples, 0, u32::MAX as usize)?;
        self.tuner.probe(share, u32::try_from(samples).unwrap_or(u32::MAX)).map_err(|error| failed(py, error))
    }

    /// Turn adaptation off, or on again: the model and the controller stay as they are.
    fn set_adaptation(&mut self, on: bool) {
        self.tuner.set_adaptation(on);
    }

    /// Say that the plant's static gain has this sign from now on.
    ///
    /// Parameters
    /// ----------
    /// sign : {-1, 0, 1}
    ///     0 if it is not known.
    fn set_gain_sign(&mut self, py: Python<'_>, sign: Whole) -> PyResult<()> {
        let sign = sign_of(sign)?;
        self.tuner.set_gain_sign(sign).map_err(|error| failed(py, error))
    }

    /// Choose what acts while it is not trusted.
    ///
    /// Parameters
    /// ----------
    /// fallback : {"hold", "last good"} or float
    fn set_fallback(&mut self, py: Python<'_>, fallback: &Bound<'_, PyAny>) -> PyResult<()> {
        self.tuner.set_fallback(fallback_of(fallback)?).map_err(|error| failed(py, error))
    }

    /// Trust it from now on: the controller acts, or the plant is excited until there is one.
    fn trust(&mut self) {
        self.tuner.trust();
    }

    /// Why it is not trusted, as "sign of the gain"; None if it is.
    #[getter]
    fn distrust(&self) -> Option<&'static str> {
        self.tuner.distrust().map(thetahat_core::Distrust::word)
    }

    /// What the latest measurement told the model.
    #[getter]
    fn innovation(&self) -> Innovation {
        self.tuner.innovation().into()
    }

    /// The samples since the latest design that was accepted.
    #[getter]
    fn design_age(&self) -> u32 {
        self.tuner.design_age()
    }

    /// What it did in the latest sample: "probing", "controlling", "bridging" a silent sensor with the model, "holding"
    /// the input, or "distrusted": the fallback acts, or a controller that is old.
    #[getter]
    fn state(&self) -> &'static str {
        match self.tuner.state() {
            TunerState::Probing => "probing",
            TunerState::Controlling => "controlling",
            TunerState::Bridging => "bridging",
            TunerState::Distrusted(_) => "distrusted",
            _ => "holding",
        }
    }

    /// A of the model, from its 1 on.
    #[getter]
    fn a<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_iter(py, self.tuner.plant().a())
    }

    /// B of the model, with its leading zero.
    #[getter]
    fn b<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_iter(py, self.tuner.plant().b(0).into_iter().flatten())
    }

    /// C of the model, from its 1 on.
    #[getter]
    fn c<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_iter(py, self.tuner.plant().c())
    }

    /// The constant of the model; None if it has none.
    #[getter]
    fn constant(&self) -> Option<f64> {
        self.tuner.plant().constant()
    }

    /// The standard errors of a_1 ... b_1 ..., the constant and c_1 ...; None as long as they are not known.
    #[getter]
    fn standard_errors<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray1<f64>>> {
        self.tuner.plant().estimator().standard_errors().map(|errors| argument::from_vector(py, &errors))
    }

    /// The controller as it is, a copy; None until there is one.
    #[getter]
    fn controller(&self) -> Option<RstController> {
        self.tuner.controller().cloned().map(RstController::of)
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Reduced<'py>> {
        snapshot(py, "SelfTuner", &self.tuner)
    }

    fn __repr__(&self) -> String {
        let plant = self.tuner.plant();
        let (a, b, c) = (plant.a().count(), plant.b(0).map_or(1, Iterator::count), plant.c().count());
        format!("SelfTuner(na={}, nb={}, nc={}, {})", a - 1, b - 1, c - 1, self.state())
    }
}
