//! PID controllers.

use nalgebra::{Const, Vector3};

use super::RstController;
use crate::{Error, Real};

/// The settings of a PID controller in the standard form of the ISA.
///
/// ```text
/// u = K (β u_c - y + 1/T_i ∫ (u_c - y) dt - T_d dy_f/dt),     T_d/N_d dy_f/dt = y - y_f
/// ```
///
/// Each sample of length h has the backward differences of these, in polynomials of the delay
///
/// ```text
/// R = (1 - q⁻¹) (1 - γ q⁻¹),   γ = T_d/(T_d + N_d h)
/// S = K ((1 + h/T_i - q⁻¹) (1 - γ q⁻¹) + N_d γ (1 - q⁻¹)²)
/// T = K (β + h/T_i - β q⁻¹) (1 - γ q⁻¹)
/// ```
///
/// Without an integral R, S and T lack the factor 1 - q⁻¹. Beyond its limits the controller tracks the input that
/// acted, with the poles of T: within the time T_i β and that of the filter.
///
/// Source: Åström and Wittenmark, Computer-Controlled Systems, 3rd ed. 1997, section 8.5.
///
/// ```
/// use thetahat_core::{Error, PidSettings};
///
/// let settings = PidSettings::proportional(2.0, 0.5).with_integral_time(10.0).with_derivative_time(1.0);
/// let mut oven = settings.controller()?.with_limits(0.0..=100.0)?;
/// let power = oven.control(180.0, 20.0);
/// assert_eq!(power, 100.0);
/// # Ok::<(), Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct PidSettings<T> {
    /// K, the unit of u over that of y.
    pub gain: T,
    /// T_i, in the unit of time of the sample; infinity for no integral.
    pub integral_time: T,
    /// T_d, likewise; 0 for no derivative.
    pub derivative_time: T,
    /// N_d: the derivative is filtered with the time constant T_d/N_d. 3 to 20 are usual.
    pub derivative_filter: T,
    /// β, from 0 to 1: how much of a step of the set point reaches u at once.
    pub set_point_weight: T,
    /// h, the time between samples.
    pub sample_time: T,
}

impl<T: Real> PidSettings<T> {
    /// A proportional controller, N_d = 10 and β = 1 if more is added.
    pub fn proportional(gain: T, sample_time: T) -> Self {
        PidSettings {
            gain,
            integral_time: T::INFINITY,
            derivative_time: T::zero(),
            derivative_filter: T::from_count(10),
            set_point_weight: T::one(),
            sample_time,
        }
    }

    /// The same with an integral of this T_i.
    pub fn with_integral_time(mut self, time: T) -> Self {
        self.integral_time = time;
        self
    }

    /// The same with a derivative of this T_d.
    pub fn with_derivative_time(mut self, time: T) -> Self {
        self.derivative_time = time;
        self
    }

    /// The same with this filter of the derivative, N_d.
    pub fn with_derivative_filter(mut self, number: T) -> Self {
        self.derivative_filter = number;
        self
    }

    /// The same with this weight of the set point, β.
    pub fn with_set_point_weight(mut self, weight: T) -> Self {
        self.set_point_weight = weight;
        self
    }

    /// The controller, at rest.
    ///
    /// Without an integral the set point must have a weight above 0: nothing else of it reaches u.
    ///
    /// Errors: [`Error::OutOfRange`] for a setting that is out of its range; [`Error::NotFinite`] for a gain that is.
    pub fn controller(&self) -> Result<RstController<T, Const<3>>, Error> {
        let PidSettings { gain, integral_time, derivative_time, derivative_filter, .. } = *self;
        let PidSettings { set_point_weight: weight, sample_time, .. } = *self;
        let (zero, one) = (T::zero(), T::one());
        let above = |value: T| value > zero && value.is_finite();
        let integral = sample_time / integral_time;
        let checks = [
            ("gain", gain != zero, "not 0"),
            ("sample_time", above(sample_time), "finite and above 0"),
            ("integral_time", integral >= zero && integral.is_finite(), "above 0; infinity for no integral"),
            ("derivative_time", derivative_time >= zero && derivative_time.is_finite(), "finite, 0 or more"),
            ("derivative_filter", above(derivative_filter), "finite and above 0"),
            (
                "set_point_weight",
                weight >= zero && weight <= one && weight + integral > zero,
                "from 0 to 1, and above 0 without an integral",
            ),
        ];
        for (argument, holds, range) in checks {
            if !holds {
                return Err(Error::OutOfRange { argument, range });
            }
        }
        let filter = derivative_time / (derivative_time + derivative_filter * sample_time);
        let derivative = derivative_filter * filter;
        let (observer, bend) = (weight / (weight + integral), derivative + derivative);
        let (r, s, forgets) = if integral > zero {
            let later = -one - (one + integral) * filter - bend;
            (
                Vector3::new(-one - filter, filter, zero),
                Vector3::new(one + integral + derivative, later, filter + derivative),
                Vector3::new(-observer - filter, observer * filter, zero),
            )
        } else {
            let forgets = Vector3::new(-filter, zero, zero);
            (forgets, Vector3::new(one + derivative, -filter - derivative, zero), forgets)
        };
        RstController::new(gain * (weight + integral), r, s * gain, forgets)
    }
}

#[cfg(test)]
mod tests;
