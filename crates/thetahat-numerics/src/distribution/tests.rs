use super::*;

#[test]
fn tails_and_quantiles_are_those_of_tables() {
    // Abramowitz and Stegun 1964, tables 26.8 and 26.2.
    assert!((chi_square_tail(37.6525, 25.0).unwrap() - 0.05).abs() < 1e-6);
    assert!((chi_square_tail(3.841459, 1.0).unwrap() - 0.05).abs() < 1e-8);
    assert_eq!(chi_square_tail(0.0, 3.0), Some(1.0));
    assert_eq!(chi_square_tail(1.0, 0.0), None);
    assert!(chi_square_tail(1e6, 25.0).unwrap() < 1e-300);
    // Abramowitz and Stegun 1964, table 26.8, has five digits.
    let (low, high) = chi_square_interval(10).unwrap();
    assert!((low - 3.24697).abs() < 1e-5 && (high - 20.4832).abs() < 1e-4, "{low} {high}");
    assert_eq!(chi_square_interval(0), None);
    assert!((two_sided(0.05) - 1.959963985).abs() < 1e-9);
    assert!((two_sided(0.01) - 2.575829304).abs() < 1e-9);
    assert!((two_sided(1.0)).abs() < 1e-12);
    // Table 26.10.
    assert!((student_two_sided(0.05, Some(10)) - 2.228).abs() < 5e-4);
    assert_eq!(student_two_sided(0.05, None), two_sided(0.05));
    // Very many degrees of freedom, in no time.
    let many = |degrees| student_two_sided(0.05, Some(degrees));
    assert!((many(1_000_001) - 1.959_966_356_8).abs() < 1e-9, "{}", many(1_000_001));
    assert!((many(usize::MAX) - two_sided(0.05)).abs() < 1e-15);
    // The moments of what is outside and inside add up to none.
    let (share, [second, fourth]) = outside(1.5);
    assert!((share - 0.133614).abs() < 1e-6);
    let step = 1e-4;
    let inside = |of: fn(f64) -> f64| -> f64 {
        let at = |k: i32| (f64::from(k) + 0.5) * step;
        2.0 * step * (0..15_000).map(|k| of(at(k)) * Normal::standard().pdf(at(k))).sum::<f64>()
    };
    assert!((second + inside(|x| x * x - 1.0)).abs() < 1e-7);
    assert!((fourth + inside(|x| x.powi(4) - 6.0 * x * x + 3.0)).abs() < 1e-7);
}

#[test]
fn binomial_tails_are_sums_of_their_terms() {
    for (of, p) in [(1_usize, 0.3_f64), (7, 0.01), (25, 0.05), (100, 0.2)] {
        // (of over k) p^k (1 - p)^(of - k), each from the one before.
        let mut term = (1.0 - p).powi(of as i32);
        let mut below = 0.0;
        for count in 0..=of {
            assert!((binomial_tail(count, of, p, 1.0) - (1.0 - below)).abs() < 1e-12, "{count} of {of}, {p}");
            let mid = 1.0 - below - 0.5 * term;
            assert!((binomial_mid_p(count, of, p, 1.0) - mid).abs() < 1e-12, "{count} of {of}, {p}");
            below += term;
            term *= (of - count) as f64 / (count + 1) as f64 * p / (1.0 - p);
        }
        assert_eq!(binomial_tail(of + 1, of, p, 1.0), 0.0);
        // Each event twice is half of the events.
        assert!((binomial_tail(2, 2 * of, p, 2.0) - binomial_tail(1, of, p, 1.0)).abs() < 1e-12);
    }
}
