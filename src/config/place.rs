//! Where records and blobs are kept, as the operator writes it down.

use std::fmt;
use std::path::PathBuf;
use std::str::FromStr;

/// Where records and the queue are kept: `sqlite:FILE` or `postgres://USER:PASSWORD@HOST:PORT/DATABASE`.
#[derive(Clone, PartialEq, Eq)]
pub enum DatabasePlace {
    /// One file, served by one process.
    Sqlite(PathBuf),
    /// A database that any number of replicas share. The whole URL, which holds a password.
    Postgres(String),
}

/// Where blobs are kept: a folder or `s3://BUCKET/PREFIX`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum BlobPlace {
    /// A folder; replicas on several machines need one that all of them see.
    Folder(PathBuf),
    /// A bucket, and what all its keys begin with (may be empty).
    S3 {
        /// The bucket.
        bucket: String,
        /// What all keys begin with, without slashes at its ends.
        prefix: String,
    },
}

/// Text that names no place.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{what} is not allowed: it must be {limit}")]
pub struct BadPlace {
    /// What was written; never the whole of a database URL.
    what: String,
    limit: &'static str,
}

const DATABASES: &str = "sqlite:FILE or postgres://USER:PASSWORD@HOST:PORT/DATABASE";
const BLOBS: &str = "a folder or s3://BUCKET/PREFIX";

impl FromStr for DatabasePlace {
    type Err = BadPlace;

    fn from_str(text: &str) -> Result<Self, BadPlace> {
        if text.starts_with("postgres://") || text.starts_with("postgresql://") {
            return Ok(Self::Postgres(text.to_owned()));
        }
        match text.strip_prefix("sqlite:") {
            // as other programs write it: sqlite:///absolute and sqlite://relative
            Some(file) => match file.strip_prefix("//").unwrap_or(file) {
                "" | ":memory:" => Err(BadPlace {
                    what: format!("{text:?}"),
                    limit: "sqlite:FILE with the path of a file: records outlive the process",
                }),
                file => Ok(Self::Sqlite(PathBuf::from(file))),
            },
            None => Err(BadPlace {
                what: match text.split_once(':') {
                    Some((scheme, _)) => format!("a database URL that begins with {scheme:?}"),
                    None => "a database URL without a scheme".to_owned(),
                },
                limit: DATABASES,
            }),
        }
    }
}

/// Without the password.
impl fmt::Display for DatabasePlace {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Sqlite(file) => write!(f, "sqlite:{}", file.display()),
            Self::Postgres(url) => {
                // what follows the last @ of the authority; a query may hold a password too
                let place = url.split_once("://").map_or("", |(_, rest)| rest);
                let place = place.split_once('?').map_or(place, |(place, _)| place);
                let place = place.rsplit_once('@').map_or(place, |(_, place)| place);
                write!(f, "postgres://{place}")
            }
        }
    }
}

impl fmt::Debug for DatabasePlace {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}

impl FromStr for BlobPlace {
    type Err = BadPlace;

    fn from_str(text: &str) -> Result<Self, BadPlace> {
        let bad = || BadPlace {
            what: format!("{text:?}"),
            limit: BLOBS,
        };
        if let Some(place) = text.strip_prefix("s3://") {
            let (bucket, prefix) = place.split_once('/').unwrap_or((place, ""));
            if bucket.is_empty() {
                return Err(bad());
            }
            return Ok(Self::S3 {
                bucket: bucket.to_owned(),
                prefix: prefix.trim_matches('/').to_owned(),
            });
        }
        if text.is_empty() || text.contains("://") {
            return Err(bad());
        }
        Ok(Self::Folder(PathBuf::from(text)))
    }
}

impl fmt::Display for BlobPlace {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Folder(folder) => folder.display().fmt(f),
            Self::S3 { bucket, prefix } => write!(f, "s3://{bucket}/{prefix}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_database_is_a_file_or_a_url() {
        let sqlite = |file: &str| Ok(DatabasePlace::Sqlite(PathBuf::from(file)));
        assert_eq!("sqlite:a/b.sqlite".parse(), sqlite("a/b.sqlite"));
        assert_eq!("sqlite:///var/b.sqlite".parse(), sqlite("/var/b.sqlite"));
        assert_eq!("sqlite:/var/b.sqlite".parse(), sqlite("/var/b.sqlite"));
        let url = "postgresql://host/db";
        assert_eq!(url.parse(), Ok(DatabasePlace::Postgres(url.to_owned())));
        for bad in ["", "sqlite:", "sqlite::memory:", "mysql://u:p@h/d", "/var/b.sqlite"] {
            assert!(bad.parse::<DatabasePlace>().is_err(), "{bad:?}");
        }
    }

    #[test]
    fn a_password_is_told_by_no_message() {
        for url in [
            "postgres://u:hunter2@host:5432/db",
            "postgres://u:p@hunter2@host:5432/db?password=hunter2",
        ] {
            let place: DatabasePlace = url.parse().expect("a place");
            assert_eq!(
                format!("{place} {place:?}"),
                "postgres://host:5432/db postgres://host:5432/db"
            );
        }
        let error = "mysql://u:hunter2@host/db"
            .parse::<DatabasePlace>()
            .expect_err("unknown");
        assert!(!format!("{error} {error:?}").contains("hunter2"), "{error}");
        assert!(error.to_string().contains("mysql"), "{error}");
    }

    #[test]
    fn blobs_lie_in_a_folder_or_in_a_bucket() {
        assert_eq!("./blobs".parse(), Ok(BlobPlace::Folder(PathBuf::from("./blobs"))));
        let s3 = |bucket: &str, prefix: &str| {
            Ok(BlobPlace::S3 {
                bucket: bucket.to_owned(),
                prefix: prefix.to_owned(),
            })
        };
        assert_eq!("s3://maps".parse(), s3("maps", ""));
        assert_eq!("s3://maps/fleet/a/".parse(), s3("maps", "fleet/a"));
        for bad in ["", "s3://", "s3:///x", "gs://maps"] {
            assert!(bad.parse::<BlobPlace>().is_err(), "{bad:?}");
        }
    }
}
