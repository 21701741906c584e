//! Who may know whom: rooms stand on floors, and no two modules of a room know each other.
//!
//! The floors are those of CONTRIBUTING.md. What a module knows are the paths that it names, `crate::`, `super::` and
//! those of its own children, each followed through re-exports to the module that has the item. A parent may know its
//! children and they it.

mod package;

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;
use std::process::Command;

use syn::visit::{self, Visit};
use syn::{Attribute, Item, ItemUse, UseTree, Visibility};

/// The modules of a crate from the ground up. Those of one floor do not know each other.
struct House {
    source: &'static str,
    floors: &'static [&'static [&'static str]],
}

const CORE: House = House {
    source: "crates/thetahat-core/src",
    floors: &[
        &["scalar", "textbook"],
        &["dual", "error", "triangle"],
        &["forgetting", "ud"],
        &["dim", "stability"],
        &["basis", "innovation", "snapshot", "solution"],
        &["covariance", "detect", "lags", "least_squares", "outliers"],
        &["rls", "state_space", "windowed"],
        &["around", "arx", "augmented", "differentiated", "gradient", "kalman"],
        &[
            "armax",
            "ekf",
            "luenberger",
            "nonlinear_arx",
            "output_error",
            "schedule",
            "unscented",
            "vector_arx",
            "zonotope",
        ],
        &["control", "out_of_sequence", "recursive_narx", "smoother"],
    ],
};

const NUMERICS: House = House {
    source: "crates/thetahat-numerics/src",
    floors: &[
        &["distribution", "figures", "fourier", "noise", "random", "text"],
        &["error"],
        &["optimize", "regression"],
    ],
};

const LIBRARY: House = House {
    source: "crates/thetahat/src",
    floors: &[
        &["document", "optimize"],
        &["data"],
        &["options"],
        &["model"],
        &["respond"],
        &["estimate"],
        &["validate"],
        &["select"],
        &["inspect", "spectrum", "templates"],
        &["control", "design", "plan", "step_test", "tune"],
        &["report"],
        &["filter", "fit", "track"],
        &["export", "present"],
    ],
};

const TABLE: House = House {
    source: "crates/thetahat-table/src",
    floors: &[
        &["blanks", "decimal", "error", "lines", "memory", "record", "words"],
        &["dialect", "mailbox", "number", "source"],
        &["block", "matlab", "names", "spreadsheet", "time"],
        &["names_of_times", "zone"],
        &["clock"],
        &["shape"],
        &["layout"],
        &["columnar", "rows", "topics"],
        &["stream"],
        &["reader"],
        &["formats"],
    ],
};

const COMMAND_LINE: House = House {
    source: "cli",
    floors: &[
        &["main", "memory", "options", "shell", "threads"],
        &["wrap"],
        &["messages"],
        &["failure"],
        &["interrupt"],
        &["live", "progress", "replace"],
        &["files", "output"],
        &["args", "line_writer"],
        &["job"],
        &["log"],
        &["commands"],
        &["binding"],
    ],
};

const PYTHON: House = House {
    source: "py/src",
    floors: &[
        &["error", "in_use"],
        &["journal", "work"],
        &["array", "plan"],
        &["grey_box", "log"],
        &["model", "templates"],
        &["online"],
        &["design", "evaluation", "experiments", "filter", "normal_equations", "track"],
    ],
};

const C: House = House {
    source: "crates/thetahat-c/src",
    floors: &[
        &["error", "panic"],
        &["memory", "shapes"],
        &["innovation", "learning"],
        &["arx", "detector", "rls", "rst", "tuner"],
        &["functions", "linear"],
        &["ekf", "kalman", "luenberger", "ukf"],
        &["sizes"],
    ],
};

const PEERS: House = House {
    source: "benches/peers/src/filters",
    floors: &[
        &["data"],
        &["kalman"],
        &["nalgebra_form"],
        &["ours"],
        &["peers"],
        &["nonlinear"],
        &["survival", "timing"],
    ],
};

/// A module by its path from the root of its crate, which is the empty one.
type Module = Vec<String>;

/// What a file says of modules.
#[derive(Default)]
struct Named {
    /// Paths that it names, segment by segment.
    paths: Vec<Vec<String>>,
    /// Names that others may take from it, and where they come from.
    given: BTreeMap<String, Vec<String>>,
    /// Texts that it holds, those inside of macros with what stands around them.
    texts: Vec<String>,
}

impl Named {
    fn of(source: &str, file: &Path) -> Self {
        let parsed = syn::parse_file(source);
        let parsed =
            parsed.map_err(|error| format!("{}: {error}", file.display())).expect("a source that compiles");
        let mut named = Self::default();
        named.visit_file(&parsed);
        named
    }

    fn take(&mut self, tree: &UseTree, mut before: Vec<String>, public: bool) {
        match tree {
            UseTree::Path(path) => {
                before.push(path.ident.to_string());
                self.take(&path.tree, before, public);
            }
            UseTree::Group(group) => {
                group.items.iter().for_each(|tree| self.take(tree, before.clone(), public))
            }
            UseTree::Name(_) | UseTree::Rename(_) | UseTree::Glob(_) => {
                let (name, known_as) = match tree {
                    UseTree::Name(name) => (name.ident.to_string(), name.ident.to_string()),
                    UseTree::Rename(name) => (name.ident.to_string(), name.rename.to_string()),
                    _ => ("*".to_owned(), "*".to_owned()),
                };
                if name != "self" {
                    before.push(name);
                }
                if public {
                    self.given.insert(known_as, before.clone());
                }
                self.paths.push(before);
            }
        }
    }
}

fn is_for_tests(attributes: &[Attribute]) -> bool {
    let words = |attribute: &Attribute| attribute.meta.require_list().map(|list| list.tokens.to_string());
    attributes.iter().any(|attribute| {
        attribute.path().is_ident("test")
            || attribute.path().is_ident("cfg") && words(attribute).is_ok_and(|words| words == "test")
    })
}

impl<'ast> Visit<'ast> for Named {
    fn visit_item(&mut self, item: &'ast Item) {
        let attributes = match item {
            Item::Mod(item) => &item.attrs,
            Item::Use(item) => &item.attrs,
            Item::Fn(item) => &item.attrs,
            Item::Impl(item) => &item.attrs,
            _ => &Vec::new(),
        };
        if !is_for_tests(attributes) {
            visit::visit_item(self, item);
        }
    }

    fn visit_item_use(&mut self, item: &'ast ItemUse) {
        self.take(&item.tree, Vec::new(), !matches!(item.vis, Visibility::Inherited));
    }

    fn visit_attribute(&mut self, _: &'ast Attribute) {
        // Documentation may say how the program is called.
    }

    fn visit_lit_str(&mut self, text: &'ast syn::LitStr) {
        self.texts.push(text.value());
    }

    fn visit_macro(&mut self, called: &'ast syn::Macro) {
        self.texts.push(called.tokens.to_string());
        visit::visit_macro(self, called);
    }

    fn visit_path(&mut self, path: &'ast syn::Path) {
        self.paths.push(path.segments.iter().map(|segment| segment.ident.to_string()).collect());
        visit::visit_path(self, path);
    }
}

/// All modules of a crate but those of tests.
fn modules(source: &Path) -> BTreeMap<Module, Named> {
    let mut found = BTreeMap::new();
    let root = if source.join("lib.rs").exists() { "lib" } else { "main" };
    let mut folders = vec![(source.to_owned(), Vec::new())];
    while let Some((folder, parent)) = folders.pop() {
        for entry in fs::read_dir(&folder).expect("a folder of sources") {
            let path = entry.expect("an entry").path();
            let name = path.file_stem().expect("a name").to_string_lossy().into_owned();
            if name == "tests" || name == "noise" || name.ends_with("_tests") {
                continue;
            }
            let module = [&parent[..], std::slice::from_ref(&name)].concat();
            if path.is_dir() {
                // A folder that is no module holds other things.
                if path.with_extension("rs").exists() {
                    folders.push((path, module));
                }
            } else if path.extension().is_some_and(|extension| extension == "rs") {
                let text = fs::read_to_string(&path).expect("a source");
                let module = if parent.is_empty() && name == root { Vec::new() } else { module };
                found.insert(module, Named::of(&text, &path));
            }
        }
    }
    found
}

/// The module that has what a path names in another; none for what other crates have.
fn owner(modules: &BTreeMap<Module, Named>, from: &Module, path: &[String], depth: usize) -> Option<Module> {
    let child = |parent: &Module, name: &String| [&parent[..], std::slice::from_ref(name)].concat();
    let mut at = from.clone();
    let mut rest = path;
    match path.first()?.as_str() {
        "crate" => (at, rest) = (Vec::new(), &path[1..]),
        "self" => rest = &path[1..],
        "super" => {
            while rest.first().is_some_and(|word| word == "super") {
                at.pop();
                rest = &rest[1..];
            }
        }
        _ if modules.contains_key(&child(from, &path[0])) => {}
        _ => return None,
    }
    while let Some(name) = rest.first() {
        let next = child(&at, name);
        if modules.contains_key(&next) {
            (at, rest) = (next, &rest[1..]);
            continue;
        }
        let given = modules.get(&at).and_then(|named| named.given.get(name)).filter(|_| depth < 8);
        return given.and_then(|given| owner(modules, &at, given, depth + 1)).or(Some(at));
    }
    Some(at)
}

/// For each room the modules in it that each of its modules knows, with who says so.
type Rooms = BTreeMap<Module, BTreeMap<String, BTreeMap<String, String>>>;

fn rooms(modules: &BTreeMap<Module, Named>) -> Rooms {
    let mut rooms = Rooms::new();
    for (from, named) in modules {
        for path in &named.paths {
            let Some(to) = owner(modules, from, path, 0) else { continue };
            let shared = from.iter().zip(&to).take_while(|(one, other)| one == other).count();
            if shared < from.len() && shared < to.len() {
                let room = rooms.entry(from[..shared].to_vec()).or_default();
                let who = format!("{} names {}", from.join("::"), path.join("::"));
                room.entry(from[shared].clone()).or_default().insert(to[shared].clone(), who);
            }
        }
    }
    rooms
}

/// What is known from a module on, one step or several.
fn reached<'r>(room: &'r BTreeMap<String, BTreeMap<String, String>>, from: &'r str) -> BTreeSet<&'r str> {
    let mut seen = BTreeSet::new();
    let mut next = vec![from];
    while let Some(module) = next.pop() {
        for to in room.get(module).into_iter().flat_map(BTreeMap::keys) {
            if seen.insert(to.as_str()) {
                next.push(to);
            }
        }
    }
    seen
}

/// What is wrong with the modules of a house.
fn wrongs(modules: &BTreeMap<Module, Named>, floors: &[&[&str]]) -> Vec<String> {
    let floor = |name: &str| floors.iter().position(|floor| floor.contains(&name));
    let top = modules.keys().filter_map(|module| module.first()).collect::<BTreeSet<_>>();
    let mut wrong: Vec<String> = top
        .into_iter()
        .filter(|name| floor(name).is_none())
        .map(|name| format!("{name} has no floor"))
        .collect();
    for (room, knows) in &rooms(modules) {
        for (from, others) in knows {
            for (to, who) in others {
                if room.is_empty() && floor(to) >= floor(from) {
                    wrong.push(format!("{from} must not know {to}: {who}"));
                }
                if !room.is_empty() && reached(knows, to).contains(from.as_str()) {
                    wrong.push(format!("a circle in {}: {who}", room.join("::")));
                }
            }
        }
    }
    wrong
}

#[test]
fn nobody_knows_who_stands_above() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    for House { source, floors } in [CORE, NUMERICS, LIBRARY, TABLE, COMMAND_LINE, PYTHON, C, PEERS] {
        let modules = modules(&root.join(source));
        assert!(modules.len() > 5, "{source}");
        assert_eq!(wrongs(&modules, floors), Vec::<String>::new(), "{source}");
    }
}

#[test]
fn what_is_turned_round_is_seen() {
    let file = |text: &str| Named::of(text, Path::new("example.rs"));
    let house = |data: &str, model: &str, one: &str| {
        let path = |words: &[&str]| words.iter().map(|word| (*word).to_owned()).collect::<Module>();
        BTreeMap::from([
            (path(&[]), file("pub use model::Model; mod data; mod model;")),
            (path(&["data"]), file(data)),
            (path(&["model"]), file("mod one; mod two; pub use one::Model; pub(crate) use two::Root;")),
            (path(&["model", "one"]), file(one)),
            (path(&["model", "two"]), file(model)),
        ])
    };
    let floors: &[&[&str]] = &[&["data"], &["model"]];
    let of = |data, two, one| wrongs(&house(data, two, one), floors);
    assert!(of("", "use crate::data::Log;", "use super::Root;").is_empty());
    assert!(of("#[cfg(test)] mod tests { use crate::Model; }", "", "").is_empty());
    assert_eq!(of("use crate::Model;", "", ""), ["data must not know model: data names crate::Model"]);
    assert_eq!(of("fn f(m: &crate::model::Model) {}", "", "").len(), 1);
    assert_eq!(of("", "use super::Model;", "use super::Root;").len(), 2);
}

/// Options of the command line that a text names.
fn options(text: &str) -> impl Iterator<Item = &str> {
    let each = text.split("--").skip(1).zip(text.split("--"));
    each.filter_map(|(option, before)| {
        let begins = before.is_empty() || before.ends_with([' ', '(', '"', '\n']);
        let letters = option.bytes().take_while(|byte| byte.is_ascii_lowercase() || *byte == b'-').count();
        (begins && letters > 0).then_some(&option[..letters])
    })
}

#[test]
fn libraries_name_no_options() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    for library in [
        "crates/thetahat-core/src",
        "crates/thetahat/src",
        "crates/thetahat-table/src",
        "crates/thetahat-c/src",
    ] {
        for (module, named) in modules(&root.join(library)) {
            let found: Vec<&str> = named.texts.iter().flat_map(|text| options(text)).collect();
            assert!(found.is_empty(), "{library}, {}: {found:?}", module.join("::"));
        }
    }
    assert_eq!(
        options("leave out --split (--validate), a--b, -- and 1 --2").collect::<Vec<_>>(),
        ["split", "validate"]
    );
}

/// Where the variants of `Model` and of `Procedure` may be named: beside what they are, and
/// where each kind has a presentation and a form of its own. All others ask for what a kind can do.
const KINDS: [&str; 4] = ["estimate", "export", "model", "present::kinds"];

/// Variants of these enums that a source names outside of comments and tests.
fn variants(source: &str) -> Vec<String> {
    let code = source.lines().take_while(|line| !line.trim_start().starts_with("#[cfg(test)]"));
    let code = code.filter(|line| !line.trim_start().starts_with("//"));
    let mut found = Vec::new();
    for line in code {
        for name in ["Model::", "Procedure::"] {
            for (at, _) in line.match_indices(name) {
                let before = line[..at].chars().next_back();
                let after = line[at + name.len()..].chars().next();
                let whole = !before.is_some_and(|c| c.is_alphanumeric() || c == '_');
                if whole && after.is_some_and(|c| c.is_ascii_uppercase()) {
                    found.push(line.trim().to_owned());
                }
            }
        }
    }
    found
}

#[test]
fn kinds_are_asked_what_they_can_do() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let allowed = |module: &str| {
        KINDS.iter().any(|room| {
            module == *room || module.strip_prefix(room).is_some_and(|rest| rest.starts_with("::"))
        })
    };
    for (folder, is_library) in [("crates/thetahat/src", true), ("cli", false), ("py/src", false)] {
        let mut files = Vec::new();
        files_below(&root.join(folder), &mut files);
        for file in files {
            let path = file.strip_prefix(root.join(folder)).expect("below").with_extension("");
            let module = path.to_string_lossy().replace(['/', '\\'], "::");
            if module.split("::").any(|part| part.ends_with("tests")) || is_library && allowed(&module) {
                continue;
            }
            // Their one dispatch.
            let found = variants(&fs::read_to_string(&file).expect("a source"));
            assert!(found.is_empty() || module == "respond::kinds", "{folder}, {module}: {found:?}");
        }
    }
    let source = "/// Model::Process\nlet Model::Process(p) = m;\nStateModel::From\nModel::of\n#[cfg(test)]\nModel::Process";
    assert_eq!(variants(source), ["let Model::Process(p) = m;"]);
}

/// The sources below a folder.
fn files_below(folder: &Path, found: &mut Vec<std::path::PathBuf>) {
    for entry in fs::read_dir(folder).expect("a folder") {
        let path = entry.expect("an entry").path();
        if path.is_dir() {
            files_below(&path, found);
        } else if path.extension().is_some_and(|kind| kind == "rs") {
            found.push(path);
        }
    }
}

/// The features of each package, once for each set of them, as `cargo tree` says for these packages.
fn features(packages: &[&str]) -> BTreeMap<String, BTreeSet<String>> {
    let tree = ["tree", "--locked", "--offline", "--no-dedupe", "--prefix", "none", "--format", "{p}|{f}"];
    let said = Command::new(env!("CARGO"))
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .args(tree)
        .args(packages)
        .output()
        .expect("cargo");
    assert!(said.status.success(), "{}", String::from_utf8_lossy(&said.stderr));
    let mut features = BTreeMap::<String, BTreeSet<String>>::new();
    for line in String::from_utf8_lossy(&said.stdout).lines() {
        let (package, own) = line.split_once('|').unwrap_or((line, ""));
        features.entry(package.to_owned()).or_default().insert(own.to_owned());
    }
    features
}

/// One feature more in one of them compiles its crate, and all that depend on it, once more.
#[test]
fn the_program_the_module_and_the_tests_are_built_of_the_same_crates() {
    let module = features(&["--package", "thetahat-py", "--edges", "normal,build"]);
    let program = features(&["--edges", "normal,build"]);
    let tests = features(&["--workspace", "--all-features", "--edges", "normal,build,dev"]);
    assert!(module.len() > 100, "{module:?}");
    // Tests may have what macros are built of once more.
    for (others, name, more) in [(program, "the program", false), (tests, "the tests", true)] {
        let wrong: Vec<String> = module
            .iter()
            .filter_map(|(package, own)| Some((package, own, others.get(package)?)))
            .filter(|(_, own, other)| if more { !own.is_subset(other) } else { own != other })
            .map(|(package, own, other)| format!("{package}: {own:?} in the module, {other:?} in {name}"))
            .collect();
        assert_eq!(wrong, Vec::<String>::new());
    }
}
