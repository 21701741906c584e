//! The logs of the templates, which stand in the folder `templates`: each of a plant whose numbers are here.

use std::fmt::Write;

use super::Random;

/// One step of the classical Runge-Kutta method, in ten parts.
fn advanced<const N: usize>(state: [f64; N], step: f64, slope: impl Fn([f64; N]) -> [f64; N]) -> [f64; N] {
    const PARTS: usize = 10;
    let h = step / PARTS as f64;
    let mut state = state;
    for _ in 0..PARTS {
        let along = |slope: [f64; N], time: f64| std::array::from_fn(|i| state[i] + time * slope[i]);
        let k1 = slope(state);
        let k2 = slope(along(k1, h / 2.0));
        let k3 = slope(along(k2, h / 2.0));
        let k4 = slope(along(k3, h));
        state = std::array::from_fn(|i| state[i] + h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]));
    }
    state
}

/// A motor for 12 V, of 0.8 Ohm, 1.2 mH, 0.03 N m/A, 4e-5 kg m^2, 2e-5 N m s/rad and 4 mN m of dry friction.
fn motor() -> String {
    let mut random = Random(11);
    let (mut state, mut voltage) = ([0.0, 0.0], 0.0);
    let mut csv = String::from("t,voltage,current,speed\n");
    for k in 0..1200 {
        voltage = if k < 10 { 0.0 } else { random.switched(voltage, &[-12.0, -5.0, 3.0, 8.0, 12.0], 60.0) };
        let (current, speed) = (state[0] + 0.05 * random.normal(), state[1] + 0.5 * random.normal());
        // Writing to a string cannot fail.
        let _ = writeln!(csv, "{:.3},{voltage},{current:.4},{speed:.3}", f64::from(k) * 0.001);
        state = advanced(state, 0.001, |[current, speed]| {
            let friction = 2e-5 * speed + 0.004 * (speed / 1.0).tanh();
            [(voltage - 0.8 * current - 0.03 * speed) / 0.0012, (0.03 * current - friction) / 4e-5]
        });
    }
    csv
}

/// Quasistatic and dynamic runs there and back, with pauses, of a mechanism of kS 1.01, kV 3.060, kA 0.327 and this
/// gravity; velocity and position, and what the last column is called.
fn mechanism(name: &str, seed: u64, gravity: impl Fn(f64) -> f64) -> String {
    const STEP: f64 = 0.02;
    const PARTS: usize = 200;
    let (fade, part) = ((-STEP / PARTS as f64 * 3.06 / 0.327).exp(), STEP / PARTS as f64);
    let mut random = Random(seed);
    let (mut velocity, mut position) = (0.0_f64, 0.0_f64);
    let mut csv = format!("t,voltage,velocity,{name}\n");
    for k in 0..750_i32 {
        let voltage = match k {
            25..225 => f64::from(k - 25) * 0.025,
            250..450 => -f64::from(k - 250) * 0.025,
            475..575 => 7.0,
            625..725 => -7.0,
            _ => 0.0,
        };
        let noise = [0.01 * random.normal(), 0.001 * random.normal()];
        let (v, x) = (velocity + noise[0], position + noise[1]);
        let _ = writeln!(csv, "{:.2},{voltage:.3},{v:.4},{x:.4}", f64::from(k) * STEP);
        for _ in 0..PARTS {
            let before = velocity;
            let pulled = voltage - gravity(position);
            let side = if velocity == 0.0 { pulled.signum() } else { velocity.signum() };
            let end = (pulled - 1.01 * side) / 3.06;
            velocity = end + (velocity - end) * fade;
            // Friction stops it, and does not turn it round.
            if velocity * side < 0.0 {
                velocity = 0.0;
            }
            position += part * (before + velocity) / 2.0;
        }
    }
    csv
}

/// Without gravity.
fn simple() -> String {
    mechanism("position", 21, |_| 0.0)
}

/// An elevator of kG -0.211, as a counterweight makes it.
fn elevator() -> String {
    mechanism("position", 22, |_| -0.211)
}

/// An arm of kG 0.6 whose angle is read 0.1 rad too small.
fn arm() -> String {
    mechanism("angle", 23, |angle| 0.6 * (angle + 0.1).cos())
}

/// A cell of 2.5 Ah that starts full, with r0 = 20 mOhm, and pairs of 10 mOhm and 25 s and, if there are two, of 15
/// mOhm and 250 s; the current is above 0 in discharge.
fn battery(pairs: usize) -> String {
    let mut random = Random(31);
    let (mut soc, mut lags, mut current) = (1.0_f64, [0.0; 2], 0.0);
    let mut csv = String::from("Time [s],Current [A],Voltage [V]\n");
    for k in 0..1500 {
        current = if k < 20 { 0.0 } else { random.switched(current, &[0.0, 1.0, 5.0, 7.5, 7.5], 40.0) };
        let open =
            3.0 + 1.1 * soc - 0.55 * soc.powi(2) + 0.5 * soc.powi(3) + 0.1 * (1.0 - (-20.0 * soc).exp());
        let voltage = open - 0.02 * current - lags.iter().sum::<f64>() + 0.001 * random.normal();
        let _ = writeln!(csv, "{k},{current},{voltage:.5}");
        soc -= current / (3600.0 * 2.5);
        for (lag, (r, tau)) in lags.iter_mut().zip([(0.01, 25.0), (0.015, 250.0)]).take(pairs) {
            *lag = r * current + (*lag - r * current) * (-1.0_f64 / tau).exp();
        }
    }
    csv
}

/// Five days of a room, every ten minutes: of 0.008 K/W and 4e6 J/K, or of air of 1.2e6 J/K and walls of 8e6 J/K, with
/// 0.003 K/W inside and 0.006 K/W outside of them; the sun comes in through 1.5 m^2.
fn room(walls: bool) -> String {
    const STEP: f64 = 600.0;
    let mut random = Random(41);
    let (mut state, mut heater, mut clouds) = ([18.0, 14.0], 0.0, 1.0_f64);
    let mut csv = String::from("t,indoor,heater,outdoor,sun\n");
    for k in 0..720 {
        let hour = f64::from(k) / 6.0;
        let outdoor = 4.0 + 4.0 * (std::f64::consts::TAU * (hour - 9.0) / 24.0).sin() + 0.02 * hour;
        clouds = (0.95 * clouds + 0.05 + 0.15 * random.normal()).clamp(0.1, 1.2);
        let sun = (500.0 * clouds * (std::f64::consts::TAU * (hour - 6.0) / 24.0).sin()).max(0.0);
        heater = random.switched(heater, &[0.0, 1000.0, 3000.0], 12.0);
        let (indoor, outdoor, sun) = (
            state[0] + 0.05 * random.normal(),
            (outdoor * 100.0).round() / 100.0,
            (sun * 10.0).round() / 10.0,
        );
        let _ = writeln!(csv, "{},{indoor:.3},{heater},{outdoor},{sun}", f64::from(k) * STEP);
        let gains = heater + 1.5 * sun;
        state = advanced(state, STEP, |[air, wall]| {
            if walls {
                let inside = (wall - air) / 0.003;
                [(inside + gains) / 1.2e6, ((outdoor - wall) / 0.006 - inside) / 8e6]
            } else {
                [((outdoor - air) / 0.008 + gains) / 4e6, 0.0]
            }
        });
    }
    csv
}

/// A tank of 0.05 m^2 with an outflow of 4e-4 m^2.5/s.
fn tank() -> String {
    let mut random = Random(51);
    let (mut state, mut inflow) = ([0.3], 2e-4);
    let mut csv = String::from("t,inflow,level\n");
    for k in 0..600 {
        inflow = random.switched(inflow, &[0.0, 1e-4, 2e-4, 3e-4], 40.0);
        let _ = writeln!(csv, "{},{inflow},{:.4}", 2 * k, state[0] + 0.002 * random.normal());
        state = advanced(state, 2.0, |[level]| [(inflow - 4e-4 * level.max(0.0).sqrt()) / 0.05]);
    }
    csv
}

/// A pendulum of 0.5 m and 0.1 kg m^2 with a damping of 0.3 1/s, which hangs at 0.05 rad.
fn pendulum() -> String {
    let mut random = Random(61);
    let (mut state, mut torque) = ([1.2, 0.0], 0.0);
    let mut csv = String::from("t,angle,torque\n");
    for k in 0..800 {
        torque = if k < 200 { 0.0 } else { random.switched(torque, &[-0.5, 0.0, 0.5], 30.0) };
        let _ = writeln!(csv, "{:.2},{:.4},{torque}", f64::from(k) * 0.02, state[0] + 0.01 * random.normal());
        state = advanced(state, 0.02, |[angle, rate]| {
            [rate, -9.80665 / 0.5 * (angle - 0.05).sin() - 0.3 * rate + torque / 0.1]
        });
    }
    csv
}

/// A mass of 2 kg on a spring of 80 N/m with a damper of 3 N s/m, which rests at 0.01 m.
fn spring() -> String {
    let mut random = Random(71);
    let (mut state, mut force) = ([0.0, 0.0], 0.0);
    let mut csv = String::from("t,force,position\n");
    for k in 0..800 {
        force = random.switched(force, &[-4.0, 0.0, 4.0, 8.0], 40.0);
        let _ = writeln!(csv, "{:.2},{force},{:.5}", f64::from(k) * 0.02, state[0] + 0.001 * random.normal());
        state = advanced(state, 0.02, |[position, velocity]| {
            [velocity, (force - 80.0 * (position - 0.01) - 3.0 * velocity) / 2.0]
        });
    }
    csv
}

/// A heat exchanger that holds 4 kg of water, with 1500 W/K to steam of 130 degC.
fn exchanger() -> String {
    let mut random = Random(81);
    let (mut state, mut flow, mut inlet) = ([80.0], 0.4, 20.0_f64);
    let mut csv = String::from("t,flow,inlet,outlet\n");
    for k in 0..900 {
        flow = random.switched(flow, &[0.2, 0.3, 0.5, 0.7], 30.0);
        inlet += 0.1 * random.normal() - 0.01 * (inlet - 20.0);
        let shown = (inlet * 100.0).round() / 100.0;
        let _ = writeln!(csv, "{k},{flow},{shown},{:.2}", state[0] + 0.1 * random.normal());
        state = advanced(state, 1.0, |[outlet]| {
            [(flow * (shown - outlet) + 1500.0 / 4186.0 * (130.0 - outlet)) / 4.0]
        });
    }
    csv
}

/// An axis of a multirotor, 250 rows a second: 120 rad/s^2 for a command of 1, a lag of 0.04 s, a delay of 0.018 s, a
/// damping of 0.5 1/s and a trim of 0.4 rad/s^2.
fn multirotor() -> String {
    const STEP: f64 = 0.004;
    const PARTS: usize = 100;
    let mut random = Random(91);
    let (mut rate, mut motor, mut command) = (0.0, 0.0, 0.0);
    let mut commands: Vec<f64> = Vec::new();
    let mut csv = String::from("t,command,rate\n");
    for k in 0..1200 {
        // Against what has come of the commands before, as a pilot does.
        let back = if rate > 2.0 {
            -0.1
        } else if rate < -2.0 {
            0.1
        } else {
            0.0
        };
        command = if k < 10 { 0.0 } else { random.switched(command, &[back - 0.1, back, back + 0.1], 20.0) };
        commands.push(command);
        let _ = writeln!(csv, "{:.3},{command:.1},{:.4}", f64::from(k) * STEP, rate + 0.02 * random.normal());
        for part in 0..PARTS {
            let samples = f64::from(k) + (part as f64 + 0.5) / PARTS as f64 - 0.018 / STEP;
            let given = commands[samples.max(0.0) as usize];
            motor += STEP / PARTS as f64 * (120.0 * given - motor) / 0.04;
            rate += STEP / PARTS as f64 * (motor - 0.5 * rate + 0.4);
        }
    }
    csv
}

/// All of them, by their files.
pub(super) fn logs() -> Vec<(&'static str, String)> {
    vec![
        ("motor", motor()),
        ("mechanism", simple()),
        ("elevator", elevator()),
        ("arm", arm()),
        ("battery", battery(1)),
        ("battery2", battery(2)),
        ("room", room(false)),
        ("room2", room(true)),
        ("tank", tank()),
        ("pendulum", pendulum()),
        ("spring", spring()),
        ("exchanger", exchanger()),
        ("multirotor", multirotor()),
    ]
}
