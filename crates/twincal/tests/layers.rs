//! Arrows go one way: a module of the core uses only modules whose `mod` line stands above its own in lib.rs, no files of
//! a module use each other in a circle but in those named here, and no part of the core touches files, clocks, the environment or the terminal.

use crate::size::source::{blanked, files_below};
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

/// What the core may not name outside tests.
const FORBIDDEN: [&str; 14] = [
    "std::fs",
    "std::io",
    "std::env",
    "std::net",
    "std::process",
    "std::time",
    "std::thread::sleep",
    "Instant::now",
    "SystemTime",
    "println!",
    "print!",
    "eprintln!",
    "eprint!",
    "dbg!",
];

/// One source file with comments and literals blanked out.
struct Source {
    path: PathBuf,
    /// Top-level module that it belongs to; `lib` for lib.rs itself.
    module: String,
    /// Modules from the crate's root to it.
    parts: Vec<String>,
    code: String,
    /// The same without `#[cfg(test)]` items; empty for files that are tests as a whole.
    shipped: String,
}

#[test]
fn modules_use_only_what_stands_above_them() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let order = module_order(&blanked(&fs::read_to_string(root.join("lib.rs")).unwrap()));
    assert!(order.len() > 10, "lib.rs lists {} modules", order.len());
    let sources = sources(&root);
    assert!(sources.len() > order.len(), "{} files", sources.len());
    let mut arrows = Vec::new();
    for source in sources.iter().filter(|source| source.module != "lib") {
        let own = order.iter().position(|name| *name == source.module);
        let own =
            own.unwrap_or_else(|| panic!("{}: its module is not in lib.rs", source.path.display()));
        for used in uses(&source.code, source.parts.len()) {
            if order
                .iter()
                .position(|name| *name == used)
                .is_some_and(|place| place > own)
            {
                arrows.push(format!(
                    "{}: `{}` uses `{used}`, which stands below it",
                    source.path.display(),
                    source.module
                ));
            }
        }
    }
    assert!(
        arrows.is_empty(),
        "{} arrows against the order of lib.rs:\n{}",
        arrows.len(),
        arrows.join("\n")
    );
}

/// A file that uses an item of a module above it closes a circle as well: that module has it as a part. Folders of `calibrate` and
/// `signal` are held to the same.
#[test]
fn no_files_of_a_module_use_each_other_in_a_circle() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let order = module_order(&blanked(&fs::read_to_string(root.join("lib.rs")).unwrap()));
    let sources = sources(&root);
    let arrows_of = |module: &str| {
        let own = |source: &&Source| source.module == module && !source.shipped.is_empty();
        let codes: Vec<(String, &str)> = (sources.iter().filter(own))
            .map(|source| (source.parts.join("::"), source.shipped.as_str()))
            .collect();
        arrows(&codes)
    };
    let calibrate = arrows_of("calibrate");
    assert!(calibrate.len() > 40, "{} files", calibrate.len());
    assert!(calibrate["calibrate"].len() > 5, "{calibrate:?}");
    for with_wings in ["calibrate", "signal"] {
        assert_eq!(circle(&folders(&arrows_of(with_wings))), None);
    }
    for whole in [
        "assess",
        "calibrate",
        "fleet",
        "incidents",
        "rigid_fit",
        "signal",
        "statistics",
    ] {
        assert_eq!(circle(&arrows_of(whole)), None);
    }
    for module in &order {
        let circle = circle(&without_ancestors(arrows_of(module)));
        assert_eq!(circle, None, "two files use each other");
    }
}

#[test]
fn a_circle_is_found_whatever_its_paths_look_like() {
    let closed = |user: &str| {
        let codes = [
            ("a".to_owned(), "mod b; pub(super) mod c; fn call() {}"),
            ("a::b".to_owned(), "use super::c::{self, deep::Thing};"),
            ("a::c".to_owned(), "mod deep; pub(in crate::a) fn f() {}"),
            ("a::c::deep".to_owned(), user),
        ];
        circle(&arrows(&codes)).map(|circle| circle.join(" "))
    };
    assert_eq!(
        closed("use crate::z; use std::fmt; pub(super) fn f();"),
        None
    );
    let through_b = Some("a::b a::c::deep a::b".to_owned());
    assert_eq!(closed("use crate::{z, a::b::Other};"), through_b);
    assert_eq!(closed("fn f() { super::super::b::f() }"), through_b);
    let to_parent = Some("a::c a::c::deep a::c".to_owned());
    assert_eq!(closed("use super::f;"), to_parent);
    assert_eq!(closed("fn f() { super::f() }"), to_parent);
    assert_eq!(closed("use super::*;"), to_parent);
    let to_top = closed("use crate::a::call;").unwrap();
    assert!(to_top.ends_with("a::c::deep a"), "{to_top}");
    let codes = [
        ("a::b::x".to_owned(), "use crate::a::c::x;"),
        ("a::b::y".to_owned(), ""),
        ("a::c::x".to_owned(), ""),
        ("a::c::y".to_owned(), "use crate::a::b::y;"),
    ];
    assert_eq!(circle(&arrows(&codes)), None);
    let between = circle(&folders(&arrows(&codes))).unwrap();
    assert_eq!(between, ["a::b", "a::c", "a::b"]);
}

#[test]
fn the_core_touches_no_outside_world() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut found = Vec::new();
    for source in sources(&root) {
        for name in forbidden(&source.shipped) {
            found.push(format!("{}: {name}", source.path.display()));
        }
    }
    assert!(found.is_empty(), "{}", found.join("\n"));
}

#[test]
fn the_reader_of_sources_sees_what_it_should() {
    let text = r##"
        // crate::comment is no use, println! neither
        use crate::first::{Thing, Other};
        use crate::{second, third::Deep, fourth::{A, crate_b}};
        fn f<'a>(x: &'a str) -> char { let s = "crate::string \" println!"; let r = r#"crate::raw"#; '"' }
        /* crate::block /* nested */ */
        fn g() { super::fifth::call(); super::super::sixth::call(); super::no(); }
        #[cfg(test)]
        mod tests { use crate::seventh; fn h() { println!("}"); } }
        fn after() { std::fs::read("x"); }
    "##;
    let code = blanked(text);
    assert_eq!(
        uses(&code, 1),
        [
            "fifth", "first", "fourth", "no", "second", "seventh", "sixth", "third"
        ]
    );
    assert_eq!(
        uses(&code, 2),
        ["first", "fourth", "second", "seventh", "sixth", "third"]
    );
    assert_eq!(forbidden(&without_tests(&code)), ["std::fs"]);
    assert_eq!(forbidden(&code), ["std::fs", "println!"]);
    assert_eq!(
        module_order("pub mod a;\nmod b;\npub(crate) mod c;\n"),
        ["a", "b", "c"]
    );
}

/// Every file below `root`; a file that is declared under `#[cfg(test)]` ships nothing.
fn sources(root: &Path) -> Vec<Source> {
    let read = |path: PathBuf| {
        let inside = path.strip_prefix(root).expect("a file below the folder");
        let inside = inside.with_extension("");
        let mut parts: Vec<String> = inside
            .components()
            .map(|part| part.as_os_str().to_string_lossy().into_owned())
            .collect();
        parts.retain(|part| part != "mod");
        let code = blanked(&fs::read_to_string(&path).expect("a readable source tree"));
        let is_test = parts.iter().any(|part| part.ends_with("tests"));
        let shipped = if is_test {
            String::new()
        } else {
            without_tests(&code)
        };
        Source {
            path,
            module: parts[0].clone(),
            parts,
            code,
            shipped,
        }
    };
    files_below(root).into_iter().map(read).collect()
}

fn module_order(lib: &str) -> Vec<String> {
    let declared = |line: &str| {
        let line = line.trim().strip_suffix(';')?;
        let name = line
            .strip_prefix("mod ")
            .or_else(|| line.split_once(") mod ").map(|pair| pair.1));
        name.or_else(|| line.strip_prefix("pub mod "))
            .map(str::to_owned)
    };
    lib.lines().filter_map(declared).collect()
}

fn forbidden(code: &str) -> Vec<&'static str> {
    let whole = |name: &&str| {
        let starts_word =
            |at: usize| !code[..at].ends_with(|c: char| c.is_alphanumeric() || c == '_');
        code.match_indices(*name).any(|(at, _)| starts_word(at))
    };
    FORBIDDEN.into_iter().filter(whole).collect()
}

/// Names that follow `crate::`, or as many `super::` as reach the crate's root; sorted.
fn uses(code: &str, depth: usize) -> Vec<String> {
    let mut names = Vec::new();
    for (at, _) in code.match_indices("crate::") {
        if !code[..at].ends_with(|c: char| c.is_alphanumeric() || c == '_' || c == '$') {
            heads(&code[at + "crate::".len()..], &mut names);
        }
    }
    let chain = "super::".repeat(depth);
    for (at, _) in code.match_indices(&chain) {
        heads(
            code[at + chain.len()..].trim_start_matches("super::"),
            &mut names,
        );
    }
    names.sort();
    names.dedup();
    names
}

/// The first name of a path, or of each path in a `{…}` list.
fn heads(rest: &str, names: &mut Vec<String>) {
    match rest.strip_prefix('{') {
        None => names.push(word(rest).to_owned()),
        Some(list) => names.extend(listed(list).into_iter().map(|path| word(path).to_owned())),
    }
    names.retain(|name| !name.is_empty());
}

/// The name with which a path begins; `*` for all names.
fn word(path: &str) -> &str {
    let end = path.find(|c: char| !c.is_alphanumeric() && c != '_' && c != '*');
    &path[..end.unwrap_or(path.len())]
}

/// What stands between commas up to the brace that closes a list.
fn listed(list: &str) -> Vec<&str> {
    let (mut level, mut start, mut items) = (1, 0, Vec::new());
    for (at, c) in list.char_indices() {
        level += match c {
            '{' => 1,
            '}' => -1,
            _ => 0,
        };
        if level == 0 || (level == 1 && c == ',') {
            items.push(list[start..at].trim());
            start = at + 1;
        }
        if level == 0 {
            break;
        }
    }
    items
}

/// Which of these modules each of them uses; one with parts uses them all.
fn arrows(codes: &[(String, &str)]) -> BTreeMap<String, BTreeSet<String>> {
    let modules: BTreeSet<&String> = codes.iter().map(|(module, _)| module).collect();
    let known = |path: &[String]| {
        let prefixes = (1..=path.len()).rev().map(|end| path[..end].join("::"));
        prefixes.into_iter().find(|prefix| modules.contains(prefix))
    };
    let of = |(module, code): &(String, &str)| {
        let used = full_paths(code, module);
        let mut used: BTreeSet<String> = used.iter().filter_map(|path| known(path)).collect();
        let is_part = |other: &&&String| {
            let own = other.strip_prefix(module.as_str());
            own.and_then(|own| own.strip_prefix("::"))
                .is_some_and(|own| !own.contains("::"))
        };
        used.extend(modules.iter().filter(is_part).map(|part| (*part).clone()));
        used.remove(module);
        (module.clone(), used)
    };
    codes.iter().map(of).collect()
}

/// The same without what files use of the modules above them: types that stand there.
fn without_ancestors(
    mut arrows: BTreeMap<String, BTreeSet<String>>,
) -> BTreeMap<String, BTreeSet<String>> {
    for (module, used) in &mut arrows {
        used.retain(|other| !module.starts_with(&format!("{other}::")));
    }
    arrows
}

/// The same between the parts of the topmost module.
fn folders(arrows: &BTreeMap<String, BTreeSet<String>>) -> BTreeMap<String, BTreeSet<String>> {
    let folder = |module: &String| {
        let parts: Vec<&str> = module.split("::").take(2).collect();
        parts.join("::")
    };
    let mut all: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
    for (module, used) in arrows {
        let own = all.entry(folder(module)).or_default();
        own.extend(used.iter().map(folder));
        own.remove(&folder(module));
    }
    all
}

/// Paths from the crate's root that follow `crate::` or `super::` in a module, lists spelled out.
fn full_paths(code: &str, module: &str) -> Vec<Vec<String>> {
    let mut paths = Vec::new();
    let starts = |at: usize| {
        let before = &code[..at];
        let inside = before.ends_with(|c: char| c.is_alphanumeric() || "_$:".contains(c));
        !inside && !before.ends_with("(in ")
    };
    for (at, root) in code.match_indices("crate::") {
        if starts(at) {
            spell(&code[at + root.len()..], &[], &mut paths);
        }
    }
    let parts: Vec<String> = module.split("::").map(str::to_owned).collect();
    for (at, _) in code.match_indices("super::") {
        let rest = code[at..].trim_start_matches("super::");
        let up = (code.len() - at - rest.len()) / "super::".len();
        if starts(at) && up <= parts.len() {
            spell(rest, &parts[..parts.len() - up], &mut paths);
        }
    }
    paths
}

/// The paths of a use tree behind `before`.
fn spell(tree: &str, before: &[String], paths: &mut Vec<Vec<String>>) {
    if let Some(list) = tree.strip_prefix('{') {
        listed(list)
            .into_iter()
            .for_each(|tree| spell(tree, before, paths));
        return;
    }
    let name = word(tree);
    let mut path = before.to_vec();
    if name != "self" {
        path.push(name.to_owned());
    }
    match tree[name.len()..].strip_prefix("::") {
        Some(rest) => spell(rest, &path, paths),
        None => paths.push(path),
    }
}

/// A shortest way from a module back to itself, if there is one.
fn circle(arrows: &BTreeMap<String, BTreeSet<String>>) -> Option<Vec<String>> {
    let from = |start: &String| {
        let mut ways = vec![vec![start.clone()]];
        let mut seen = BTreeSet::new();
        while !ways.is_empty() {
            let mut longer = Vec::new();
            for way in ways {
                for next in way.last().and_then(|last| arrows.get(last))? {
                    let way = [&way[..], std::slice::from_ref(next)].concat();
                    if next == start {
                        return Some(way);
                    }
                    if seen.insert(next.clone()) {
                        longer.push(way);
                    }
                }
            }
            ways = longer;
        }
        None
    };
    arrows.keys().filter_map(from).min_by_key(Vec::len)
}

/// Code without its `#[cfg(test)]` items (to the end of their block or their semicolon).
fn without_tests(code: &str) -> String {
    let mut kept = String::new();
    let mut rest = code;
    while let Some(at) = rest.find("#[cfg(test)]") {
        kept.push_str(&rest[..at]);
        let item = &rest[at..];
        let mut level = 0;
        let end = item.char_indices().find(|&(_, c)| {
            level += match c {
                '{' => 1,
                '}' => -1,
                _ => 0,
            };
            level == 0 && (c == '}' || c == ';')
        });
        rest = end.map_or("", |(end, c)| &item[end + c.len_utf8()..]);
    }
    kept + rest
}
