//! The page that shows all outcomes: one HTML file that links the pictures and tables beside it and needs nothing else.

use std::fmt::Write as _;

use super::outcome::{Outcome, Table, Verdict};

/// One experiment on the page: its outcome, and how long it took in seconds.
#[derive(Debug, Clone, PartialEq)]
pub struct Entry {
    /// What came out.
    pub outcome: Outcome,
    /// Seconds.
    pub seconds: f64,
}

/// Where the files of an experiment lie, relative to the page: its pictures and tables.
#[must_use]
pub fn file_of(outcome: &Outcome, name: &str, ending: &str) -> String {
    format!("{}/{name}.{ending}", outcome.name)
}

/// All files that the page links, relative to it.
#[must_use]
pub fn files_of(outcome: &Outcome) -> Vec<String> {
    let figures = outcome
        .figures
        .iter()
        .flat_map(|figure| ["png", "svg"].map(|ending| (&figure.name, ending)));
    let tables = outcome.tables.iter().map(|table| (&table.name, "csv"));
    let mut files: Vec<String> = figures
        .chain(tables)
        .map(|(name, ending)| file_of(outcome, name, ending))
        .collect();
    files.push(file_of(outcome, "outcome", "json"));
    files
}

/// The page. `settings` tells how the experiments were run.
#[must_use]
pub fn page(entries: &[Entry], settings: &str) -> String {
    let mut html = String::from(HEAD);
    put(&mut html, format_args!("<p>{}</p>\n", escaped(settings)));
    html += &contents(entries);
    for entry in entries {
        html += &section(entry);
    }
    html += "</body>\n</html>\n";
    html
}

const HEAD: &str = r#"<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>mapweld: the paper's experiments</title>
<style>
body { font: 16px/1.45 system-ui, sans-serif; margin: 2rem auto; max-width: 76rem; padding: 0 1rem; color: #222; }
h1, h2, h3 { line-height: 1.2; }
h2 { border-top: 1px solid #ccc; margin-top: 2.5rem; padding-top: 1rem; }
table { border-collapse: collapse; font-size: 0.9rem; margin: 0.5rem 0 1rem; }
th, td { border: 1px solid #ccc; padding: 0.25rem 0.5rem; text-align: left; vertical-align: top; }
td.number { text-align: right; font-variant-numeric: tabular-nums; }
th { background: #f2f2f2; }
.holds { background: #dff2e3; } .in-part { background: #fdf1d3; } .fails { background: #fbe0dc; }
figure { margin: 1rem 0; } img { max-width: 100%; height: auto; border: 1px solid #ddd; }
figcaption, caption { color: #444; font-size: 0.9rem; text-align: left; padding: 0.25rem 0; }
.wide { overflow-x: auto; }
</style>
</head>
<body>
<h1>The paper's experiments</h1>
<p>S. Saeedi, L. Paull, M. Trentini, M. Seto, H. Li: <i>Map merging for multiple robots using Hough peak matching</i>,
rebuilt by simulation. Its recorded data are not at hand, so absolute values compare in kind only. Statements that begin
with &quot;Ours&quot; are not the paper's.</p>
"#;

/// Writing to a string cannot fail.
fn put(html: &mut String, text: std::fmt::Arguments<'_>) {
    html.write_fmt(text).expect("invariant: a string takes every letter");
}

fn contents(entries: &[Entry]) -> String {
    let mut html = String::from(
        "<table>\n<thead><tr><th>experiment</th><th>claims that hold</th><th>in part</th><th>do not</th><th>time</th></tr></thead>\n",
    );
    for entry in entries {
        let count = |verdict| {
            entry
                .outcome
                .claims
                .iter()
                .filter(|claim| claim.verdict == verdict)
                .count()
        };
        let counts = [Verdict::Holds, Verdict::InPart, Verdict::Fails].map(count);
        put(
            &mut html,
            format_args!(
                "<tr><td><a href=\"#{name}\">{title}</a></td><td class=\"number\">{}</td><td class=\"number\">{}</td>\
                 <td class=\"number\">{}</td><td class=\"number\">{:.1} s</td></tr>\n",
                counts[0],
                counts[1],
                counts[2],
                entry.seconds,
                name = entry.outcome.name,
                title = escaped(entry.outcome.name.title()),
            ),
        );
    }
    html + "</table>\n"
}

fn section(entry: &Entry) -> String {
    let outcome = &entry.outcome;
    let mut html = String::new();
    put(
        &mut html,
        format_args!(
            "<section id=\"{name}\">\n<h2>{}</h2>\n<p>{}</p>\n<p><code>mapweld experiments {name} --out FOLDER</code>, \
             {:.1} s. <a href=\"{}\">All values as JSON</a></p>\n",
            escaped(outcome.name.title()),
            escaped(&outcome.method),
            entry.seconds,
            file_of(outcome, "outcome", "json"),
            name = outcome.name,
        ),
    );
    html += "<table>\n<thead><tr><th>claim</th><th>the paper</th><th>here</th><th></th></tr></thead>\n";
    for claim in &outcome.claims {
        let class = match claim.verdict {
            Verdict::Holds => "holds",
            Verdict::InPart => "in-part",
            Verdict::Fails => "fails",
        };
        put(
            &mut html,
            format_args!(
                "<tr><td>{}</td><td>{}</td><td>{}</td><td class=\"{class}\">{}</td></tr>\n",
                escaped(&claim.claim),
                escaped(&claim.paper),
                escaped(&claim.ours),
                claim.verdict.words(),
            ),
        );
    }
    html += "</table>\n";
    for figure in &outcome.figures {
        let [png, svg] = ["png", "svg"].map(|ending| file_of(outcome, &figure.name, ending));
        put(
            &mut html,
            format_args!(
                "<figure><a href=\"{svg}\"><img src=\"{png}\" alt=\"{alt}\" loading=\"lazy\"></a>\
                 <figcaption>{caption} <a href=\"{png}\">PNG</a> <a href=\"{svg}\">SVG</a></figcaption></figure>\n",
                alt = escaped(&figure.name),
                caption = escaped(&figure.caption),
            ),
        );
    }
    for table in &outcome.tables {
        html += &table_of(table, &file_of(outcome, &table.name, "csv"));
    }
    html + "</section>\n"
}

fn table_of(table: &Table, csv: &str) -> String {
    let mut html = String::new();
    put(
        &mut html,
        format_args!(
            "<div class=\"wide\"><table>\n<caption>{} <a href=\"{csv}\">CSV</a></caption>\n<thead><tr>",
            escaped(&table.caption)
        ),
    );
    for column in &table.columns {
        put(&mut html, format_args!("<th>{}</th>", escaped(column)));
    }
    html += "</tr></thead>\n";
    for row in &table.rows {
        html += "<tr>";
        for cell in row {
            let class = if cell.is_number() { " class=\"number\"" } else { "" };
            put(&mut html, format_args!("<td{class}>{}</td>", escaped(&cell.shown())));
        }
        html += "</tr>\n";
    }
    html + "</table></div>\n"
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
        .replace('"', "&quot;")
}
