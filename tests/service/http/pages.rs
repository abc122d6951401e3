//! What people look at: the page, the document, the health of the server.

use reqwest::StatusCode;

use super::rooms::{Files, scrap};
use super::server::TestServer;

#[tokio::test]
async fn the_page_and_the_documents_page_come_whole_from_the_server_itself() {
    let server = TestServer::start(&["--workers", "0"]);
    let paths = [
        ("/", "text/html"),
        ("/assets/page.css", "text/css"),
        ("/assets/page.js", "text/javascript"),
        ("/assets/icon.svg", "image/svg+xml"),
        ("/docs/", "text/html"),
        ("/docs/swagger-ui-bundle.js", "text/javascript"),
        ("/docs/swagger-initializer.js", "text/javascript"),
        ("/openapi.json", "application/json"),
    ];
    for (path, media_type) in paths {
        let answer = server.get(path).send().await.expect("an answer");
        assert_eq!(answer.status(), StatusCode::OK, "{path}");
        let headers = answer.headers();
        let told = headers["content-type"].to_str().expect("text");
        assert!(told.starts_with(media_type), "{path}: {told}");
        assert_eq!(headers["x-content-type-options"], "nosniff");
        let policy = headers["content-security-policy"].to_str().expect("text");
        assert!(policy.contains("default-src 'none'"), "{path}: {policy}");
        assert!(!policy.contains("http:") && !policy.contains("https:") && !policy.contains("unsafe-eval"));
    }
}

#[tokio::test]
async fn a_server_is_alive_and_ready_and_tells_its_methods() {
    let server = TestServer::start(&["--workers", "0"]);
    server.push("hall", "r1", &Files::of("m", &scrap(1))).await;
    let alive: serde_json::Value = server.read("/livez").await;
    assert_eq!(alive["version"], env!("CARGO_PKG_VERSION"));
    let ready: serde_json::Value = server.read("/readyz").await;
    assert_eq!(ready["queued"], 1);
    let methods: serde_json::Value = server.read("/v1/methods").await;
    assert_eq!(methods["methods"][0]["default"], true);
    assert!(methods["methods"][0]["parameters"].is_object());
}
