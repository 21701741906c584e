use super::*;

#[test]
fn json_says_the_same_without_what_is_invisible() {
    let name = "a\u{7f}\u{9b}\u{e0041}\u{202e}\r\t温度🌡";
    let written = json(name);
    assert!(!written.contains(is_invisible), "{written:?}");
    assert_eq!(serde_json::from_str::<String>(&written).unwrap(), name);
}

#[test]
fn a_message_about_a_message_is_the_same() {
    let long = message(&"\x1b\u{202e}é".repeat(100_000));
    assert!(long.chars().count() == START + END + 1 && !long.contains(is_invisible));
    assert_eq!(message(&long), long);
    assert_eq!(message("short: 'µ'"), "short: 'µ'");
    // Neither too short nor too long at the seam.
    for (length, expected) in [
        (START, START),
        (LONGEST, LONGEST),
        (LONGEST + 1, START + END + 1),
        (10 * LONGEST, START + END + 1),
        (10 * LONGEST + 1, START + END + 1),
    ] {
        assert_eq!(message(&"x".repeat(length)).chars().count(), expected);
    }
}
