use super::*;

#[test]
fn names_carry_the_power_and_the_input() {
    let orders = Orders::arx(1, &[2, 1], &[0, 4]).unwrap();
    assert_eq!(orders.names(), ["a1", "b1_0", "b1_1", "b2_4"]);
    let general = Orders::new(1, &[1], 2, 1, &[2], &[3]).unwrap();
    assert_eq!(general.names(), ["a1", "b3", "c1", "c2", "d1", "f1", "f2"]);
    assert_eq!(orders.parameters(), 4);
    assert_eq!(orders.maximum_lag(), 4);
}

#[test]
fn orders_that_make_no_model_are_refused() {
    assert!(Orders::arx(0, &[0], &[1]).is_err());
    assert!(Orders::arx(0, &[], &[]).is_err());
    assert!(Orders::arx(1, &[1], &[]).is_err());
    assert!(Orders::arx(1001, &[1], &[1]).is_err());
    assert!(Orders::arx(2, &[], &[]).is_ok());
    assert!(Orders::oe(&[0], &[2], &[1]).is_err());
    assert!(Orders::oe(&[1], &[2, 2], &[1]).is_err());
    assert!(Orders::bj(&[1], 1001, 0, &[1], &[1]).is_err());
}

#[test]
fn orders_say_which_structure_they_make() {
    let of = |na, nb: &[usize], nc, nd, nf: &[usize]| {
        Orders::new(na, nb, nc, nd, nf, &vec![1; nb.len()]).unwrap().structure()
    };
    assert_eq!(of(2, &[], 0, 0, &[]), Structure::Ar);
    assert_eq!(of(2, &[], 1, 0, &[]), Structure::Arma);
    assert_eq!(of(0, &[2], 0, 0, &[0]), Structure::Arx);
    assert_eq!(of(1, &[2], 1, 0, &[0]), Structure::Armax);
    assert_eq!(of(0, &[2, 1], 0, 0, &[0, 1]), Structure::Oe);
    assert_eq!(of(0, &[2], 0, 1, &[1]), Structure::Bj);
    assert_eq!(of(1, &[2], 0, 1, &[0]), Structure::General);
    assert_eq!(of(1, &[2], 0, 0, &[1]), Structure::General);
    assert_eq!(of(1, &[], 1, 1, &[]), Structure::General);
}

#[test]
fn orders_are_written_as_the_field_does() {
    let written = |orders: Result<Orders, Error>| orders.unwrap().to_string();
    assert_eq!(written(Orders::arx(3, &[], &[])), "AR(3)");
    assert_eq!(written(Orders::armax(2, &[], 1, &[])), "ARMA(2, 1)");
    assert_eq!(written(Orders::arx(2, &[1, 1], &[3, 4])), "ARX(2, 1, [3 4])");
    assert_eq!(written(Orders::armax(2, &[3], 1, &[0])), "ARMAX(2, 3, 1, 0)");
    assert_eq!(written(Orders::bj(&[1], 2, 3, &[4], &[5])), "BJ(1, 2, 3, 4, 5)");
    assert_eq!(written(Orders::new(1, &[2], 3, 4, &[5], &[6])), "General(1, 2, 3, 4, 5, 6)");
}
