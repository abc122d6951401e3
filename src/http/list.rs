//! Lists in pages.

use std::fmt::Display;
use std::str::FromStr;

use serde::Deserialize;
use utoipa::IntoParams;

use super::error::{ApiError, ApiResult};
use crate::{api, store};

/// Which part of a list.
#[derive(Debug, Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub(super) struct ListQuery {
    /// Most items of the page.
    #[param(default = 50, minimum = 1, maximum = 200)]
    page_size: Option<u32>,
    /// `next_page_token` of the page before.
    page_token: Option<String>,
}

const SIZE_DEFAULT: u32 = 50;
const SIZE_MAX: u32 = 200;

impl ListQuery {
    /// A page of `page_size` from `page_token` on.
    pub(super) fn new(page_size: Option<u32>, page_token: Option<String>) -> Self {
        Self { page_size, page_token }
    }

    /// What to ask the store for: one item more than the page has, to know whether it is the last one.
    pub(super) fn page<K: FromStr>(&self) -> ApiResult<store::Page<K>> {
        let after = match &self.page_token {
            None => None,
            Some(token) => {
                let key = token.parse();
                Some(key.map_err(|_| ApiError::invalid("page_token", token, "a next_page_token of this list"))?)
            }
        };
        Ok(store::Page {
            after,
            size: self.size()? + 1,
        })
    }

    fn size(&self) -> ApiResult<u32> {
        let size = self.page_size.unwrap_or(SIZE_DEFAULT);
        if (1..=SIZE_MAX).contains(&size) {
            Ok(size)
        } else {
            Err(ApiError::invalid("page_size", size.to_string(), "within 1 and 200"))
        }
    }

    /// The page that the store's answer makes.
    pub(super) fn answer<R, T: From<R>, K: Display>(
        &self,
        mut records: Vec<R>,
        key: impl Fn(&R) -> K,
    ) -> ApiResult<api::Page<T>> {
        let size = self.size()? as usize;
        let more = records.len() > size;
        records.truncate(size);
        let next_page_token = records.last().filter(|_| more).map(|last| key(last).to_string());
        Ok(api::Page {
            items: records.into_iter().map(T::from).collect(),
            next_page_token,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_page_has_no_token_and_the_others_that_of_their_last_item() {
        let query = ListQuery::new(Some(2), None);
        assert_eq!(query.page::<u32>().expect("valid").size, 3);
        let page: api::Page<u32> = query.answer(vec![1_u32, 2, 3], |n| *n).expect("valid");
        assert_eq!((page.items, page.next_page_token), (vec![1, 2], Some("2".to_owned())));
        let page: api::Page<u32> = query.answer(vec![3_u32, 4], |n| *n).expect("valid");
        assert_eq!(page.next_page_token, None);
    }

    #[test]
    fn page_sizes_and_tokens_that_make_no_sense_are_refused() {
        assert!(ListQuery::new(Some(0), None).page::<u32>().is_err());
        assert!(ListQuery::new(Some(201), None).page::<u32>().is_err());
        assert!(ListQuery::new(None, Some("x".to_owned())).page::<u32>().is_err());
    }
}
