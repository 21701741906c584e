use super::*;
use crate::model::polynomial::is_stable;

#[test]
fn random_starts_are_stable_differ_and_come_again() {
    let orders = Orders::bj(&[2], 1, 2, &[2], &[1]).unwrap();
    let best = [1.0, 0.5, 0.3, -1.2, 0.6, -1.9, 0.95];
    let starts: Vec<Vec<f64>> = restarts(&orders, &best, 7, 50).collect();
    assert_eq!(starts, restarts(&orders, &best, 7, 50).collect::<Vec<_>>());
    assert!(starts.windows(2).all(|pair| pair[0] != pair[1]));
    for start in starts {
        assert_eq!(start[..2], best[..2]);
        let polynomials = Polynomials::new(&orders, &start);
        for monic in [&polynomials.f[0], &polynomials.c, &polynomials.d] {
            assert!(is_stable(monic, &mut Vec::new()), "{monic:?}");
        }
    }
}

#[test]
fn moved_roots_stay_on_their_side_and_new_ones_come_near_the_circle() {
    let orders = Orders::oe(&[1], &[1], &[1]).unwrap();
    let starts: Vec<f64> = restarts(&orders, &[1.0, 0.9], 1, 400).map(|start| start[1]).collect();
    assert!(starts.iter().step_by(2).all(|f| (0.0..1.0).contains(f)));
    let close = starts.iter().skip(1).step_by(2).filter(|f| f.abs() > 0.97).count();
    // Uniform on a logarithmic scale: half of them are within the square root of 0.001.
    assert!((60..140).contains(&close), "{close}");
}
