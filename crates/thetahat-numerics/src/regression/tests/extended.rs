//! Normal equations in twice the precision: exact, and the same from any pieces.

use thetahat_core::nalgebra::DVector;

use super::super::{DividedMonomials, ExtendedGram, Lagged, Regression, Unsolved};
use super::{Case, Noise, Presample, Reference, hard_cases, output, taps, whole};

fn solved(gram: &ExtendedGram, case: &Case) -> Regression {
    gram.solve(&ExtendedGram::columns(&case.taps), 1).unwrap()
}

#[test]
fn the_solution_is_that_of_double_double_rows() {
    let mut noise = Noise(14);
    let mut worst = 0.0_f64;
    for residual in [1e-10, 1e-5, 1.0] {
        for case in hard_cases(residual, &mut noise) {
            let reference = Reference::new(&case.rows());
            let found = solved(&ExtendedGram::of(&case.lagged()), &case);
            let error = reference.error(&found.parameters);
            // eps, and eps^2 kappa^2 with a factor for the sums.
            let bound = 4.0 * f64::EPSILON + 1e-29 * reference.condition * reference.condition;
            assert!(error < bound, "{error:e} at {:e}", reference.condition);
            let moved = (found.residual_norm / reference.residual - 1.0).abs();
            let digits =
                1e-15 + 1e-29 * ((reference.target + reference.scaled.norm()) / reference.residual).powi(2);
            assert!(moved < digits, "{moved:e} at {:e}", reference.condition);
            worst = worst.max(reference.condition);
        }
    }
    assert!(worst > 1e10);
}

#[test]
fn pieces_in_any_order_add_up_to_the_whole() {
    let mut noise = Noise(15);
    let length = 30_000;
    let u = noise.take(length);
    let y: Vec<f64> = output(&[0.98, 0.9], &u, || noise.uniform()).iter().map(|y| y + 1e6).collect();
    let case = Case {
        signals: vec![y, u],
        taps: taps(3, &[(4, 2)]),
        segments: whole(length),
        initial: Presample::Drop,
    };
    let whole = ExtendedGram::of(&case.lagged());
    // A piece begins with the five rows that its first one reaches back to.
    let boundaries = [0, 6, 7, 1000, 17_000, 17_004, length];
    let signals: Vec<&[f64]> = case.signals.iter().map(Vec::as_slice).collect();
    let piece = |pair: &[usize]| {
        let rows = pair[0].saturating_sub(5)..pair[1];
        ExtendedGram::of(&Lagged::new(&signals, case.taps.clone(), &[rows], Presample::Drop))
    };
    let pieces: Vec<ExtendedGram> = boundaries.windows(2).map(piece).collect();
    let mut orders = [vec![0, 1, 2, 3, 4, 5], vec![5, 3, 1, 0, 2, 4]];
    for order in &mut orders {
        let mut merged = pieces[order[0]].clone();
        order[1..].iter().for_each(|next| merged.merge(&pieces[*next]));
        assert_eq!(merged.rows(), whole.rows());
        let offsets = vec![0.0; whole.size()]
            .iter()
            .enumerate()
            .map(|(c, _)| if (1..5).contains(&c) { 1e6 } else { 0.0 })
            .collect::<Vec<_>>();
        let (found, expected) =
            (solved(&merged.moved(&offsets), &case), solved(&whole.moved(&offsets), &case));
        for (found, expected) in found.parameters.iter().zip(expected.parameters.iter()) {
            assert!((found - expected).abs() < 1e-14, "{found} {expected}");
        }
        assert!((found.residual_norm / expected.residual_norm - 1.0).abs() < 1e-14);
    }
}

#[test]
fn offsets_that_are_taken_later_are_taken_exactly() {
    let mut noise = Noise(16);
    let u = noise.take(2000);
    let y = output(&[0.9], &u, || 0.1 * noise.uniform());
    // Powers of two: what stands in the signals is exact.
    let (level, base) = (2_f64.powi(20), -2_f64.powi(22));
    let round = |x: &f64| (x * 2_f64.powi(25)).round() / 2_f64.powi(25);
    let (u, y): (Vec<f64>, Vec<f64>) = (u.iter().map(round).collect(), y.iter().map(round).collect());
    let case = |y: Vec<f64>, u: Vec<f64>| Case {
        signals: vec![y, u],
        taps: taps(2, &[(2, 1)]),
        segments: vec![0..900, 905..2000],
        initial: Presample::Drop,
    };
    let plain = case(y.clone(), u.clone());
    let far = case(y.iter().map(|y| y + level).collect(), u.iter().map(|u| u + base).collect());
    let offsets = [0.0, level, level, level, base, base];
    let found = ExtendedGram::of(&far.lagged()).moved(&offsets);
    let expected = ExtendedGram::of(&plain.lagged());
    let (a, b) = (solved(&found, &far), solved(&expected, &plain));
    assert!((a.parameters - b.parameters).norm() < 1e-15);
    assert!((found.spread(1) / expected.spread(1) - 1.0).abs() < 1e-14);
    // A column of ones does the same.
    let with_one = |gram: &ExtendedGram| {
        let mut columns = ExtendedGram::columns(&plain.taps);
        columns.push((0, 1.0));
        gram.solve(&columns, 1).unwrap().parameters
    };
    let (a, b) = (with_one(&ExtendedGram::of(&far.lagged())), with_one(&expected));
    assert!((a.rows(0, 4) - b.rows(0, 4)).norm() < 1e-13);
}

#[test]
fn what_is_stored_is_what_is_read() {
    let mut noise = Noise(17);
    let case = Case {
        signals: vec![noise.take(50), noise.take(50)],
        taps: taps(1, &[(1, 1)]),
        segments: whole(50),
        initial: Presample::Drop,
    };
    let gram = ExtendedGram::of(&case.lagged());
    let text = serde_json::to_string(&gram).unwrap();
    assert_eq!(serde_json::from_str::<ExtendedGram>(&text).unwrap(), gram);
    for (from, to) in
        [("\"rows\":49", "\"rows\":48"), ("\"size\":4", "\"size\":5"), ("[49.0,0.0]", "[49.0,1.0]")]
    {
        assert!(text.contains(from));
        assert!(serde_json::from_str::<ExtendedGram>(&text.replace(from, to)).is_err(), "{to}");
    }
}

#[test]
fn what_the_rows_do_not_tell_is_named() {
    let mut noise = Noise(18);
    let (u, zero) = (noise.take(200), vec![0.0; 200]);
    let y = output(&[0.5], &u, || noise.uniform());
    let deficient = |signals: Vec<&Vec<f64>>| {
        let taps = taps(1, &[(2, 1), (1, 1)]);
        let case = Case {
            signals: signals.into_iter().cloned().collect(),
            segments: whole(200),
            initial: Presample::Drop,
            taps: taps.clone(),
        };
        ExtendedGram::of(&case.lagged()).solve(&ExtendedGram::columns(&taps), 1).unwrap_err()
    };
    assert_eq!(deficient(vec![&y, &u, &zero]), Unsolved::Deficient(vec![3]));
    assert_eq!(deficient(vec![&y, &u, &u]), Unsolved::Deficient(vec![3]));
    let huge: Vec<f64> = u.iter().map(|u| 1e150 * u).collect();
    assert_eq!(deficient(vec![&y, &u, &huge]), Unsolved::Range);
    // An exact fit.
    let exact = output(&[0.5], &u, || 0.0);
    let case = Case {
        signals: vec![exact, u],
        taps: taps(1, &[(2, 1)]),
        segments: whole(200),
        initial: Presample::Drop,
    };
    let found = solved(&ExtendedGram::of(&case.lagged()), &case);
    let expected = DVector::from_column_slice(&[-0.5, 1.0, 0.5]);
    assert!((found.parameters - expected).norm() < 1e-14 && found.residual_norm < 1e-13);
}

#[test]
fn sums_move_to_other_centres() {
    let rows = 3000;
    let value = |index: usize, row: usize| ((row * row + 7 * row * (index + 1)) % (11 + index)) as f64 - 4.0;
    // x_0^2 x_1, and x_1 x_2: whole numbers, so that all sums are exact.
    let set = DividedMonomials::new(&[vec![0, 1, 0], vec![2, 1]], 3).unwrap();
    assert_eq!((set.size(), set.place(&[]), set.place(&[1, 0]).is_some()), (9, Some(0), true));
    assert_eq!(set.place(&[2, 2]), None);
    let about = |centre: [f64; 4]| {
        let fill = |index: usize, first: usize, into: &mut [f64]| {
            into.iter_mut().zip(first..).for_each(|(into, row)| *into = value(index, row) - centre[index]);
        };
        set.sums(rows, fill)
    };
    let (here, there) = ([0.0; 4], [3.0, -2.0, 0.0, 1e3]);
    assert_eq!(set.moved(&about(here), &here, &there), about(there));
    assert_eq!(set.moved(&about(there), &there, &here), about(here));
    assert!(DividedMonomials::new(&[(0..12).collect()], 12).is_none());
}
