//! Attitude from a gyroscope, an accelerometer and a magnetometer: the multiplicative extended Kalman filter.
//!
//! ```text
//! truth       q <- q * exp((ω - b) T / 2),        b: the bias of the gyroscope, which walks
//! error       q = q̂ * exp(δ / 2),                 b = b̂ + β:        the filter's state is x = (δ, β), which is small
//! predict     δ <- R' δ - T β + w,                β <- β + w_b,      R: the rotation by (ω - b̂) T
//! correct     z = C'(q) g + v:                    z - C'(q̂) g = [C'(q̂) g]x δ + v
//! reset       q̂ <- q̂ * exp(δ / 2),  b̂ <- b̂ + β,  x <- 0
//! ```
//!
//! A quaternion has four numbers and three degrees of freedom. So the filter does not estimate it but the rotation by
//! which it is wrong, three numbers in rad about the axes of the body, and puts that into the quaternion after each
//! measurement. The error is linear to first order, whatever the attitude: a [`KalmanFilter`] is all there is to it. (P
//! turns by δ/2 at the reset, which is left out: it is of second order.)
//!
//! Source: Lefferts, Markley and Shuster, Kalman filtering for spacecraft attitude estimation, 1982, section VI;
//! Markley, Attitude error representations for Kalman filtering, 2003.

use thetahat_core::nalgebra::{Const, Matrix3, SMatrix, SVector, Vector3};
use thetahat_core::{
    Action, Covariance, Error, Innovation, KalmanFilter, LinearObservation, LinearTransition,
};

use crate::record::sample;
use crate::{Case, Scenario};

/// The attitude of a body, and the bias of its gyroscope.
#[derive(Clone, Debug)]
pub struct Attitude {
    /// The body in the world: a unit quaternion, its real part first.
    quaternion: [f32; 4],
    /// In rad/s.
    bias: Vector3<f32>,
    errors: KalmanFilter<f32, Const<6>>,
    noise: Covariance<f32, Const<6>>,
    sample_time: f32,
}

/// What is known of sensors, as standard deviations.
#[derive(Clone, Copy, Debug)]
pub struct Gyroscope {
    /// Of the rate in one sample, in rad/s.
    pub noise: f32,
    /// Of the change of the bias from sample to sample, in rad/s.
    pub walk: f32,
    /// Of the bias at first, in rad/s.
    pub bias: f32,
    /// In seconds.
    pub sample_time: f32,
}

impl Attitude {
    /// A body at rest that measures this force and this field: the attitude that explains both is known within
    /// `deviation` rad about each axis.
    ///
    /// The error is small then, as the filter wants it: from tens of degrees off, the first accurate measurement would
    /// leave more error than it says, and the gate would lock the others out.
    ///
    /// # Errors
    /// [`Error::NotFinite`] or [`Error::Negative`] for what is no standard deviation, or two vectors along one line.
    pub fn new(
        (force, field): (&Vector3<f32>, &Vector3<f32>),
        deviation: f32,
        gyroscope: Gyroscope,
    ) -> Result<Self, Error> {
        let Gyroscope { noise, walk, bias, sample_time } = gyroscope;
        let of = |angle: f32, rate: f32| {
            let (angle, rate) = (angle * angle, rate * rate);
            Covariance::from_diagonal(&SVector::from([angle, angle, angle, rate, rate, rate]))
        };
        // The gate: an accelerometer that feels more than gravity is not used. 25 is far in the tail of three elements.
        let errors = KalmanFilter::new(SVector::zeros(), of(deviation, bias)?)?.with_gate(25.0)?;
        let noise = of(noise * sample_time, walk)?;
        let quaternion = quaternion(&(triad(&GRAVITY, &FIELD) * triad(force, field).transpose()));
        if !quaternion.iter().all(|number| number.is_finite()) {
            return Err(Error::NotFinite { argument: "attitude" });
        }
        Ok(Attitude { quaternion, bias: Vector3::zeros(), errors, noise, sample_time })
    }

    /// The body in the world: a unit quaternion, its real part first.
    pub fn quaternion(&self) -> [f32; 4] {
        self.quaternion
    }

    /// The bias of the gyroscope, in rad/s.
    pub fn bias(&self) -> &Vector3<f32> {
        &self.bias
    }

    /// The covariance of the error: three angles about the axes of the body in rad, three rates in rad/s.
    pub fn covariance(&self) -> &Covariance<f32, Const<6>> {
        self.errors.covariance()
    }

    /// One sample ahead, with the rate that the gyroscope measures, in rad/s.
    ///
    /// # Errors
    /// [`Error::NotFinite`] if the rate is not finite; [`Error::Overflow`].
    pub fn predict(&mut self, rate: &Vector3<f32>) -> Result<(), Error> {
        let turn = (rate - self.bias) * self.sample_time;
        let step = exponential(&turn);
        let back = rotation(&step).transpose();
        let mut matrix = SMatrix::<f32, 6, 6>::identity();
        matrix.fixed_view_mut::<3, 3>(0, 0).copy_from(&back);
        for axis in 0..3 {
            matrix[(axis, axis + 3)] = -self.sample_time;
        }
        self.errors.predict(&LinearTransition::new(matrix, self.noise.clone())?, &SVector::zeros())?;
        self.quaternion = product(&self.quaternion, &step);
        Ok(())
    }

    /// Corrects by a vector that is known in the world, as the body measures it with noise of this standard deviation:
    /// gravity, or the field of the earth. NaN is a missing element.
    ///
    /// # Errors
    /// Those of [`KalmanFilter::correct`], after which nothing has changed.
    pub fn correct(
        &mut self,
        world: &Vector3<f32>,
        deviation: f32,
        measured: &Vector3<f32>,
    ) -> Result<Innovation<f32, Vector3<f32>>, Error> {
        let seen = rotation(&self.quaternion).transpose() * world;
        let mut matrix = SMatrix::<f32, 3, 6>::zeros();
        matrix.fixed_view_mut::<3, 3>(0, 0).copy_from(&cross(&seen));
        let noise = Covariance::from_diagonal(&Vector3::repeat(deviation * deviation))?;
        let observation = LinearObservation::new(matrix, noise)?;
        let innovation = self.errors.correct(&observation, &SVector::zeros(), &(measured - seen))?;
        // A gated or missing vector leaves the errors at 0.
        let errors = *self.errors.state();
        self.quaternion = product(&self.quaternion, &exponential(&errors.fixed_rows::<3>(0).into_owned()));
        self.bias += errors.fixed_rows::<3>(3);
        self.errors.set_state(SVector::zeros())?;
        Ok(innovation)
    }
}

/// The unit quaternion of a rotation vector: exp(φ/2) = (cos |φ|/2, φ sin(|φ|/2)/|φ|), by its series. That is exact in
/// single precision up to half a radian, and needs no sine, whose last bit would be that of a library.
fn exponential(turn: &Vector3<f32>) -> [f32; 4] {
    let square = turn.norm_squared() / 4.0;
    let real = 1.0 - square * (0.5 - square * (1.0 / 24.0 - square / 720.0));
    let rest = 0.5 - square * (1.0 / 12.0 - square * (1.0 / 240.0 - square / 10080.0));
    unit([real, rest * turn.x, rest * turn.y, rest * turn.z])
}

/// a * b: first b, then a, as rotations of a vector of the body into the world.
fn product(a: &[f32; 4], b: &[f32; 4]) -> [f32; 4] {
    let [aw, ax, ay, az] = *a;
    let [bw, bx, by, bz] = *b;
    unit([
        aw * bw - ax * bx - ay * by - az * bz,
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
    ])
}

/// The same with length 1: rounding would add up. It is so near to it that one step of Newton's method does.
fn unit([w, x, y, z]: [f32; 4]) -> [f32; 4] {
    let factor = 1.5 - 0.5 * (w * w + x * x + y * y + z * z);
    [w * factor, x * factor, y * factor, z * factor]
}

/// C(q), from the body into the world.
fn rotation(&[w, x, y, z]: &[f32; 4]) -> Matrix3<f32> {
    Matrix3::new(
        1.0 - 2.0 * (y * y + z * z),
        2.0 * (x * y - w * z),
        2.0 * (x * z + w * y),
        2.0 * (x * y + w * z),
        1.0 - 2.0 * (x * x + z * z),
        2.0 * (y * z - w * x),
        2.0 * (x * z - w * y),
        2.0 * (y * z + w * x),
        1.0 - 2.0 * (x * x + y * y),
    )
}

/// Three axes from two vectors: the first, the normal of both, and the third beside them (Black 1964).
fn triad(first: &Vector3<f32>, second: &Vector3<f32>) -> Matrix3<f32> {
    let normal = first.cross(second);
    let (first, normal) = (first / first.norm(), normal / normal.norm());
    Matrix3::from_columns(&[first, normal, first.cross(&normal)])
}

/// The unit quaternion of a rotation, by its largest number (Shepperd 1978).
fn quaternion(c: &Matrix3<f32>) -> [f32; 4] {
    let trace = c.m11 + c.m22 + c.m33;
    let [w, x, y, z] = if trace >= c.m11 && trace >= c.m22 && trace >= c.m33 {
        [1.0 + trace, c.m32 - c.m23, c.m13 - c.m31, c.m21 - c.m12]
    } else if c.m11 >= c.m22 && c.m11 >= c.m33 {
        [c.m32 - c.m23, 1.0 + c.m11 - c.m22 - c.m33, c.m12 + c.m21, c.m13 + c.m31]
    } else if c.m22 >= c.m33 {
        [c.m13 - c.m31, c.m12 + c.m21, 1.0 - c.m11 + c.m22 - c.m33, c.m23 + c.m32]
    } else {
        [c.m21 - c.m12, c.m13 + c.m31, c.m23 + c.m32, 1.0 - c.m11 - c.m22 + c.m33]
    };
    (SVector::<f32, 4>::from([w, x, y, z]).normalize()).into()
}

/// [v]x: its product with a vector is the cross product.
fn cross(v: &Vector3<f32>) -> Matrix3<f32> {
    Matrix3::new(0.0, -v.z, v.y, v.z, 0.0, -v.x, -v.y, v.x, 0.0)
}

/// Specific force of a body at rest, in m/s², and the field of the earth in units of its strength: up and to the north.
pub const GRAVITY: Vector3<f32> = Vector3::new(0.0, 0.0, 9.81);
/// 60 degrees down.
pub const FIELD: Vector3<f32> = Vector3::new(0.5, 0.0, -0.866_025_4);

/// What the sensors of a body measure that turns a little, accelerated at times.
#[derive(Clone, Copy, Debug)]
pub struct Sensors {
    /// In rad/s.
    pub rate: Vector3<f32>,
    /// In m/s².
    pub force: Vector3<f32>,
    /// In units of the strength of the field.
    pub field: Vector3<f32>,
}

impl Scenario for Attitude {
    const NAME: &'static str = "Attitude, quaternion and bias";
    type Input = Sensors;
    type Output = Innovation<f32, Vector3<f32>>;

    fn start(case: Case) -> Result<Self, Error> {
        let deviation = if case == Case::Hard { 1.0 } else { 0.1 };
        Attitude::new(
            (&GRAVITY, &FIELD),
            deviation,
            Gyroscope { noise: 0.02, walk: 1e-5, bias: 0.05, sample_time: 0.01 },
        )
    }

    fn input(case: Case, k: usize) -> Sensors {
        let noise = Vector3::new(sample(case, k, 0).y, sample(case, k, 1).y, sample(case, k, 2).y);
        Sensors { rate: noise * 0.01, force: GRAVITY + noise * 0.02, field: FIELD + noise * 0.01 }
    }

    #[inline(never)]
    fn step(&mut self, Sensors { rate, force, field }: &Sensors) -> Result<Self::Output, Error> {
        self.predict(rate)?;
        self.correct(&GRAVITY, 0.2, force)?;
        self.correct(&FIELD, 0.05, field)
    }

    fn numbers(&self, innovation: &Self::Output, number: &mut impl FnMut(f32)) {
        number(innovation.nis);
        number(if innovation.action == Action::Updated { 1.0 } else { 0.0 });
        self.quaternion.iter().copied().chain(self.bias.iter().copied()).for_each(&mut *number);
        self.covariance().matrix().iter().copied().for_each(number);
    }
}

#[cfg(test)]
mod tests {
    extern crate std;

    use super::*;

    /// SplitMix64 (Steele, Lea and Flood 2014): nearly Gaussian numbers, sums of twelve.
    struct Noise(u64);

    impl Noise {
        fn normal(&mut self) -> f64 {
            let mut uniform = || {
                self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
                let mut bits = self.0;
                bits = (bits ^ (bits >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
                bits = (bits ^ (bits >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
                ((bits ^ (bits >> 31)) >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
            };
            (0..12).map(|_| uniform()).sum()
        }

        fn vector(&mut self, deviation: f64) -> Vector3<f64> {
            Vector3::new(self.normal(), self.normal(), self.normal()) * deviation
        }
    }

    type Quaternion = thetahat_core::nalgebra::UnitQuaternion<f64>;

    /// A body that tumbles for a minute, in double precision and by exact rotations; the filter sees where it looks at
    /// first by one measurement of each sensor, and knows nothing of the bias of its gyroscope.
    fn tumble(seed: u64, accelerated: bool) -> (f64, f64, f64, usize) {
        let (step, mut noise) = (0.01, Noise(seed));
        let bias = noise.vector(0.03);
        let mut truth = Quaternion::from_scaled_axis(noise.vector(1.5));
        let settings = Gyroscope { noise: 0.02, walk: 1e-6, bias: 0.05, sample_time: step as f32 };
        let body = truth.inverse();
        let force = body * GRAVITY.map(f64::from) + noise.vector(0.1);
        let field = body * FIELD.map(f64::from) + noise.vector(0.02);
        let seen = (&force.map(|value| value as f32), &field.map(|value| value as f32));
        let mut filter = Attitude::new(seen, 0.05, settings).unwrap();
        let (mut squares, mut count, mut gated, mut worst) = (0.0, 0, 0, 0.0_f64);
        for k in 0..6000 {
            let t = f64::from(k) * step;
            let rate = Vector3::new((0.7 * t).sin(), 0.8 * (0.5 * t).cos(), 0.6 * (0.3 * t + 1.0).sin());
            truth *= Quaternion::from_scaled_axis(rate * step);
            filter.predict(&(rate + bias + noise.vector(0.02)).map(|value| value as f32)).unwrap();
            // Half a second of acceleration in each five.
            let push =
                if accelerated && k % 500 > 450 { Vector3::new(0.0, 3.0, 0.0) } else { Vector3::zeros() };
            let body = truth.inverse();
            let force = body * (GRAVITY.map(f64::from) + push) + noise.vector(0.1);
            let told = filter.correct(&GRAVITY, 0.1, &force.map(|value| value as f32)).unwrap();
            gated += usize::from(told.action == Action::Gated);
            assert!(push.norm() == 0.0 || k < 1000 || told.action == Action::Gated, "{k}: {}", told.nis);
            if k % 10 == 0 {
                let field = body * FIELD.map(f64::from) + noise.vector(0.02);
                filter.correct(&FIELD, 0.02, &field.map(|value| value as f32)).unwrap();
            }
            if k >= 1000 {
                let [w, x, y, z] = filter.quaternion().map(f64::from);
                let found = thetahat_core::nalgebra::Quaternion::new(w, x, y, z);
                assert!((found.norm() - 1.0).abs() < 1e-6, "{k}: {}", found.norm());
                let angle = (Quaternion::from_quaternion(found).inverse() * truth).scaled_axis();
                worst = worst.max(angle.norm().to_degrees());
                let p = filter.covariance().matrix().map(f64::from);
                let covariance = p.fixed_view::<3, 3>(0, 0).into_owned();
                squares += (angle.transpose() * covariance.try_inverse().unwrap() * angle)[0];
                count += 1;
            }
        }
        let left = (filter.bias().map(f64::from) - bias).amax();
        (worst, left, squares / f64::from(count), gated)
    }

    #[test]
    fn attitude_and_bias_are_found() {
        let mut sum = 0.0;
        for seed in 1..=8 {
            let (worst, bias, squares, gated) = tumble(seed, false);
            std::println!(
                "worst {worst:.2} degrees, bias {bias:.1e} rad/s, squared error {squares:.2}, gated {gated}"
            );
            assert!(worst < 1.5 && bias < 2e-3, "{worst} {bias}");
            sum += squares / 8.0;
        }
        // Three degrees of freedom; errors are correlated over a second, so that 8 x 50 of them are independent.
        assert!((sum / 3.0 - 1.0).abs() < 0.25, "{sum}");
    }

    #[test]
    fn an_acceleration_is_gated() {
        let (worst, bias, _, gated) = tumble(3, true);
        assert!(worst < 1.5 && bias < 2e-3 && gated >= 490, "{worst} {bias} {gated}");
    }

    #[test]
    fn a_quaternion_is_that_of_its_rotation() {
        let mut noise = Noise(1);
        for _ in 0..1000 {
            let exact = Quaternion::from_scaled_axis(noise.vector(3.0));
            let matrix = exact.to_rotation_matrix().into_inner().map(|value| value as f32);
            assert!((rotation(&quaternion(&matrix)) - matrix).amax() < 1e-6);
        }
        let settings = Gyroscope { noise: 0.02, walk: 0.0, bias: 0.05, sample_time: 0.01 };
        let along = Attitude::new((&GRAVITY, &GRAVITY), 0.05, settings);
        assert_eq!(along.unwrap_err(), Error::NotFinite { argument: "attitude" });
    }

    #[test]
    fn the_series_is_the_exponential() {
        for turn in [Vector3::new(0.1_f32, -0.2, 0.3), Vector3::zeros(), Vector3::new(0.0, 0.5, 0.0)] {
            let exact = Quaternion::from_scaled_axis(turn.map(f64::from));
            let [w, x, y, z] = exponential(&turn).map(f64::from);
            let found = [w, x, y, z];
            let expected = [exact.w, exact.i, exact.j, exact.k];
            for (found, expected) in found.iter().zip(expected) {
                assert!((found - expected).abs() < 2e-7, "{found} {expected}");
            }
        }
    }
}
