use super::*;

#[test]
fn moments_are_the_gram_matrix_of_the_monomials() {
    for (variables, degree) in [(1, 1), (3, 1), (1, 4), (3, 2), (2, 3)] {
        let monomials = Monomials::new(variables, degree).unwrap();
        assert_eq!(Some(monomials.count()), combinations(variables + degree, degree));
        let value = |index: usize, t: usize| ((t * (index + 3) + index) % 17) as f64 / 8.0 - 1.0;
        let rows = 1300;
        let variable = |index: usize, first: usize, into: &mut [f64]| {
            into.iter_mut().zip(first..).for_each(|(into, t)| *into = value(index, t));
        };
        let target = |first: usize, into: &mut [f64]| {
            into.iter_mut().zip(first..).for_each(|(into, t)| *into = (t % 5) as f64);
        };
        let mut moments = Moments::zero(&monomials);
        moments.add(&monomials, rows, variable, target);
        let monomial = |place: usize, t: usize| -> f64 {
            monomials.factors(place).iter().map(|factor| value(*factor, t)).product()
        };
        for one in 0..monomials.count() {
            let direct: f64 = (0..rows).map(|t| monomial(one, t) * (t % 5) as f64).sum();
            assert!((moments.cross[one] - direct).abs() < 1e-9 * rows as f64);
            for other in 0..monomials.count() {
                let direct: f64 = (0..rows).map(|t| monomial(one, t) * monomial(other, t)).sum();
                let found = moments.gram(&monomials, one, other);
                assert!((found - direct).abs() < 1e-9 * rows as f64, "{one} {other}: {found} {direct}");
            }
        }
    }
}

#[test]
fn too_many_products_are_refused() {
    assert!(Monomials::new(3, 0).is_err());
    let error = Monomials::new(60, 5).unwrap_err().to_string();
    assert!(error.contains("too many terms"), "{error}");
}
