//! The floors of what is written in Python: the package, and the programs that compare with other packages.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use super::{House, Module, Named, PYTHON, modules, owner, wrongs};

/// What users of Python import: `_thetahat` is the module that is compiled of `py/src`.
const PACKAGE: House = House {
    source: "py/python/thetahat",
    floors: &[
        &["base"],
        &["_thetahat"],
        &["engine"],
        &["logs"],
        &["models"],
        &["experiments"],
        &["fits"],
        &["controllers", "online"],
        &["command", "dask", "plot", "sklearn"],
    ],
};

const PROGRAMS_OF_PEERS: House = House {
    source: "benches/peers",
    floors: &[&["compare"], &["filters", "many_logs", "prediction_error", "python_module"]],
};

/// The modules that a source in Python imports, each with the names that it takes, and whether a function does so.
fn imports(source: &str) -> Vec<(Vec<String>, bool)> {
    let mut found = Vec::new();
    let mut outer = "";
    let mut lines = source.lines();
    while let Some(line) = lines.next() {
        let code = line.trim_start();
        if code.len() == line.len() && !code.is_empty() {
            outer = code;
        }
        let inside = code.len() < line.len() && !outer.starts_with("if TYPE_CHECKING");
        let segments = |path: &str| path.trim().split('.').map(str::to_owned).collect::<Vec<_>>();
        let first = |name: &str| name.split_whitespace().next().map(str::to_owned);
        if let Some((path, names)) = code.strip_prefix("from ").and_then(|rest| rest.split_once(" import ")) {
            let mut names = names.to_owned();
            while names.contains('(') && !names.contains(')') {
                let Some(more) = lines.next() else { break };
                names.push_str(more.split('#').next().expect("the first part"));
            }
            let names = names.split('#').next().expect("the first part").replace(['(', ')'], "");
            let each = names.split(',').filter_map(first);
            found.extend(each.map(|name| ([segments(path), vec![name]].concat(), inside)));
        } else if let Some(paths) = code.strip_prefix("import ") {
            let each = paths.split('#').next().expect("the first part").split(',').filter_map(first);
            found.extend(each.map(|path| (segments(&path), inside)));
        } else if let Some((_, path)) =
            ["import_module(", "__import__("].iter().find_map(|f| code.split_once(f))
        {
            let path = path.trim_start_matches('f').trim_start_matches(['"', '\'']);
            found.push((segments(path.split(['"', '\'']).next().expect("the first part")), inside));
        }
    }
    found
}

/// What is wrong with modules of Python, by their paths and sources: with those of a package, or with single programs.
fn wrongs_of_python(
    package: Option<&str>,
    sources: &BTreeMap<Module, String>,
    floors: &[&[&str]],
) -> Vec<String> {
    let mut wrong = Vec::new();
    let mut modules: BTreeMap<Module, Named> =
        sources.keys().map(|module| (module.clone(), Named::default())).collect();
    for (from, source) in sources {
        let mut paths = Vec::new();
        for (mut path, inside) in imports(source) {
            let own = match package {
                Some(package) => path[0] == package,
                None => sources.contains_key(&path[..1]),
            };
            let who = format!("{} imports {}", from.join("."), path.join("."));
            if path[0].is_empty() {
                wrong.push(format!("not from the package on: {who}"));
            }
            if !own {
                continue;
            }
            // The package itself loads some modules late: for users, as none of its own may know it.
            if inside && !from.is_empty() {
                wrong.push(format!("hidden in a function: {who}"));
            }
            match package {
                Some(_) => path[0] = "crate".to_owned(),
                None => path.insert(0, "crate".to_owned()),
            }
            let to = owner(&modules, from, &path, 0).unwrap_or_default();
            if to.len() < from.len() && from.starts_with(&to) {
                wrong.push(format!("a package imports its modules, and they must not import it: {who}"));
            }
            paths.push(path);
        }
        modules.get_mut(from).expect("a module of these").paths = paths;
    }
    wrong.extend(wrongs(&modules, floors));
    wrong
}

/// The sources in Python of a folder and of the packages in it.
fn python(folder: &Path) -> BTreeMap<Module, String> {
    let mut found = BTreeMap::new();
    let mut folders = vec![(folder.to_owned(), Module::new())];
    while let Some((folder, parent)) = folders.pop() {
        for entry in fs::read_dir(&folder).expect("a folder of sources") {
            let path = entry.expect("an entry").path();
            let name = path.file_stem().expect("a name").to_string_lossy().into_owned();
            let module = [&parent[..], std::slice::from_ref(&name)].concat();
            if path.join("__init__.py").exists() {
                folders.push((path, module));
            } else if path.extension().is_some_and(|extension| extension == "py" || extension == "pyi") {
                let module = if name == "__init__" { parent.clone() } else { module };
                found.insert(module, fs::read_to_string(&path).expect("a source"));
            }
        }
    }
    found
}

#[test]
fn no_module_of_python_knows_who_stands_above() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut package = python(&root.join(PACKAGE.source));
    assert!(package.len() > 40 && package.contains_key(&Module::new()));
    // What the compiled module calls by name.
    let compiled = modules(&root.join(PYTHON.source));
    let names =
        compiled.values().flat_map(|named| &named.texts).filter_map(|text| text.strip_prefix("thetahat."));
    let called: Vec<&str> = names
        .filter(|name| name.chars().all(|letter| letter.is_alphanumeric() || "._".contains(letter)))
        .collect();
    assert!(called.contains(&"base.numbers"), "{called:?}");
    for name in called {
        assert!(package.contains_key(&name.split('.').map(str::to_owned).collect::<Module>()), "{name}");
        let stub = package.get_mut(&["_thetahat".to_owned()][..]).expect("the stub");
        stub.push_str(&format!("\nimport thetahat.{name}\n"));
    }
    assert_eq!(wrongs_of_python(Some("thetahat"), &package, PACKAGE.floors), Vec::<String>::new());

    let programs = python(&root.join(PROGRAMS_OF_PEERS.source));
    assert!(programs.len() > 3);
    assert_eq!(wrongs_of_python(None, &programs, PROGRAMS_OF_PEERS.floors), Vec::<String>::new());
}

#[test]
fn what_is_turned_round_in_python_is_seen() {
    let house = |log: &str, fit: &str, grey: &str| {
        let path = |name: &str| name.split('.').filter(|word| !word.is_empty()).map(str::to_owned).collect();
        let root = "from th.fits.fit import arx\nfrom th.logs.log import (\n    Log,  # data\n)\n";
        let files = [
            ("", root),
            ("logs", ""),
            ("logs.log", log),
            ("fits", ""),
            ("fits.fit", fit),
            ("fits.grey", grey),
        ];
        let sources: BTreeMap<Module, String> =
            files.into_iter().map(|(name, text)| (path(name), text.to_owned())).collect();
        wrongs_of_python(Some("th"), &sources, &[&["logs"], &["fits"]])
    };
    assert!(
        house("import numpy as np", "from th.logs.log import Log", "from th.fits import fit as _fit")
            .is_empty()
    );
    assert!(house("\"\"\"\n    >>> import th\n    >>> from th.fits import fit\n\"\"\"", "", "").is_empty());
    for upwards in [
        "from th.fits.fit import arx",
        "from th.fits import (\n    fit as _fit,\n)",
        "import th.fits.fit",
        "import os, th.fits.fit as fit  # for arx",
        "if TYPE_CHECKING:\n    from th.fits.fit import arx",
        "fit = import_module(\"th.fits.fit\")",
    ] {
        let found = house(upwards, "", "");
        assert_eq!(found.len(), 1, "{upwards}: {found:?}");
        assert!(found[0].starts_with("logs must not know fits: logs::log names"), "{upwards}: {found:?}");
    }
    let circle = house("", "from th.fits import grey", "from th.fits.fit import arx");
    assert_eq!(circle.len(), 2, "{circle:?}");
    assert!(circle.iter().all(|wrong| wrong.starts_with("a circle in fits: ")), "{circle:?}");
    let hidden = house("", "def arx(log):\n    from th.logs.log import Log\n", "");
    assert_eq!(hidden, ["hidden in a function: fits.fit imports th.logs.log.Log"]);
    let relative = house("", "from .grey import GreyBox", "");
    assert_eq!(relative, ["not from the package on: fits.fit imports .grey.GreyBox"]);
    for parent in ["from th import Log", "import th"] {
        let found = house("", parent, "");
        assert_eq!(found.len(), 1, "{parent}: {found:?}");
        assert!(found[0].starts_with("a package imports its modules, and they must not"), "{found:?}");
    }
}
