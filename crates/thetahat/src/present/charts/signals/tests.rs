use super::*;

#[test]
fn a_chart_scales_to_what_was_measured() {
    let (time, measured) = ([0.0, 1.0, 2.0, 3.0], [1.0, 3.0, f64::NAN, 2.0]);
    let range = |curve: [f64; 4]| {
        let mut stack = Stack::new(&time, 1.0, 100);
        stack.panel("y");
        stack.measured("measured", &measured);
        stack.curve("free run", &curve);
        let chart = stack.draw("", "", &[]).map(|chart| chart.json).unwrap();
        let figure: Value = serde_json::from_str(&chart).unwrap();
        figure["layout"]["yaxis"]["range"].clone()
    };
    assert_eq!(range([1.0, 2.0, -9.0, 1e30]), json!([-1.0, 5.0]));
    assert_eq!(range([1.0, 2.0, 4.0, f64::NAN]), Value::Null);
    assert_eq!(window(&[f64::NAN]), None);
    assert_eq!(window(&[-2.0, -2.0]), Some([-4.0, 0.0]));
    assert_eq!(window(&[0.0]), Some([-1.0, 1.0]));
}
