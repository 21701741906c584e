use nalgebra::Const;

use super::{Tuner, WANTED, settings, tuner};
use crate::{
    DirectOrders, DirectSelfTuner, Error, Fallback, Forgetting, IndirectSelfTuner, Probing, RecursiveArmax,
    ResponseWanted, Sensor, Supervision, TunerOrders, TunerSettings,
};

fn refused<V>(result: Result<V, Error>, name: &str) -> bool {
    matches!(result, Err(Error::OutOfRange { argument, .. }) if argument == name)
}

#[test]
fn settings_out_of_their_range_are_refused() {
    let of = |response| TunerSettings { response, ..settings() };
    let probing = |probing| TunerSettings { probing, ..settings() };
    let usual = Probing::of_scale(1.0);
    let supervised = |supervision| TunerSettings { supervision, ..settings() };
    let of_scale = Supervision::of_scale(1.0);
    let cases = [
        ("frequency", of(ResponseWanted { frequency: 0.0, ..WANTED })),
        ("frequency", of(ResponseWanted { frequency: f32::NAN, ..WANTED })),
        ("damping", of(ResponseWanted { damping: 1.5, ..WANTED })),
        ("observer", of(ResponseWanted { observer: 1.0, ..WANTED })),
        ("limits", TunerSettings { limits: 1.0..=-1.0, ..settings() }),
        ("limits", TunerSettings { limits: f32::NAN..=1.0, ..settings() }),
        ("input", TunerSettings { input: 11.0, ..settings() }),
        ("input", TunerSettings { input: f32::NAN, ..settings() }),
        ("gain_sign", TunerSettings { gain_sign: f32::NAN, ..settings() }),
        ("probing", probing(Probing { amplitude: -1.0, ..usual })),
        ("probing", probing(Probing { amplitude: f32::INFINITY, ..usual })),
        ("probing", probing(Probing { largest: 0.01, ..usual })),
        ("probing", probing(Probing { at_least: 300, ..usual })),
        ("range", TunerSettings { sensor: Sensor { range: 1.0..=0.0, ..Sensor::default() }, ..settings() }),
        ("excitation", supervised(Supervision { excitation: -0.1, ..of_scale })),
        ("excitation", supervised(Supervision { excitation: f32::INFINITY, ..of_scale })),
        ("saturated", supervised(Supervision { saturated: 1.1, ..of_scale })),
        ("innovations", supervised(Supervision { innovations: f32::NAN, ..of_scale })),
        ("innovations", supervised(Supervision { innovations: 0.5, ..of_scale })),
        ("fallback", supervised(Supervision { fallback: Fallback::Input(f32::NAN), ..of_scale })),
    ];
    for (name, settings) in cases {
        assert!(refused(tuner(&settings, 0.98), name), "{settings:?}");
    }
}

#[test]
fn orders_and_numbers_out_of_their_range_are_refused() -> Result<(), Error> {
    let forgetting = || Forgetting::Exponential { factor: 0.98_f32 };
    let orders = TunerOrders { na: 2, nb: 2, nc: 0, constant: true, integrator: true };
    let found = Tuner::new(&orders, &settings(), 1.0, 1.0, forgetting()).map(|_| ());
    assert_eq!(found, Err(Error::Orders { needed: 4, available: 7 }));
    let small: Result<IndirectSelfTuner<f32, Const<4>, Const<4>>, _> =
        IndirectSelfTuner::new(&orders, &settings(), 1.0, 1.0, forgetting());
    assert_eq!(small.map(|_| ()), Err(Error::Orders { needed: 5, available: 4 }));
    let none = TunerOrders { nb: 0, ..orders };
    assert!(refused(Tuner::new(&none, &settings(), 1.0, 1.0, forgetting()), "nb"));
    let usual = || tuner(&settings(), 0.98);
    assert!(refused(usual()?.with_design_every(0), "samples"));
    assert!(refused(usual()?.with_peaks(0.5, 2.0), "peaks"));
    assert!(refused(usual()?.with_peaks(3.0, 2.0), "peaks"));
    assert!(refused(usual()?.probe(1.5, 3), "share"));
    assert!(refused(usual()?.set_gain_sign(f32::NAN), "gain_sign"));
    assert!(refused(usual()?.set_fallback(Fallback::Input(f32::INFINITY)), "fallback"));
    assert!(refused(usual()?.probe(f32::NAN, 3), "share"));
    type Small = DirectSelfTuner<f32, Const<3>, Const<1>, Const<2>>;
    let small = DirectOrders { na: 1, nb: 1, delay: 1, constant: true };
    let direct = |orders| Small::new(&orders, &settings(), 1.0, 1.0, forgetting());
    assert!(refused(direct(DirectOrders { delay: 0, ..small }), "delay"));
    assert!(refused(direct(DirectOrders { na: 0, ..small }), "na"));
    assert!(refused(direct(DirectOrders { nb: 0, ..small }), "nb"));
    assert_eq!(
        direct(DirectOrders { delay: 3, ..small }).map(|_| ()),
        Err(Error::Orders { needed: 2, available: 1 })
    );
    assert!(refused(direct(small)?.with_gradient(2.0), "gain"));
    assert!(refused(direct(small)?.with_gradient(f32::NAN), "gain"));
    Ok(())
}

const COLOURED: TunerOrders = TunerOrders { nc: 2, ..super::ORDERS };
type Plant = RecursiveArmax<f32, Const<{ COLOURED.parameters() }>>;
type Coloured = IndirectSelfTuner<f32, Const<{ COLOURED.parameters() }>, Const<{ COLOURED.size() }>, Plant>;

fn coloured() -> Result<Coloured, Error> {
    Coloured::new(&COLOURED, &settings(), 1.0, 1.0, Forgetting::Exponential { factor: 0.98 })
}

/// Whatever is measured, and whatever is wanted: a finite input within the limits, and never a panic.
#[test]
fn any_number_may_be_measured() -> Result<(), Error> {
    const NUMBERS: [f32; 9] =
        [0.0, 1.0, -1.0, f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::MAX, f32::MIN_POSITIVE, 1e-30];
    type Direct = DirectSelfTuner<f32, Const<3>, Const<1>, Const<2>>;
    let orders = DirectOrders { na: 1, nb: 1, delay: 1, constant: true };
    let mut noise = crate::noise::Noise(1);
    let mut pick = || NUMBERS.get(((noise.next() + 1.0) * 4.5) as usize).copied().unwrap_or(0.5);
    let mut indirect = tuner(&settings(), 0.98)?;
    let mut direct = Direct::new(&orders, &settings(), 1.0, 1.0, Forgetting::Exponential { factor: 0.98 })?;
    let mut coloured = coloured()?;
    for _ in 0..20_000 {
        let (set_point, measurement) = (pick(), pick());
        let of_indirect =
            [indirect.control(set_point, measurement), coloured.control(set_point, measurement)];
        for u in [of_indirect[0], of_indirect[1], direct.control(set_point, measurement)] {
            assert!((-10.0..=10.0).contains(&u), "{set_point} {measurement}: {u}");
        }
        let told = pick();
        indirect.applied(told);
        coloured.applied(told);
        direct.applied(told);
    }
    // And all still work.
    let (mut x, mut y, mut z) = (0.0, 0.0, 0.0);
    for _ in 0..3000 {
        x = 0.9 * x + 0.1 * coloured.control(1.0, x);
        y = 0.9 * y + 0.1 * indirect.control(1.0, y);
        z = 0.9 * z + 0.1 * direct.control(1.0, z);
    }
    assert!((x - 1.0).abs() < 0.05, "{x}");
    assert!((y - 1.0).abs() < 0.05 && (z - 1.0).abs() < 0.05, "{y} {z}");
    Ok(())
}
