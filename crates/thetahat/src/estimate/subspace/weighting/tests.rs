use std::io::Write;

use super::super::tests::{Run, distance, plant};
use super::super::{Subspace, SubspaceOptions, subspace};
use super::*;
use crate::data::JointRecord;
use crate::model::StateSpace;

const CLASSICAL: [Weighting; 3] = [Weighting::Moesp, Weighting::N4sid, Weighting::Cva];

fn options(weighting: Weighting, past: usize, future: usize) -> SubspaceOptions {
    SubspaceOptions { weighting, past: Some(past), future: Some(future), ..SubspaceOptions::default() }
}

/// The channels of a public log: of those in the repository, or in the folder that THETAHAT_LOGS names; where it is
/// absent, says so.
fn public_log(name: &str) -> Option<Vec<Vec<f64>>> {
    let own = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/data/public").to_owned();
    let found = [Some(own), std::env::var("THETAHAT_LOGS").ok()]
        .iter()
        .flatten()
        .find_map(|folder| std::fs::read_to_string(format!("{folder}/{name}.csv")).ok());
    let Some(text) = found else {
        let line = format!("skipped: {name}.csv is in no folder of logs; THETAHAT_LOGS names one\n");
        let _ = std::io::stderr().write_all(line.as_bytes());
        return None;
    };
    let mut lines = text.lines();
    let mut channels = vec![Vec::new(); lines.next().unwrap().split(',').count()];
    for line in lines {
        let values = line.split(',').map(|value| value.parse::<f64>().unwrap());
        channels.iter_mut().zip(values).for_each(|(channel, value)| channel.push(value));
    }
    Some(channels)
}

/// Of signals whose first ones are inputs.
fn of_channels(channels: &[Vec<f64>], inputs: usize, options: &SubspaceOptions) -> Subspace {
    let signals: Vec<&[f64]> = channels.iter().map(Vec::as_slice).collect();
    let (inputs, outputs) = signals.split_at(inputs);
    subspace(&JointRecord::new(inputs.to_vec(), outputs.to_vec()).unwrap(), options).unwrap()
}

fn assert_values(found: &[f64], expected: &[f64], tolerance: f64) {
    for (found, expected) in found.iter().zip(expected) {
        assert!((found - expected).abs() < tolerance, "{found} {expected}");
    }
}

#[test]
fn words_are_read_and_written() {
    for weighting in Weighting::ALL {
        assert_eq!(weighting.to_string().parse::<Weighting>().unwrap(), weighting);
        assert_eq!(serde_json::to_string(&weighting).unwrap(), format!("\"{weighting}\""));
    }
    assert_eq!(Weighting::default(), Weighting::Ssarx);
    assert_eq!(
        "CCA".parse::<Weighting>().unwrap_err().to_string(),
        "weighting: 'CCA' is none; there are ssarx, moesp, n4sid, cva"
    );
}

/// L of a QR decomposition of the data themselves: what the equations at [`Weighting`] say of it.
#[test]
fn singular_values_are_those_of_the_data_matrices() {
    let run = Run::open(&plant(), 300, 1, 0.5);
    let (past, future) = (4, 3);
    let columns = 300 - past - future + 1;
    let hankel = |signals: &[&[Vec<f64>]], first: usize, count: usize| {
        let signals: Vec<&Vec<f64>> = signals.iter().flat_map(|signals| signals.iter()).collect();
        DMatrix::from_fn(columns, count * signals.len(), |row, column| {
            signals[column % signals.len()][first + row + column / signals.len()]
        })
    };
    let (u, y): (&[Vec<f64>], &[Vec<f64>]) = (&run.inputs, &run.outputs);
    let all = [hankel(&[u], past, future), hankel(&[u, y], 0, past), hankel(&[y], past, future)];
    let sizes: Vec<usize> = all.iter().map(DMatrix::ncols).collect();
    let mut stacked = DMatrix::zeros(columns, sizes.iter().sum());
    let mut first = 0;
    for block in &all {
        stacked.columns_mut(first, block.ncols()).copy_from(block);
        first += block.ncols();
    }
    let l = stacked.qr().r().transpose() / (columns as f64).sqrt();
    let (a, b, c) = (sizes[0], sizes[0] + sizes[1], first);
    let block = |rows: std::ops::Range<usize>, columns: std::ops::Range<usize>| {
        l.view_range(rows, columns).into_owned()
    };
    let (l22, l32, l33) = (block(a..b, a..b), block(b..c, a..b), block(b..c, b..c));
    let theta = &l32 * l22.try_inverse().unwrap();
    let root = (&l32 * l32.transpose() + &l33 * l33.transpose()).cholesky().unwrap().l();
    // Correlations are told from rounding by what is added to the covariance.
    for (weighting, expected, tolerance) in [
        (Weighting::Moesp, l32.clone(), 1e-12),
        (Weighting::N4sid, theta * block(a..b, 0..b), 1e-12),
        (Weighting::Cva, root.solve_lower_triangular(&l32).unwrap(), 1e-10),
    ] {
        let found = subspace(&run.record(), &options(weighting, past, future)).unwrap();
        assert_eq!((found.weighting(), found.past(), found.future()), (weighting, past, future));
        let expected = expected.singular_values();
        assert_eq!(found.singular_values().len(), expected.len());
        assert_values(found.singular_values(), expected.as_slice(), tolerance * expected[0]);
    }
}

/// SLICOT's IB01AD prints the singular values of MOESP (PyPI `ctrlsys`), those of CVA are by QR in NumPy.
#[test]
fn the_hair_dryer_has_the_values_of_slicot() {
    let channels = public_log("hair_dryer").unwrap();
    let columns = (channels[0].len() - 29) as f64;
    let moesp = of_channels(&channels, 1, &options(Weighting::Moesp, 15, 15));
    let values: Vec<f64> = moesp.singular_values().iter().map(|value| value * columns.sqrt()).collect();
    assert_values(&values, &[69.884102, 14.996314, 3.667529, 1.967661, 0.300044, 0.207791], 6e-7);
    let cva = of_channels(&channels, 1, &options(Weighting::Cva, 15, 15));
    assert_values(cva.singular_values(), &[0.999450, 0.991737, 0.928499, 0.473253], 6e-7);

    // The poles by the shift of Gamma, which are not ours, are those of the same program: the vectors are right too.
    let record = JointRecord::new(vec![&channels[0]], vec![&channels[1]]).unwrap();
    let regression = LaggedProducts::new(&record, 15, false).unwrap();
    let Weighted { map, factor } = Weighting::Moesp.weighted(&record, &regression, 15, false).unwrap();
    let weighted = map * factor;
    let (rows, columns) = weighted.shape();
    let same = faer::Mat::from_fn(rows, columns, |row, column| weighted[(row, column)]);
    let decomposed = same.thin_svd().unwrap();
    let gamma = DMatrix::from_fn(rows, 4, |row, column| decomposed.U()[(row, column)]);
    let (above, below) = (gamma.rows(0, 14), gamma.rows(1, 14));
    let shifted = (above.transpose() * above).cholesky().unwrap().solve(&(above.transpose() * below));
    let mut poles: Vec<(f64, f64)> = shifted.complex_eigenvalues().iter().map(|p| (p.re, p.im)).collect();
    poles.sort_by(|a, b| a.partial_cmp(b).unwrap());
    let expected = [(0.4758, -0.1999), (0.4758, 0.1999), (0.7456, 0.0), (0.9610, 0.0)];
    for (found, expected) in poles.iter().zip(expected) {
        assert!((found.0 - expected.0).hypot(found.1 - expected.1) < 1e-4, "{found:?} {expected:?}");
    }
}

/// Two inputs and two outputs, in their own units.
#[test]
fn the_arm_has_the_values_of_slicot() {
    let Some(channels) = public_log("cd_player_arm") else { return };
    let columns = (channels[0].len() - 29) as f64;
    let found = of_channels(&channels, 2, &options(Weighting::Moesp, 15, 15));
    let values: Vec<f64> = found.singular_values().iter().map(|value| value * columns.sqrt()).collect();
    assert_values(&values, &[14.4188, 11.9753, 4.8061, 3.2636, 2.6910], 6e-5);
}

#[test]
fn each_finds_the_plant() {
    let exact = Run::open(&plant(), 600, 1, 0.0);
    let noisy = Run::open(&plant(), 3000, 2, 1.0);
    for weighting in CLASSICAL {
        let options = SubspaceOptions { weighting, ..SubspaceOptions::default() };
        let found = subspace(&exact.record(), &options).unwrap();
        assert!(found.feedthrough());
        assert_eq!(found.order(&exact.record(), found.orders()).unwrap(), 4, "{weighting}");
        let error = distance(&found.state_space(4, 1.0).unwrap(), &plant());
        assert!(error < 1e-6, "{weighting} {error}");

        let found = subspace(&noisy.record(), &options).unwrap();
        assert_eq!(found.future(), found.past());
        assert_eq!(found.order(&noisy.record(), found.orders()).unwrap(), 4, "{weighting}");
        let error = distance(&found.state_space(4, 1.0).unwrap(), &plant());
        assert!(error < 0.04, "{weighting} {error}");
    }
}

#[test]
fn a_series_without_inputs_has_a_model() {
    let plant = StateSpace { g: DMatrix::zeros(4, 0), d: DMatrix::zeros(2, 0), ..plant() };
    let run = Run::open(&plant, 4000, 5, 1.0);
    for weighting in CLASSICAL {
        let options = SubspaceOptions { weighting, ..SubspaceOptions::default() };
        let model = subspace(&run.record(), &options).unwrap().state_space(4, 1.0).unwrap();
        let spread = (&model.noise_covariance - &plant.noise_covariance).norm();
        assert!(spread < 0.04, "{weighting} {spread}");
    }
}

/// Correlations have no units. The values of MOESP and N4SID have those of an only output, and the models are the same.
#[test]
fn other_units_do_what_they_should() {
    let run = Run::open(&plant(), 800, 6, 1.0);
    let values = |weighting, factors: [f64; 2]| {
        let channels = [
            run.inputs[0].iter().map(|u| u * 1e4).collect(),
            run.outputs[0].iter().map(|y| y * factors[0]).collect(),
            run.outputs[1].iter().map(|y| y * factors[1]).collect::<Vec<f64>>(),
        ];
        of_channels(&channels, 1, &options(weighting, 6, 6)).singular_values().to_vec()
    };
    assert_values(&values(Weighting::Cva, [1e-6, 1e3]), &values(Weighting::Cva, [1.0, 1.0]), 1e-9);
    for weighting in [Weighting::Moesp, Weighting::N4sid] {
        let (large, small) = (values(weighting, [1e3, 1e3]), values(weighting, [1.0, 1.0]));
        let large: Vec<f64> = large.iter().map(|value| value / 1e3).collect();
        assert_values(&large, &small, 1e-12 * small[0]);
    }
}

/// The rows of SSARX's map beyond the past are zero, and fewer rows see the plant too.
#[test]
fn a_future_that_is_not_the_past() {
    let run = Run::open(&plant(), 3000, 2, 1.0);
    let with = |weighting, future| subspace(&run.record(), &options(weighting, 10, future)).unwrap();
    assert_eq!(with(Weighting::Ssarx, 40).future(), 10);
    assert_eq!(with(Weighting::Ssarx, 40).singular_values(), with(Weighting::Ssarx, 10).singular_values());
    for weighting in Weighting::ALL {
        for future in [4, 20] {
            let error = distance(&with(weighting, future).state_space(4, 1.0).unwrap(), &plant());
            assert!(error < 0.05, "{weighting} {future} {error}");
        }
    }
    assert_eq!(with(Weighting::Cva, 2).highest_order(), 4);
}

#[test]
fn what_cannot_be_told_is_said() {
    let run = Run::open(&plant(), 300, 8, 1.0);
    let message = |options: &SubspaceOptions| subspace(&run.record(), options).unwrap_err().to_string();
    for weighting in Weighting::ALL {
        assert!(message(&options(weighting, 4, 0)).starts_with("future: it is 0"));
        assert!(message(&options(weighting, 0, 4)).starts_with("past: it is 0"));
    }
    for weighting in CLASSICAL {
        let long = message(&options(weighting, 10, 60));
        assert!(
            long.contains("a past of 10 and a future of 60 make 280 lagged signals, and 231 samples"),
            "{long}"
        );
        assert!(message(&options(weighting, 10, usize::MAX)).contains("more samples than signals"));
    }
}

/// What depends on others, exactly: something finite is found, or said.
#[test]
fn dependent_signals_do_no_harm() {
    let run = Run::open(&plant(), 300, 8, 1.0);
    let (u, y) = (&run.inputs[0], &run.outputs[0]);
    let constant = vec![3.0; 300];
    let copy: Vec<f64> = u.iter().map(|u| 2.0 * u).collect();
    let late: Vec<f64> = [0.0].iter().chain(&u[..299]).copied().collect();
    let sine: Vec<f64> = (0..300).map(|t| (0.3 * f64::from(t)).sin()).collect();
    type Signals<'a> = Vec<&'a [f64]>;
    let cases: [(Signals<'_>, Signals<'_>); 8] = [
        (vec![u], vec![y, y]),
        (vec![u, u], vec![y]),
        (vec![u], vec![&constant]),
        (vec![&constant], vec![y]),
        (vec![u], vec![&copy]),
        (vec![u], vec![&late]),
        (vec![&sine], vec![&sine]),
        (vec![], vec![&sine]),
    ];
    for weighting in Weighting::ALL {
        for (case, (inputs, outputs)) in cases.iter().enumerate() {
            let record = JointRecord::new(inputs.clone(), outputs.clone()).unwrap();
            for past in [None, Some(3), Some(20)] {
                let options = SubspaceOptions { weighting, past, ..SubspaceOptions::default() };
                let Ok(found) = subspace(&record, &options) else { continue };
                assert!(found.singular_values().iter().all(|value| value.is_finite()));
                for order in found.orders() {
                    let Ok(model) = found.state_space(order, 1.0) else { continue };
                    let all = [&model.f, &model.g, &model.h, &model.d, &model.k, &model.noise_covariance];
                    let finite = all.iter().all(|matrix| matrix.iter().all(|value| value.is_finite()));
                    assert!(finite, "{weighting} {case} {past:?} {order}");
                }
                assert!(found.scores(&record, found.orders()).is_ok());
            }
        }
    }
}
