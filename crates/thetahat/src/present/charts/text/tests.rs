use super::*;

#[test]
fn names_are_no_markup_in_charts() {
    assert_eq!(plain("<b>x</b> & \"'"), "&lt;b&gt;x&lt;/b&gt; &amp; \"'");
    assert_eq!(plain("🚀"), "🚀");
    assert_eq!(plain("\u{202e}x"), "\\u{202e}x");
    assert_eq!(plain(&"ä".repeat(41)), format!("{}…", "ä".repeat(40)));
}

#[test]
fn json_cannot_end_its_script() {
    let text = "</script><!-- & \u{2028}\u{2029} 🚀";
    let safe = inside_script(&serde_json::to_string(text).unwrap());
    assert!(!safe.contains(['<', '>', '&', '\u{2028}', '\u{2029}']));
    assert_eq!(serde_json::from_str::<String>(&safe).unwrap(), text);
}
