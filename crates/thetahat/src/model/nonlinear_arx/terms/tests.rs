use super::*;
use crate::tests::assert_refused;

#[test]
fn what_is_written_is_read() {
    let names = ["y(k-1)", "u(k)", "u(k)*v(k)"].map(str::to_owned);
    for (text, factors) in [
        ("1", vec![]),
        ("u(k)", vec![1]),
        (" y(k-1) ^ 2 * u(k) ", vec![0, 0, 1]),
        ("u(k)*y(k-1)", vec![0, 1]),
        ("u(k)*v(k)*u(k)", vec![1, 2]),
    ] {
        assert_eq!(read(text, &names).unwrap(), factors, "{text}");
        let again = written(&factors, &names[..2]);
        assert!(factors.contains(&2) || read(&again, &names).unwrap() == factors, "{again}");
    }
    for (text, what) in [
        ("", "none of the regressors"),
        ("y(k-2)", "none of the regressors"),
        ("y(k-1)*", "none of the regressors"),
        ("y(k-1)u(k)", "no product"),
        ("y(k-1)^", "whole number"),
        ("y(k-1)^0", "whole number"),
        ("y(k-1)^9999999999999999999", "whole number"),
        ("y(k-1)^99*u(k)^99", "more than"),
        ("2", "none of the regressors"),
    ] {
        let error = read(text, &names).unwrap_err().to_string();
        assert!(error.contains(what), "{text}: {error}");
    }
    let twice = ["y(k-1)*u(k)", "u(k)*y(k-1)"].map(str::to_owned);
    assert_refused(factors(&twice, &names), "twice");
}
