//! The simulated heater. On a board this file goes: an ADC measures, and a PWM output applies.

/// What is lost to the surroundings, in W/K, and how warm they are, in °C.
const LOSSES: f32 = 0.5;
const AMBIENT: f32 = 20.0;
/// Heat capacities in J/K, and what flows from the element to the body, in W/K: time constants of about 5 s and 70 s.
const ELEMENT: f32 = 10.0;
const BODY: f32 = 25.0;
const CONTACT: f32 = 2.0;
/// Dead time in samples, and the standard deviation of the sensor in K.
const DEAD_TIME: usize = 2;
const NOISE: f32 = 0.05;
/// Power at 100 % in W: of a new element, and of one that is older, from that second on.
const NEW: f32 = 60.0;
const OLD: f32 = 42.0;
const AGES_AT: f32 = 1200.0;

/// An element that heats a body, which loses heat to its surroundings:
///
/// ```text
/// ELEMENT dTe/dt = P - CONTACT (Te - Tb)
/// BODY    dTb/dt = CONTACT (Te - Tb) - LOSSES (Tb - AMBIENT)
/// ```
pub struct Heater {
    element: f32,
    body: f32,
    /// Power that has not acted yet, in %, the oldest first.
    on_its_way: [f32; DEAD_TIME],
    /// Seconds since the start.
    age: f32,
    seed: u32,
}

impl Heater {
    pub const fn new() -> Self {
        Heater { element: AMBIENT, body: AMBIENT, on_its_way: [0.0; DEAD_TIME], age: 0.0, seed: 1 }
    }

    /// What the heater really is at, in °C.
    pub fn temperature(&self) -> f32 {
        self.body
    }

    /// What the sensor says, in °C: with noise, and in one sample of twenty nothing (NaN).
    pub fn measure(&mut self) -> f32 {
        if self.uniform() < 0.05 {
            return f32::NAN;
        }
        // The sum of twelve has the variance 1.
        let noise = (0..12).fold(-6.0, |sum, _| sum + self.uniform());
        self.body + NOISE * noise
    }

    /// Power in % from now on, and so many seconds later.
    pub fn apply(&mut self, power: f32, seconds: f32) {
        let rating = if self.age < AGES_AT { NEW } else { OLD };
        let acts = rating * self.on_its_way[0] / 100.0;
        self.age += seconds;
        self.on_its_way.rotate_left(1);
        self.on_its_way[DEAD_TIME - 1] = power;
        const STEPS: u16 = 20;
        let step = seconds / f32::from(STEPS);
        for _ in 0..STEPS {
            let flow = CONTACT * (self.element - self.body);
            self.element += step * (acts - flow) / ELEMENT;
            self.body += step * (flow - LOSSES * (self.body - AMBIENT)) / BODY;
        }
    }

    /// In 0 … 1.
    fn uniform(&mut self) -> f32 {
        self.seed = self.seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (self.seed >> 8) as f32 / (1 << 24) as f32
    }
}
