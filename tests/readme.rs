//! What the README prints is what its commands print.

use std::fs;

use crate::harness::Folder;

/// The commands of the console blocks, and what stands below each.
fn commands() -> Vec<(String, Vec<String>)> {
    let readme = include_str!("../README.md");
    let mut all: Vec<(String, Vec<String>)> = Vec::new();
    for block in readme.split("```console\n").skip(1) {
        for line in block.split("```").next().unwrap_or_default().lines() {
            match (line.strip_prefix("$ "), all.last_mut()) {
                (Some(command), _) => all.push((command.to_owned(), Vec::new())),
                (None, Some((_, printed))) => printed.push(line.to_owned()),
                (None, None) => {}
            }
        }
    }
    all
}

#[test]
fn the_readme_prints_what_its_commands_print() {
    let folder = Folder::new();
    folder.done("demo");
    fs::create_dir_all(folder.path("tests/data")).expect("the folder can be written to");
    for (name, content) in [
        ("battery.toml", include_str!("data/battery.toml")),
        ("battery.csv", include_str!("data/battery.csv")),
    ] {
        folder.write(&format!("tests/data/{name}"), content);
    }
    let mut compared = 0;
    for (command, mut expected) in commands() {
        let Some(words) = command.strip_prefix("thetahat ") else { continue };
        let line = words.split(" > ").next().unwrap_or_default().trim();
        let run = folder.done(line);
        if expected.is_empty() {
            continue;
        }
        // What goes to a file leaves the table on standard error.
        let printed = if words.contains(" > ") { run.stderr } else { run.stdout };
        let mut printed: Vec<&str> = printed.lines().collect();
        if expected.last().is_some_and(|line| line == "…") {
            expected.pop();
            printed.truncate(expected.len());
        }
        assert_eq!(printed, expected, "{command}");
        compared += 1;
    }
    assert!(compared >= 7, "{compared}");
}
