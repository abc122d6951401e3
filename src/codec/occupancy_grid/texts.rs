//! The lengths of a message's texts, looked at before it is read.
//!
//! What stands where another kind of value belongs is quoted by the reader's error, a name becomes part of a path, and a
//! text with escapes is unfolded: copies as long as the text, of which a hostile message could make several of a whole body
//! each. Only the cells in base64 have a reason to be long, and are read where they lie.

use memchr::{memchr, memchr2};

use super::CodecError;

/// The longest text, name or value: far more than any that means something, and little to copy.
const TEXT_MAX: usize = 1 << 20;
/// The name of the value that may be longer.
const CELLS: &[u8] = b"data";

/// Refuses a text that is longer than [`TEXT_MAX`] bytes, unless it is the cells in base64 and has no escapes. Whether the
/// message is JSON otherwise is not looked at.
///
/// Time: a pass over the bytes.
pub(super) fn check(json: &[u8]) -> Result<(), CodecError> {
    let mut at = 0;
    let mut named = false;
    while let Some(quote) = memchr(b'"', &json[at..]) {
        let start = at + quote + 1;
        let (end, escaped) = end_of(json, start);
        let length = end - start;
        let is_cells = named && json[at..start - 1].iter().all(|byte| b": \t\r\n".contains(byte));
        if length > TEXT_MAX && (escaped || !is_cells) {
            let expected = format!("at most {TEXT_MAX} bytes long, unless it is the base64 of data, without escapes");
            return Err(CodecError::bad_field(
                "a text",
                format_args!("{length} bytes long at byte {start}"),
                expected,
            ));
        }
        named = &json[start..end] == CELLS;
        at = (end + 1).min(json.len());
    }
    Ok(())
}

/// Where the text that begins here ends: at its quote, or with the bytes; and whether it has escapes.
fn end_of(json: &[u8], start: usize) -> (usize, bool) {
    let (mut at, mut escaped) = (start, false);
    while let Some(found) = json.get(at..).and_then(|rest| memchr2(b'"', b'\\', rest)) {
        at += found;
        if json[at] == b'"' {
            return (at, escaped);
        }
        escaped = true;
        at += 2;
    }
    (json.len(), escaped)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn long(byte: &str) -> String {
        byte.repeat(TEXT_MAX + 1)
    }

    #[test]
    fn only_the_cells_may_be_long_and_only_without_escapes() {
        let (x, folded) = (long("x"), long("\\/"));
        for json in [
            format!("\"{x}\""),
            format!("\"{x}"),
            format!("{{\"info\": \"{x}\"}}"),
            format!("{{\"{x}\": 1}}"),
            format!("{{\"data\": \"{folded}\"}}"),
            format!("{{\"data\": [\"{x}\"]}}"),
            format!("{{\"data\": 1, \"{x}\": 1}}"),
            format!("{{\"a\": \"\\\\\", \"b\": \"{x}\"}}"),
        ] {
            let error = check(json.as_bytes()).expect_err(&json[..30]).to_string();
            assert!(error.contains("1048576"), "{error}");
            assert!(error.len() < 300, "{error}");
        }
        check(format!("{{\"data\" :\n \"{x}\"}}").as_bytes()).expect("cells in base64");
        check(format!("{{\"note\": \"{}\"}}", &x[1..]).as_bytes()).expect("as long as may be");
    }

    #[test]
    fn quotes_that_are_escaped_end_no_text() {
        let json = br#"{"a": "b\"c\\", "d": ["", "e"]}"#;
        let mut texts = Vec::new();
        let mut at = 0;
        while let Some(quote) = memchr(b'"', &json[at..]) {
            let (end, _) = end_of(json, at + quote + 1);
            texts.push(std::str::from_utf8(&json[at + quote + 1..end]).expect("ASCII"));
            at = end + 1;
        }
        assert_eq!(texts, ["a", r#"b\"c\\"#, "d", "", "e"]);
    }

    proptest! {
        #[test]
        fn no_bytes_make_it_panic(bytes in prop::collection::vec(prop::sample::select(b"\"\\a:{}[]".to_vec()), 0..60)) {
            check(&bytes).expect("all is short");
        }
    }
}
