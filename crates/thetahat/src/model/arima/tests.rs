use super::*;

#[test]
fn factors_are_multiplied_and_their_derivatives_are_those_of_differences() {
    let orders = ArimaOrders::new([2, 1, 1], Some([1, 1, 2, 4])).unwrap();
    assert_eq!(orders.names(), ["ar1", "ar2", "ma1", "sar4", "sma4", "sma8"]);
    let parameters = [0.5, -0.2, 0.3, 0.4, -0.6, 0.1];
    let Expanded { a, c, slopes } = orders.expanded(&parameters, true);
    // (1 - 0.5 q^-1 + 0.2 q^-2)(1 - 0.4 q^-4)
    assert_eq!(a, [1.0, -0.5, 0.2, 0.0, -0.4, 0.2, -0.08000000000000002]);
    assert_eq!(c, [1.0, 0.3, 0.0, 0.0, -0.6, -0.18, 0.0, 0.0, 0.1, 0.03]);
    assert_eq!(orders.differencing(), [1.0, -1.0, 0.0, 0.0, -1.0, 1.0]);
    for (place, (a_slope, c_slope)) in slopes.iter().enumerate() {
        let mut moved = parameters;
        moved[place] += 1e-6;
        let there = orders.expanded(&moved, false);
        let same = |slope: &[f64], to: &[f64], from: &[f64]| {
            let found = to.iter().zip(from).map(|(to, from)| (to - from) / 1e-6);
            slope.iter().zip(found).all(|(slope, found)| (slope - found).abs() < 1e-9)
        };
        assert!(same(a_slope, &there.a, &a) && same(c_slope, &there.c, &c), "{place}");
    }
}

#[test]
fn orders_that_make_no_sense_are_refused() {
    let refused = |order, seasonal| ArimaOrders::new(order, seasonal).unwrap_err().to_string();
    assert!(refused([1, 0, 0], Some([1, 0, 0, 1])).contains("two rows at least"));
    assert!(refused([1, 0, 0], Some([0, 0, 0, 12])).contains("nothing seasonal"));
    assert!(refused([1, 0, 0], Some([6, 0, 0, 168])).contains("1009 rows back"));
    assert!(refused([usize::MAX, 2, 0], None).contains("lower the orders"));
    // Seasons may overlap with what is not seasonal.
    let overlap = ArimaOrders::new([4, 0, 0], Some([1, 0, 0, 3])).unwrap();
    assert_eq!(overlap.names(), ["ar1", "ar2", "ar3", "ar4", "sar3"]);
    assert_eq!(ArimaOrders::new([1, 0, 0], Some([0; 4])).unwrap().seasonal, None);
}
