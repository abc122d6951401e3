//! Encrypted connections.

use std::fs;

use reqwest::{Certificate, Client, StatusCode};

use super::command::{Folder, mapweld};
use super::rooms::scrap;
use super::server::{TestServer, command};

/// A certificate for this machine that vouches for itself, and its key, as files: `(certificate, key)`.
fn certificate(folder: &Folder, name: &str) -> (String, String) {
    let names = vec!["127.0.0.1".to_owned(), "localhost".to_owned()];
    let made = rcgen::generate_simple_self_signed(names).expect("a certificate");
    let path = |ending: &str| folder.path(&format!("{name}.{ending}"));
    fs::write(path("crt"), made.cert.pem()).expect("it is written");
    fs::write(path("key"), made.signing_key.serialize_pem()).expect("it is written");
    (path("crt").display().to_string(), path("key").display().to_string())
}

#[tokio::test]
async fn a_server_with_a_certificate_speaks_to_those_who_trust_it_and_to_nobody_in_the_clear() {
    let folder = Folder::new();
    let (certificate, key) = certificate(&folder, "server");
    let server = TestServer::start(&["--workers", "0", "--tls-cert", &certificate, "--tls-key", &key]);
    let url = server.url("/livez");
    assert!(url.starts_with("https://"), "{url}");
    let trusted = Certificate::from_pem(&fs::read(&certificate).expect("a file")).expect("a certificate");
    let http = Client::builder().tls_certs_only([trusted]).build().expect("a client");
    let answer = http.get(&url).send().await.expect("an answer");
    assert_eq!(answer.status(), StatusCode::OK);
    assert!(Client::new().get(&url).send().await.is_err(), "nobody vouches for it");
    let clear = url.replace("https://", "http://");
    assert!(http.get(clear).send().await.is_err(), "in the clear");

    let map = folder.map("m.yaml", &scrap(1));
    let server_url = server.url("");
    let push = [
        "push",
        &map,
        "--server",
        &server_url,
        "--session",
        "hall",
        "--robot",
        "r1",
        "--retry-for",
        "20",
    ];
    let push = [&push[..], &["--ca", &certificate]]
        .concat()
        .into_iter()
        .map(str::to_owned);
    let push: Vec<String> = push.collect();
    let pushed = tokio::task::spawn_blocking(move || mapweld(&push.iter().map(String::as_str).collect::<Vec<_>>()));
    let pushed = pushed.await.expect("no panic");
    assert!(pushed.status.success(), "{}", String::from_utf8_lossy(&pushed.stderr));
}

#[test]
fn a_certificate_that_is_none_or_goes_with_another_key_is_refused_by_its_file() {
    let folder = Folder::new();
    let (certificate_1, key_1) = certificate(&folder, "one");
    let (_, key_2) = certificate(&folder, "two");
    let missing = folder.path("missing.crt").display().to_string();
    for (certificate, key, told) in [
        (&certificate_1, &key_2, "one.crt"),
        (&key_1, &key_1, "one.key"),
        (&certificate_1, &certificate_1, "one.crt"),
        (&missing, &key_1, "missing.crt"),
    ] {
        let data = folder.path("data");
        let refused = command(&data, &["--tls-cert", certificate, "--tls-key", key]).output();
        let refused = refused.expect("the binary runs");
        let errors = String::from_utf8_lossy(&refused.stderr).into_owned();
        assert_eq!(refused.status.code(), Some(2), "{errors}");
        assert!(errors.contains(told) && !errors.contains("PRIVATE KEY"), "{errors}");
    }
}
