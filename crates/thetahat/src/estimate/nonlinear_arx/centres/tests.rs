use super::*;

#[test]
fn clusters_are_found_where_points_lie_together() {
    let around =
        |x: f64, y: f64| (0..20).map(move |k| vec![x + 0.01 * f64::from(k % 5), y - 0.01 * f64::from(k % 3)]);
    let points: Vec<Vec<f64>> = around(0.0, 0.0).chain(around(5.0, 1.0)).chain(around(-3.0, 4.0)).collect();
    for seed in 0..10 {
        let mut centres = clusters(&points, 3, seed);
        centres.sort_by(|one, other| one[0].total_cmp(&other[0]));
        for (centre, x) in centres.iter().zip([-3.0, 0.0, 5.0]) {
            assert!((centre[0] - x - 0.02).abs() < 1e-12, "{centres:?}");
        }
    }
    assert_eq!(clusters(&vec![vec![1.0]; 4], 3, 0).len(), 1, "there is one place");
}

#[test]
fn grids_and_random_points_fill_the_range() {
    let points = [vec![-1.0, 2.0], vec![1.0, 4.0], vec![0.0, 3.0]];
    assert_eq!(grid(&points, 3).len(), 9);
    assert_eq!(grid(&points, 3)[8], [1.0, 4.0]);
    let found = random(&points, 50, 1);
    assert!(found.iter().all(|point| point[0].abs() <= 1.0 && (2.0..=4.0).contains(&point[1])));
    assert_eq!(spread(&points, 2).len(), 2);
    let Map::Radial { widths, .. } = map(grid(&points, 3), None, &points, false, true) else { panic!() };
    assert_eq!(widths, [2.0; 9], "twice the distance of neighbours");
}
