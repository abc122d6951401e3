//! Who calls: the key of a request, if it shows a good one.

use std::sync::Arc;

use axum::http::header::AUTHORIZATION;
use axum::http::{HeaderMap, HeaderValue, Method};
use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;

use crate::api::{FieldError, ProblemCode};
use crate::http::error::{ApiError, ApiResult};
use crate::http::state::AppState;
use crate::model::{ApiKey, Author, ShownKey, Standing};

/// Who calls.
#[derive(Debug, Clone)]
pub(in crate::http) enum Caller {
    /// Whoever reaches a server that asks for no keys.
    Anyone,
    /// The owner of a good key.
    Key(Arc<ApiKey>),
}

impl Caller {
    /// Who sent a request with these headers.
    ///
    /// # Errors
    /// 401 when it shows no good key and one is needed, or one that is not good.
    pub(super) async fn of(state: &AppState, method: &Method, headers: &HeaderMap) -> ApiResult<Self> {
        let Some(shown) = shown_key(method, headers)? else {
            return if state.gate.is_open(state).await? {
                Ok(Self::Anyone)
            } else {
                Err(unauthorized("this server asks for a key, and the request shows none"))
            };
        };
        let known = state.store.find_key(shown.id()).await?;
        // whoever does not know the secret is not told that the key exists
        let key = known
            .filter(|key| key.is(&shown))
            .ok_or_else(|| unauthorized("the key is not known"))?;
        match key.standing(state.clock.now()) {
            Standing::Good => Ok(Self::Key(Arc::new(key))),
            Standing::Expired(when) => Err(unauthorized(format!("the key {} expired at {when}", key.id))),
            Standing::Revoked(when) => Err(unauthorized(format!("the key {} was revoked at {when}", key.id))),
        }
    }

    /// The key, unless everyone may.
    pub(in crate::http) fn key(&self) -> Option<&ApiKey> {
        match self {
            Self::Anyone => None,
            Self::Key(key) => Some(key),
        }
    }

    /// Who is told to have said something, unless they say so themselves.
    pub(in crate::http) fn author(&self) -> Option<Author> {
        Author::parse(self.key()?.name.as_str()).ok()
    }
}

/// The key in `Authorization`: as a bearer token, or as the password of a browser that asks its user. Browsers send a
/// password by themselves, also for a form on a foreign page; so it lets them read and no more.
fn shown_key(method: &Method, headers: &HeaderMap) -> ApiResult<Option<ShownKey>> {
    let mut values = headers.get_all(AUTHORIZATION).iter();
    let Some(value) = values.next() else { return Ok(None) };
    let key = match values.next() {
        None => bearer(value).or_else(|| if method.is_safe() { password(value) } else { None }),
        Some(_) => None,
    };
    key.map(Some)
        .ok_or_else(|| unauthorized("the header Authorization is not understood"))
}

fn bearer(value: &HeaderValue) -> Option<ShownKey> {
    ShownKey::parse(credentials(value, "bearer")?)
}

fn password(value: &HeaderValue) -> Option<ShownKey> {
    let decoded = STANDARD.decode(credentials(value, "basic")?).ok()?;
    let (_, password) = std::str::from_utf8(&decoded).ok()?.split_once(':')?;
    ShownKey::parse(password)
}

fn credentials<'a>(value: &'a HeaderValue, scheme: &str) -> Option<&'a str> {
    let (sent, credentials) = value.to_str().ok()?.split_once(' ')?;
    sent.eq_ignore_ascii_case(scheme).then(|| credentials.trim())
}

/// Never repeats what was sent: it may be a secret with a typing mistake.
fn unauthorized(detail: impl Into<String>) -> ApiError {
    ApiError::new(ProblemCode::Unauthorized, detail).field(FieldError::missing(
        "authorization",
        "Bearer and a key that `mapweld keys create` has made",
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::KeyId;

    fn shown(method: &Method, values: &[&str]) -> ApiResult<Option<String>> {
        let mut headers = HeaderMap::new();
        for value in values {
            headers.append(AUTHORIZATION, HeaderValue::from_str(value).expect("a header"));
        }
        shown_key(method, &headers).map(|key| key.map(|key| key.reveal()))
    }

    #[test]
    fn a_key_is_a_bearer_token_or_for_reading_a_password() {
        let text = ShownKey::new(KeyId::new(uuid::Uuid::from_u128(7)), [3; 32]).reveal();
        let bearer = format!("bearer {text}");
        let basic = format!("Basic {}", STANDARD.encode(format!("anna:{text}")));
        for (method, value) in [(Method::POST, &bearer), (Method::GET, &bearer), (Method::GET, &basic)] {
            let found = shown(&method, &[value]).expect("a key");
            assert_eq!(found.as_deref(), Some(text.as_str()), "{method}");
        }
        assert!(shown(&Method::POST, &[&basic]).is_err(), "a form on a foreign page");
        assert!(shown(&Method::GET, &[&bearer, &bearer]).is_err(), "one key only");
        assert_eq!(shown(&Method::GET, &[]).expect("none is shown"), None);
    }

    #[test]
    fn what_was_sent_is_not_repeated() {
        let error = shown(&Method::GET, &["Bearer mapweld_almost_a_secret"]).expect_err("no key");
        assert!(!format!("{error:?}").contains("almost"), "{error:?}");
    }
}
