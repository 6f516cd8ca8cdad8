//! The order in which the core's modules may use each other, as the table in `ARCHITECTURE.md` has it; the
//! length of files (`clippy.toml` limits that of functions); names of types, each with one meaning; and words
//! that no doc line begins with.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

/// From what everything uses to what uses everything.
const ORDER: [&str; 16] = [
    "uncompared",
    "math",
    "handle",
    "workers",
    "frame",
    "shape",
    "contact",
    "broad",
    "motion",
    "constraint",
    "body",
    "joint",
    "response",
    "swarm",
    "world",
    "scene",
];

fn files(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            files(&path, found);
        } else {
            found.push(path);
        }
    }
}

/// Modules of the crate that a source file names, outside of comments and of its own tests.
fn used(source: &str) -> impl Iterator<Item = &str> {
    let code = source.split("#[cfg(test)]").next().unwrap_or(source);
    let lines = code.lines().filter(|line| !line.trim_start().starts_with("//"));
    lines.flat_map(|line| {
        line.split("crate::").skip(1).map(|rest| {
            let end = rest.find(|c: char| !c.is_alphanumeric() && c != '_');
            &rest[..end.unwrap_or(rest.len())]
        })
    })
}

#[test]
fn no_module_uses_one_that_comes_later() {
    let root = Path::new("src");
    let mut all = Vec::new();
    files(root, &mut all);
    let rank = |name: &str| ORDER.iter().position(|module| *module == name);
    let mut checked = 0;
    for path in all {
        let inside = path.strip_prefix(root).unwrap();
        let first = inside.iter().next().unwrap().to_str().unwrap().trim_end_matches(".rs");
        let Some(own) = rank(first).filter(|_| !path.ends_with("tests.rs")) else { continue };
        checked += 1;
        for module in used(&fs::read_to_string(&path).unwrap()) {
            let later = rank(module).is_some_and(|other| other > own);
            assert!(!later, "{} uses {module}, which comes later", inside.display());
        }
    }
    assert!(checked > 100, "only {checked} files were found");
}

/// Source files of the workspace.
fn sources() -> Vec<PathBuf> {
    let workspace = Path::new("../..");
    let mut all = Vec::new();
    for folder in
        ["crates", "examples", "tests", "peers/src", "peers/parry/benches", "peers/parry/tests"]
    {
        files(&workspace.join(folder), &mut all);
    }
    all.retain(|path| path.extension().is_some_and(|ending| ending == "rs"));
    all
}

/// Lines of a source file at most.
const LONGEST: usize = 500;

#[test]
fn no_file_is_too_long_to_read() {
    let all = sources();
    let lines = |path: &PathBuf| fs::read_to_string(path).unwrap().lines().count();
    let long: Vec<_> = all.iter().filter(|path| lines(path) > LONGEST).collect();
    assert!(long.is_empty(), "over {LONGEST} lines: {long:#?}");
    assert!(all.len() > 300, "only {} files were found", all.len());
}

#[test]
fn no_type_name_has_two_meanings() {
    let mut all = Vec::new();
    files(Path::new("src"), &mut all);
    let mut defined: BTreeMap<String, Vec<String>> = BTreeMap::new();
    for path in all {
        let text = fs::read_to_string(&path).unwrap();
        let code = text.split("#[cfg(test)]").next().unwrap_or(&text);
        for line in code.lines().filter(|line| !line.starts_with(char::is_whitespace)) {
            let item = line.strip_prefix("pub").map_or(line, |rest| {
                rest.strip_prefix('(').and_then(|rest| rest.split_once(')')).map_or(rest, |it| it.1)
            });
            let mut words = item.split_whitespace();
            if words.next().is_some_and(|word| ["struct", "enum", "trait", "type"].contains(&word))
            {
                let name = words.next().unwrap().split(|c: char| !c.is_alphanumeric()).next();
                defined.entry(name.unwrap().into()).or_default().push(path.display().to_string());
            }
        }
    }
    assert!(defined.len() > 300, "only {} types were found", defined.len());
    defined.retain(|_, places| places.len() > 1);
    assert!(defined.is_empty(), "{defined:#?}");
}

/// Words that begin no documentation, which names the thing or says what is done.
const NO_BEGINNINGS: [&str; 4] = ["What", "The same", "Whether", "How"];

#[test]
fn no_docs_begin_with_a_question_word() {
    let mut found = Vec::new();
    for path in sources() {
        let text = fs::read_to_string(&path).unwrap();
        let mut before = None;
        for (number, line) in (1..).zip(text.lines().map(str::trim)) {
            let doc = ["///", "//!"].iter().find_map(|mark| line.strip_prefix(mark));
            let doc = doc.map(str::trim);
            let begins = |word: &&str| {
                let rest = doc.and_then(|doc| doc.strip_prefix(*word));
                rest.is_some_and(|rest| !rest.starts_with(char::is_alphabetic))
            };
            if before.is_none_or(str::is_empty) && NO_BEGINNINGS.iter().any(begins) {
                found.push(format!("{}:{number}: {line}", path.display()));
            }
            before = doc;
        }
    }
    assert!(found.is_empty(), "{found:#?}");
}
