//! What the library makes public is listed in `docs/public-items.txt`, so that a change of it shows in every diff.
//!
//! The list is read from the documentation that `cargo doc --no-deps` has built. To write it anew:
//! `cargo doc --no-deps && POLHODE_ACCEPT=1 cargo test --test files public_items -- --ignored`.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

const LIST: &str = "docs/public-items.txt";

/// Where what a page says of its own item ends, and what traits bring begins.
const ENDS: [&str; 4] = [
    r#"id="trait-implementations""#,
    r#"id="synthetic-implementations""#,
    r#"id="foreign-impls""#,
    r#"id="implementors""#,
];

/// What a page calls the members of its item, and what they are.
const MEMBERS: [(&str, &str); 6] = [
    ("structfield", "field"),
    ("variant", "variant"),
    ("associatedconstant", "const"),
    ("associatedtype", "type"),
    ("tymethod", "required fn"),
    ("method", "fn"),
];

fn documentation() -> PathBuf {
    let target = std::env::var_os("CARGO_TARGET_DIR").unwrap_or_else(|| "target".into());
    Path::new(env!("CARGO_MANIFEST_DIR")).join(target).join("doc/polhode")
}

/// The texts that stand between two others.
fn between<'a>(text: &'a str, before: &'a str, after: char) -> impl Iterator<Item = &'a str> {
    text.split(before).skip(1).filter_map(move |rest| rest.split(after).next())
}

/// The items, each with its members.
fn items(documentation: &Path) -> BTreeSet<String> {
    let read = |page: &str| {
        let path = documentation.join(page);
        fs::read_to_string(&path)
            .unwrap_or_else(|error| panic!("{}: {error}; run `cargo doc --no-deps`", path.display()))
    };
    let all = read("all.html");
    let mut found = BTreeSet::new();
    for page in between(&all, r#"<a href=""#, '"').filter(|page| page.ends_with(".html")) {
        let (folder, file) = page.rsplit_once('/').unwrap_or(("", page));
        let Some((kind, name)) = file.trim_end_matches(".html").split_once('.') else { continue };
        let item = format!("{}::{name}", ["polhode", folder].join("/").trim_end_matches('/').replace('/', "::"));
        let text = read(page);
        let own = ENDS.iter().filter_map(|end| text.find(end)).min().map_or(&*text, |end| &text[..end]);
        for (id, member) in MEMBERS {
            // A name that blocks share has a number behind it.
            let before = format!(r#"id="{id}."#);
            let names = between(own, &before, '"').filter_map(|name| name.split('-').next().map(str::to_owned));
            let names: BTreeSet<String> = names.collect();
            found.extend(names.into_iter().map(|name| format!("{item}::{name} ({member})")));
        }
        found.insert(format!("{item} ({kind})"));
    }
    found
}

#[test]
#[ignore = "reads what `cargo doc --no-deps` has built; .ci/run runs it"]
fn public_items_are_those_that_are_listed() {
    let found = items(&documentation());
    assert!(found.contains("polhode::Scene (struct)") || found.contains("polhode::scene::Scene (struct)"));
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(LIST);
    if std::env::var_os("POLHODE_ACCEPT").is_some() {
        let lines: Vec<&str> = found.iter().map(String::as_str).collect();
        return fs::write(path, lines.join("\n") + "\n").expect("written");
    }
    let listed = fs::read_to_string(path).expect("a list");
    let listed: BTreeSet<String> = listed.lines().map(str::to_owned).collect();
    let lines = |sign, of: &BTreeSet<String>, other| {
        of.difference(other).map(|line| format!("{sign} {line}\n")).collect::<String>()
    };
    let change = lines('-', &listed, &found) + &lines('+', &found, &listed);
    assert!(change.is_empty(), "what is public has changed; the test says how to list it anew:\n{change}");
}
