//! The page for operators says what the command says.
#![cfg(feature = "server")]

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

use clap::{Args, Command};
use mapweld::config::ServeConfig;

fn page() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/operations.md")
}

/// The table of all settings as the command defines them.
fn table() -> String {
    let command = ServeConfig::augment_args(Command::new("serve"));
    let mut table = "| option | variable | default | what |\n|---|---|---|---|\n".to_owned();
    for argument in command.get_arguments().filter(|argument| !argument.is_hide_set()) {
        let option = argument.get_long().expect("every setting has a long option");
        let variable = argument.get_env().expect("every setting has a variable");
        let variable = variable.to_str().expect("a readable name");
        let defaults: Vec<_> = argument
            .get_default_values()
            .iter()
            .filter_map(|value| value.to_str())
            .collect();
        let default = match defaults[..] {
            ["false"] | [] => String::new(),
            [default] => format!("`{default}`"),
            _ => panic!("--{option} has several defaults"),
        };
        let help = argument.get_help().map(ToString::to_string).unwrap_or_default();
        let help = help.trim().trim_end_matches('.').replace('|', "\\|");
        assert!(!help.is_empty(), "--{option} says nothing of itself");
        writeln!(table, "| `--{option}` | `{variable}` | {default} | {help}. |").expect("memory takes it");
    }
    table
}

/// The table of all that is measured.
fn meters() -> String {
    let mut table = "| metric | kind | labels | what |\n|---|---|---|---|\n".to_owned();
    for meter in mapweld::meters::ALL {
        let labels: Vec<String> = meter.labels.iter().map(|label| format!("`{label}`")).collect();
        let (kind, labels) = (meter.kind.as_str(), labels.join(", "));
        writeln!(table, "| `{}` | {kind} | {labels} | {} |", meter.name, meter.what).expect("memory takes it");
    }
    table
}

#[test]
fn the_tables_of_the_page_are_those_that_the_program_defines() {
    for (name, defined) in [("settings", table()), ("metrics", meters())] {
        let (begin, end) = (format!("<!-- {name}: begin -->\n"), format!("<!-- {name}: end -->"));
        let text = fs::read_to_string(page()).expect("the page is there");
        let (before, rest) = text.split_once(&begin).expect("the table's begin");
        let (written, after) = rest.split_once(&end).expect("the table's end");
        if std::env::var_os("MAPWELD_WRITE_DOCS").is_some() {
            fs::write(page(), format!("{before}{begin}{defined}{end}{after}")).expect("the page can be written");
            continue;
        }
        assert!(
            written == defined,
            "the table of {name} in docs/operations.md is stale; write it anew: \
             MAPWELD_WRITE_DOCS=1 cargo test --test operations\n\n{defined}"
        );
    }
}

#[test]
fn every_metric_that_an_alert_of_the_page_names_is_measured() {
    let text = fs::read_to_string(page()).expect("the page is there");
    let words = text.split(|at: char| !(at.is_ascii_alphanumeric() || at == '_'));
    let named: Vec<&str> = words.filter(|word| word.starts_with("mapweld_")).collect();
    assert!(named.len() > 20, "found only {named:?}");
    for name in named {
        let base = ["_bucket", "_sum", "_count"]
            .iter()
            .find_map(|end| name.strip_suffix(end));
        let known = |name: &str| mapweld::meters::ALL.iter().any(|meter| meter.name == name);
        assert!(known(name) || base.is_some_and(known), "{name} is not measured");
    }
}

#[test]
fn every_variable_has_the_name_of_its_option() {
    let command = ServeConfig::augment_args(Command::new("serve"));
    let mut seen = 0;
    for argument in command.get_arguments() {
        let option = argument
            .get_long()
            .expect("a long option")
            .to_uppercase()
            .replace('-', "_");
        let variable = argument.get_env().and_then(|name| name.to_str()).expect("a variable");
        assert_eq!(variable, format!("MAPWELD_{option}"));
        seen += 1;
    }
    assert!(seen > 15, "found only {seen} settings: the walk is broken");
}
