//! README.md and the pages under docs/ are true: commands print what stands below them, snippets are compiled or are
//! files that tests use, links lead somewhere, options exist.
//!
//! Rust snippets are doctests of the command line's crate, Python snippets run in `py/tests/test_pages.py`.

use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::process::Stdio;

use crate::harness::Folder;

/// What a newcomer reads in one go. More goes into a page under docs/.
const README_LINES: usize = 175;

/// What commands in console blocks begin with that this test cannot run.
const NOT_RUN: [&str; 8] =
    ["make ", "cargo ", "pip ", "benches/", "tests/", "git ", "cd ", "arm-none-eabi-gcc "];

/// Options of those.
const FOREIGN_OPTIONS: [&str; 9] = [
    "--nocapture",
    "--release",
    "--bench",
    "--write",
    "--path",
    "--open",
    "--target",
    "--features",
    "--gc-sections",
];

/// A page: its path from the root of the repository, and its text.
struct Page {
    path: String,
    text: String,
}

/// A block of code: its language and its lines.
struct Block {
    language: String,
    lines: Vec<String>,
}

fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

fn page(path: &str) -> Page {
    Page { path: path.to_owned(), text: fs::read_to_string(root().join(path)).expect("a page") }
}

/// The files of a folder that end so, sorted.
fn files(folder: &str, end: &str) -> Vec<String> {
    let entries = fs::read_dir(root().join(folder)).expect("a folder");
    let names = entries.map(|entry| entry.expect("an entry").file_name().to_string_lossy().into_owned());
    let mut files: Vec<String> =
        names.filter(|name| name.ends_with(end)).map(|name| format!("{folder}/{name}")).collect();
    files.sort();
    files
}

/// README.md, then what is in docs/.
fn pages() -> Vec<Page> {
    let paths = ["README.md".to_owned()].into_iter().chain(files("docs", ".md"));
    paths.map(|path| page(&path)).collect()
}

impl Page {
    /// The blocks of code, and what stands outside of them.
    fn split(&self) -> (Vec<Block>, Vec<&str>) {
        let (mut blocks, mut prose, mut inside) = (Vec::new(), Vec::new(), false);
        for line in self.text.lines() {
            match (line.strip_prefix("```"), inside) {
                (Some(end), true) => {
                    assert_eq!(end, "", "{}: a block begins inside a block", self.path);
                    inside = false;
                }
                (Some(language), false) => {
                    blocks.push(Block { language: language.to_owned(), lines: Vec::new() });
                    inside = true;
                }
                (None, true) => blocks.last_mut().expect("a block has begun").lines.push(line.to_owned()),
                (None, false) => prose.push(line),
            }
        }
        assert!(!inside, "{}: a block has no end", self.path);
        (blocks, prose)
    }

    fn blocks(&self, language: &str) -> impl Iterator<Item = Block> {
        self.split().0.into_iter().filter(move |block| block.language == language)
    }

    /// The commands of the console blocks, and what stands below each.
    fn commands(&self) -> Vec<(String, Vec<String>)> {
        let mut all: Vec<(String, Vec<String>)> = Vec::new();
        for block in self.blocks("console") {
            for (number, line) in block.lines.into_iter().enumerate() {
                match (line.strip_prefix("$ "), all.last_mut()) {
                    (Some(command), _) => all.push((command.to_owned(), Vec::new())),
                    (None, Some((_, printed))) if number > 0 => printed.push(line),
                    _ => assert!(line.starts_with("$ "), "{}: what printed {line}?", self.path),
                }
            }
        }
        all
    }

    /// The targets of links, without those to other hosts.
    fn links(&self) -> Vec<String> {
        let prose = self.split().1.join("\n");
        // Every second part stands between backticks.
        let outside: String = prose.split('`').step_by(2).collect();
        let targets = outside.split("](").skip(1).filter_map(|rest| rest.split_once(')'));
        let targets = targets.map(|(target, _)| target.to_owned());
        targets.filter(|target| !target.contains("://")).collect()
    }

    /// The anchors of the headings, as GitHub makes them.
    fn anchors(&self) -> Vec<String> {
        let headings = self.split().1.into_iter().filter(|line| line.starts_with('#'));
        headings.map(|line| anchor(line.trim_start_matches('#').trim())).collect()
    }

    /// The options that are named between backticks and in commands.
    fn options(&self) -> Vec<String> {
        let prose = self.split().1.join("\n");
        let between = prose.split('`').skip(1).step_by(2).map(str::to_owned);
        let texts = between.chain(self.commands().into_iter().map(|(command, _)| command));
        let words = |text: String| -> Vec<String> { text.split_whitespace().map(str::to_owned).collect() };
        let options = texts.flat_map(words).filter(|word| word.starts_with("--"));
        let name = |word: String| {
            let end =
                word[2..].find(|c: char| !c.is_ascii_lowercase() && c != '-').map_or(word.len(), |n| n + 2);
            word[..end].to_owned()
        };
        options.map(name).filter(|name| name != "--").collect()
    }
}

/// A heading in lower case, without punctuation, with hyphens for spaces.
fn anchor(heading: &str) -> String {
    let kept = heading.to_lowercase();
    let kept = kept.chars().filter(|&c| c.is_alphanumeric() || matches!(c, ' ' | '-' | '_'));
    kept.map(|c| if c == ' ' { '-' } else { c }).collect()
}

/// What one sees of a command: standard error, and standard output unless it goes to a file; and the exit code.
fn shown(folder: &Folder, command: &str) -> (String, i32) {
    let (feeder, line) =
        command.split_once(" | ").map_or((None, command), |(feeder, line)| (Some(feeder), line));
    let (words, target) =
        line.split_once(" > ").map_or((line, None), |(words, target)| (words, Some(target)));
    let words = words.strip_prefix("thetahat ").expect("a command of thetahat");
    let mut run = folder.command(words);
    if let Some(feeder) = feeder {
        // It would wait for more lines for ever: here the file is all there is.
        let log = feeder.strip_prefix("tail -n +1 -F ").expect("a log that grows");
        run.stdin(File::open(folder.path(log)).expect("the log"));
    }
    let terminal = File::create(folder.path("terminal.txt")).expect("the folder can be written to");
    let output = match target {
        Some(name) => File::create(folder.path(name.trim())).expect("the folder can be written to"),
        None => terminal.try_clone().expect("a second handle"),
    };
    let status = run.stdout(Stdio::from(output)).stderr(Stdio::from(terminal)).status();
    (folder.read("terminal.txt"), status.expect("the program starts").code().unwrap_or(-1))
}

/// Whether this was printed; a line with … stands for any lines.
fn is_printed(expected: &[String], printed: &str) -> bool {
    let printed: Vec<&str> = printed.lines().collect();
    let parts: Vec<&[String]> = expected.split(|line| line == "…").collect();
    let (mut at, last) = (0, parts.len() - 1);
    for (number, part) in parts.into_iter().enumerate() {
        let fits = |start: usize| printed.get(start..start + part.len()).is_some_and(|lines| lines == part);
        let start = match (number == 0, number == last) {
            (true, true) => (part.len() == printed.len()).then_some(0),
            (true, false) => Some(0),
            (false, true) => printed.len().checked_sub(part.len()).filter(|&start| start >= at),
            (false, false) => (at..printed.len()).find(|&start| fits(start)),
        };
        match start.filter(|&start| fits(start)) {
            Some(start) => at = start + part.len(),
            None => return false,
        }
    }
    true
}

/// Runs the commands of a page in a folder of its own, where the demo was and `tests/data` is, and gives how many
/// outputs were compared.
fn run(page: &Page) -> usize {
    let folder = Folder::new();
    folder.done("demo");
    for subfolder in ["public", "columnar", "flights", "spreadsheets", "templates", "blocks"]
        .map(|name| format!("tests/data/{name}"))
    {
        fs::create_dir_all(folder.path(&subfolder)).expect("the folder can be written to");
    }
    let public = files("tests/data/public", ".csv");
    let columnar = files("tests/data/columnar", ".parquet");
    let flights = files("tests/data/flights", ".ulg");
    let sheets = files("tests/data/spreadsheets", ".xlsx");
    let simulated = ["templates", "blocks"].map(|name| files(&format!("tests/data/{name}"), ".csv")).concat();
    let own = [files("tests/data", ".toml"), files("tests/data", ".csv")].concat();
    for file in [own, public, columnar, flights, sheets, simulated].concat() {
        folder.write(&file, fs::read(root().join(&file)).expect("data"));
    }
    let (mut compared, mut code) = (0, 0);
    for (command, expected) in page.commands() {
        let place = format!("{}: {command}", page.path);
        // Comments end lines.
        let command = command.split("  #").next().unwrap_or_default().trim();
        if command == "echo $?" {
            assert_eq!(expected, [code.to_string()], "{place}");
            code = 0;
            continue;
        }
        assert_eq!(code, 0, "{place} stands after a command that failed");
        if NOT_RUN.iter().any(|begin| command.starts_with(begin)) {
            continue;
        }
        let printed;
        (printed, code) = shown(&folder, command);
        if expected.is_empty() {
            assert_eq!(code, 0, "{place}: {printed}");
            continue;
        }
        assert!(
            is_printed(&expected, &printed),
            "{place} prints\n\n{printed}\nThe page has\n\n{}",
            expected.join("\n")
        );
        compared += 1;
    }
    assert_eq!(code, 0, "{}: its last command fails", page.path);
    compared
}

/// Takes 15 s: each command of each page runs, some compile what they export.
#[test]
fn pages_print_what_their_commands_print() {
    let compared: usize = pages().iter().map(run).sum();
    assert!(compared >= 12, "{compared}");
}

#[test]
fn lines_that_are_left_out_may_be_any() {
    let lines = |text: &str| text.lines().map(str::to_owned).collect::<Vec<_>>();
    let printed = "a\nb\nc\nd\n";
    for expected in ["a\nb\nc\nd", "a\n…", "…\nd", "a\n…\nd", "…\nb\n…", "a\nb\n…\nc\nd", "…\nb\n…\nd", "…"]
    {
        assert!(is_printed(&lines(expected), printed), "{expected}");
    }
    for expected in
        ["a\nb\nc", "b\n…", "…\nc", "a\n…\nb", "a\n…\nx\n…\nd", "a\nb\nc\n…\nc\nd", "a\nb\nc\nd\ne"]
    {
        assert!(!is_printed(&lines(expected), printed), "{expected}");
    }
}

#[test]
fn every_snippet_is_tested() {
    let crate_root = fs::read_to_string(root().join("cli/lib.rs")).expect("a source");
    let python = fs::read_to_string(root().join("py/tests/test_pages.py")).expect("a source");
    assert!(python.contains("glob(\"docs/*.md\")"));
    let data: Vec<String> = files("tests/data", ".toml").iter().map(|path| page(path).text).collect();
    // crates/thetahat-c/tests/interface runs them, and make embedded does.
    let programs = files("crates/thetahat-c/tests/c", ".c");
    for page in pages() {
        for block in page.split().0 {
            let Block { language, lines } = block;
            match language.as_str() {
                "console" | "python" => {}
                "rust" => {
                    let included = format!("#[doc = include_str!(\"../{}\")]", page.path);
                    assert!(crate_root.contains(&included), "cli/lib.rs has no {included}");
                }
                "toml" => {
                    let text = format!("{}\n", lines.join("\n"));
                    assert!(data.contains(&text), "{}: not a file of tests/data:\n{text}", page.path);
                }
                "c" => {
                    let text = lines.join("\n");
                    let held = |path: &String| self::page(path).text.contains(&text);
                    assert!(
                        programs.iter().any(held),
                        "{}: not in a program that is run:\n{text}",
                        page.path
                    );
                }
                _ => assert_eq!(language, "text", "{}: nothing tests this language", page.path),
            }
        }
    }
}

#[test]
fn links_lead_to_files_and_headings() {
    let mut count = 0;
    let others = [
        "CONTRIBUTING.md",
        "CHANGELOG.md",
        "py/README.md",
        "benches/peers/README.md",
        "tests/data/public/README.md",
        "examples/battery_gauge/README.md",
        "examples/self_tuning_heater/README.md",
    ];
    for page in pages().into_iter().chain(others.map(page)) {
        for link in page.links() {
            let (file, heading) =
                link.split_once('#').map_or((&link[..], None), |(file, at)| (file, Some(at)));
            let folder = Path::new(&page.path).parent().expect("a page is in a folder");
            let target =
                if file.is_empty() { page.path.clone() } else { folder.join(file).display().to_string() };
            assert!(root().join(&target).exists(), "{}: no {link}", page.path);
            if let Some(heading) = heading {
                let anchors = self::page(&target).anchors();
                assert!(anchors.iter().any(|anchor| anchor == heading), "{}: no {link}", page.path);
            }
            count += 1;
        }
    }
    assert!(count > 20, "{count}");
}

#[test]
fn what_is_wrong_with_a_link_is_seen() {
    let text = "# One `x`, two\n\n[a](b.md#c) `[no](no.md)`\n[d\ne](#f) [g](https://h)\n\n```text\n[no](no.md)\n# no\n```\n";
    let page = Page { path: "docs/x.md".to_owned(), text: text.to_owned() };
    assert_eq!(page.links(), ["b.md#c", "#f"]);
    assert_eq!(page.anchors(), ["one-x-two"]);
}

#[test]
fn options_that_pages_name_exist() {
    let folder = Folder::new();
    let verbs = [
        "fit",
        "inspect",
        "predict",
        "simulate",
        "validate",
        "compare",
        "track",
        "filter",
        "bode",
        "step",
        "impulse",
        "spectrum",
        "design",
        "tune",
        "control",
        "reduce",
        "convert",
        "model",
        "export",
        "templates",
    ];
    let help: String = verbs.iter().map(|verb| folder.done(&format!("{verb} --help")).stdout).collect();
    let known: Vec<&str> = help.split(|c: char| !c.is_ascii_lowercase() && c != '-').collect();
    for page in pages() {
        for option in page.options() {
            let known = known.contains(&&option[..]) || FOREIGN_OPTIONS.contains(&&option[..]);
            assert!(known, "{}: no verb has {option}", page.path);
        }
    }
}

#[test]
fn the_readme_is_short_and_names_every_page() {
    let readme = page("README.md");
    let lines = readme.text.lines().count();
    assert!(
        lines <= README_LINES,
        "README.md has {lines} lines: what is not for a newcomer belongs into docs/"
    );
    let links = readme.links();
    for path in files("docs", ".md") {
        assert!(links.contains(&path), "README.md has no link to {path}");
    }
}

/// The rows of the tables of a text, without spaces that align them.
fn rows(text: &str) -> Vec<String> {
    let lines =
        text.lines().map(|line| line.trim_start_matches("//!").trim()).filter(|line| line.starts_with('|'));
    lines.map(|line| line.split_whitespace().collect::<Vec<_>>().join(" ")).collect()
}

#[test]
fn what_stands_twice_is_the_same() {
    let core = rows(&page("crates/thetahat-core/src/lib.rs").text);
    for row in rows(&page("docs/notation.md").text) {
        assert!(row.starts_with("|--") || core.contains(&row), "not in the docs of thetahat-core: {row}");
    }
    let measured = rows(&page("benches/peers/README.md").text);
    let readme = page("README.md").text;
    let (_, speed) =
        readme.split_once("<!-- rows of benches/peers/README.md -->").expect("a table of figures");
    let (speed, _) = speed.split_once("<!-- /rows -->").expect("its end");
    assert!(rows(speed).len() > 3);
    for row in rows(speed) {
        // There are further columns there.
        let begins = |measured: &String| measured.starts_with(row.trim_end_matches('|'));
        assert!(row.contains("---") || measured.iter().any(begins), "not in benches/peers/README.md: {row}");
    }
}
