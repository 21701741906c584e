use super::*;

#[test]
fn knots_reach_over_the_range() {
    let Map::Spline { regressors, knots } = map(&[[-1.0, 3.0], [2.0, 2.0]], 3) else { panic!("another map") };
    assert_eq!((regressors, knots), (vec![0; 3], vec![[-1.0, 0.0, 1.0], [0.0, 1.0, 2.0], [1.0, 2.0, 3.0]]));
}
