//! The API's document is the one that is committed, and it is whole.
#![cfg(feature = "server")]

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

use serde_json::Value;

fn document() -> Value {
    serde_json::to_value(mapweld::http::openapi()).expect("it serialises")
}

/// `(METHOD path, operation)` of every operation.
fn operations(document: &Value) -> Vec<(String, Value)> {
    let paths = document["paths"].as_object().expect("paths");
    let of_path = |(path, item): (&String, &Value)| {
        let methods = item.as_object().expect("methods").clone();
        let path = path.clone();
        methods
            .into_iter()
            .map(move |(method, operation)| (format!("{} {path}", method.to_uppercase()), operation))
    };
    paths.iter().flat_map(of_path).collect()
}

#[test]
fn the_committed_document_is_the_one_that_the_handlers_make() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("openapi/mapweld.json");
    let committed = fs::read_to_string(&path).expect("openapi/mapweld.json is there");
    let made = mapweld::http::openapi().to_pretty_json().expect("it serialises") + "\n";
    assert!(
        committed == made,
        "openapi/mapweld.json is stale; make it again: cargo run -- openapi > openapi/mapweld.json"
    );
}

#[test]
fn every_handler_that_is_written_is_in_the_table_of_routes() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("src/http");
    let mut written = BTreeSet::new();
    for entry in fs::read_dir(folder).expect("src/http") {
        let path = entry.expect("an entry").path();
        if path.extension().is_none_or(|extension| extension != "rs") {
            continue;
        }
        let text = fs::read_to_string(path).expect("a source file");
        for attribute in text.split("#[utoipa::path(").skip(1) {
            let name = attribute
                .split("operation_id = \"")
                .nth(1)
                .expect("every handler has an id");
            let fresh = written.insert(name.split('"').next().expect("a name").to_owned());
            assert!(fresh, "two handlers have one id: {name}");
        }
    }
    let routed: BTreeSet<String> = operations(&document())
        .iter()
        .map(|(_, operation)| operation["operationId"].as_str().expect("an id").to_owned())
        .collect();
    assert!(
        written.len() > 20,
        "found only {} handlers: the search is broken",
        written.len()
    );
    assert_eq!(written, routed);
}

#[test]
fn every_operation_tells_what_it_is_for_and_how_it_is_refused() {
    let document = document();
    assert!(
        document["openapi"]
            .as_str()
            .is_some_and(|version| version.starts_with("3.1"))
    );
    for (name, operation) in operations(&document) {
        assert!(operation["summary"].is_string(), "{name} has no summary");
        assert!(operation["tags"][0].is_string(), "{name} has no tag");
        let responses = operation["responses"].as_object().expect("responses");
        assert!(
            responses.keys().any(|status| status.starts_with('2')),
            "{name} has no success"
        );
        for (status, response) in responses {
            let refusal = status == "default" || status.starts_with('4') || status.starts_with('5');
            let problem = &response["content"]["application/problem+json"]["schema"]["$ref"];
            assert_eq!(refusal, *problem == "#/components/schemas/Problem", "{name} {status}");
        }
        for parameter in operation["parameters"].as_array().into_iter().flatten() {
            assert!(
                parameter["description"].is_string(),
                "{name}: parameter {} has no description",
                parameter["name"]
            );
        }
    }
}

#[test]
fn every_reference_leads_somewhere_and_every_member_is_described() {
    let document = document();
    let mut references = BTreeSet::new();
    collect(&document, &mut references);
    for reference in references {
        let pointer = reference.strip_prefix('#').expect("a local reference");
        assert!(document.pointer(pointer).is_some(), "{reference} leads nowhere");
    }
    for (name, schema) in document["components"]["schemas"].as_object().expect("schemas") {
        for (member, described) in schema["properties"].as_object().into_iter().flatten() {
            let optional = described["oneOf"].as_array().into_iter().flatten();
            let told = |schema: &Value| schema["description"].is_string() || schema["$ref"].is_string();
            assert!(
                told(described) || optional.clone().any(told),
                "{name}.{member} has no description"
            );
        }
    }
}

fn collect(value: &Value, references: &mut BTreeSet<String>) {
    match value {
        Value::Object(members) => {
            for (name, member) in members {
                match member.as_str() {
                    Some(reference) if name == "$ref" => {
                        references.insert(reference.to_owned());
                    }
                    _ => collect(member, references),
                }
            }
        }
        Value::Array(members) => members.iter().for_each(|member| collect(member, references)),
        _ => {}
    }
}
