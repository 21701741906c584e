//! What all self-tuners have around their estimators.

use super::past::Past;
use super::probe::Signs;
use super::sensor::{Reading, Watch};
use super::trust::{Distrust, Fallback, Supervisor};
use super::{TunerSettings, TunerState};
use crate::{Dimension, Error, Real, RstController};

/// The sensor, the actuator, the controller with its past, and the probing input.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(bound = ""))]
pub(super) struct ClosedLoop<T: Real, N: Dimension> {
    pub(super) settings: TunerSettings<T>,
    watch: Watch<T>,
    past: Past<T, N>,
    /// `None` until the first design.
    pub(super) controller: Option<RstController<T, N>>,
    /// What acts now.
    pub(super) input: T,
    /// How many there were, in which something was measured.
    samples: u16,
    signs: Signs,
    /// α, and for how many samples more.
    share: T,
    share_left: u32,
    pub(super) adapting: bool,
    pub(super) state: TunerState,
    pub(super) supervisor: Supervisor<T, N>,
}

impl<T: Real, N: Dimension> ClosedLoop<T, N> {
    /// The innovations of its model are so many samples `ahead`.
    pub(super) fn new(
        size: N,
        settings: &TunerSettings<T>,
        output_scale: T,
        ahead: usize,
    ) -> Result<Self, Error> {
        settings.check()?;
        Ok(ClosedLoop {
            watch: Watch::new(&settings.sensor),
            past: Past::resting(size, settings.input),
            controller: None,
            input: settings.input,
            samples: 0,
            signs: Signs::new(),
            share: T::zero(),
            share_left: 0,
            adapting: true,
            state: TunerState::Probing,
            supervisor: Supervisor::new(output_scale, ahead, settings.response.frequency, settings.input),
            settings: settings.clone(),
        })
    }

    /// Checks what was read: that it fits together, for controllers of this size.
    #[cfg(feature = "serde")]
    pub(super) fn check(&self, size: usize) -> Result<(), Error> {
        self.settings.check()?;
        self.past.check(size)?;
        self.supervisor.check(size)?;
        if let Some(controller) = &self.controller {
            crate::error::check_length("controller", size, controller.s().len())?;
        }
        if !(self.input.is_finite() && (T::zero()..=T::one()).contains(&self.share) && self.signs.is_alive())
        {
            return Err(Error::OutOfRange {
                argument: "input, share or signs",
                range: "as they were written",
            });
        }
        Ok(())
    }

    /// How many coefficients a controller has.
    pub(super) fn size(&self) -> N {
        self.past.size()
    }

    /// What the sensor says.
    pub(super) fn read(&mut self, measurement: T, predicted: T) -> Reading<T> {
        self.supervisor.ages();
        let reading = self.watch.take(measurement, predicted);
        self.samples = self.samples.saturating_add(u16::from(reading.output.is_some()));
        reading
    }

    /// Nothing to act on: the input stays.
    pub(super) fn hold(&mut self) -> T {
        let fallback = self.settings.supervision.fallback;
        let replacing = self.supervisor.distrust.filter(|_| self.supervisor.replaced);
        let held = match fallback {
            Fallback::Hold if replacing.is_some() => self.supervisor.held(),
            Fallback::Input(input) if replacing.is_some() => input,
            _ => self.input,
        };
        self.state = replacing.map_or(TunerState::Holding, TunerState::Distrusted);
        // The actuator may have told of one beyond them.
        self.input = self.limited(held);
        self.input
    }

    fn limited(&self, input: T) -> T {
        input.max(*self.settings.limits.start()).min(*self.settings.limits.end())
    }

    /// Whether there is no controller yet, and it is too early for one.
    pub(super) fn waits(&self, knows_gain: impl FnOnce() -> bool) -> bool {
        let probing = &self.settings.probing;
        self.controller.is_none()
            && (self.samples < probing.at_least || (self.samples < probing.at_most && !knows_gain()))
    }

    /// There is no need to probe.
    pub(super) fn skip_probing(&mut self) {
        self.samples = self.settings.probing.at_most;
    }

    /// Another controller, as if it had been there.
    pub(super) fn install(&mut self, controller: RstController<T, N>) -> Result<(), Error> {
        let mut controller = controller.with_limits(self.settings.limits.clone())?;
        self.past.resume(&mut controller);
        self.controller = Some(controller);
        self.supervisor.designed();
        Ok(())
    }

    /// The input from now on. The set point is that of the controller; the user's is larger by the offset.
    pub(super) fn act(
        &mut self,
        set_point: T,
        offset: T,
        reading: &Reading<T>,
        output: T,
        knows_gain: impl FnOnce() -> bool,
    ) -> T {
        let was_replaced = self.supervisor.replaced;
        self.supervisor.evaluate(&self.settings.supervision, self.controller.is_some(), knows_gain);
        let distrust = self.supervisor.distrust;
        if let Some(distrust) = distrust.filter(|_| self.supervisor.replaced) {
            if let Some(good) = self.supervisor.good_mut().filter(|_| !was_replaced) {
                self.past.resume(good);
            }
            return self.fall_back(distrust, set_point, output);
        }
        let probing = self.settings.probing;
        let (wanted, amplitude) = match &mut self.controller {
            Some(controller) => {
                self.state = match distrust {
                    _ if reading.predicted => TunerState::Bridging,
                    Some(distrust) => TunerState::Distrusted(distrust),
                    None => TunerState::Controlling,
                };
                let amplitude = if self.share_left > 0 { self.share * probing.largest } else { T::zero() };
                self.share_left = self.share_left.saturating_sub(1);
                (controller.control(set_point, output), amplitude)
            }
            None => {
                self.state = TunerState::Probing;
                (self.settings.input, probing.amplitude_at(self.samples))
            }
        };
        let excited =
            if amplitude > T::zero() { wanted + amplitude * self.signs.next::<T>() } else { wanted };
        let input = self.limited(excited);
        let (lowest, highest) = (*self.settings.limits.start(), *self.settings.limits.end());
        let at_limits = (excited <= lowest, excited >= highest && highest > lowest);
        self.supervisor.acted(
            self.controller.as_ref(),
            set_point + offset,
            input,
            at_limits,
            self.settings.response.frequency,
        );
        self.past.push(set_point, output, input, wanted);
        self.tell(input);
        input
    }

    /// The input of the fallback, and what excites the plant.
    fn fall_back(&mut self, distrust: Distrust, set_point: T, output: T) -> T {
        self.state = TunerState::Distrusted(distrust);
        let supervision = self.settings.supervision;
        let wanted = self.supervisor.fallback(supervision.fallback, set_point, output);
        let excited = wanted + supervision.excitation * self.signs.next::<T>();
        let input = self.limited(excited);
        self.past.push(set_point, output, input, wanted);
        self.tell(input);
        input
    }

    /// The sign of the gain is another one than it was said to be.
    pub(super) fn set_gain_sign(&mut self, sign: T) -> Result<(), Error> {
        if !sign.is_finite() {
            return Err(Error::OutOfRange { argument: "gain_sign", range: "a number" });
        }
        self.settings.gain_sign = sign;
        Ok(())
    }

    pub(super) fn set_fallback(&mut self, fallback: Fallback<T>) -> Result<(), Error> {
        fallback.check()?;
        self.settings.supervision.fallback = fallback;
        Ok(())
    }

    /// Goes back to the controller, if it is not trusted.
    pub(super) fn trust(&mut self) {
        self.supervisor.trust();
        self.supervisor.forgive();
        if let Some(controller) = &mut self.controller {
            self.past.resume(controller);
        }
    }

    /// The actuator did something else.
    pub(super) fn applied(&mut self, input: T) {
        if input.is_finite() {
            self.past.correct(input);
            self.tell(input);
        }
    }

    fn tell(&mut self, input: T) {
        let acting = match self.supervisor.replaced {
            false => self.controller.as_mut(),
            true => self.supervisor.good_mut(),
        };
        if let Some(controller) = acting {
            controller.applied(input);
        }
        self.input = input;
    }

    /// u = α u_c + (1 - α) u_f for so many samples.
    pub(super) fn probe(&mut self, share: T, samples: u32) -> Result<(), Error> {
        if !(share >= T::zero() && share <= T::one()) {
            return Err(Error::OutOfRange { argument: "share", range: "from 0 to 1" });
        }
        (self.share, self.share_left) = (share, samples);
        Ok(())
    }
}
