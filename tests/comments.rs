//! Comments are within 120 columns, but for what cannot be broken: tables, formulas and code of documentation.

use std::fs;
use std::path::Path;

/// The widest comment, in characters.
const WIDEST: usize = 120;

/// The sources below a folder, but for what was built.
fn sources(folder: &Path, found: &mut Vec<std::path::PathBuf>) {
    for entry in fs::read_dir(folder).expect("a folder") {
        let path = entry.expect("an entry").path();
        let name = path.file_name().and_then(|name| name.to_str()).unwrap_or_default();
        if path.is_dir() && name != "target" && !name.starts_with('.') {
            sources(&path, found);
        } else if path.extension().is_some_and(|kind| kind == "rs") {
            found.push(path);
        }
    }
}

/// The lines of a source whose comment is too wide, counted from 1.
fn too_wide(source: &str) -> Vec<usize> {
    let mut fenced = false;
    let mut found = Vec::new();
    for (line, number) in source.lines().zip(1..) {
        let Some(comment) = line.trim_start().strip_prefix("//") else {
            fenced = false;
            continue;
        };
        let text = comment.trim_start_matches(['/', '!']).trim_start();
        if text.starts_with("```") {
            fenced = !fenced;
        }
        // What has line breaks written out is a text of several lines.
        let of_text = line.contains("\\n");
        if line.chars().count() > WIDEST && !fenced && !of_text && !text.starts_with('|') {
            found.push(number);
        }
    }
    found
}

#[test]
fn comments_are_within_120_columns() {
    let mut all = Vec::new();
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    for folder in ["benches", "cli", "crates", "examples", "fuzz", "py/src", "tests"] {
        sources(&root.join(folder), &mut all);
    }
    assert!(all.len() > 1000, "{}", all.len());
    for path in all {
        let lines = too_wide(&fs::read_to_string(&path).expect("a source"));
        assert!(lines.is_empty(), "{}: lines {lines:?}", path.display());
    }
}

#[test]
fn what_is_too_wide_is_seen() {
    let wide = "x".repeat(WIDEST);
    let source = format!(
        "// {wide}\n/// | {wide} |\n/// ```text\n/// {wide}\n/// ```\n/// {wide}\nlet text = \"// {wide}\";\n"
    );
    assert_eq!(too_wide(&source), [1, 6]);
}
