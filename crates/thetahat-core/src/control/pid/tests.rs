extern crate std;

use super::PidSettings;
use crate::Error;

/// The settings as a program of its own: integral, filtered derivative, output.
struct Textbook {
    settings: PidSettings<f64>,
    integral: f64,
    derivative: f64,
    before: f64,
}

impl Textbook {
    fn control(&mut self, set_point: f64, measurement: f64) -> f64 {
        let PidSettings {
            gain,
            integral_time,
            derivative_time,
            derivative_filter,
            set_point_weight,
            sample_time,
        } = self.settings;
        self.integral += gain * sample_time / integral_time * (set_point - measurement);
        let slow = derivative_time + derivative_filter * sample_time;
        self.derivative = derivative_time / slow * self.derivative
            - gain * derivative_time * derivative_filter / slow * (measurement - self.before);
        self.before = measurement;
        gain * (set_point_weight * set_point - measurement) + self.integral + self.derivative
    }
}

#[test]
fn it_is_the_textbooks_sum_of_three_parts() -> Result<(), Error> {
    let whole = PidSettings {
        integral_time: 4.0,
        derivative_time: 0.8,
        derivative_filter: 8.0,
        set_point_weight: 0.3,
        ..PidSettings::proportional(-1.7, 0.25)
    };
    let cases = [
        whole,
        PidSettings { set_point_weight: 0.0, ..whole },
        PidSettings { derivative_time: 0.0, ..whole },
        PidSettings { integral_time: f64::INFINITY, ..whole },
        PidSettings::proportional(3.0, 0.1),
    ];
    for settings in cases {
        let mut controller = settings.controller()?;
        let mut textbook = Textbook { settings, integral: 0.0, derivative: 0.0, before: 0.0 };
        for k in 0..100 {
            let (set_point, measurement) = (f64::from(k % 17 - 8), f64::from(k * k % 13) / 7.0);
            let wanted = textbook.control(set_point, measurement);
            let found = controller.control(set_point, measurement);
            assert!((found - wanted).abs() < 1e-11, "{settings:?} {k}: {found} {wanted}");
        }
    }
    Ok(())
}

#[test]
fn settings_out_of_their_range_are_refused() {
    let good = PidSettings { integral_time: 4.0, ..PidSettings::proportional(1.0_f32, 0.1) };
    let cases = [
        ("gain", PidSettings { gain: 0.0, ..good }),
        ("sample_time", PidSettings { sample_time: 0.0, ..good }),
        ("sample_time", PidSettings { sample_time: f32::NAN, ..good }),
        ("integral_time", PidSettings { integral_time: 0.0, ..good }),
        ("integral_time", PidSettings { integral_time: -1.0, ..good }),
        ("derivative_time", PidSettings { derivative_time: f32::INFINITY, ..good }),
        ("derivative_filter", PidSettings { derivative_filter: 0.0, ..good }),
        ("set_point_weight", PidSettings { set_point_weight: 1.1, ..good }),
        ("set_point_weight", PidSettings { set_point_weight: 0.0, integral_time: f32::INFINITY, ..good }),
    ];
    for (name, settings) in cases {
        let error = settings.controller().map(|_| ());
        assert!(
            matches!(error, Err(Error::OutOfRange { argument, .. }) if argument == name),
            "{settings:?} {error:?}"
        );
    }
    for gain in [f32::NAN, f32::INFINITY, f32::MAX] {
        let settings = PidSettings { gain, derivative_time: 1.0, ..good };
        assert!(matches!(settings.controller(), Err(Error::NotFinite { .. })), "{gain}");
    }
}
