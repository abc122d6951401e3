//! `mapweld keys`: makes, lists and revokes API keys, in the database itself; a server that runs knows of it at once.

use std::path::PathBuf;

use clap::{Args, Subcommand};
use comfy_table::{Table, presets};
use jiff::{SpanRelativeTo, Unit};
use serde_json::{Value, json};

use super::home::open_beside;
use super::runtime::block_on;
use super::{BadInput, Done, Failure, say, tell};
use crate::clock::{Clock, Ids, SystemClock, SystemIds};
use crate::config::DatabasePlace;
use crate::model::{ApiKey, KeyId, KeyName, RobotId, Scope, SessionId, ShownKey, Standing, Timestamp};
use crate::store::{Missing, Page, Store, StoreError};

/// Make, list and revoke the keys that callers of a server show.
#[derive(Debug, Args)]
pub(super) struct Keys {
    #[command(subcommand)]
    action: Action,

    /// Folder of the server's database; the server may be running.
    #[arg(
        long,
        env = "MAPWELD_DATA",
        default_value = "./mapweld-data",
        value_name = "FOLDER",
        global = true
    )]
    data: PathBuf,

    /// Where the records are when they are not in the data folder: `sqlite:FILE` or
    /// `postgres://USER:PASSWORD@HOST:PORT/DATABASE`.
    #[arg(
        long,
        env = "MAPWELD_DATABASE_URL",
        hide_env_values = true,
        value_name = "URL",
        global = true
    )]
    database_url: Option<DatabasePlace>,

    /// Print JSON, one line a key.
    #[arg(long, global = true)]
    json: bool,
}

#[derive(Debug, Subcommand)]
enum Action {
    Create(Create),
    List,
    Revoke(Revoke),
}

/// Make a key, and print it: this once and never again.
///
/// From the first key on the server asks everyone for one, on any address.
#[derive(Debug, Args)]
struct Create {
    /// What it is good for: admin (everything), operator (all but deleting sessions), robot (its own maps in its own
    /// session), read (reading everything).
    #[arg(long)]
    scope: String,
    /// The session that a robot's key is good for.
    #[arg(long)]
    session: Option<SessionId>,
    /// The robot that a robot's key is good for.
    #[arg(long)]
    robot: Option<RobotId>,
    /// What to call it in lists and logs. Default: the scope.
    #[arg(long)]
    name: Option<KeyName>,
    /// How long it is good, such as `12h` or `90d`. Default: until it is revoked.
    #[arg(long, value_name = "TIME", value_parser = parse_span)]
    expires_in: Option<jiff::Span>,
}

/// Take keys back: whoever shows one is refused from now on.
#[derive(Debug, Args)]
struct Revoke {
    /// Ids of the keys, as `mapweld keys list` tells them.
    #[arg(required = true)]
    ids: Vec<KeyId>,
}

impl Keys {
    pub(super) fn run(self) -> Result<Done, Failure> {
        block_on(async {
            let standard = || DatabasePlace::Sqlite(self.data.join("mapweld.sqlite"));
            let store = open_beside(&self.database_url.unwrap_or_else(standard)).await?;
            let keys = KeyCommand {
                store: &*store,
                now: SystemClock::new().now(),
                json: self.json,
            };
            let done = match self.action {
                Action::Create(create) => keys.create(create).await,
                Action::List => keys.list().await,
                Action::Revoke(revoke) => keys.revoke(&revoke.ids).await,
            };
            store.close().await;
            done.map(|()| Done::Entirely)
        })?
    }
}

struct KeyCommand<'a> {
    store: &'a dyn Store,
    now: Timestamp,
    json: bool,
}

impl KeyCommand<'_> {
    async fn create(&self, create: Create) -> Result<(), Failure> {
        let scope = Scope::parse(&create.scope, create.session, create.robot).bad_input(|| "--scope")?;
        let expires_at = create.expires_in.map(|span| expiry(self.now, span)).transpose()?;
        let shown = ShownKey::new(KeyId::new(SystemIds.next()), random()?);
        let key = ApiKey {
            id: shown.id(),
            name: match create.name {
                Some(name) => name,
                None => KeyName::parse(scope.as_str()).bad_input(|| "--name")?,
            },
            scope,
            digest: shown.digest(),
            created_at: self.now,
            expires_at,
            revoked_at: None,
        };
        self.store
            .add_key(&key)
            .await
            .map_err(|error| failed(error, "cannot keep the key"))?;
        if self.json {
            let mut line = described(&key, self.now);
            line["key"] = Value::String(shown.reveal());
            return say(&line.to_string());
        }
        tell(&format!(
            "key {} ({}) of scope {}; it is shown this once:",
            key.id, key.name, key.scope
        ))?;
        say(&shown.reveal())
    }

    async fn list(&self) -> Result<(), Failure> {
        let mut keys = Vec::new();
        let mut page = Page::first(200);
        loop {
            let part = self.store.list_keys(&page).await;
            let part = part.map_err(|error| failed(error, "cannot list the keys"))?;
            let Some(last) = part.last() else { break };
            page.after = Some(last.id);
            keys.extend(part);
        }
        if self.json {
            return keys
                .iter()
                .try_for_each(|key| say(&described(key, self.now).to_string()));
        }
        let mut table = Table::new();
        table.load_style(presets::NOTHING);
        table.set_header(["id", "name", "scope", "made", "standing"]);
        for key in &keys {
            table.add_row([
                key.id.to_string(),
                key.name.to_string(),
                key.scope.to_string(),
                format!("{:.0}", key.created_at),
                standing(key, self.now),
            ]);
        }
        say(&table.trim_fmt())
    }

    async fn revoke(&self, ids: &[KeyId]) -> Result<(), Failure> {
        for id in ids {
            let key = self.store.revoke_key(*id, self.now).await;
            let key = key.map_err(|error| failed(error, "cannot revoke"))?;
            if self.json {
                say(&described(&key, self.now).to_string())?;
            } else {
                say(&format!("{} ({}): {}", key.id, key.name, standing(&key, self.now)))?;
            }
        }
        Ok(())
    }
}

fn described(key: &ApiKey, now: Timestamp) -> Value {
    let (session, robot) = match &key.scope {
        Scope::Robot { session, robot } => (Some(session), Some(robot)),
        Scope::Admin | Scope::Operator | Scope::Read => (None, None),
    };
    let standing = match key.standing(now) {
        Standing::Good => "good",
        Standing::Expired(_) => "expired",
        Standing::Revoked(_) => "revoked",
    };
    json!({
        "id": key.id,
        "name": key.name.as_str(),
        "scope": key.scope.as_str(),
        "session": session,
        "robot": robot,
        "created_at": key.created_at,
        "expires_at": key.expires_at,
        "revoked_at": key.revoked_at,
        "standing": standing,
    })
}

fn standing(key: &ApiKey, now: Timestamp) -> String {
    match (key.standing(now), key.expires_at) {
        (Standing::Good, None) => "good".to_owned(),
        (Standing::Good, Some(until)) => format!("good until {until:.0}"),
        (Standing::Expired(when), _) => format!("expired {when:.0}"),
        (Standing::Revoked(when), _) => format!("revoked {when:.0}"),
    }
}

/// The caller's mistake is a key that there is not.
fn failed(error: StoreError, what: &str) -> Failure {
    match error {
        StoreError::NotFound(Missing::Key(_)) => Failure::BadInput(error.into()),
        error => Failure::Internal(anyhow::Error::new(error).context(what.to_owned())),
    }
}

fn random() -> Result<[u8; 32], Failure> {
    let mut bytes = [0; 32];
    getrandom::fill(&mut bytes)
        .map_err(|error| Failure::Internal(anyhow::Error::msg(error.to_string()).context("no randomness")))?;
    Ok(bytes)
}

fn parse_span(text: &str) -> Result<jiff::Span, String> {
    let limit = "a time from 1s to 100y, such as 12h or 90d";
    let span: jiff::Span = text.parse().map_err(|_| format!("{text:?} must be {limit}"))?;
    let seconds = span.total((Unit::Second, SpanRelativeTo::days_are_24_hours()));
    match seconds {
        Ok(seconds) if (1.0..=100.0 * 366.0 * 86_400.0).contains(&seconds) => Ok(span),
        _ => Err(format!("{text:?} must be {limit}, without months and years")),
    }
}

/// The end of a span of days and shorter units.
fn expiry(now: Timestamp, span: jiff::Span) -> Result<Timestamp, Failure> {
    let later = span
        .to_duration(SpanRelativeTo::days_are_24_hours())
        .and_then(|length| now.checked_add(length));
    later.bad_input(|| "--expires-in")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_key_lives_for_days_and_shorter_units() {
        let end = |text: &str| {
            let span = parse_span(text).expect("a time");
            expiry(Timestamp::UNIX_EPOCH, span).expect("a time").as_second()
        };
        assert_eq!(end("90d"), 90 * 86_400);
        assert_eq!(end("1d 12h"), 36 * 3_600);
        for bad in ["", "0s", "-1d", "90", "500ms", "2 months"] {
            let error = parse_span(bad).expect_err(bad);
            assert!(error.contains("must be"), "{error}");
        }
    }

    #[test]
    fn two_secrets_differ() {
        assert_ne!(random().expect("random"), random().expect("random"));
    }
}
