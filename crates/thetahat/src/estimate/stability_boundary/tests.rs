use super::*;
use crate::model::polynomial::roots;

#[test]
fn a_root_outside_comes_back_and_the_others_stay() {
    // F: roots 0.5 and 0.9 before; 0.4 and 1.3 after the step. C: stable before and after.
    let orders = Orders::bj(&[1], 1, 0, &[2], &[1]).unwrap();
    let from = [2.0, 0.3, -1.4, 0.45];
    let mut trial = [3.0, 0.5, -1.7, 0.52];
    assert!(StabilityBoundary::new(&orders, false).draw_in(&from, &mut trial));
    assert_eq!(trial[..2], [3.0, 0.5]);
    let found = roots(&[1.0, trial[2], trial[3]]).unwrap();
    // A fifth of the distance of 0.1.
    assert!((found[0].re - 0.98).abs() < 1e-12 && (found[1].re - 0.4).abs() < 1e-12, "{found:?}");
    // A may be unstable, or may not.
    let orders = Orders::armax(1, &[], 1, &[]).unwrap();
    let (from, mut trial) = ([-0.9, 0.3], [-1.2, 0.4]);
    assert!(StabilityBoundary::new(&orders, false).draw_in(&from, &mut trial));
    assert_eq!(trial, [-1.2, 0.4]);
    assert!(StabilityBoundary::new(&orders, true).draw_in(&from, &mut trial));
    assert!((trial[0] + 0.98).abs() < 1e-12 && trial[1] == 0.4, "{trial:?}");
}
