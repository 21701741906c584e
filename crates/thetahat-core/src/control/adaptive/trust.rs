//! Whether a self-tuner may be trusted, and what acts while it may not.

use crate::{Action, Dimension, Error, Innovation, Real, RstController};

/// What acts while a self-tuner is not trusted.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(bound = "T: Real"))]
pub enum Fallback<T> {
    /// An input that stays: the mean of the inputs in the latest 64 sound samples, or the first input of the tuner
    /// before there are any. (The latest input may be the limit at which the loop is latched.)
    Hold,
    /// The controller of the latest 64 sound samples, which is not designed anew; before there is one, as `Hold`.
    LastGood,
    /// This input, in its unit: an open loop. It is limited as all inputs are.
    Input(#[cfg_attr(feature = "serde", serde(with = "crate::snapshot::number"))] T),
}

/// Why a self-tuner is not trusted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum Distrust {
    /// The gain of the model has another sign than was given, or than was known: it gets no controller.
    Sign,
    /// The input goes from one limit to the other while the set point stays.
    Saturated,
    /// No controller was designed for long, as numbers of the model or of the design are out of range, or the search
    /// goes on.
    Age,
    /// No controller was designed for long: none of those that are tried has margins that are bearable.
    Margin,
    /// The model predicts worse than the latest measurement does.
    Innovations,
}

impl Distrust {
    /// The reason in a few words.
    ///
    /// ```
    /// assert_eq!(thetahat_core::Distrust::Sign.word(), "sign of the gain");
    /// ```
    pub const fn word(self) -> &'static str {
        match self {
            Distrust::Sign => "sign of the gain",
            Distrust::Saturated => "saturated input",
            Distrust::Age => "old design",
            Distrust::Margin => "margins",
            Distrust::Innovations => "innovations",
        }
    }
}

/// When a self-tuner is not trusted, and what acts then.
///
/// A sample is sound if the input is within the limits, the innovation is within three of its usual deviations, and the
/// design is new. A mean is one of about 20/frequency samples, with the [`frequency`](super::ResponseWanted::frequency)
/// that is wanted: 50 at least.
///
/// # The way back
///
/// While the fallback acts the model goes on learning, from the fallback plus or minus the
/// [`excitation`](Supervision::excitation), and controllers are designed, which do not act. The tuner controls again by
/// itself, where a new design was accepted, the model predicts better than the latest measurement does, and
///
/// - after 64 samples, or twice as many after each time that this failed, up to 2048: if the gain is known to five
///   standard errors;
/// - after eight times as many in any case, but not with [`Distrust::Sign`].
///
/// 1000 samples of trust make it forget that it failed. A sign that was given wrong, or a plant that stays reversed, is
/// a matter for the user: `set_gain_sign` gives another one (or 0, to learn it), and trust comes back as above. `trust`
/// goes back at once.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(bound = "T: Real"))]
pub struct Supervision<T> {
    /// What acts while it is not trusted.
    pub fallback: Fallback<T>,
    /// The amplitude that excites the plant then, in the unit of the input. With 0 nothing is learnt while the input
    /// stays, and trust may not come back by itself.
    #[cfg_attr(feature = "serde", serde(with = "crate::snapshot::number"))]
    pub excitation: T,
    /// The largest mean share of samples, 0 to 1, in which the input is at either limit, with a quarter of them at each
    /// or more, while the set point stays. Samples sooner than 3/frequency after a change of the set point do not
    /// count. 1 allows any.
    #[cfg_attr(feature = "serde", serde(with = "crate::snapshot::number"))]
    pub saturated: T,
    /// For so many samples in a row a design may be refused; a quarter of it where the sign is wrong by five standard
    /// errors. 0 allows any number.
    pub refused: u16,
    /// The largest ratio of the mean squared innovation to the mean squared change of the measurement, where
    /// innovations are above a hundredth of the output's scale. Infinity allows any.
    #[cfg_attr(feature = "serde", serde(with = "crate::snapshot::number"))]
    pub innovations: T,
    /// Whether the fallback acts with [`Distrust::Age`] and [`Distrust::Margin`] too. If not, the controller goes on,
    /// as it was good when it was designed, and the first design that is accepted ends the distrust: what is told then
    /// is that the loop no longer adapts.
    pub replace_old: bool,
}

impl<T: Real> Supervision<T> {
    /// [`Fallback::Hold`], an excitation of a tenth of this size of inputs, half of the samples at a limit, 200 refused
    /// samples, after which the controller goes on, and a ratio of 2.
    pub fn of_scale(input_scale: T) -> Self {
        let two = T::one() + T::one();
        Supervision {
            fallback: Fallback::Hold,
            excitation: input_scale / T::from_count(10),
            saturated: T::one() / two,
            refused: 200,
            innovations: two,
            replace_old: false,
        }
    }

    /// The same without an end of trust: the last good design acts, whatever happens.
    pub fn without_distrust(self) -> Self {
        Supervision { saturated: T::one(), refused: 0, innovations: T::INFINITY, replace_old: false, ..self }
    }

    pub(super) fn check(&self) -> Result<(), Error> {
        let zero = T::zero();
        let checks = [
            (
                "excitation",
                self.excitation >= zero && self.excitation.is_finite(),
                "an amplitude of 0 or more",
            ),
            ("saturated", self.saturated >= zero && self.saturated <= T::one(), "from 0 to 1"),
            ("innovations", self.innovations >= T::one(), "1 or more"),
        ];
        for (argument, holds, range) in checks {
            if !holds {
                return Err(Error::OutOfRange { argument, range });
            }
        }
        self.fallback.check()
    }
}

impl<T: Real> Fallback<T> {
    pub(super) fn check(&self) -> Result<(), Error> {
        match self {
            Fallback::Input(input) if !input.is_finite() => {
                Err(Error::OutOfRange { argument: "fallback", range: "an input that is a number" })
            }
            _ => Ok(()),
        }
    }
}

/// So many sound samples in a row make a controller and an input good.
const SOUND: u16 = 64;
/// So many samples pass at least before trust comes back; doubled up to five times.
const SHORTEST: u32 = 64;
const DOUBLINGS: u8 = 5;
/// After so many samples of trust it does not count that it failed before.
const FORGIVEN: u16 = 1000;

/// An [`Innovation`], which may have numbers that are none.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(bound = "T: Real"))]
struct Told<T> {
    #[cfg_attr(feature = "serde", serde(with = "crate::snapshot::number"))]
    error: T,
    #[cfg_attr(feature = "serde", serde(with = "crate::snapshot::number"))]
    variance: T,
    #[cfg_attr(feature = "serde", serde(with = "crate::snapshot::number"))]
    nis: T,
    action: Action,
}

impl<T: Real> Told<T> {
    fn nothing() -> Self {
        Told { error: T::NAN, variance: T::NAN, nis: T::zero(), action: Action::Missing }
    }

    fn of(innovation: Innovation<T>) -> Self {
        let Innovation { error, variance, nis, action } = innovation;
        Told { error, variance, nis, action }
    }
}

/// What is known of how well a tuner does: averages and counters.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(bound = ""))]
pub(super) struct Supervisor<T: Real, N: Dimension> {
    /// A hundredth of the output's scale.
    floor: T,
    /// The square of the samples that innovations are ahead: where a change is compared with them, as many samples of
    /// it are.
    ahead: T,
    /// What a sample adds to a mean.
    weight: T,
    #[cfg_attr(feature = "serde", serde(with = "crate::snapshot::number"))]
    set_point: T,
    /// Samples since it changed.
    rested: u16,
    /// The mean shares of samples at the lower and the upper limit.
    lower: T,
    upper: T,
    #[cfg_attr(feature = "serde", serde(with = "crate::snapshot::number"))]
    latest: T,
    /// The mean squares of innovations and of changes of the output.
    errors: T,
    changes: T,
    told: Told<T>,
    /// Samples in a row in which the model predicted badly.
    astray: u16,
    /// Samples in a row with a design that was refused, and why.
    refused: u16,
    cause: Distrust,
    /// Samples since the latest design.
    age: u32,
    sound: u16,
    sum: T,
    /// What the fallbacks are.
    held: T,
    good: Option<RstController<T, N>>,
    pub(super) distrust: Option<Distrust>,
    /// Whether the fallback acts.
    pub(super) replaced: bool,
    /// Samples since trust ended, or came back.
    since: u32,
    failures: u8,
}

impl<T: Real, N: Dimension> Supervisor<T, N> {
    /// Of a tuner with this scale of outputs and this horizon, for a loop of this frequency, from this input.
    pub(super) fn new(output_scale: T, ahead: usize, frequency: T, input: T) -> Self {
        let (zero, longest) = (T::zero(), T::from_count(50));
        Supervisor {
            floor: output_scale / T::from_count(100),
            ahead: T::from_count(ahead * ahead),
            weight: T::one() / (T::from_count(20) / frequency).max(longest),
            set_point: T::NAN,
            rested: 0,
            lower: zero,
            upper: zero,
            latest: T::NAN,
            errors: zero,
            changes: zero,
            told: Told::nothing(),
            astray: 0,
            refused: 0,
            cause: Distrust::Age,
            age: 0,
            sound: 0,
            sum: zero,
            held: input,
            good: None,
            distrust: None,
            replaced: false,
            since: 0,
            failures: 0,
        }
    }

    /// Checks what was read, for controllers of this size.
    #[cfg(feature = "serde")]
    pub(super) fn check(&self, size: usize) -> Result<(), Error> {
        if let Some(controller) = &self.good {
            crate::error::check_length("good", size, controller.s().len())?;
        }
        if self.failures > DOUBLINGS || self.sound >= SOUND {
            return Err(Error::OutOfRange { argument: "failures or sound", range: "as they were written" });
        }
        let Supervisor { floor, ahead, weight, lower, upper, errors, changes, sum, held, .. } = *self;
        let numbers = [floor, ahead, weight, lower, upper, errors, changes, sum, held];
        crate::error::check_finite("supervisor", &numbers)
    }

    /// What the latest measurement told.
    pub(super) fn innovation(&self) -> Innovation<T> {
        let Told { error, variance, nis, action } = self.told;
        Innovation { error, variance, nis, action }
    }

    /// Samples since the latest design.
    pub(super) fn age(&self) -> u32 {
        self.age
    }

    /// A controller was designed.
    pub(super) fn designed(&mut self) {
        (self.age, self.refused, self.cause) = (0, 0, Distrust::Age);
    }

    /// None was, in so many samples, and this is why.
    pub(super) fn refuse(&mut self, cause: Distrust, samples: u16) {
        self.refused = self.refused.saturating_add(samples);
        self.cause = cause;
    }

    /// Why the latest one was refused.
    pub(super) fn cause(&self) -> Distrust {
        self.cause
    }

    /// What a measurement told.
    ///
    /// It `counts` if it was measured as it is.
    pub(super) fn learnt(&mut self, innovation: Innovation<T>, output: T, counts: bool) {
        let (error, change) = (innovation.error, output - self.latest);
        (self.told, self.latest) = (Told::of(innovation), output);
        let (error, change) = (error * error, self.ahead * change * change);
        if !(counts && error.is_finite() && change.is_finite()) {
            self.sound = 0;
            return;
        }
        // Nine times the usual, or what does not matter: one spike alone makes no mean.
        let most = T::from_count(9) * self.errors.max(self.floor * self.floor / T::from_count(100));
        if error > most {
            self.sound = 0;
        }
        self.errors += self.weight * (error.min(most) - self.errors);
        self.changes += self.weight * (change - self.changes);
    }

    /// Nothing was measured.
    pub(super) fn missed(&mut self) {
        (self.latest, self.sound, self.told) = (T::NAN, 0, Told::nothing());
    }

    /// The next sample begins: whether trust ends or comes back. `knows_gain` may be asked once.
    pub(super) fn evaluate(
        &mut self,
        supervision: &Supervision<T>,
        has_controller: bool,
        knows_gain: impl FnOnce() -> bool,
    ) {
        self.since = self.since.saturating_add(1);
        self.astray = if self.predicts_badly(supervision) { self.astray.saturating_add(1) } else { 0 };
        let Some(distrust) = self.distrust.filter(|_| self.replaced) else {
            if self.since >= FORGIVEN.into() {
                self.failures = 0;
            }
            self.distrust = self.doubt(supervision, has_controller);
            let is_old = matches!(self.distrust, Some(Distrust::Age | Distrust::Margin));
            self.replaced =
                self.distrust.is_some() && !(is_old && has_controller && !supervision.replace_old);
            if self.replaced {
                (self.since, self.sound, self.sum) = (0, 0, T::zero());
            }
            return;
        };
        // What was saturated at first may have the wrong sign.
        let refusal = self.refusal(supervision).filter(|why| *why == Distrust::Sign);
        let distrust = refusal.unwrap_or(distrust);
        self.distrust = Some(distrust);
        // In the sample of a new design.
        if self.age > 0 || !has_controller || self.astray > 0 {
            return;
        }
        let shortest = SHORTEST << self.failures;
        if self.since >= shortest
            && ((distrust != Distrust::Sign && self.since >= 8 * shortest) || knows_gain())
        {
            self.trust();
            self.failures = (self.failures + 1).min(DOUBLINGS);
        }
    }

    /// It is trusted again.
    pub(super) fn trust(&mut self) {
        let zero = T::zero();
        (self.distrust, self.replaced) = (None, false);
        (self.since, self.refused, self.astray) = (0, 0, 0);
        (self.lower, self.upper, self.errors, self.changes) = (zero, zero, zero, zero);
    }

    /// As if it had never failed.
    pub(super) fn forgive(&mut self) {
        self.failures = 0;
    }

    fn predicts_badly(&self, supervision: &Supervision<T>) -> bool {
        self.errors > self.floor * self.floor && self.errors > supervision.innovations * self.changes
    }

    /// Why designs were refused for too long.
    fn refusal(&self, supervision: &Supervision<T>) -> Option<Distrust> {
        (supervision.refused > 0 && self.refused >= supervision.refused).then_some(self.cause)
    }

    /// The reason not to go on, if there is one: what shows in the loop before what is only old.
    fn doubt(&self, supervision: &Supervision<T>, has_controller: bool) -> Option<Distrust> {
        let refusal = self.refusal(supervision);
        if refusal == Some(Distrust::Sign) || !has_controller {
            return refusal;
        }
        let (both, less) = (self.lower + self.upper, self.lower.min(self.upper));
        if supervision.saturated < T::one()
            && both > supervision.saturated
            && less + less + less + less > both
        {
            return Some(Distrust::Saturated);
        }
        let is_astray = T::from_count(self.astray.into()) * self.weight >= T::one();
        if is_astray { Some(Distrust::Innovations) } else { refusal }
    }

    /// An input acts that was the controller's, and whether it was one of the limits.
    pub(super) fn acted(
        &mut self,
        controller: Option<&RstController<T, N>>,
        set_point: T,
        input: T,
        (at_lower, at_upper): (bool, bool),
        frequency: T,
    ) {
        if !self.set_point.is_finite() || (set_point - self.set_point).abs() > self.floor {
            (self.set_point, self.rested, self.lower, self.upper) = (set_point, 0, T::zero(), T::zero());
        }
        self.rested = self.rested.saturating_add(1);
        if T::from_count(self.rested.into()) * frequency > T::from_count(3) {
            let share = |is_there| if is_there { T::one() } else { T::zero() };
            self.lower += self.weight * (share(at_lower) - self.lower);
            self.upper += self.weight * (share(at_upper) - self.upper);
        }
        // A loop that is latched.
        if self.refused > 0 && (at_lower || at_upper) {
            self.refused = self.refused.saturating_add(1);
        }
        let Some(controller) = controller.filter(|_| !(at_lower || at_upper || self.refused > 0)) else {
            (self.sound, self.sum) = (0, T::zero());
            return;
        };
        if self.sound == 0 {
            self.sum = T::zero();
        }
        self.sum += input / T::from_count(SOUND.into());
        self.sound += 1;
        if self.sound >= SOUND {
            self.held = self.sum;
            self.good = Some(controller.clone());
            self.sound = 0;
        }
    }

    /// A sample goes by.
    pub(super) fn ages(&mut self) {
        self.age = self.age.saturating_add(1);
    }

    /// The input of the fallback, before its limits.
    pub(super) fn fallback(&mut self, fallback: Fallback<T>, set_point: T, output: T) -> T {
        match (fallback, &mut self.good) {
            (Fallback::Input(input), _) => input,
            (Fallback::LastGood, Some(good)) => good.control(set_point, output),
            _ => self.held,
        }
    }

    /// The controller of the fallback.
    pub(super) fn good_mut(&mut self) -> Option<&mut RstController<T, N>> {
        self.good.as_mut()
    }

    /// The input that stays.
    pub(super) fn held(&self) -> T {
        self.held
    }
}
