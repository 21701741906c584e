//! Simulates the logs of the models beside it, with the noises that they tell of. Write the logs anew with
//! `cargo run --example simulated_logs`.

mod simulated_blocks;
mod simulated_templates;

use std::fmt::Write;

/// Uniform numbers in [0, 1): xorshift (Marsaglia 2003).
struct Random(u64);

impl Random {
    fn uniform(&mut self) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Nearly normal, with mean 0 and variance 1: the sum of twelve uniform numbers.
    fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.uniform()).sum::<f64>() - 6.0
    }

    /// With probability 1/`samples` another of some levels, else the one that was.
    fn switched(&mut self, level: f64, levels: &[f64], samples: f64) -> f64 {
        if self.uniform() * samples >= 1.0 {
            return level;
        }
        let index = (self.uniform() * levels.len() as f64) as usize;
        levels[index.min(levels.len() - 1)]
    }
}

/// The log of `mass_spring_damper.toml`: time [s], force [N], position [m].
fn mass_spring_damper() -> String {
    const MASS: f64 = 1.6;
    const STIFFNESS: f64 = 4.0;
    const DAMPING: f64 = 0.6;
    const STEP: f64 = 0.05;
    let mut random = Random(1_687);
    let (mut position, mut velocity, mut force) = (0.06, -0.04, 1.0);
    let mut csv = String::from("t,force,position\n");
    for k in 0..800 {
        force = random.switched(force, &[-2.0, -1.0, 1.0, 2.0], 20.0);
        let measured = position + 0.02 * random.normal();
        // Writing to a string cannot fail.
        let _ = writeln!(csv, "{:.2},{force},{measured:.4}", f64::from(k) * STEP);
        let acceleration = (force - STIFFNESS * position - DAMPING * velocity) / MASS;
        position += STEP * velocity;
        velocity += STEP * acceleration + 0.01 * random.normal();
    }
    csv
}

/// The log of `battery.toml`: time [s], current [A], voltage [V].
fn battery() -> String {
    const R0: f64 = 0.002;
    const R1: f64 = 0.0015;
    const C1: f64 = 20_000.0;
    const CAPACITY: f64 = 40.0;
    let mut random = Random(1_800);
    let (mut soc, mut v_rc, mut current) = (0.785_f64, 0.003, 0.0);
    let fading = (-1.0 / (R1 * C1)).exp();
    let mut csv = String::from("t,i,v\n");
    for k in 0..1200 {
        current = random.switched(current, &[-60.0, -30.0, 0.0, 0.0, 40.0], 60.0);
        let open = 3.3 + 1.3 * soc - 1.2 * soc.powi(2) + 0.8 * soc.powi(3);
        let measured = open + v_rc + R0 * current + 0.001 * random.normal();
        let _ = writeln!(csv, "{k},{current},{measured:.5}");
        soc += current / (3600.0 * CAPACITY) + 1e-6 * random.normal();
        v_rc = R1 * current + (v_rc - R1 * current) * fading + 1e-5 * random.normal();
    }
    csv
}

/// The log of `dc_motor.toml`: time [s], voltage [V], current [A], speed [rad/s].
fn dc_motor() -> String {
    const TORQUE_CONSTANT: f64 = 0.05;
    const FRICTION: f64 = 1e-4;
    const RESISTANCE: f64 = 1.5;
    const INDUCTANCE: f64 = 0.03;
    const INERTIA: f64 = 2e-4;
    const STEP: f64 = 0.01;
    let slope = |[current, speed]: [f64; 2], voltage: f64| {
        [
            (voltage - RESISTANCE * current - TORQUE_CONSTANT * speed) / INDUCTANCE,
            (TORQUE_CONSTANT * current - FRICTION * speed) / INERTIA,
        ]
    };
    let mut random = Random(1_834);
    let (mut state, mut voltage) = ([0.5, 8.0], 5.0);
    let mut csv = String::from("t,u,i,speed\n");
    for k in 0..1000 {
        voltage = random.switched(voltage, &[-6.0, 2.0, 8.0], 15.0);
        let current = state[0] + 0.05 * random.normal();
        let speed = state[1] + 0.3 * random.normal();
        let _ = writeln!(csv, "{:.2},{voltage},{current:.4},{speed:.3}", f64::from(k) * STEP);
        // One step of the classical Runge-Kutta method.
        let along = |slope: [f64; 2], time: f64| [state[0] + time * slope[0], state[1] + time * slope[1]];
        let k1 = slope(state, voltage);
        let k2 = slope(along(k1, STEP / 2.0), voltage);
        let k3 = slope(along(k2, STEP / 2.0), voltage);
        let k4 = slope(along(k3, STEP), voltage);
        state = std::array::from_fn(|i| state[i] + STEP / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]));
        state[1] += 0.2 * random.normal();
    }
    csv
}

/// A step test of a heater: time [s], heater [%], temperature [degC]; a gain of 0.6 degC per %, a time constant of 80 s
/// and a dead time of 12 s.
fn heater_steps() -> String {
    const GAIN: f64 = 0.6;
    const TIME_CONSTANT: f64 = 80.0;
    const DEAD_TIME: f64 = 12.0;
    const LEVELS: [(f64, f64); 4] = [(0.0, 20.0), (100.0, 40.0), (700.0, 20.0), (1300.0, 35.0)];
    let mut random = Random(1_736);
    let mut csv = String::from("t,heater,temperature\n");
    for k in 0..950 {
        let time = 2.0 * f64::from(k);
        let heater = LEVELS.iter().rfind(|(from, _)| *from <= time).map_or(0.0, |(_, level)| *level);
        let risen = |from: f64| 1.0 - (-(time - from - DEAD_TIME).max(0.0) / TIME_CONSTANT).exp();
        let steps = LEVELS.windows(2).map(|pair| (pair[1].1 - pair[0].1) * risen(pair[1].0));
        let temperature = 22.0 + GAIN * (20.0 + steps.sum::<f64>()) + 0.12 * random.normal();
        let _ = writeln!(csv, "{time},{heater},{temperature:.3}");
    }
    csv
}

/// Those of templates and of models in blocks, by their files.
fn logs() -> Vec<(String, String)> {
    let of = |folder: &str, logs: Vec<(&str, String)>| -> Vec<(String, String)> {
        logs.into_iter().map(|(name, log)| (format!("{folder}/{name}.csv"), log)).collect()
    };
    [of("templates", simulated_templates::logs()), of("blocks", simulated_blocks::logs())].concat()
}

fn main() -> std::io::Result<()> {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data");
    for (name, log) in logs() {
        std::fs::write(folder.join(name), log)?;
    }
    std::fs::write(folder.join("mass_spring_damper.csv"), mass_spring_damper())?;
    std::fs::write(folder.join("battery.csv"), battery())?;
    std::fs::write(folder.join("heater_steps.csv"), heater_steps())?;
    std::fs::write(folder.join("dc_motor.csv"), dc_motor())
}

#[test]
fn the_logs_beside_this_program_are_what_it_writes() {
    assert!(include_str!("mass_spring_damper.csv") == mass_spring_damper());
    assert!(include_str!("battery.csv") == battery());
    assert!(include_str!("heater_steps.csv") == heater_steps());
    assert!(include_str!("dc_motor.csv") == dc_motor());
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data");
    for (name, log) in logs() {
        assert!(std::fs::read_to_string(folder.join(&name)).is_ok_and(|text| text == log), "{name}");
    }
}
