//! Where the code departs from the paper: told on the line that departs, and on the page "What we found in the paper".

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

/// How the comment on a departing line begins.
const DEPARTS: &str = "// Departs from ";

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// The files of the room `registration` that depart somewhere, relative to `src/registration`.
fn departing() -> BTreeSet<PathBuf> {
    fn walk(folder: &Path, found: &mut Vec<PathBuf>) {
        for entry in fs::read_dir(folder).expect("a source folder") {
            let path = entry.expect("an entry").path();
            if path.is_dir() {
                walk(&path, found);
            } else if fs::read_to_string(&path).is_ok_and(|text| text.contains(DEPARTS)) {
                found.push(path);
            }
        }
    }
    let room = root().join("src/registration");
    let mut found = Vec::new();
    walk(&room, &mut found);
    let within = |path: PathBuf| path.strip_prefix(&room).expect("inside the room").to_owned();
    found.into_iter().map(within).collect()
}

/// The files that the page links to.
fn told() -> BTreeSet<PathBuf> {
    let page = fs::read_to_string(root().join("docs/paper.md")).expect("the page is there");
    let links = page.split("]: ../src/registration/").skip(1);
    links
        .filter_map(|rest| rest.lines().next())
        .map(PathBuf::from)
        .collect()
}

#[test]
fn every_departure_from_the_paper_is_told_on_its_line_and_on_the_page() {
    let (departing, told) = (departing(), told());
    assert!(departing.len() > 5, "found only {departing:?}");
    assert_eq!(
        departing, told,
        "left: files with a line `{DEPARTS}...`; right: files that docs/paper.md links to"
    );
}
