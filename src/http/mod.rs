//! The HTTP service: the whole API as one table of routes. One file a noun.
//!
//! Imports `geometry`, `grid`, `registration`, `fusion`, `codec`, `model`, `api`, `clock`, `compute`, `store`, `web` and
//! `config`; never `worker`: the queue in the store links the two. A handler is: extract, domain call, one store call,
//! respond.

mod artifact;
mod auth;
mod calls;
mod constraints;
mod docs;
mod error;
mod events;
mod extract;
mod health;
mod jobs;
mod list;
mod listen;
mod load;
mod maps;
mod merge;
mod methods;
mod metrics;
mod middleware;
mod oneshot;
mod openapi;
mod page;
mod refusals;
mod refuse;
mod rest;
mod rules;
mod sessions;
mod state;
mod suffix;
mod tls;
mod upload;
mod versions;
mod watch;
mod zip;

use axum::Router;
use axum::extract::Request;
use axum::middleware::{from_fn, from_fn_with_state, map_request_with_state};
use tower::{ServiceBuilder, ServiceExt as _};
use tower_http::catch_panic::CatchPanicLayer;
use utoipa::OpenApi as _;
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

pub use listen::{Door, listen};
pub use state::{AppState, Rooms};
pub use tls::{BadCertificate, acceptor};
#[cfg(fuzzing)]
pub use upload::fuzzed_upload;

use suffix::add_suffixed;

/// Every path of the API, with its methods. Who may call them stands in [`auth::ANSWERS`].
fn table() -> OpenApiRouter<AppState> {
    let router = OpenApiRouter::with_openapi(openapi::Document::openapi())
        .routes(routes!(sessions::list, sessions::create))
        .routes(routes!(sessions::get, sessions::put, sessions::patch, sessions::delete))
        .routes(routes!(sessions::robots))
        .routes(routes!(events::of_session))
        .routes(routes!(maps::push))
        .routes(routes!(maps::list))
        .routes(routes!(maps::get))
        .routes(routes!(jobs::list, jobs::merge))
        .routes(routes!(jobs::get))
        .routes(routes!(events::of_job))
        .routes(routes!(constraints::list, constraints::add))
        .routes(routes!(constraints::get, constraints::remove))
        .routes(routes!(versions::list))
        .routes(routes!(versions::get))
        .routes(routes!(versions::map_png))
        .routes(routes!(versions::map_pgm))
        .routes(routes!(versions::map_yaml))
        .routes(routes!(versions::map_zip))
        .routes(routes!(versions::occupancy_grid))
        .routes(routes!(versions::overlay_png))
        .routes(routes!(versions::transforms))
        .routes(routes!(merge::merge))
        .routes(routes!(methods::list))
        .routes(routes!(health::livez))
        .routes(routes!(health::readyz))
        .routes(routes!(metrics::metrics));
    let router = add_suffixed(router, routes!(maps::png));
    add_suffixed(router, routes!(jobs::cancel))
}

/// The OpenAPI document of [`app`].
#[must_use]
pub fn openapi() -> utoipa::openapi::OpenApi {
    openapi::complete(table().into_openapi())
}

/// The whole service over this state.
pub fn app(state: AppState) -> Router {
    let (api, _) = table().split_for_parts();
    let routed = api
        .merge(docs::routes(openapi()))
        .merge(page::routes())
        .layer(from_fn_with_state(state.clone(), calls::once))
        .layer(from_fn_with_state(state.clone(), auth::authorise))
        .layer(CatchPanicLayer::custom(middleware::panicked))
        .layer(from_fn(middleware::secure))
        .with_state(state.clone());
    // Before the router: a layer of the router itself would come too late to change a request's path.
    let routed = ServiceBuilder::new()
        .layer_fn(|service: Router| service.map_request(suffix::rewrite as fn(Request) -> Request))
        .service(routed);
    Router::new()
        .fallback_service(routed)
        .layer(from_fn_with_state(state.clone(), load::shed))
        .layer(from_fn_with_state(state.clone(), middleware::follow))
        .layer(map_request_with_state(state, rest::read_rest))
}
