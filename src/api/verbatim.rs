//! JSON documents that pass through unread.

use std::borrow::Cow;
use std::marker::PhantomData;

use serde::de::DeserializeOwned;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use serde_json::value::RawValue;
use utoipa::openapi::{RefOr, Schema};
use utoipa::{PartialSchema, ToSchema};

/// A JSON document of type `T`, handed on byte for byte as it was written: its numbers are not read and written again.
#[derive(Debug, Clone)]
pub struct Verbatim<T> {
    text: Box<RawValue>,
    of: PhantomData<fn() -> T>,
}

impl<T> Verbatim<T> {
    /// The document as its text.
    #[must_use]
    pub fn as_str(&self) -> &str {
        self.text.get()
    }

    /// The document of this text, which must hold a `T`.
    #[must_use]
    pub fn new(text: Box<RawValue>) -> Self {
        Self { text, of: PhantomData }
    }
}

impl<T: DeserializeOwned> Verbatim<T> {
    /// The document as its type.
    ///
    /// # Errors
    /// When the text holds no `T`, which another version of mapweld may have written.
    pub fn read(&self) -> Result<T, serde_json::Error> {
        serde_json::from_str(self.as_str())
    }
}

impl<T> Serialize for Verbatim<T> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.text.serialize(serializer)
    }
}

impl<'de, T> Deserialize<'de> for Verbatim<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        Box::deserialize(deserializer).map(Self::new)
    }
}

impl<T: PartialSchema> PartialSchema for Verbatim<T> {
    fn schema() -> RefOr<Schema> {
        T::schema()
    }
}

impl<T: ToSchema> ToSchema for Verbatim<T> {
    fn name() -> Cow<'static, str> {
        T::name()
    }

    fn schemas(schemas: &mut Vec<(String, RefOr<Schema>)>) {
        T::schemas(schemas);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_verbatim_document_keeps_its_bytes_and_can_be_read() {
        let text = "[1.0,0.1000,2e0]";
        let document: Verbatim<Vec<f64>> = serde_json::from_str(text).expect("JSON");
        assert_eq!(serde_json::to_string(&document).expect("serialises"), text);
        assert_eq!(document.read().expect("numbers").len(), 3);
    }
}
