//! The modules of the library lie in layers: each uses those below it alone.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

/// The layers, lowest first, as they stand on the crate's page.
const LAYERS: [&str; 15] = [
    "math",
    "error",
    "bodies",
    "expression",
    "kernel",
    "torque",
    "scene",
    "study",
    "engine",
    "plan",
    "record",
    "run",
    "verify",
    "bench",
    "plot",
];

/// Arrows upward that are allowed: from, to, the name that is used, and why.
const EXCEPTIONS: [(&str, &str, &str, &str); 3] = [
    ("error", "kernel", "method", "errors name the integrator, an enumeration that returns no errors"),
    ("error", "scene", "Accuracy", "an error says which accuracy is out of reach; the type returns no errors"),
    ("error", "scene", "Target", "as `Accuracy`, of which it names a part"),
];

/// A use of another top-level module: the module, and the path behind it.
type Use = (String, String);

#[test]
fn no_module_uses_one_of_a_higher_layer() {
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let reexports = reexports(&fs::read_to_string(source.join("lib.rs")).expect("src/lib.rs"));
    let mut upward = BTreeSet::new();
    let mut excepted = BTreeSet::new();
    for file in rust_files(&source) {
        let name = file.strip_prefix(&source).expect("below src").to_str().expect("UTF-8").replace('\\', "/");
        if name == "lib.rs" || name.starts_with("bin/") {
            continue;
        }
        let text = fs::read_to_string(&file).expect("a source file");
        let own = name.split(['/', '.']).next().unwrap_or_default();
        for (module, rest) in uses(&text, &reexports) {
            if layer(own) >= layer(&module) {
                continue;
            }
            let first = rest.split("::").next().unwrap_or_default();
            match EXCEPTIONS.iter().position(|&(from, to, item, _)| (from, to, item) == (own, &module, first)) {
                Some(index) => drop(excepted.insert(index)),
                None => drop(upward.insert(format!("{name}: crate::{module}::{rest}"))),
            }
        }
    }
    assert!(upward.is_empty(), "arrows upward:\n{}", upward.into_iter().collect::<Vec<_>>().join("\n"));
    assert_eq!(excepted.len(), EXCEPTIONS.len(), "an exception is no longer needed: take it out");
}

#[test]
fn the_crate_page_lists_the_layers_in_their_order() {
    let page = include_str!("../../src/lib.rs");
    let modules: BTreeSet<&str> =
        page.lines().filter_map(|line| line.strip_prefix("pub mod ")?.strip_suffix(';')).collect();
    assert_eq!(modules, LAYERS.into_iter().collect(), "each module of src/lib.rs is a layer");
    let listed: Vec<&str> = page
        .lines()
        .filter_map(|line| line.trim_start_matches("//! ").split_once(". `"))
        .filter(|(number, _)| number.parse::<usize>().is_ok())
        .filter_map(|(_, rest)| rest.split('`').next())
        .collect();
    assert_eq!(listed, LAYERS);
}

#[test]
fn arrows_of_each_form_are_seen() {
    let reexports = vec![("Plan".to_owned(), "plan".to_owned())];
    let text = "
        use crate::run::{run, unit::Unit};
        use crate::{plan::class, verify};
        fn f() -> crate::Plan { crate::bench::row::rows() } // crate::plot
        /// [`crate::study`]
        #[cfg(test)]
        mod tests {
            use crate::record::Record;
            mod inner {}
        }
        use crate::engine as e;
    ";
    let found: Vec<String> = uses(text, &reexports).into_iter().map(|(module, _)| module).collect();
    assert_eq!(found, ["run", "plan", "verify", "plan", "bench", "engine"]);
}

/// The place of a module among the layers.
fn layer(module: &str) -> usize {
    LAYERS.iter().position(|&layer| layer == module).unwrap_or_else(|| panic!("{module} is not among the layers"))
}

fn rust_files(folder: &Path) -> Vec<PathBuf> {
    let mut files = Vec::new();
    for entry in fs::read_dir(folder).expect("a folder") {
        let path = entry.expect("an entry").path();
        match path.extension() {
            _ if path.is_dir() => files.extend(rust_files(&path)),
            // Modules of tests in files of their own.
            Some(extension) if extension == "rs" && path.file_stem().is_some_and(|stem| stem != "tests") => {
                files.push(path)
            }
            _ => {}
        }
    }
    files
}

/// Names that the crate's root re-exports, each with its module.
fn reexports(root: &str) -> Vec<(String, String)> {
    let mut found = Vec::new();
    for line in root.lines().filter_map(|line| line.strip_prefix("pub use ")?.strip_suffix(';')) {
        // A crate is in no layer.
        let Some((module, names)) = line.split_once("::") else { continue };
        let names = names.rsplit("::").next().unwrap_or(names).trim_matches(['{', '}']);
        found.extend(names.split(", ").map(|name| (name.to_owned(), module.to_owned())));
    }
    found
}

/// What a text uses by paths from the crate's root, outside comments and modules of tests.
fn uses(text: &str, reexports: &[(String, String)]) -> Vec<Use> {
    let code: String = text.lines().map(|line| format!("{}\n", line.split("//").next().unwrap_or(line))).collect();
    let code = without_tests(&code);
    let mut found = Vec::new();
    for (place, _) in code.match_indices("crate::") {
        let rest = &code[place + "crate::".len()..];
        let paths = match rest.strip_prefix('{') {
            Some(list) => members(list),
            None => vec![path(rest)],
        };
        for path in paths {
            let (first, rest) = path.split_once("::").unwrap_or((path, ""));
            if let Some((_, module)) = reexports.iter().find(|(name, _)| name == first) {
                found.push((module.clone(), first.to_owned()));
            } else if LAYERS.contains(&first) {
                found.push((first.to_owned(), rest.to_owned()));
            }
        }
    }
    found
}

/// A path at the start of a text.
fn path(text: &str) -> &str {
    let end = text.find(|c: char| !(c.is_alphanumeric() || c == '_' || c == ':')).unwrap_or(text.len());
    text[..end].trim_end_matches(':')
}

/// The members of a list in braces, whose opening one has been read.
fn members(list: &str) -> Vec<&str> {
    let (mut depth, mut start, mut found) = (0, 0, Vec::new());
    for (place, c) in list.char_indices() {
        match c {
            '{' => depth += 1,
            '}' if depth > 0 => depth -= 1,
            ',' | '}' if depth == 0 => {
                found.push(path(list[start..place].trim_start()));
                start = place + 1;
                if c == '}' {
                    break;
                }
            }
            _ => {}
        }
    }
    found.retain(|path| !path.is_empty());
    found
}

/// The code without modules marked `#[cfg(test)]`.
fn without_tests(code: &str) -> String {
    let mut kept = String::new();
    let mut rest = code;
    while let Some(place) = rest.find("#[cfg(test)]") {
        kept.push_str(&rest[..place]);
        let marked = &rest[place + "#[cfg(test)]".len()..];
        let end = marked.find(['{', ';']).unwrap_or(marked.len() - 1);
        rest = match marked.as_bytes()[end] {
            b'{' => {
                let mut depth = 0;
                let close = marked[end..].find(|c| {
                    depth += i32::from(c == '{') - i32::from(c == '}');
                    depth == 0
                });
                &marked[end + close.map_or(marked.len() - end, |close| close + 1)..]
            }
            _ => &marked[end + 1..],
        };
    }
    kept + rest
}
