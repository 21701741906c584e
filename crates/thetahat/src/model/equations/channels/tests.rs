use super::*;

#[test]
fn expressions_have_values_and_slopes() {
    let names = ["y", "u1", "u2"];
    let mut buffer = ExpressionBuffer::default();
    let root = ChannelExpression::read("sqrt(u1)", &names).unwrap();
    assert_eq!((root.channels(), root.value(&[0.0, 9.0, 0.0], &mut buffer)), (&[1_usize][..], 3.0));
    assert_eq!(root.slopes(&[0.0, 4.0, 0.0], &mut buffer).collect::<Vec<f64>>(), [0.25]);
    let product = ChannelExpression::read("y*u2^2 + pi*0", &names).unwrap();
    assert_eq!(product.channels(), [0, 2]);
    assert_eq!(product.value(&[2.0, 0.0, 3.0], &mut buffer), 18.0);
    assert_eq!(product.slopes(&[2.0, 0.0, 3.0], &mut buffer).collect::<Vec<f64>>(), [9.0, 12.0]);
}

#[test]
fn what_is_wrong_is_told_with_its_place() {
    for (text, what) in [
        ("sqrt(u3)", "'sqrt(u3)' at character 6: unknown name 'u3'"),
        ("sqrt(u1", "')' is missing"),
        ("", "ends where a number"),
        ("2 + pi", "reads no channel"),
        ("u1(k-1)", "there is no function 'u1'"),
        ("t", "unknown name 't'"),
        ("u1 u2", "an operator"),
    ] {
        let message = ChannelExpression::read(text, &["y", "u1", "u2"]).unwrap_err();
        assert!(message.contains(what), "{text}: {message}");
    }
}
