//! What each forgetting policy does with a jump, with silence, and with its intervals: the table in the doc of
//! [`Forgetting`](thetahat_core::Forgetting), and the limits that hold for selective forgetting.
//!
//! The table is printed by `cargo test -p thetahat-core --test forgetting table -- --nocapture`.

mod held;
#[path = "../../src/noise.rs"]
#[expect(dead_code, reason = "the unit tests take more of it")]
mod noise;

use std::fmt::Write;

use thetahat_core::nalgebra::{Const, SVector, convert};
use thetahat_core::{Forgetting, Real, RecursiveLeastSquares};

const RUNS: u64 = 200;

/// Normal numbers by twos (Box and Muller 1958).
struct Noise {
    uniform: noise::Noise,
    spare: Option<f64>,
}

impl Noise {
    fn new(seed: u64) -> Self {
        Noise { uniform: noise::Noise(seed), spare: None }
    }

    fn bits(&mut self) -> u64 {
        self.uniform.bits()
    }

    /// Above 0, at most 1.
    fn uniform(&mut self) -> f64 {
        ((self.bits() >> 11) + 1) as f64 / (1_u64 << 53) as f64
    }

    fn normal(&mut self) -> f64 {
        self.spare.take().unwrap_or_else(|| {
            let radius = (-2.0 * self.uniform().ln()).sqrt();
            let (sine, cosine) = (std::f64::consts::TAU * self.uniform()).sin_cos();
            self.spare = Some(radius * sine);
            radius * cosine
        })
    }

    /// Normal numbers of variance 1, each two of them with this correlation.
    fn correlated<const K: usize>(&mut self, correlation: f64) -> SVector<f64, K> {
        let common = correlation.sqrt() * self.normal();
        SVector::from_fn(|_, _| common + (1.0 - correlation).sqrt() * self.normal())
    }
}

/// An estimator all of whose scales are `scale`, and whose regressors may stand in reverse order.
#[derive(Clone, Copy)]
struct Subject<T> {
    forgetting: Forgetting<T>,
    scale: f64,
    reversed: bool,
}

impl<T: Real> Subject<T> {
    fn new(forgetting: Forgetting<T>) -> Self {
        Subject { forgetting, scale: 1.0, reversed: false }
    }

    fn estimator<const K: usize>(&self) -> Run<T, K> {
        let scales = SVector::repeat(convert(self.scale));
        let estimator = RecursiveLeastSquares::new(&scales, self.forgetting).expect("a policy");
        Run { estimator, reversed: self.reversed }
    }
}

struct Run<T: Real, const K: usize> {
    estimator: RecursiveLeastSquares<T, Const<K>>,
    reversed: bool,
}

impl<T: Real, const K: usize> Run<T, K> {
    fn ordered<V: Copy>(&self, vector: &[V; K]) -> [V; K] {
        std::array::from_fn(|index| vector[if self.reversed { K - 1 - index } else { index }])
    }

    fn update(&mut self, regressor: &SVector<f64, K>, output: f64) {
        let regressor = self.ordered(&(*regressor).into());
        let regressor = SVector::from_fn(|index, _| convert(regressor[index]));
        self.estimator.update(&regressor, convert(output)).expect("finite numbers");
    }

    fn parameters(&self) -> SVector<f64, K> {
        let parameters = (*self.estimator.parameters()).map(|value| value.to_subset().expect("a number"));
        self.ordered(&parameters.into()).into()
    }

    fn distance(&self, truth: &SVector<f64, K>) -> f64 {
        (self.parameters() - truth).norm()
    }

    /// The distance of each parameter from the truth, in its standard errors.
    fn off(&self, truth: &SVector<f64, K>) -> SVector<f64, K> {
        let errors = self.estimator.standard_errors().expect("many samples");
        let errors: SVector<f64, K> =
            self.ordered(&errors.map(|value| value.to_subset().expect("a number")).into()).into();
        (self.parameters() - truth).component_div(&errors)
    }

    /// The share of the 95 % intervals that hold the truth.
    fn covered(&self, truth: &SVector<f64, K>) -> f64 {
        self.off(truth).iter().filter(|off| off.abs() < 1.96).count() as f64 / K as f64
    }
}

/// 1, and so on down to -1.
fn truth<const K: usize>() -> SVector<f64, K> {
    SVector::from_fn(|index, _| 1.0 - 2.0 * index as f64 / (K - 1) as f64)
}

fn mean(run: impl Fn(u64) -> f64) -> f64 {
    (0..RUNS).map(run).sum::<f64>() / RUNS as f64
}

/// The distance from the truth 500 samples after a jump of norm 1.80. The deviation of the noise is 0.02.
fn after_a_jump<T: Real, const K: usize>(subject: Subject<T>, correlation: f64) -> f64 {
    let jump = SVector::<f64, K>::from_fn(|index, _| {
        (1.0 + 0.3 * index as f64) * if index % 2 == 0 { 1.0 } else { -1.0 }
    });
    let jump = jump * (1.8 / jump.norm());
    mean(|seed| {
        let (mut noise, mut run, mut theta) = (Noise::new(seed), subject.estimator::<K>(), truth::<K>());
        for k in 0..1500 {
            if k == 1000 {
                theta += jump;
            }
            let phi = noise.correlated(correlation);
            run.update(&phi, phi.dot(&theta) + 0.02 * noise.normal());
        }
        run.distance(&theta)
    })
}

/// The same for a plant y(k) = φ(k)'θ + e(k), φ(k) = \[-y(k-1) -y(k-2) u(k-1) u(k-2)\]', whose input is a random
/// sequence of 1 and -1, and a jump of norm 0.69.
fn after_a_jump_of_a_plant<T: Real>(subject: Subject<T>) -> f64 {
    mean(|seed| {
        let (mut noise, mut run) = (Noise::new(1000 + seed), subject.estimator::<4>());
        let mut theta = SVector::<f64, 4>::new(-1.2, 0.5, 1.0, 0.5);
        let mut phi = SVector::<f64, 4>::zeros();
        for k in 0..1500 {
            if k == 1000 {
                theta = SVector::<f64, 4>::new(-0.9, 0.3, 0.5, 0.8);
            }
            let y = phi.dot(&theta) + 0.02 * noise.normal();
            run.update(&phi, y);
            let u = if noise.bits() >> 63 == 0 { 1.0 } else { -1.0 };
            phi = [-y, phi[0], u, phi[2]].into();
        }
        run.distance(&theta)
    })
}

/// What becomes of regressors that had variance 1.
#[derive(Clone, Copy, PartialEq)]
enum After {
    /// All of them have a deviation of 0.01.
    Silence,
    /// The second half of them has.
    HalfSilence,
    /// They stay where they are, but for a deviation of 0.01.
    Held,
}

/// The largest distance from the truth in `steps` such samples. The deviation of the noise is 0.1.
fn in_silence<T: Real, const K: usize>(
    subject: Subject<T>,
    after: After,
    correlation: f64,
    steps: usize,
    runs: u64,
) -> f64 {
    let largest = |seed| {
        let (mut noise, mut run, theta) = (Noise::new(2000 + seed), subject.estimator::<K>(), truth::<K>());
        let (mut held, mut largest) = (SVector::zeros(), 0.0_f64);
        for k in 0..1000 + steps {
            let mut phi = noise.correlated::<K>(correlation);
            if k < 1000 {
                held = phi;
            } else {
                match after {
                    After::Silence => phi *= 0.01,
                    After::HalfSilence => phi.rows_mut(K / 2, K - K / 2).scale_mut(0.01),
                    After::Held => phi = held + 0.01 * phi,
                }
            }
            run.update(&phi, phi.dot(&theta) + 0.1 * noise.normal());
            if k >= 1000 {
                largest = largest.max(run.distance(&theta));
            }
        }
        largest
    };
    (0..runs).map(largest).sum::<f64>() / runs as f64
}

/// The share of 95 % intervals that hold the truth, of steady correlated regressors. The parameters walk by
/// `walk` times the variance of the noise.
fn coverage<T: Real>(subject: Subject<T>, walk: f64) -> f64 {
    mean(|seed| {
        let (mut noise, mut run, mut theta) =
            (Noise::new(3000 + seed), subject.estimator::<4>(), truth::<4>());
        let mut covered = 0.0;
        for k in 1..=2000 {
            let phi = noise.correlated(0.95);
            run.update(&phi, phi.dot(&theta) + 0.1 * noise.normal());
            if k > 1000 && k % 100 == 0 {
                covered += run.covered(&theta) / 10.0;
            }
            theta += noise.correlated(0.0) * (0.1 * walk.sqrt());
        }
        covered
    })
}

/// The same for the plant in closed loop: u = 0.3 (r - y), where r is 1 or -1, for 200 samples each.
fn coverage_in_closed_loop<T: Real>(subject: Subject<T>, walk: f64) -> f64 {
    mean(|seed| {
        let (mut noise, mut run) = (Noise::new(4000 + seed), subject.estimator::<4>());
        let mut theta = SVector::<f64, 4>::new(-1.2, 0.5, 0.5, 0.25);
        let (mut phi, mut covered) = (SVector::<f64, 4>::zeros(), 0.0);
        let phase = seed as usize;
        for k in 1..=4000 {
            let y = phi.dot(&theta) + 0.1 * noise.normal();
            run.update(&phi, y);
            let reference = if ((k + phase) / 200).is_multiple_of(2) { 1.0 } else { -1.0 };
            phi = [-y, phi[0], 0.3 * (reference - y), phi[2]].into();
            if k > 1000 && k % 100 == 0 {
                covered += run.covered(&theta) / 30.0;
            }
            theta += noise.correlated(0.0) * (0.1 * walk.sqrt());
        }
        covered
    })
}

/// Two digits, as many decimals as they need.
fn digits(value: f64) -> String {
    let decimals = if value < 0.095 { 3 } else { 2 };
    format!("{value:.decimals$}")
}

#[test]
fn table_of_the_policies() {
    let factor = 0.99;
    let mut table = String::new();
    for (name, policy) in [
        ("none", Forgetting::None),
        ("exponential, 0.99", Forgetting::Exponential { factor }),
        ("selective, 0.99", Forgetting::Selective { factor }),
        ("random walk, 1e-4", Forgetting::RandomWalk { variance: 1e-4 }),
        ("variable, 0.99", Forgetting::Variable { factor, minimum: 0.9, noise_variance: 0.0 }),
    ] {
        let with = |variance: f64| match policy {
            Forgetting::Variable { factor, minimum, .. } => {
                Subject::new(Forgetting::Variable { factor, minimum, noise_variance: variance })
            }
            _ => Subject::<f64>::new(policy),
        };
        // The intervals of the random walk are those of parameters that walk as it says.
        let walk = if let Forgetting::RandomWalk { variance } = policy { variance } else { 0.0 };
        let (quiet, noisy) = (with(4e-4), with(1e-2));
        let silence = |after, correlation| in_silence::<_, 4>(noisy, after, correlation, 5000, RUNS);
        let intervals = [coverage(noisy, walk), coverage_in_closed_loop(noisy, walk)];
        let cells = [
            after_a_jump::<_, 4>(quiet, 0.0),
            after_a_jump::<_, 4>(quiet, 0.95),
            after_a_jump::<_, 4>(quiet, 0.99),
            after_a_jump_of_a_plant(quiet),
            silence(After::Silence, 0.0),
            silence(After::HalfSilence, 0.0),
            silence(After::HalfSilence, 0.95),
            silence(After::Held, 0.0),
        ];
        write!(table, "/// | {name} |").expect("a string");
        for cell in cells {
            write!(table, " {} |", digits(cell)).expect("a string");
        }
        for share in intervals {
            assert!((0.9..0.99).contains(&share), "{name}: {share} of the intervals hold the truth");
            write!(table, " {share:.2} |").expect("a string");
        }
        table.push('\n');
    }
    println!("{table}");
    assert!(include_str!("../../src/forgetting.rs").contains(&table), "the table of the doc is out of date");
}

/// What selective forgetting promises, in both precisions.
fn selective_holds<T: Real>() {
    let forgetting = Forgetting::Selective { factor: convert(0.99) };
    let plain = Subject::<T>::new(forgetting);
    let holds = |what: &str, found: f64, limit: f64| {
        assert!(found <= limit, "{what}: {found}, above {limit}");
    };
    let silence = |subject, after| in_silence::<_, 4>(subject, after, 0.0, 5000, RUNS);
    holds("independent", after_a_jump::<_, 4>(plain, 0.0), 0.02);
    holds("correlation 0.95", after_a_jump::<_, 4>(plain, 0.95), 0.03);
    holds("correlation 0.99", after_a_jump::<_, 4>(plain, 0.99), 0.06);
    holds("a plant", after_a_jump_of_a_plant(plain), 0.008);
    holds("silence", silence(plain, After::Silence), 0.03);
    holds("two of four silent", silence(plain, After::HalfSilence), 0.05);
    // The inputs first, and the silent regressors.
    let reversed = Subject { reversed: true, ..plain };
    holds("a plant, reversed", after_a_jump_of_a_plant(reversed), 0.008);
    holds("two of four silent, reversed", silence(reversed, After::HalfSilence), 0.05);
    for scale in [0.1, 10.0] {
        let wrong = Subject { scale, ..plain };
        holds("a wrong scale", after_a_jump::<_, 4>(wrong, 0.99), 0.06);
        holds("two of four silent, a wrong scale", silence(wrong, After::HalfSilence), 0.05);
    }
    // More parameters take the same time, and their errors add up.
    holds("2 parameters", after_a_jump::<_, 2>(plain, 0.99), 0.02);
    holds("8 parameters", after_a_jump::<_, 8>(plain, 0.95), 0.03);
    holds("16 parameters", after_a_jump::<_, 16>(plain, 0.95), 0.04);
    holds("4 of 8 silent", in_silence::<_, 8>(plain, After::HalfSilence, 0.0, 5000, 50), 0.05);
    holds("8 of 16 silent", in_silence::<_, 16>(plain, After::HalfSilence, 0.0, 5000, 20), 0.06);
    holds("10^6 silent samples", in_silence::<_, 4>(plain, After::Silence, 0.0, 1_000_000, 3), 0.2);
    for share in [coverage(plain, 0.0), coverage_in_closed_loop(plain, 0.0)] {
        assert!((0.9..0.99).contains(&share), "{share} of the intervals hold the truth");
    }
}

#[test]
fn selective_forgetting_holds_in_single_precision() {
    selective_holds::<f32>();
}

#[test]
fn selective_forgetting_holds_in_double_precision() {
    selective_holds::<f64>();
}
