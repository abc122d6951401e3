//! One package has no crate walls, so the walls are tested: who may import whom (the table in `src/lib.rs`), and what a
//! pure room may not touch.

use std::fs;
use std::path::{Path, PathBuf};

/// A room and the rooms that it may import. A room stands below all that it imports, so there is no cycle.
const ARROWS: &[(&str, &[&str])] = &[
    ("geometry", &[]),
    ("grid", &["geometry"]),
    ("random", &[]),
    ("registration", &["geometry", "grid", "random"]),
    ("fusion", &["geometry", "grid", "registration"]),
    ("codec", &["geometry", "grid"]),
    ("simulation", &["geometry", "grid", "random"]),
    (
        "experiments",
        &["geometry", "grid", "registration", "fusion", "simulation"],
    ),
    ("model", &["geometry", "grid", "registration"]),
    ("api", &["geometry", "grid", "registration", "fusion", "codec", "model"]),
    ("clock", &[]),
    ("client", &["geometry", "grid", "codec", "model", "api", "clock"]),
    ("telemetry", &["model"]),
    ("compute", &["registration", "clock"]),
    ("failpoint", &[]),
    ("meters", &[]),
    (
        "store",
        &[
            "geometry",
            "grid",
            "registration",
            "model",
            "clock",
            "failpoint",
            "meters",
        ],
    ),
    (
        "worker",
        &[
            "geometry",
            "grid",
            "registration",
            "fusion",
            "codec",
            "model",
            "api",
            "clock",
            "compute",
            "failpoint",
            "meters",
            "telemetry",
            "store",
        ],
    ),
    ("web", &[]),
    ("config", &["codec", "failpoint"]),
    (
        "http",
        &[
            "geometry",
            "grid",
            "registration",
            "fusion",
            "codec",
            "model",
            "api",
            "clock",
            "compute",
            "failpoint",
            "meters",
            "telemetry",
            "store",
            "web",
            "config",
        ],
    ),
];

/// Rooms that see everything.
const OPEN: &[&str] = &["cli", "main", "lib"];

/// Values in, values out: what these rooms may not name.
const PURE: &[&str] = &[
    "geometry",
    "grid",
    "random",
    "registration",
    "fusion",
    "codec",
    "simulation",
    "experiments",
    "model",
    "api",
];
const IMPURE: &[&str] = &[
    "std::fs",
    "std::net",
    "std::env",
    "std::process",
    "std::thread",
    "std::time::Instant",
    "std::time::SystemTime",
    "tokio",
    "axum",
    "sqlx",
    "reqwest",
    "object_store",
    "tracing",
];

#[test]
fn every_import_follows_an_arrow() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut files = Vec::new();
    collect(&root, &mut files);
    assert!(
        files.len() > 20,
        "found only {} source files: the walk is broken",
        files.len()
    );
    let mut broken = Vec::new();
    for file in &files {
        let text = fs::read_to_string(file).expect("a source file is readable");
        let relative = file.strip_prefix(&root).expect("inside src");
        broken.extend(violations(relative, &text));
    }
    assert!(broken.is_empty(), "imports against the arrows:\n{}", broken.join("\n"));
}

#[test]
fn every_room_of_the_table_exists_and_every_folder_has_a_row() {
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let table: Vec<&str> = ARROWS
        .iter()
        .map(|(room, _)| *room)
        .chain(OPEN.iter().copied())
        .collect();
    for entry in fs::read_dir(&source).expect("src is readable") {
        let name = entry
            .expect("an entry")
            .file_name()
            .into_string()
            .expect("a readable name");
        let room = name.trim_end_matches(".rs");
        assert!(table.contains(&room), "src/{name} has no row in the table of rooms");
    }
    for row in table {
        let stands = source.join(row).is_dir() || source.join(format!("{row}.rs")).is_file();
        assert!(stands, "the table names room {row}, but there is none");
    }
}

#[test]
fn the_arrows_have_no_cycle() {
    for (at, (room, imports)) in ARROWS.iter().enumerate() {
        for import in *imports {
            let above = ARROWS[..at].iter().any(|(name, _)| name == import);
            assert!(
                above,
                "{room} imports {import}, which does not stand above it in the table"
            );
        }
    }
}

#[test]
fn a_forbidden_import_is_noticed() {
    let bad = |file: &str, text: &str| assert!(!violations(Path::new(file), text).is_empty(), "{file}: {text}");
    bad("grid/mod.rs", "use crate::registration::Method;");
    bad("http/maps.rs", "use crate::worker::Worker;");
    bad("worker/mod.rs", "use crate::{store::Store, http::Api};");
    bad(
        "worker/mod.rs",
        "use crate::{\n    model::{JobId, SessionId},\n    http::Api,\n};",
    );
    bad("client/mod.rs", "fn f() { crate::store::open() }");
    bad("client/spool.rs", "use super::super::store::Blobs;");
    bad("fusion/mod.rs", "let t = std::time::Instant::now();");
    bad("codec/image.rs", "use tokio::fs;");
    bad("codec/image.rs", "let x = '\"'; use tokio::fs;");
    bad("attic/mod.rs", "use crate::grid::Lattice;");
}

#[test]
fn what_follows_the_arrows_is_let_through() {
    let good = |file: &str, text: &str| assert_eq!(violations(Path::new(file), text), Vec::<String>::new());
    good(
        "grid/mod.rs",
        "use crate::geometry::Pose2; // crate::http would be wrong",
    );
    good(
        "grid/mod.rs",
        "//! [`crate::registration`] uses this\nlet s = \"crate::http::x\";",
    );
    good("http/maps.rs", "use crate::{api::Problem, store::{Store, Added}};");
    good("cli/serve.rs", "use crate::{http, worker};");
    good(
        "registration/methods/hough/mod.rs",
        "use super::super::Control; use crate::grid::Lattice;",
    );
    good(
        "grid/lattice.rs",
        "#[cfg(test)]\nmod tests { mod deep { use super::super::Lattice; } }",
    );
    good("store/sqlite.rs", "use sqlx::Row; use std::fs::File;");
}

fn collect(folder: &Path, files: &mut Vec<PathBuf>) {
    let entries = fs::read_dir(folder).expect("a source folder");
    let mut paths: Vec<_> = entries.map(|entry| entry.expect("an entry").path()).collect();
    paths.sort();
    for path in paths {
        if path.is_dir() {
            collect(&path, files);
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            files.push(path);
        }
    }
}

/// What a file of `src` imports against the arrows, one sentence each.
fn violations(file: &Path, text: &str) -> Vec<String> {
    let parts: Vec<&str> = file
        .iter()
        .map(|part| part.to_str().expect("a readable path"))
        .collect();
    let room = parts[0].trim_end_matches(".rs");
    if OPEN.contains(&room) {
        return Vec::new();
    }
    let Some((_, allowed)) = ARROWS.iter().find(|(name, _)| *name == room) else {
        return vec![format!("{}: room {room} has no row in the table", file.display())];
    };
    // Unit tests may use what they like to make their examples.
    let code = without_comments_and_strings(text);
    let code = code.split("#[cfg(test)]").next().unwrap_or_default();
    let mut found = Vec::new();
    for target in crate_paths(code) {
        if target != room && !allowed.contains(&target.as_str()) {
            found.push(format!("{}: {room} may not import {target}", file.display()));
        }
    }
    // How many `super` lead to the crate's root: `grid` is one below it, `grid::lattice` two.
    let depth = parts.len() - usize::from(parts.len() > 1 && parts.last() == Some(&"mod.rs"));
    if code.contains(&"super::".repeat(depth)) {
        found.push(format!("{}: climbs out of {room} by super", file.display()));
    }
    if PURE.contains(&room) {
        for name in IMPURE {
            if names(code, name) {
                found.push(format!("{}: the pure room {room} may not name {name}", file.display()));
            }
        }
    }
    found
}

/// The first segments of all paths that begin at the crate's root, also from inside braces: `crate::{a::X, b}`.
fn crate_paths(code: &str) -> Vec<String> {
    let mut targets = Vec::new();
    for (at, root) in code.match_indices("crate::") {
        if code[..at].ends_with(is_word) {
            continue;
        }
        let rest = &code[at + root.len()..];
        let Some(group) = rest.trim_start().strip_prefix('{') else {
            targets.push(identifier(rest));
            continue;
        };
        let (mut depth, mut begins) = (1, true);
        for (i, c) in group.char_indices() {
            match c {
                '{' => depth += 1,
                '}' => depth -= 1,
                ',' if depth == 1 => begins = true,
                c if begins && depth == 1 && is_word(c) => {
                    targets.push(identifier(&group[i..]));
                    begins = false;
                }
                _ => {}
            }
            if depth == 0 {
                break;
            }
        }
    }
    targets
}

fn is_word(c: char) -> bool {
    c.is_alphanumeric() || c == '_'
}

fn identifier(text: &str) -> String {
    text.chars().take_while(|c| is_word(*c)).collect()
}

/// Whether a path stands in the code as a whole: `tokio::` or `use tokio;`, not `my_tokio` nor `a.tokio`.
fn names(code: &str, path: &str) -> bool {
    code.match_indices(path).any(|(at, _)| {
        let before = code[..at].chars().next_back();
        let after = &code[at + path.len()..];
        let begins = !before.is_some_and(|c| is_word(c) || c == ':' || c == '.');
        let ends = if path.contains("::") {
            !after.starts_with(is_word)
        } else {
            after.starts_with("::") || after.starts_with(';')
        };
        begins && ends
    })
}

fn without_comments_and_strings(text: &str) -> String {
    let mut code = String::with_capacity(text.len());
    let mut chars = text.chars().peekable();
    while let Some(c) = chars.next() {
        match c {
            '/' if chars.peek() == Some(&'/') => {
                chars.by_ref().take_while(|c| *c != '\n').for_each(drop);
                code.push('\n');
            }
            '/' if chars.peek() == Some(&'*') => {
                let mut before = ' ';
                for c in chars.by_ref().skip(1) {
                    if before == '*' && c == '/' {
                        break;
                    }
                    before = c;
                }
            }
            '"' => {
                while let Some(c) = chars.next() {
                    if c == '\\' {
                        chars.next();
                    } else if c == '"' {
                        break;
                    }
                }
                code.push_str("\"\"");
            }
            // A quote or a backslash as a character: not the start of a string.
            '\'' if matches!(chars.peek(), Some('"' | '\\')) => {
                if chars.next() == Some('\\') {
                    chars.next();
                }
                code.push_str("' ");
            }
            c => code.push(c),
        }
    }
    code
}
