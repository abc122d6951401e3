//! The two databases have the same tables, columns and constraints, under the same names, each with its sentence.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

#[test]
fn both_databases_have_the_same_tables_columns_and_constraint_names() {
    let (sqlite, postgres) = (files("sqlite"), files("postgres"));
    assert!(!sqlite.is_empty(), "no migrations found: the walk is broken");
    assert_eq!(
        sqlite.keys().collect::<Vec<_>>(),
        postgres.keys().collect::<Vec<_>>(),
        "each migration stands in both folders"
    );
    for (file, text) in &sqlite {
        let (here, there) = (outline(text), outline(&postgres[file]));
        assert!(!here.is_empty(), "{file}: nothing was recognised");
        assert_eq!(here, there, "{file}");
    }
}

#[test]
fn every_table_and_column_has_a_sentence() {
    for folder in ["sqlite", "postgres"] {
        for (file, text) in files(folder) {
            let lines: Vec<&str> = text.lines().map(str::trim).collect();
            for (at, line) in lines.iter().enumerate() {
                if named(line).is_some() && !line.starts_with("CONSTRAINT") {
                    let before = at.checked_sub(1).map_or("", |above| lines[above]);
                    assert!(before.starts_with("-- "), "{folder}/{file}: no sentence above: {line}");
                }
            }
        }
    }
}

#[test]
fn a_difference_would_be_noticed() {
    let one =
        "CREATE TABLE a (\n    -- Its id.\n    id TEXT NOT NULL,\n    CONSTRAINT a_pk PRIMARY KEY (id)\n) STRICT;";
    assert_eq!(outline(one), ["a", "id", "a_pk"]);
    assert_ne!(outline(one), outline(&one.replace("a_pk", "b_pk")));
    assert_ne!(outline(one), outline(&one.replace("id TEXT", "key TEXT")));
}

fn files(folder: &str) -> BTreeMap<String, String> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("migrations").join(folder);
    fs::read_dir(folder)
        .expect("the folder is readable")
        .map(|entry| {
            let entry = entry.expect("an entry");
            let name = entry.file_name().into_string().expect("a readable name");
            (name, fs::read_to_string(entry.path()).expect("the file is readable"))
        })
        .collect()
}

/// The names of tables, columns, constraints and indices, in their order.
fn outline(text: &str) -> Vec<String> {
    text.lines()
        .filter_map(|line| named(line.trim()))
        .map(str::to_owned)
        .collect()
}

/// The name that a line gives to something.
fn named(line: &str) -> Option<&str> {
    let words: Vec<&str> = line.split_whitespace().map(|word| word.trim_end_matches(',')).collect();
    match words[..] {
        ["CREATE", "TABLE" | "INDEX", name, ..]
        | ["CREATE", "UNIQUE", "INDEX", name, ..]
        | ["ALTER", "TABLE", _, "ADD", "COLUMN" | "CONSTRAINT", name, ..]
        | ["ADD", "COLUMN" | "CONSTRAINT", name, ..]
        | ["CONSTRAINT", name, ..]
        | [
            name,
            "TEXT" | "INTEGER" | "REAL" | "BLOB" | "BIGINT" | "DOUBLE" | "BOOLEAN" | "BYTEA",
            ..,
        ] => Some(name),
        _ => None,
    }
}
