use thetahat_numerics::noise::Noise;

use super::*;

#[test]
fn what_is_missing_is_expected_as_the_dense_matrices_say() {
    let mut noise = Noise(11);
    let (segments, highest) = ([0..40, 50..75], 4);
    let mut values = noise.take(80);
    for row in [3, 4, 9, 15, 16, 17, 18, 19, 20, 21, 33, 52, 60, 62, 74] {
        values[row] = f64::NAN;
    }
    for monic in [&[1.0][..], &[1.0, -0.8], &[1.0, -1.4, 0.9], &[1.0, -0.5, 0.2, -0.3, 0.1]] {
        let mut holes = Holes::new(&values, &segments, highest);
        let mut filled = vec![values.iter().map(|v| if v.is_nan() { 7.0 } else { *v }).collect::<Vec<f64>>()];
        holes.fill(&mut filled, monic);
        let mut spread = DMatrix::zeros(highest + 1, highest + 1);
        for segment in &segments {
            let size = segment.len();
            let a = DMatrix::from_fn(size, size, |i, j| {
                i.checked_sub(j).and_then(|lag| monic.get(lag)).copied().unwrap_or(0.0)
            });
            let information = a.transpose() * &a;
            let own = &values[segment.clone()];
            let missing: Vec<usize> = (0..size).filter(|row| own[*row].is_nan()).collect();
            let known: Vec<usize> = (0..size).filter(|row| !own[*row].is_nan()).collect();
            let part = |rows: &[usize], columns: &[usize]| {
                DMatrix::from_fn(rows.len(), columns.len(), |i, j| information[(rows[i], columns[j])])
            };
            let inverse = part(&missing, &missing).try_inverse().unwrap();
            let given = DMatrix::from_fn(known.len(), 1, |i, _| own[known[i]]);
            let expected = -&inverse * part(&missing, &known) * given;
            for (i, row) in missing.iter().enumerate() {
                assert!((filled[0][segment.start + row] - expected[i]).abs() < 1e-10, "{monic:?} {row}");
            }
            for t in highest..size {
                for (k, l) in (0..=highest).flat_map(|k| (0..=highest).map(move |l| (k, l))) {
                    let place = |lag: usize| missing.iter().position(|row| *row == t - lag);
                    if let (Some(i), Some(j)) = (place(k), place(l)) {
                        spread[(k, l)] += inverse[(i, j)];
                    }
                }
            }
        }
        assert!((holes.spread() - &spread).amax() < 1e-10, "{monic:?}");
        for (value, filled) in values.iter().zip(&filled[0]).filter(|(value, _)| !value.is_nan()) {
            assert_eq!(value, filled);
        }
    }
}
