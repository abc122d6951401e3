//! multipart/form-data bodies.

use axum::body::Body;
use axum::extract::{FromRequest, Multipart, Request};
use axum::http::header;
use bytes::Bytes;

use crate::api::{FieldError, ProblemCode};
use crate::http::error::{ApiError, ApiResult};

/// The most parts that a body may have.
const PARTS_MAX: usize = 256;

/// One part of a multipart body.
#[derive(Debug, Clone)]
pub(in crate::http) struct Part {
    /// Its name.
    pub(in crate::http) name: String,
    /// The name of the file that it was made from.
    pub(in crate::http) file_name: Option<String>,
    /// What it holds.
    pub(in crate::http) bytes: Bytes,
}

/// The parts of a body that is already in memory, in their order.
pub(in crate::http) async fn read_parts(content_type: &str, bytes: Bytes) -> ApiResult<Vec<Part>> {
    let request = Request::builder()
        .header(header::CONTENT_TYPE, content_type)
        .body(Body::from(bytes))
        .map_err(|error| malformed(&error.to_string()))?;
    let mut request = request;
    axum::extract::DefaultBodyLimit::disable().apply(&mut request); // the body's length has been looked at
    let mut multipart = Multipart::from_request(request, &())
        .await
        .map_err(|rejection| malformed(&rejection.body_text()))?;
    let mut parts = Vec::new();
    while let Some(field) = multipart
        .next_field()
        .await
        .map_err(|error| malformed(&error.body_text()))?
    {
        if parts.len() == PARTS_MAX {
            return Err(malformed(&format!("it has more than {PARTS_MAX} parts")));
        }
        let (name, file_name) = (field.name().map(str::to_owned), field.file_name().map(str::to_owned));
        let bytes = field.bytes().await.map_err(|error| malformed(&error.body_text()))?;
        parts.push(Part {
            name: name.ok_or_else(|| malformed("a part has no name"))?,
            file_name,
            bytes,
        });
    }
    Ok(parts)
}

fn malformed(reason: &str) -> ApiError {
    ApiError::new(ProblemCode::MalformedMultipart, reason).field(FieldError::missing(
        "body",
        "multipart/form-data with a boundary (RFC 7578)",
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    const BODY: &str = "--x\r\nContent-Disposition: form-data; name=\"map\"; filename=\"a.yaml\"\r\n\r\nimage: a.pgm\r\n\
                        --x\r\nContent-Disposition: form-data; name=\"image\"\r\n\r\nP5\r\n--x--\r\n";

    #[tokio::test]
    async fn parts_come_with_their_names_in_their_order() {
        let parts = read_parts("multipart/form-data; boundary=x", Bytes::from_static(BODY.as_bytes()))
            .await
            .expect("two parts");
        assert_eq!(
            (parts[0].name.as_str(), parts[0].file_name.as_deref()),
            ("map", Some("a.yaml"))
        );
        assert_eq!((parts[1].name.as_str(), &parts[1].bytes[..]), ("image", &b"P5"[..]));
    }

    #[tokio::test]
    async fn a_body_that_is_cut_off_or_has_no_boundary_is_refused() {
        let cut = Bytes::from_static(&BODY.as_bytes()[..60]);
        assert!(read_parts("multipart/form-data; boundary=x", cut).await.is_err());
        assert!(read_parts("multipart/form-data", Bytes::new()).await.is_err());
    }
}
