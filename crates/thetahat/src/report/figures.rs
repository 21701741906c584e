//! How numbers are written for people.

/// A number to six significant digits, as tables and pages write it.
///
/// ```
/// assert_eq!(thetahat::figures::number(18.9182446), "18.9182");
/// assert_eq!(thetahat::figures::number(-2.5e-7), "-2.50000e-7");
/// ```
pub fn number(value: f64) -> String {
    let size = value.abs();
    if value == 0.0 {
        return "0".to_owned();
    }
    if !(1e-4..1e6).contains(&size) {
        return format!("{value:.5e}");
    }
    let decimals = (5 - size.log10().floor() as i32).clamp(0, 9) as usize;
    format!("{value:.decimals$}")
}

/// [`number`] without zeros at its end.
///
/// ```
/// assert_eq!(thetahat::figures::short(0.0800000001), "0.08");
/// ```
pub fn short(value: f64) -> String {
    let text = number(value);
    if text.contains('.') && !text.contains('e') {
        return text.trim_end_matches('0').trim_end_matches('.').to_owned();
    }
    text
}
