use super::*;

fn of(criteria: &Criteria, word: &str) -> Option<f64> {
    criteria.of(word.parse().unwrap())
}

#[test]
fn criteria_equal_what_another_tool_prints() {
    let (mse, p, n) = (1.6575, 6, 300);
    let criteria = Criteria::new(mse, p, n);
    let n = f64::from(n as u32);
    let printed = n * (2.0 * std::f64::consts::PI).ln() + n + n * of(&criteria, "aic").unwrap();
    assert!((printed - 1014.96).abs() < 0.01, "{printed}");
    // 2 p ln ln N = 20.8959.
    let hqc = n * of(&criteria, "hqc").unwrap() - n * mse.ln();
    assert!((hqc - 12.0 * 1.741_129_5).abs() < 1e-4, "{hqc}");
}

#[test]
fn what_is_not_defined_is_none() {
    let exact = Criteria::new(0.0, 2, 100);
    let words: Vec<&str> = InformationCriterion::all().map(InformationCriterion::word).collect();
    let values = words.iter().map(|word| of(&exact, word));
    assert!(values.clone().next() == Some(Some(0.0)) && values.skip(1).all(|value| value.is_none()));
    assert_eq!(of(&Criteria::new(1.0, 2, 3), "aicc"), None);
    assert!("bic".parse::<InformationCriterion>().is_err());
    for (constant, word) in [
        (InformationCriterion::FPE, "fpe"),
        (InformationCriterion::AIC, "aic"),
        (InformationCriterion::MDL, "mdl"),
    ] {
        assert_eq!(constant.word(), word);
    }
}

#[test]
fn documents_have_them_by_their_words() {
    let criteria = Criteria::new(0.5, 2, 3);
    let text = serde_json::to_string(&criteria).unwrap();
    assert!(text.starts_with("{\"fpe\":2.5,\"aic\":") && text.contains("\"aicc\":null"), "{text}");
    assert_eq!(serde_json::from_str::<Criteria>(&text).unwrap(), criteria);
    let among = text.replace('{', "{\"other\":[1],");
    assert_eq!(serde_json::from_str::<Criteria>(&among).unwrap(), criteria);
}
