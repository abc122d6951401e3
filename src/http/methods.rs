//! The registration methods that there are.

use axum::Json;
use serde::Serialize;
use utoipa::ToSchema;

use crate::model::MethodSpec;
use crate::registration::MethodName;

/// All methods.
#[derive(Debug, Serialize, ToSchema)]
pub(super) struct Methods {
    /// The default first.
    methods: Vec<MethodInfo>,
}

/// A registration method.
#[derive(Debug, Serialize, ToSchema)]
pub(super) struct MethodInfo {
    /// Its name.
    name: MethodName,
    /// Whether it is taken when none is named.
    default: bool,
    /// All its parameters with their defaults.
    #[schema(value_type = Object)]
    parameters: serde_json::Value,
}

/// List the registration methods
///
/// With all their parameters and the defaults.
#[utoipa::path(
    get, path = "/v1/methods", tag = "service", operation_id = "list_methods",
    responses((status = 200, description = "All methods", body = Methods))
)]
pub(super) async fn list() -> Json<Methods> {
    let default = MethodSpec::default().name();
    let methods = MethodName::ALL.into_iter().map(|name| MethodInfo {
        name,
        default: name == default,
        parameters: MethodSpec::default_of(name).parameters(),
    });
    Json(Methods {
        methods: methods.collect(),
    })
}
