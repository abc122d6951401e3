//! What sessions are sorted by: labels, and the filter that asks for them.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use utoipa::openapi::{ObjectBuilder, RefOr, Schema, Type};
use utoipa::{PartialSchema, ToSchema};

use super::Invalid;
use super::text::{PLAIN, is_plain};

/// Labels by name: at most [`Labels::COUNT_MAX`]; names of 1 to [`Labels::CHARS_MAX`] characters, values of at most as
/// many, no control characters.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "BTreeMap<String, String>", into = "BTreeMap<String, String>")]
pub struct Labels(BTreeMap<String, String>);

impl PartialSchema for Labels {
    fn schema() -> RefOr<Schema> {
        let text = |least| {
            ObjectBuilder::new()
                .schema_type(Type::String)
                .min_length(Some(least))
                .max_length(Some(Self::CHARS_MAX))
                .pattern(Some(PLAIN))
        };
        let labels = ObjectBuilder::new()
            .schema_type(Type::Object)
            .description(Some("Labels by name, none with control characters."))
            .property_names(Some(text(1)))
            .additional_properties(Some(Schema::from(text(0))))
            .max_properties(Some(Self::COUNT_MAX));
        labels.into()
    }
}

impl ToSchema for Labels {}

impl Labels {
    /// The most labels of a session.
    pub const COUNT_MAX: usize = 32;
    /// The most characters of a label's name, and of its value.
    pub const CHARS_MAX: usize = 100;

    /// The labels, if they are allowed.
    ///
    /// # Errors
    /// [`Invalid`] names the label and the limit.
    pub fn parse(labels: BTreeMap<String, String>) -> Result<Self, Invalid> {
        if labels.len() > Self::COUNT_MAX {
            let limit = format!("at most {} labels", Self::COUNT_MAX);
            return Err(Invalid::new("labels", &labels.len().to_string(), limit));
        }
        let good = |text: &str| is_plain(text, Self::CHARS_MAX);
        match labels
            .iter()
            .find(|(name, value)| name.is_empty() || !good(name) || !good(value))
        {
            None => Ok(Self(labels)),
            Some((name, value)) => {
                let limit = format!(
                    "names of 1 to {max} and values of at most {max} characters without control characters",
                    max = Self::CHARS_MAX
                );
                Err(Invalid::new("labels", &format!("{name}={value}"), limit))
            }
        }
    }

    /// The labels by name.
    #[must_use]
    pub fn as_map(&self) -> &BTreeMap<String, String> {
        &self.0
    }
}

impl TryFrom<BTreeMap<String, String>> for Labels {
    type Error = Invalid;
    fn try_from(labels: BTreeMap<String, String>) -> Result<Self, Invalid> {
        Self::parse(labels)
    }
}

impl From<Labels> for BTreeMap<String, String> {
    fn from(labels: Labels) -> Self {
        labels.0
    }
}

/// Which sessions are asked for, by their labels: those that have all of these, with this value where one is said.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize)]
#[serde(transparent)]
pub struct LabelFilter(BTreeMap<String, Option<String>>);

impl LabelFilter {
    /// A filter of texts `NAME=VALUE`, split at the first `=`, or `NAME`.
    ///
    /// # Errors
    /// [`Invalid`] names the text that is no label, or that asks for another value of a name that was there before.
    pub fn parse<'a>(texts: impl IntoIterator<Item = &'a str>) -> Result<Self, Invalid> {
        let mut wanted = BTreeMap::new();
        for text in texts {
            let (name, value) = match text.split_once('=') {
                Some((name, value)) => (name, Some(value)),
                None => (text, None),
            };
            let good = |text: &str| is_plain(text, Labels::CHARS_MAX);
            if name.is_empty() || !good(name) || !value.is_none_or(good) {
                let limit = format!("NAME or NAME=VALUE of at most {} characters each", Labels::CHARS_MAX);
                return Err(Invalid::new("label", text, limit));
            }
            let before = wanted.insert(name.to_owned(), value.map(str::to_owned));
            if before.is_some() {
                return Err(Invalid::new(
                    "label",
                    text,
                    "of another name than the other labels that are asked for",
                ));
            }
            if wanted.len() > Labels::COUNT_MAX {
                let limit = format!("one of at most {} labels", Labels::COUNT_MAX);
                return Err(Invalid::new("label", text, limit));
            }
        }
        Ok(Self(wanted))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_filter_names_labels_with_their_values_or_without() {
        let filter = LabelFilter::parse(["floor=2", "site", "note=a=b", "empty="]).expect("labels");
        let json = serde_json::to_string(&filter).expect("serialises");
        assert_eq!(json, r#"{"empty":"","floor":"2","note":"a=b","site":null}"#);
        for bad in [&["=2"][..], &[""], &["floor=1", "floor=2"], &["a\nb"]] {
            assert!(LabelFilter::parse(bad.iter().copied()).is_err(), "{bad:?}");
        }
    }

    #[test]
    fn labels_out_of_range_are_refused_with_the_limit() {
        let label = |name: &str, value: &str| Labels::parse(BTreeMap::from([(name.to_owned(), value.to_owned())]));
        assert!(label("floor", "").is_ok());
        assert!(label("", "2").is_err());
        let error = label("floor", &"2".repeat(101)).expect_err("too long");
        assert!(error.to_string().contains("at most 100 characters"), "{error}");
        let many = (0..33).map(|i| (i.to_string(), String::new())).collect();
        assert!(Labels::parse(many).is_err());
    }
}
