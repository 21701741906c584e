use super::*;

fn grid(na: OrderRange, nb: &[OrderRange], nf: &[OrderRange], nk: &[OrderRange], path: Path) -> Grid {
    Grid { na, nb: nb.to_vec(), nc: 0.into(), nd: 0.into(), nf: nf.to_vec(), nk: nk.to_vec(), path }
}

#[test]
fn a_grid_has_each_model_once_and_the_smallest_first() {
    let all = grid(range(1, 3), &[range(0, 2)], &[0.into()], &[range(0, 4)], Path::All);
    let models = all.orders(1).unwrap();
    // nb = 0 counts once, not for each delay.
    assert_eq!(models.len(), 3 * (1 + 2 * 5));
    assert!(models.windows(2).all(|pair| pair[0].parameters() <= pair[1].parameters()));
    let keys: std::collections::BTreeSet<_> = models.iter().map(super::super::grid::key).collect();
    assert_eq!(keys.len(), models.len());
    assert!(models.iter().all(|orders| orders.nb[0] > 0 || orders.nk[0] == 0));
    assert_eq!(models[0], Orders::arx(1, &[0], &[0]).unwrap());
}

#[test]
fn inputs_share_a_range_or_have_their_own() {
    let models =
        |nb: &[OrderRange], nk: &[OrderRange]| grid(range(1, 2), nb, &[0.into()], nk, Path::All).orders(2);
    let shared = models(&[range(1, 3)], &[range(1, 2)]).unwrap();
    assert_eq!(shared.len(), 2 * 3 * 4);
    assert!(shared.iter().all(|orders| orders.nb[0] == orders.nb[1]));
    let own = models(&[range(1, 3), range(1, 2)], &[1.into(), range(2, 3)]).unwrap();
    assert_eq!(own.len(), 2 * 3 * 2 * 2);
    assert!(own.iter().all(|orders| orders.nk[0] == 1));
    for (nb, nk) in [(&[range(1, 2); 3][..], &[1.into()][..]), (&[range(1, 2)], &[1.into(); 3])] {
        let Err(Error::Argument { message, .. }) = models(nb, nk) else { panic!("three values for two") };
        assert!(message.contains("3 values for 2 inputs"), "{message}");
    }
}

#[test]
fn combinations_that_are_no_model_are_left_out() {
    let some = grid(range(0, 1), &[range(0, 1)], &[range(0, 1)], &[1.into()], Path::All);
    // Neither 0 0 0 nor F without B.
    assert_eq!(some.orders(1).unwrap().len(), 5);
    let none = grid(0.into(), &[0.into()], &[range(0, 3)], &[1.into()], Path::All);
    assert!(matches!(none.orders(1), Err(Error::Argument { .. })));
    // A time series has no use for the inputs' ranges.
    assert_eq!(grid(range(1, 4), &[], &[], &[], Path::All).orders(0).unwrap().len(), 4);
    assert!(grid(range(1, 4), &[], &[], &[], Path::All).orders(1).is_err());
}

#[test]
fn a_grid_of_too_many_models_is_refused_before_it_is_made() {
    let large = range(0, 999);
    let Err(Error::Argument { message, .. }) = grid(large, &[large], &[large], &[large], Path::All).orders(1)
    else {
        panic!("10^12 models");
    };
    assert!(message.contains("1000000000000 models"), "{message}");
    assert!(grid(large, &[large; 9], &[large], &[large], Path::All).orders(9).is_err());
    assert!(
        grid(range(1, 999), &[range(1, 30)], &[0.into()], &[1.into()], Path::Alternate).orders(1).is_ok()
    );
    // An order that was mistyped.
    assert!(grid(range(0, usize::MAX), &[large], &[large], &[large], Path::All).orders(1).is_err());
    assert!(grid(range(1, 2), &[1.into()], &[0.into()], &[2000.into()], Path::All).orders(1).is_err());
}

#[test]
fn the_alternate_path_goes_up_by_one_order_at_a_time() {
    let path = Grid {
        nc: range(0, 1),
        ..grid(range(1, 4), &[range(1, 2)], &[0.into()], &[range(1, 2)], Path::Alternate)
    };
    let models = path.orders(1).unwrap();
    let of_first: Vec<_> = models.iter().filter(|o| o.nk[0] == 1).map(|o| (o.na, o.nb[0], o.nc)).collect();
    assert_eq!(of_first, [(1, 1, 0), (2, 1, 0), (2, 2, 0), (2, 2, 1), (3, 2, 1), (4, 2, 1)]);
    assert_eq!(models.len(), 12);
}
