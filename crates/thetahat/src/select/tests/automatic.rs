use super::*;
use crate::select::compare::keep_quick;

const F: [f64; 3] = [1.0, -1.5, 0.7];

fn automatic(
    record: &Record<'_>,
    structure: Option<Structure>,
    nk: Option<Vec<usize>>,
) -> Result<Selection, Error> {
    let choice = Choice::Automatic(Automatic { structure, nk, ..Automatic::default() });
    chosen(record, None, &choice, Select::MDL, Initial::Auto).map(|found| found.selection)
}

/// A plant B/F with a disturbance (C/D) e of a tenth of its output.
fn plant(b: &[f64], c: &[f64], d: &[f64], seed: u64) -> (Vec<f64>, Vec<f64>) {
    let mut noise = Noise(seed);
    let (u, e) = (noise.take(600), noise.take(600));
    let (x, v) = (filtered(b, &F, &u), filtered(c, d, &e));
    let size = |x: &[f64]| x.iter().map(|x| x * x).sum::<f64>().sqrt();
    (sum(&x, &v, 0.1 * size(&x) / size(&v)), u)
}

#[test]
fn delay_structure_and_orders_are_found() {
    let b = [0.0, 0.0, 0.0, 1.0, 0.5];
    for (c, d, truth) in [
        (&[1.0][..], &F[..], Orders::arx(2, &[2], &[3])),
        (&[1.0, -1.0, 0.5], &F, Orders::armax(2, &[2], 2, &[3])),
        (&[1.0], &[1.0], Orders::oe(&[2], &[2], &[3])),
    ] {
        let (y, u) = plant(&b, c, d, 71);
        let selection = automatic(&Record::new(&y, vec![&u]).unwrap(), None, None).unwrap();
        assert_eq!(selection.chosen.orders, truth.unwrap(), "{:?}", selection.steps);
        assert_eq!(selection.path, None);
        let [delay] = &selection.delays[..] else { panic!("one input") };
        assert_eq!((delay.nk, delay.input.as_str()), (3, "u1"));
        let least = delay.mdl.iter().min_by(|a, b| a.mdl.total_cmp(&b.mdl)).unwrap();
        assert_eq!((least.nk, delay.mdl[0].nk, delay.mdl.len()), (3, 1, 14));
        assert!(selection.steps[0].starts_with("Delay of u1: 3 samples (MDL -"), "{:?}", selection.steps);
        assert!(selection.steps.iter().any(|step| step.starts_with("Second: ")), "{:?}", selection.steps);
        assert_eq!(
            selection.models + selection.failed + selection.hopeless,
            100 + 27 + 9 + 9 * 15 + 6 + 2 * 25
        );
    }
}

#[test]
fn a_long_delay_is_found_and_an_input_without_effect_is_said_to_be_one() {
    let mut b = vec![0.0; 31];
    b[30] = 1.0;
    let (y, u) = plant(&b, &[1.0], &F, 73);
    let v = Noise(5).take(600);
    let record = Record::new(&y, vec![&u, &v]).unwrap();
    let selection = automatic(&record, Some(Structure::Arx), None).unwrap();
    assert_eq!(selection.chosen.orders.nk, [30, 1], "{:?}", selection.steps);
    assert_eq!(selection.chosen.orders.nb[1], 0, "{:?}", selection.steps);
    assert!(selection.steps[1].starts_with("Delay of u2: no effect"), "{:?}", selection.steps);
}

#[test]
fn an_input_that_acts_at_once_is_seen() {
    let (y, u) = plant(&[1.0, 0.3], &[1.0], &F, 79);
    let selection = automatic(&Record::new(&y, vec![&u]).unwrap(), Some(Structure::Arx), None).unwrap();
    assert_eq!(selection.chosen.orders.nk, [0], "{:?}", selection.steps);
    assert_eq!(selection.delays[0].mdl[0].nk, 0);
    let says = |what: &str| selection.steps.iter().any(|step| step.contains(what));
    assert!(says("it acts within the same sample") && !says("feedback"), "{:?}", selection.steps);
}

/// The confidence from a regression for each window of lags.
#[test]
fn the_confidence_is_the_posterior_weight_of_the_delay() {
    use thetahat_core::nalgebra::{DMatrix, DVector};
    let mut noise = Noise(41);
    let (u, e) = (noise.take(40), noise.take(40));
    let y = sum(&filtered(&[0.0, 0.0, 1.0], &[1.0, -0.5], &u), &e, 0.3);
    let found = delays(&Record::new(&y, vec![&u]).unwrap(), &["u".to_owned()], &[false]).unwrap();
    // Of 40 samples there are ARX models of order 3 with 4 lags; 5 samples are before all of them.
    let (mut own, mut all) = (0.0, 0.0);
    for (start, end) in
        (0..5).flat_map(|start| (start + 1..=5.min(start + 4)).map(move |end| (start, end))).chain([(0, 0)])
    {
        let lags = 3 + end - start;
        let at = |t: usize, column: usize| {
            if column < 3 { -y[t - 1 - column] } else { u[t - (start + column - 3)] }
        };
        let x = DMatrix::from_fn(36, lags, |row, column| at(row + 4, column));
        let target = DVector::from_column_slice(&y[4..]);
        let theta = (x.transpose() * &x).try_inverse().unwrap() * (x.transpose() * &target);
        let mdl = ((target - x * theta).norm_squared() / 36.0).ln() + lags as f64 * 36.0_f64.ln() / 36.0;
        // Lag 0 costs one more ln(N)/N.
        let weight = (-18.0 * mdl).exp() * if start == 0 && end > 0 { 1.0 / 6.0 } else { 1.0 };
        all += weight;
        own += if start == found[0].nk && end > 0 { weight } else { 0.0 };
    }
    assert!(
        (found[0].confidence.unwrap() - own / all).abs() < 1e-9,
        "{:?} {}",
        found[0].confidence,
        own / all
    );
}

/// u(t) = K (r(t) - y(t)) explains y(t) at once, but does not act so: where it is sure to follow past errors it has no
/// lag 0, else words doubt it.
#[test]
fn an_effect_at_once_that_may_be_feedback_is_said_to_be_one() {
    for (gain, held, rows, certain) in
        [(0.25, 1, 3000, true), (0.25, 300, 3000, true), (0.1, 20, 3000, true), (0.25, 20, 180, false)]
    {
        let mut noise = Noise(83);
        let (mut y, mut u, mut x): (Vec<f64>, Vec<f64>, Vec<f64>) = Default::default();
        let mut wanted = 0.0;
        for t in 0..rows {
            let at = |x: &[f64], lag: usize| if t >= lag { x[t - lag] } else { 0.0 };
            let now =
                1.5 * at(&x, 1) - 0.7 * at(&x, 2) + 0.2 * at(&u, 1) + 0.1 * at(&u, 2) + 0.1 * noise.uniform();
            x.push(now);
            y.push(now);
            if t % held == 0 {
                wanted = noise.uniform();
            }
            u.push(gain * (wanted - now));
        }
        let selection = automatic(&Record::new(&y, vec![&u]).unwrap(), Some(Structure::Arx), None).unwrap();
        let at_once = selection.chosen.orders.nk == [0];
        let doubted =
            selection.steps.iter().any(|step| step.contains("may be feedback; `nk` 1 keeps it out"));
        // Beyond doubt it is kept out.
        assert_eq!(at_once, doubted, "{gain} {held} {:?}", selection.steps);
        assert_eq!(at_once, !certain, "{gain} {held} {:?}", selection.steps);
    }
}

#[test]
fn what_is_known_is_kept() {
    let (y, u) = plant(&[0.0, 1.0, 0.5], &[1.0], &F, 89);
    let record = Record::new(&y, vec![&u]).unwrap();
    let selection = automatic(&record, Some(Structure::Oe), Some(vec![2])).unwrap();
    assert!(selection.best.iter().all(|model| model.structure == Structure::Oe && model.orders.nk == [2]));
    assert_eq!((selection.models + selection.failed, selection.delays.len()), (9 + 3, 0));
    let selection = automatic(&record, Some(Structure::Ar), None).unwrap();
    assert!(selection.best.iter().all(|model| model.structure == Structure::Ar));
    assert!(automatic(&record, None, Some(vec![1, 2])).is_err());
    assert!(automatic(&record, Some(Structure::General), None).is_err());
}

#[test]
fn time_series_have_ar_and_arma_models() {
    let mut noise = Noise(97);
    let e = noise.take(800);
    for (c, truth) in [(&[1.0][..], Orders::arx(2, &[], &[])), (&[1.0, 0.9], Orders::armax(2, &[], 1, &[]))] {
        let y = filtered(c, &F, &e);
        let record = Record::new(&y, vec![]).unwrap();
        let selection = automatic(&record, None, None).unwrap();
        assert_eq!(selection.chosen.orders, truth.unwrap(), "{:?}", selection.steps);
        assert_eq!(selection.models + selection.failed + selection.hopeless, 19);
        assert!(automatic(&record, Some(Structure::Armax), None).is_err());
    }
}

#[test]
fn short_logs_have_fewer_models() {
    let (y, u) = plant(&[0.0, 0.0, 1.0, 0.5], &[1.0], &F, 101);
    for (rows, most) in [(60, 6), (25, 2), (8, 1)] {
        let record = Record::new(&y[..rows], vec![&u[..rows]]).unwrap();
        let selection = automatic(&record, Some(Structure::Arx), None).unwrap();
        let largest = selection.best.iter().map(|model| model.orders.na).max();
        assert_eq!(largest, Some(most), "{rows} rows: {:?}", selection.steps);
        assert!(selection.best.iter().all(|model| model.mse.is_finite() && model.score.is_some()));
        assert!(automatic(&record, None, None).is_ok(), "{rows} rows");
    }
    let nothing = Record::new(&y[..2], vec![&u[..2]]).unwrap();
    assert!(matches!(automatic(&nothing, None, None), Err(Error::Undetermined { .. })));
}

#[test]
fn few_samples_of_several_inputs_have_one_denominator() {
    let mut noise = Noise(107);
    let inputs: Vec<Vec<f64>> = (0..4).map(|_| noise.take(200)).collect();
    let y =
        sum(&filtered(&[0.0, 1.0], &[1.0, -0.8], &sum(&inputs[0], &inputs[1], -0.6)), &noise.take(200), 0.3);
    let denominators = |orders: &Orders| orders.nf.iter().filter(|&&nf| nf > 0).count();
    for (rows, several) in [(60, false), (200, true)] {
        let u = inputs.iter().map(|u| &u[..rows]).collect();
        let record = Record::new(&y[..rows], u).unwrap();
        let selection = automatic(&record, None, None).unwrap();
        let found = selection.best.iter().map(|model| &model.orders);
        let small: Vec<&Orders> =
            found.filter(|orders| denominators(orders) > 1 && rows < 10 * orders.parameters()).collect();
        assert!(small.is_empty(), "{rows} rows: {small:?}");
        let wide = selection.best.iter().any(|model| denominators(&model.orders) == 4);
        assert_eq!(wide, several, "{rows} rows: {:?}", selection.steps);
        // Who asks for the structure has it.
        let asked = automatic(&record, Some(Structure::Oe), None).unwrap();
        assert_eq!(asked.chosen.orders.structure(), Structure::Oe);
    }
}

#[test]
fn data_without_noise_have_their_own_orders() {
    let u = Noise(103).take(300);
    let y = filtered(&[0.0, 0.0, 1.0, 0.5], &F, &u);
    let selection = automatic(&Record::new(&y, vec![&u]).unwrap(), None, None).unwrap();
    assert_eq!(selection.chosen.parameters, 4, "{:?}", selection.steps);
    assert_eq!((selection.chosen.orders.nk[0], selection.chosen.mse), (2, 0.0));
}

/// One step of a search for 50 parameters takes more than the budget has.
#[test]
fn the_smallest_models_stay_whatever_their_searches_take() {
    let mut noise = Noise(211);
    let y = noise.take(5000);
    let inputs: Vec<Vec<f64>> = (0..25).map(|_| noise.take(5000)).collect();
    let record = Record::new(&y, inputs.iter().map(Vec::as_slice).collect()).unwrap();
    let (names, search) = (vec![String::new(); 25], Search::default());
    let task = Task { may_drift: false, ..task(&record, &names, &search) };
    let (one, two) = (vec![1; 25], vec![2; 25]);
    let oe = |orders: &[usize]| Orders::oe(orders, orders, &one).unwrap();
    let arx = Orders::arx(4, &two, &one).unwrap();
    let mut models = vec![oe(&two), oe(&one)];
    assert!(keep_quick(&task, &mut models).is_some_and(|said| said.contains("at most 50 parameters")));
    assert_eq!(models, [oe(&one)]);
    // What needs no search stays too.
    let mut models = vec![arx.clone(), oe(&two), Orders::arx(1, &one, &one).unwrap()];
    assert!(keep_quick(&task, &mut models).is_some());
    assert_eq!(models, [arx, Orders::arx(1, &one, &one).unwrap()]);
}
