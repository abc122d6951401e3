//! mapweld welds the occupancy grid maps of many robots into one.
//!
//! Robots that map the same place do not know where the others started: each has its own 2-D map in its own frame.
//! mapweld finds the rigid transforms between the maps in Hough space (after Saeedi, Paull, Trentini, Seto and Li, "Map
//! merging for multiple robots using Hough peak matching"), says which maps it could place and which not, and why, and
//! adds up the placed ones by their log odds. A wrong merge is far worse than no merge.
//! `docs/paper.md` tells where that paper's text is ambiguous or wrong, and what stands here instead.
//!
//! It is a library, a command (`mapweld merge a.yaml b.yaml -o out`) and a networked service (`mapweld serve`) that keeps
//! every fused version with its evidence. What it does not do: SLAM, localisation, three dimensions, scale.
//!
//! ```
//! use mapweld::codec::{self, Limits};
//! use mapweld::registration::{MethodName, MethodSpec, Unhurried, register};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let yaml = b"image: corridor.pgm\nresolution: 0.05\norigin: [0.0, 0.0, 0.0]\n";
//! let image = b"P2 3 2 255  0 254 205  254 254 0";
//! let map = codec::decode_map(yaml, image, &Limits::default())?.grid;
//! let method = MethodSpec::default_of(MethodName::Hough).build();
//! let answer = register(&*method, &map, &map, &Unhurried);
//! assert!(answer.accepted().is_none(), "three cells are too little to recognise a place by");
//! # Ok(())
//! # }
//! ```
//!
//! # Frames and units
//!
//! Metres and radians, x right, y up, counter-clockwise (REP 103); angles in (-pi, pi]. A grid's origin is the pose of the
//! lower-left corner of cell (0, 0) in the map's frame, yaw honoured; row 0 is the lowest row. `pose_fixed_moving` is the
//! pose of the moving frame in the fixed frame, `p_fixed = pose_fixed_moving * p_moving`: inner names cancel when
//! composed. Unknown is a state, not a number that arithmetic can reach.
//!
//! # Words
//!
//! | word | meaning |
//! |---|---|
//! | occupancy grid, cell, lattice | a map; its squares; where they lie (size, resolution, origin) |
//! | log odds | `ln(p / (1 - p))` of a cell's being occupied |
//! | registration | finding the pose of a moving map in a fixed one, or why it cannot be known |
//! | hypothesis, candidate | a pose that may be right; one that was looked at closely |
//! | support, evidence | what speaks for a hypothesis, and against it |
//! | overlap | area known in both maps over the smaller known area |
//! | verification index | the paper's V (eq. 34): agreeing cells over all cells known in both |
//! | fusion | adding up placed maps on one lattice |
//! | session | a place and time that robots map together |
//! | anchor | the robot whose map frame is the session's frame |
//! | job, version | one merge to be done; its published, immutable result |
//!
//! # Rooms, and who may import whom
//!
//! One package has no crate walls; `tests/layering.rs` holds the arrows.
//!
//! ```text
//! geometry <- grid <- registration <- fusion        pure: values in, values out
//!             grid <- codec                         pure: bytes <-> grid, pictures
//!             grid <- simulation                    pure: seeded worlds, lidar, mapping
//! geometry, grid, registration <- model             the service's records
//! simulation, fusion <- experiments                 the paper's experiments: values, pictures and a page as bytes
//! model, fusion, codec <- api <- client             wire types; the robot's side
//! model <- store                                    their persistence, and the queue
//! store, codec, fusion, api <- worker               merge jobs
//! store, codec, fusion, api <- http                 the routes; http and worker meet only in the store's queue
//! everything <- cli <- main
//! ```
//!
//! Beside them, small rooms: [`clock`] (time and ids, handed in), [`random`] (chance from a seed), `compute` (the bounded
//! pool for heavy work), `config`, `failpoint` (where tests of debug builds have a server die), `meters` (what Prometheus is told), `telemetry`, and `web` (the
//! embedded page).
//!
//! The service has two homes behind one door, [`store::Store`] with [`store::Blobs`], chosen at run time: SQLite and a
//! folder, for one process; PostgreSQL and a place that all see, for any number of equal replicas.
//!
//! The pure core is always there; feature `server` adds store, worker, http and web, feature `client` adds the client,
//! feature `otel` sends spans to a collector, feature `experiments` adds the experiments with their plotting.
//!
//! # The life of a map
//!
//! `http` receives an upload -> `codec` decodes it, limits before memory -> the blob is stored and fsynced ->
//! `store.add_map_and_enqueue`, one transaction -> 201 to the robot -> `store.claim_job` takes a lease -> `worker` loads
//! the newest map of each robot -> [`fusion::weld()`]: features, registrations of the pairs, consistent poses, the fused
//! map -> `codec` encodes -> `store.publish_version`, one transaction, only if the lease is still ours -> `http` serves
//! it, and whoever watches is told.

#![cfg_attr(
    test,
    expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        clippy::cast_precision_loss,
        clippy::float_cmp,
        reason = "tests compute with small numbers that they know"
    )
)]

pub mod api;
pub mod cli;
#[cfg(feature = "client")]
pub mod client;
pub mod clock;
pub mod codec;
pub mod compute;
#[cfg(feature = "server")]
pub mod config;
#[cfg(feature = "experiments")]
pub mod experiments;
#[cfg(feature = "server")]
pub mod failpoint;
pub mod fusion;
pub mod geometry;
pub mod grid;
#[cfg(feature = "server")]
pub mod http;
#[cfg(feature = "server")]
pub mod meters;
pub mod model;
pub mod random;
pub mod registration;
pub mod simulation;
#[cfg(feature = "server")]
pub mod store;
#[cfg(feature = "server")]
pub mod telemetry;
#[cfg(feature = "server")]
pub mod web;
#[cfg(feature = "server")]
pub mod worker;
