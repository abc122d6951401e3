//! `mapweld merge` as people use it: files in, files and exit codes out.

use std::path::Path;

use mapweld::codec::{Limits, decode_map};
use serde_json::Value;

use super::command::{Folder, mapweld};
use super::rooms;

/// The exit code, and what was said on standard error.
fn refusal(arguments: &[&str]) -> (Option<i32>, String) {
    let output = mapweld(arguments);
    assert!(output.stdout.is_empty(), "{output:?}");
    (output.status.code(), String::from_utf8(output.stderr).expect("text"))
}

/// The result without what differs from run to run.
fn result(folder: &Path) -> Value {
    let text = std::fs::read_to_string(folder.join("result.json")).expect("result.json was written");
    let mut result: Value = serde_json::from_str(&text).expect("it is JSON");
    result.as_object_mut().expect("an object").remove("timings");
    result
}

fn two_robots(folder: &Folder) -> [String; 2] {
    let (robots, _) = rooms::three_robots();
    [0, 1].map(|robot| folder.map(&format!("r{robot}.yaml"), &robots[robot]))
}

#[test]
fn merge_writes_the_map_the_overlay_and_the_result_and_exits_0_when_all_maps_are_placed() {
    let folder = Folder::new();
    let [a, b] = two_robots(&folder);
    let out = folder.path("out");
    let output = mapweld(&["merge", &a, &b, "-o", &folder.text("out")]);
    assert_eq!(output.status.code(), Some(0), "{output:?}");
    let told = String::from_utf8(output.stdout).expect("text");
    assert!(
        told.contains("r0") && told.contains("r1") && told.contains(" s: "),
        "{told}"
    );

    let result = result(&out);
    assert_eq!(result["anchor"], "r0");
    assert_eq!(result["maps"][1]["status"], "placed");
    let read = |name: &str| std::fs::read(out.join(name)).expect("it was written");
    let fused = decode_map(&read("map.yaml"), &read("map.png"), &Limits::default())
        .expect("a map")
        .grid;
    let counts = fused.state_counts();
    assert_eq!(result["fused"]["counts"]["occupied"], counts.occupied);
    assert_eq!(result["fused"]["counts"]["free"], counts.free);
    assert!(read("overlay.png").starts_with(b"\x89PNG"));
}

#[test]
fn merge_finds_the_true_pose() {
    let folder = Folder::new();
    let [a, b] = two_robots(&folder);
    assert_eq!(
        mapweld(&["merge", &a, &b, "-o", &folder.text("out")]).status.code(),
        Some(0)
    );
    let pose = &result(&folder.path("out"))["maps"][1]["pose"];
    let (_, [_, truth, _]) = rooms::three_robots();
    let number = |name: &str| pose[name].as_f64().expect("a number");
    assert!(
        (number("x") - truth.x()).hypot(number("y") - truth.y()) < 0.3,
        "{pose} is not {truth:?}"
    );
    assert!(
        (number("yaw") - truth.yaw().radians()).sin().abs() < 0.02,
        "{pose} is not {truth:?}"
    );
}

#[test]
fn merge_exits_3_when_a_map_belongs_elsewhere_and_leaves_it_out() {
    let folder = Folder::new();
    let a = folder.map("here.yaml", &rooms::three_robots().0[0]);
    let b = folder.map("elsewhere.yaml", &rooms::scrap(5));
    let output = mapweld(&["merge", &a, &b, "-o", &folder.text("out"), "--json"]);
    assert_eq!(output.status.code(), Some(3), "{output:?}");
    let mut printed: Value = serde_json::from_slice(&output.stdout).expect("JSON alone is printed");
    printed.as_object_mut().expect("an object").remove("timings");
    let result = result(&folder.path("out"));
    assert_eq!(printed, result, "what is printed is what is written");
    assert_eq!(result["maps"][1]["status"], "not_placed");
    assert!(result["maps"][1]["reason"]["code"].is_string());
}

#[test]
fn merge_gives_the_same_bytes_on_one_thread_and_on_many() {
    let folder = Folder::new();
    let [a, b] = two_robots(&folder);
    for threads in ["1", "3"] {
        let out = folder.text(threads);
        assert_eq!(
            mapweld(&["merge", &a, &b, "-o", &out, "--threads", threads])
                .status
                .code(),
            Some(0)
        );
    }
    assert_eq!(result(&folder.path("1")), result(&folder.path("3")));
    for name in ["map.png", "map.yaml", "overlay.png"] {
        let bytes = |threads: &str| std::fs::read(folder.path(threads).join(name)).expect("it was written");
        assert!(bytes("1") == bytes("3"), "{name} differs");
    }
}

#[test]
fn maps_of_the_same_name_are_told_apart_and_the_anchor_is_chosen_by_name() {
    let folder = Folder::new();
    let (robots, _) = rooms::three_robots();
    let [a, b] = [0, 1].map(|robot| folder.map(&format!("{robot}/map.yaml"), &robots[robot]));
    let out = folder.text("out");
    assert_eq!(
        mapweld(&["merge", &a, &b, "-o", &out, "--anchor", "map-2"])
            .status
            .code(),
        Some(0)
    );
    let result = result(&folder.path("out"));
    assert_eq!(
        (&result["maps"][0]["name"], &result["maps"][1]["name"]),
        (&"map".into(), &"map-2".into())
    );
    assert_eq!(result["anchor"], "map-2");
    assert_eq!(result["maps"][1]["pose"]["x"], 0.0);

    let (code, told) = refusal(&["merge", &a, &b, "-o", &out, "--anchor", "map-3"]);
    assert_eq!(code, Some(2));
    assert!(told.contains("\"map-3\"") && told.contains("map, map-2"), "{told}");
}

#[test]
fn bad_input_is_told_once_with_the_file_the_field_and_the_limit_and_exits_2() {
    let folder = Folder::new();
    let good = folder.map("good.yaml", &rooms::scrap(5));
    let out = folder.text("out");
    let write = |name: &str, text: &str| {
        std::fs::write(folder.path(name), text).expect("it is written");
        folder.text(name)
    };
    let cases = [
        (folder.text("none.yaml"), vec!["none.yaml", "No such file"]),
        (write("text.yaml", "hello"), vec!["text.yaml"]),
        (
            write("far.yaml", "image: good.png\nresolution: 1e9\norigin: [0, 0, 0]"),
            vec!["far.yaml", "resolution", "0.001 and 100"],
        ),
        (
            write("lost.yaml", "image: gone.png\nresolution: 0.05\norigin: [0, 0, 0]"),
            vec!["lost.yaml", "gone.png"],
        ),
        (
            write("self.yaml", "image: self.yaml\nresolution: 0.05\norigin: [0, 0, 0]"),
            vec!["self.yaml"],
        ),
    ];
    for (bad, words) in cases {
        let (code, told) = refusal(&["merge", &good, &bad, "-o", &out]);
        assert_eq!(code, Some(2), "{told}");
        assert_eq!(told.lines().count(), 1, "{told}");
        assert!(
            told.starts_with("error: ") && words.iter().all(|word| told.contains(word)),
            "{told}"
        );
    }
}

#[test]
fn options_that_are_not_understood_exit_2_and_say_what_is_allowed() {
    let folder = Folder::new();
    let good = folder.map("good.yaml", &rooms::scrap(5));
    let out = folder.text("out");
    let cases: [(&[&str], &str); 4] = [
        (&["merge", &good, "-o", &out], "2"),
        (&["merge", &good, &good, "-o", &out, "--method", "magic"], "hough"),
        (&["merge", &good, &good, "-o", &out, "--parameters", "{"], "JSON"),
        (
            &["merge", &good, &good, "-o", &out, "--parameters", r#"{"colour": 1}"#],
            "colour",
        ),
    ];
    for (arguments, word) in cases {
        let (code, told) = refusal(arguments);
        assert_eq!(code, Some(2), "{told}");
        assert!(told.contains(word), "{told}");
    }
}
