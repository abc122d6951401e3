//! Which method registers the maps of a session, and with which parameters.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::registration::MethodName;

/// A registration method and its parameters; parameters that are not named have their defaults.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct MethodSpec {
    /// The method.
    pub name: MethodName,
    /// Its parameters by name.
    #[serde(default)]
    #[schema(value_type = Object)]
    pub parameters: serde_json::Map<String, serde_json::Value>,
}

impl Default for MethodSpec {
    fn default() -> Self {
        Self {
            name: MethodName::ALL[0],
            parameters: serde_json::Map::new(),
        }
    }
}
