//! Operators steer merges: rules and constraints, the anchor, rolling back, and hypotheses accepted by hand.

use mapweld::api::{
    Basis, Constraint, Job, MergeResult, Page, PairOutcome, PlacementStatus, Pose, ProblemCode, Session,
};
use mapweld::api::{ReasonCode, Version};
use mapweld::geometry::{Angle, Pose2};
use mapweld::model::JobState;
use reqwest::StatusCode;
use serde_json::{Value, json};

use super::rooms::{Files, scrap, three_robots, two_maps_of_a_symmetric_hall};
use super::server::{TestServer, json as body, problem};

const HALL: &str = "/v1/sessions/hall";

/// A server with these maps in session `hall`, which does not merge by itself.
async fn quiet(maps: &[(&str, &mapweld::grid::OccupancyGrid)]) -> TestServer {
    let server = TestServer::start(&[]);
    let settings = json!({ "auto_merge": false });
    let made = server.put(HALL).json(&settings).send().await.expect("an answer");
    assert_eq!(made.status(), StatusCode::CREATED);
    for (name, map) in maps {
        server.push("hall", name, &Files::of(name, map)).await;
    }
    server
}

async fn merge(server: &TestServer, request: Value) -> Job {
    let path = format!("{HALL}/merges");
    let queued = server.post(&path).json(&request).send().await.expect("an answer");
    let queued: Job = body(queued).await;
    server.ended(queued.id).await
}

async fn merged(server: &TestServer, request: Value) -> (Version, MergeResult) {
    let job = merge(server, request).await;
    assert_eq!(job.state, JobState::Succeeded, "{job:?}");
    let version: Version = server
        .read(&format!("{HALL}/versions/{}", job.version.expect("a version")))
        .await;
    let result = version.result.read().expect("a result");
    (version, result)
}

async fn dry(server: &TestServer, mut request: Value) -> (Job, MergeResult) {
    request["dry_run"] = json!(true);
    let job = merge(server, request).await;
    assert_eq!(job.state, JobState::Succeeded, "{job:?}");
    let result = job.result.as_ref().expect("an answer").read().expect("a result");
    (job, result)
}

async fn constrain(server: &TestServer, constraint: Value) -> Constraint {
    let path = format!("{HALL}/constraints");
    let made = server.post(&path).json(&constraint).send().await.expect("an answer");
    assert_eq!(made.status(), StatusCode::CREATED);
    let location = made.headers()["location"].to_str().expect("a path").to_owned();
    let made: Constraint = body(made).await;
    assert_eq!(server.read::<Constraint>(&location).await, made);
    made
}

fn distance(a: Pose, b: Pose2) -> f64 {
    let off = b.inverse() * a.to_pose2().expect("finite");
    off.x().hypot(off.y()) + off.yaw().magnitude()
}

fn pose(pose: Pose2) -> Value {
    json!({ "x": pose.x(), "y": pose.y(), "yaw": pose.yaw().radians() })
}

#[tokio::test]
async fn maps_that_are_kept_apart_stay_apart_until_the_constraint_is_removed() {
    let ([a, b, _], _) = three_robots();
    let server = quiet(&[("a", &a), ("b", &b)]).await;
    let rule = json!({ "apart": { "robots": ["a", "b"] } });
    let said = constrain(
        &server,
        json!({ "rule": rule, "author": "Ada", "note": "different floors" }),
    )
    .await;
    let (_, result) = merged(&server, json!({})).await;
    assert_eq!(result.maps[1].status, PlacementStatus::NotPlaced);
    assert_eq!(
        result.maps[1].reason.as_ref().expect("a reason").code,
        ReasonCode::Forbidden
    );
    let told = &result.constraints[0];
    assert_eq!((told.id, told.applied, told.at), (Some(said.id), true, said.created_at));
    assert_eq!(told.author.as_ref().map(mapweld::model::Author::as_str), Some("Ada"));
    assert_eq!(
        told.note.as_ref().map(mapweld::model::Note::as_str),
        Some("different floors")
    );

    let path = format!("{HALL}/constraints/{}", said.id);
    let removed = server.request("DELETE", &path).send().await.expect("an answer");
    assert_eq!(removed.status(), StatusCode::NO_CONTENT);
    assert_eq!(problem(server.get(&path)).await.code, ProblemCode::ConstraintNotFound);
    let (_, result) = merged(&server, json!({})).await;
    assert_eq!(
        (result.maps[1].status, result.constraints.len()),
        (PlacementStatus::Placed, 0)
    );
}

#[tokio::test]
async fn a_fixed_pose_holds_whatever_the_maps_say_and_a_rule_of_one_merge_goes_before_it() {
    let ([a, b, c], truth) = three_robots();
    let server = quiet(&[("a", &a), ("b", &b), ("c", &c)]).await;
    let wrong = truth[1] * Pose2::new(1.0, 0.5, Angle::from_degrees(10.0));
    // told in b's frame: the anchor lies there
    let rule = json!({ "fixed": { "robot": "a", "relative_to": "b", "pose": pose(wrong.inverse()) } });
    constrain(&server, json!({ "rule": rule })).await;
    let (_, result) = merged(&server, json!({ "robots": ["a", "b"] })).await;
    assert_eq!(result.maps[1].basis, Some(Basis::Operator));
    assert!(distance(result.maps[1].pose.expect("placed"), wrong) < 1e-9);

    let right = json!({ "rules": [{ "fixed": { "robot": "b", "pose": pose(truth[1]) } }], "author": "Grace" });
    let (job, result) = dry(&server, right).await;
    assert!(distance(result.maps[1].pose.expect("placed"), truth[1]) < 1e-9);
    let told: Vec<_> = result
        .constraints
        .iter()
        .map(|one| (one.id.is_some(), one.applied))
        .collect();
    assert_eq!(told, [(false, true), (true, false)]);
    assert_eq!(result.constraints[0].at, job.created_at);
    assert_eq!(
        result.constraints[0]
            .author
            .as_ref()
            .map(mapweld::model::Author::as_str),
        Some("Grace")
    );
    assert!(result.constraints[1].why_not.is_some());
}

#[tokio::test]
async fn the_anchor_is_moved_by_a_merge_that_says_so_and_not_by_its_preview() {
    let ([a, b, _], truth) = three_robots();
    let server = quiet(&[("a", &a), ("b", &b)]).await;
    let anchor = |session: Session| session.anchor.expect("an anchor").to_string();
    let (first, _) = merged(&server, json!({})).await;
    let (_, preview) = dry(&server, json!({ "anchor": "b" })).await;
    assert_eq!(preview.anchor, "b");
    assert_eq!(anchor(server.read(HALL).await), "a");
    let (moved, result) = merged(&server, json!({ "anchor": "b" })).await;
    assert_eq!((moved.anchor.as_str(), result.anchor.as_str()), ("b", "b"));
    assert_eq!(anchor(server.read(HALL).await), "b");
    let pose_b_a = result.maps[0].pose.expect("placed");
    assert!(distance(pose_b_a, truth[1].inverse()) < 0.15, "{pose_b_a:?}");
    assert_ne!(first.digest, moved.digest);

    // rolled back: a new version with the old content, in the old frame
    let request = json!({ "restore": 1, "author": "Ada" });
    let (restored, result) = merged(&server, request).await;
    assert_eq!((restored.number.get(), restored.parent), (3, Some(moved.number)));
    assert_eq!(restored.restored_from, Some(first.number));
    assert_eq!((restored.digest, restored.inputs), (first.digest, first.inputs));
    assert_eq!(result, first.result.read().expect("a result"));
    assert_eq!(anchor(server.read(HALL).await), "a");
    let tag = |number: u32| {
        let request = server.get(&format!("{HALL}/versions/{number}/map.png"));
        async move { request.send().await.expect("an answer").headers()["etag"].clone() }
    };
    assert_eq!(tag(1).await, tag(3).await);
}

#[tokio::test]
async fn an_operator_accepts_by_hand_what_the_maps_alone_cannot_tell() {
    let ([a, b], truth) = two_maps_of_a_symmetric_hall();
    let server = quiet(&[("a", &a), ("b", &b)]).await;
    let (version, result) = merged(&server, json!({})).await;
    let pair = &result.pairs[0];
    assert_eq!(
        (pair.outcome, result.maps[1].status),
        (PairOutcome::Rejected, PlacementStatus::NotPlaced)
    );
    let right = pair
        .candidates
        .iter()
        .position(|candidate| distance(candidate.pose, truth) < 0.2);
    let right = right.expect("the truth is among the candidates");
    let accept = |candidate: usize, runner_up: bool| {
        json!({ "accept": {
            "version": version.number, "fixed": "a", "moving": "b", "candidate": candidate, "runner_up": runner_up,
        } })
    };
    // the rival of the first candidate is the other way round
    let (_, preview) = dry(&server, json!({ "rules": [accept(0, true)] })).await;
    let rival = pair.candidates[0].evidence.runner_up.as_ref().expect("a rival");
    assert_eq!(preview.maps[1].pose, Some(rival.pose));

    let said = constrain(&server, json!({ "rule": accept(right, false) })).await;
    let (_, result) = merged(&server, json!({})).await;
    assert_eq!(
        (result.maps[1].basis, result.constraints[0].id),
        (Some(Basis::Operator), Some(said.id))
    );
    let placed = result.maps[1].pose.expect("placed").to_pose2().expect("finite");
    assert!(distance(pair.candidates[right].pose, placed) < 1e-9);
    // it holds for the robot's next map too
    let mut newer = b.clone();
    newer.cells_mut()[0] = mapweld::grid::LogOdds::OCCUPIED;
    server.push("hall", "b", &Files::of("b", &newer)).await;
    let (_, result) = merged(&server, json!({})).await;
    assert_eq!(result.maps[1].basis, Some(Basis::Operator));

    let path = format!("{HALL}/constraints");
    let cases = [
        (accept(9, false), "rule.accept.candidate"),
        (
            json!({ "accept": { "version": 77, "fixed": "a", "moving": "b" } }),
            "rule.accept.version",
        ),
        (
            json!({ "accept": { "fixed": "a", "moving": "b" } }),
            "rule.accept.version",
        ),
        (
            json!({ "accept": { "version": 1, "fixed": "b", "moving": "a" } }),
            "rule.accept.fixed",
        ),
        (
            json!({ "accept": { "version": 1, "fixed": "a", "moving": "b" } }),
            "rule.accept.candidate",
        ),
        (
            json!({ "accept": { "job": version.job, "fixed": "a", "moving": "b", "candidate": 0 } }),
            "rule.accept.job",
        ),
    ];
    for (rule, field) in cases {
        let problem = problem(server.post(&path).json(&json!({ "rule": rule }))).await;
        assert_eq!(
            (problem.code, problem.errors[0].field.as_str()),
            (ProblemCode::InvalidRequest, field)
        );
        assert!(problem.errors[0].limit.is_some(), "{problem:?}");
    }
}

#[tokio::test]
async fn a_guess_decides_what_the_maps_alone_cannot_tell() {
    let ([a, b], truth) = two_maps_of_a_symmetric_hall();
    let server = quiet(&[("a", &a), ("b", &b)]).await;
    let about = truth * Pose2::new(0.4, -0.3, Angle::from_degrees(4.0));
    let guess = json!({ "rules": [{ "guess": { "robot": "b", "pose": pose(about), "reach_m": 3.0 } }] });
    let (_, result) = merged(&server, guess).await;
    let found = result.maps[1].pose.expect("placed");
    assert!(distance(found, truth) < 0.15, "{found:?} instead of {truth:?}");
    assert!(result.constraints[0].applied);
}

#[tokio::test]
async fn rules_that_make_no_sense_are_refused_with_the_field_the_value_and_the_limit() {
    let server = quiet(&[]).await;
    let at = |x: f64, yaw: f64| json!({ "x": x, "y": 0.0, "yaw": yaw });
    let cases = [
        (
            json!({ "fixed": { "robot": "b", "pose": at(0.0, 0.0) } }),
            "rule.fixed.relative_to",
        ),
        (
            json!({ "fixed": { "robot": "b", "relative_to": "a", "pose": at(0.0, 90.0) } }),
            "rule.fixed.pose.yaw",
        ),
        (
            json!({ "guess": { "robot": "b", "relative_to": "a", "pose": at(2e6, 0.0) } }),
            "rule.guess.pose.x",
        ),
        (
            json!({ "guess": { "robot": "b", "relative_to": "a", "pose": at(0.0, 0.0), "reach_m": 0.0 } }),
            "rule.guess.reach_m",
        ),
        (
            json!({ "guess": { "robot": "b", "relative_to": "b", "pose": at(0.0, 0.0) } }),
            "rule.guess.robot",
        ),
        (json!({ "apart": { "robots": ["a", "a"] } }), "rule.apart.robots"),
        (json!({ "apart": { "robots": ["a", "B"] } }), "rule.apart.robots[1]"),
        (json!({ "together": {} }), "rule"),
    ];
    let constraints = format!("{HALL}/constraints");
    for (rule, field) in cases {
        let problem = problem(server.post(&constraints).json(&json!({ "rule": rule }))).await;
        assert_eq!(problem.code, ProblemCode::InvalidRequest, "{problem:?}");
        assert!(problem.errors[0].field.starts_with(field), "{field}: {problem:?}");
        assert!(problem.errors[0].limit.is_some(), "{problem:?}");
    }
    let none: Page<Constraint> = server.read(&constraints).await;
    assert_eq!(none.items, []);

    let fixed = json!({ "fixed": { "robot": "b", "relative_to": "a", "pose": at(0.0, 0.0) } });
    constrain(&server, json!({ "rule": fixed })).await;
    let apart = json!({ "apart": { "robots": ["b", "a"] } });
    let clash = problem(server.post(&constraints).json(&json!({ "rule": apart }))).await;
    assert_eq!(clash.code, ProblemCode::Conflict, "{clash:?}");
    let merges = format!("{HALL}/merges");
    let cases = [
        (json!({ "restore": 7 }), ProblemCode::InvalidRequest, "restore"),
        (
            json!({ "restore": 1, "robots": ["a"] }),
            ProblemCode::InvalidRequest,
            "robots",
        ),
        (
            json!({ "rules": [{ "guess": { "robot": "c", "pose": at(0.0, 0.0) } }] }),
            ProblemCode::InvalidRequest,
            "rules[0].guess.relative_to",
        ),
        (json!({ "author": "" }), ProblemCode::InvalidRequest, "author"),
    ];
    for (request, code, field) in cases {
        let problem = problem(server.post(&merges).json(&request)).await;
        assert_eq!(
            (problem.code, problem.errors[0].field.as_str()),
            (code, field),
            "{problem:?}"
        );
    }
}

#[tokio::test]
async fn a_rule_about_a_robot_without_a_map_is_told_as_not_applied() {
    let server = quiet(&[("a", &scrap(1))]).await;
    let rule = json!({ "apart": { "robots": ["a", "z"] } });
    let (_, result) = merged(&server, json!({ "rules": [rule] })).await;
    let told = &result.constraints[0];
    assert!(
        !told.applied && told.why_not.as_ref().is_some_and(|why| why.contains('z')),
        "{told:?}"
    );
}
