//! `acm perceive` over small frames that the tests draw themselves.

use crate::{acm, refuses, synthetic};
use serde_json::Value;
use std::{fs, path::Path};
use synthetic::{INTRINSICS_TEXT, Thing, can, cuboid, lying_can, write, write_blank};

const RED: [u8; 3] = [190, 40, 40];
const GREEN: [u8; 3] = [40, 150, 60];

/// A red box and a green can; the can has moved in the second frame, and the box is gone in the third.
fn story(folder: &Path) {
    let red = || cuboid([0.10, 0.06, 0.05], -0.12, 0.55, 0.3, RED);
    let green = |x, y| can(0.035, 0.09, x, y, GREEN);
    write(folder, "f1", &[red(), green(0.10, 0.5)]);
    write(folder, "f2", &[red(), green(0.16, 0.65)]);
    write(folder, "f10", &[green(0.16, 0.65)]);
}

/// Runs `acm perceive` with a folder and expects an exit code; returns standard output.
fn perceive(arguments: &[&str], code: i32) -> String {
    let mut all = vec!["perceive", "--intrinsics", INTRINSICS_TEXT];
    all.extend(arguments);
    let output = acm().args(&all).output().unwrap();
    let message = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(code), "{arguments:?}: {message}");
    String::from_utf8(output.stdout).unwrap()
}

fn json(arguments: &[&str], code: i32) -> Value {
    let document: Value = serde_json::from_str(&perceive(&[arguments, &["--json"]].concat(), code)).unwrap();
    assert_eq!(document["schema"], "acm.perceive/2");
    document
}

/// Ids and statuses of a frame's objects, by category.
fn told(frame: &Value) -> Vec<(String, String, String)> {
    let text = |value: &Value| value.as_str().unwrap_or_default().to_string();
    let objects = frame["objects"].as_array().unwrap().iter();
    let absent = frame["absent"].as_array().unwrap().iter();
    let mut told: Vec<_> =
        objects.chain(absent).map(|o| (text(&o["category"]), text(&o["id"]), text(&o["status"]))).collect();
    told.sort();
    told
}

fn triple(category: &str, id: &str, status: &str) -> (String, String, String) {
    (category.into(), id.into(), status.into())
}

#[test]
fn a_folder_keeps_identities_from_frame_to_frame() {
    let dir = tempfile::tempdir().unwrap();
    story(dir.path());
    let document = json(&["--frames", dir.path().to_str().unwrap()], 0);
    let frames = document["frames"].as_array().unwrap();
    let stems: Vec<&str> = frames.iter().map(|f| f["stem"].as_str().unwrap()).collect();
    assert_eq!(stems, ["f1", "f2", "f10"]);
    let (block, can) = (told(&frames[0])[0].1.clone(), told(&frames[0])[1].1.clone());
    assert_eq!(told(&frames[0]), [triple("block", &block, "new"), triple("can", &can, "new")]);
    assert_eq!(told(&frames[1]), [triple("block", &block, "kept"), triple("can", &can, "kept")]);
    assert_eq!(told(&frames[2]), [triple("block", &block, "missing"), triple("can", &can, "kept")]);
    let sizes: Vec<f64> = frames[0]["objects"]
        .as_array()
        .unwrap()
        .iter()
        .find(|o| o["category"] == "block")
        .map(|o| o["parts"][0]["parameters"].as_array().unwrap().iter().map(|p| p["value"].as_f64().unwrap()).collect())
        .unwrap();
    for (size, truth) in sizes.iter().zip([0.10, 0.06, 0.05]) {
        assert!((size - truth).abs() < 0.006, "{sizes:?}");
    }
}

#[test]
fn a_memory_folder_carries_identities_to_the_next_call() {
    let dir = tempfile::tempdir().unwrap();
    story(dir.path());
    let memory = dir.path().join("memory");
    let file = |stem: &str, kind: &str| dir.path().join(format!("{stem}_{kind}.png")).display().to_string();
    let call = |stem: &str| {
        let (color, depth) = (file(stem, "color"), file(stem, "depth"));
        json(&["--color", &color, "--depth", &depth, "--memory", memory.to_str().unwrap()], 0)
    };
    let (first, second) = (call("f1"), call("f2"));
    let ids = |document: &Value| -> Vec<String> { told(&document["frames"][0]).into_iter().map(|t| t.1).collect() };
    assert_eq!(ids(&first), ids(&second));
    // Without a memory the second frame knows nothing of the first.
    let alone = json(&["--color", &file("f2", "color"), "--depth", &file("f2", "depth")], 0);
    assert!(told(&alone["frames"][0]).iter().all(|(_, _, status)| status == "new"), "{alone}");
}

#[test]
fn things_that_were_tipped_over_are_known_again() {
    let dir = tempfile::tempdir().unwrap();
    write(dir.path(), "1", &[cuboid([0.15, 0.07, 0.05], -0.12, 0.6, 0.3, RED), can(0.05, 0.06, 0.12, 0.5, GREEN)]);
    write(
        dir.path(),
        "2",
        &[cuboid([0.07, 0.05, 0.15], 0.1, 0.7, 0.9, RED), lying_can(0.05, 0.06, -0.1, 0.5, 0.5, GREEN)],
    );
    write(
        dir.path(),
        "3",
        &[cuboid([0.15, 0.05, 0.07], 0.1, 0.5, 0.2, RED), lying_can(0.05, 0.06, -0.1, 0.5, 0.5, GREEN)],
    );
    let document = json(&["--frames", dir.path().to_str().unwrap()], 0);
    let frames = document["frames"].as_array().unwrap();
    let sizes = |object: &Value| -> Vec<f64> {
        let parameters = object["parts"][0]["parameters"].as_array().unwrap();
        parameters.iter().map(|p| p["value"].as_f64().unwrap()).collect()
    };
    for frame in &frames[1..] {
        assert!(told(frame).iter().all(|(_, _, status)| status == "kept"), "{:?}", told(frame));
        for object in frame["objects"].as_array().unwrap() {
            let truth: &[f64] =
                if object["parts"][0]["template"] == "box" { &[0.15, 0.07, 0.05] } else { &[0.05, 0.06] };
            for (size, truth) in sizes(object).iter().zip(truth) {
                assert!((size - truth).abs() < 0.008, "{object}");
            }
        }
    }
}

#[test]
fn the_text_has_a_line_for_every_object() {
    let dir = tempfile::tempdir().unwrap();
    story(dir.path());
    let text = perceive(&["--frames", dir.path().to_str().unwrap()], 0);
    let lines: Vec<&str> = text.lines().collect();
    assert_eq!(lines.len(), 3 + 2 + 2 + 2, "{text}");
    assert!(lines[0].starts_with("f1: 2 objects"), "{text}");
    let of = |part: &str| lines.iter().filter(|line| line.contains(part)).count();
    assert_eq!((of(" new "), of(" kept "), of(" missing ")), (2, 3, 1), "{text}");
    assert_eq!(of("cylinder  radius 3."), 3, "{text}");
}

#[test]
fn overlays_and_labels_go_where_they_are_asked_for() {
    let dir = tempfile::tempdir().unwrap();
    story(dir.path());
    let (overlays, labels) = (dir.path().join("out/overlays"), dir.path().join("out/labels"));
    let frames = dir.path().to_str().unwrap();
    perceive(&["--frames", frames, "--overlay", overlays.to_str().unwrap(), "--labels", labels.to_str().unwrap()], 0);
    for stem in ["f1", "f2", "f10"] {
        let picture = image::open(overlays.join(format!("{stem}_overlay.png"))).unwrap();
        assert_eq!((picture.width(), picture.height()), (320, 240));
    }
    let image::DynamicImage::ImageLuma16(label) = image::open(labels.join("f1_label.png")).unwrap() else {
        panic!("the label image is not of 16-bit grey")
    };
    let mut counts = [0usize; 3];
    label.pixels().for_each(|pixel| counts[usize::from(pixel.0[0])] += 1);
    assert!(counts[1] >= counts[2] && counts[2] > 500, "{counts:?}");
    let (color, depth) = (dir.path().join("f1_color.png"), dir.path().join("f1_depth.png"));
    let file = dir.path().join("one.png");
    perceive(
        &["--color", color.to_str().unwrap(), "--depth", depth.to_str().unwrap(), "--overlay", file.to_str().unwrap()],
        0,
    );
    assert!(file.is_file());
}

#[test]
fn a_given_camera_pose_puts_things_into_its_world() {
    let dir = tempfile::tempdir().unwrap();
    let cube: Thing = cuboid([0.05, 0.05, 0.05], 0.08, 0.6, 0.0, RED);
    write(dir.path(), "one", std::slice::from_ref(&cube));
    let mut pose = synthetic::camera();
    pose.translation += glam::DVec3::new(1.0, -2.0, 0.5);
    let (t, q) = (pose.translation, pose.rotation);
    let numbers = [t.x, t.y, t.z, q.x, q.y, q.z, q.w].map(|n| format!("{n:.6}"));
    let frames = dir.path().to_str().unwrap();
    let poses = dir.path().join("poses.txt");
    fs::write(&poses, format!("# stem x y z qx qy qz qw\nother 0 0 0 0 0 0 1\none {}\n", numbers.join(" "))).unwrap();
    let given = numbers.join(",");
    for arguments in [["--camera-pose", given.as_str()], ["--camera-poses", poses.to_str().unwrap()]] {
        let document = json(&[&["--frames", frames], &arguments[..]].concat(), 0);
        let at = &document["frames"][0]["objects"][0]["parts"][0]["pose"]["pose"]["translation"];
        for (axis, truth) in [1.08, -1.4, 0.5].into_iter().enumerate() {
            assert!((at[axis].as_f64().unwrap() - truth).abs() < 0.008, "{at}");
        }
    }
    fs::write(&poses, "other 0 0 0 0 0 0 1\n").unwrap();
    let common = ["perceive", "--intrinsics", INTRINSICS_TEXT, "--frames", frames];
    let refuse = |arguments: &[&str], parts: &[&str]| refuses(&[&common[..], arguments].concat(), parts);
    refuse(&["--camera-poses", poses.to_str().unwrap()], &["poses.txt", "`one`"]);
    fs::write(&poses, "one 0 0 0 0 0 1\n").unwrap();
    refuse(&["--camera-poses", poses.to_str().unwrap()], &["poses.txt line 1", "needs 7 numbers", "got 6"]);
    refuse(&["--camera-pose", "0,0,1,1,0,0,1"], &["--camera-pose", "length"]);
    refuse(&["--camera-pose", "0,0,1"], &["--camera-pose", "needs 7 numbers", "got 3"]);
}

#[test]
fn frames_that_show_nothing_say_so_and_end_with_3() {
    let dir = tempfile::tempdir().unwrap();
    story(dir.path());
    write_blank(dir.path(), "f3", 0, 700);
    write_blank(dir.path(), "f4", 120, 0);
    let document = json(&["--frames", dir.path().to_str().unwrap()], 3);
    let frames = document["frames"].as_array().unwrap();
    let blindness: Vec<&Value> = frames.iter().map(|f| &f["blindness"]).collect();
    assert_eq!(blindness, [&Value::Null, &Value::Null, &"no-color".into(), &"no-depth".into(), &Value::Null]);
    // The blind frames have changed nothing: what was there is unseen in them, and the story goes on after them.
    assert!(told(&frames[2]).iter().chain(&told(&frames[3])).all(|(_, _, status)| status == "unseen"));
    let (before, after) = (told(&frames[1]), told(&frames[4]));
    assert_eq!(after, [triple("block", &before[0].1, "missing"), triple("can", &before[1].1, "kept")]);
}

#[test]
fn the_same_frame_again_adds_no_identity() {
    let dir = tempfile::tempdir().unwrap();
    story(dir.path());
    for stem in ["f1b", "f1c"] {
        for kind in ["color", "depth"] {
            let from = dir.path().join(format!("f1_{kind}.png"));
            fs::copy(from, dir.path().join(format!("{stem}_{kind}.png"))).unwrap();
        }
    }
    let document = json(&["--frames", dir.path().to_str().unwrap()], 0);
    let frames = document["frames"].as_array().unwrap();
    assert!(told(&frames[1]).iter().chain(&told(&frames[2])).all(|(_, _, status)| status == "kept"), "{document}");
}

#[test]
fn folders_that_hold_no_frames_are_refused_by_name() {
    let dir = tempfile::tempdir().unwrap();
    let frames = dir.path().to_str().unwrap();
    let common = ["perceive", "--intrinsics", INTRINSICS_TEXT, "--frames"];
    let refuse = |folder: &str, parts: &[&str]| refuses(&[&common[..], &[folder]].concat(), parts);
    refuse(frames, &["holds no frames"]);
    refuse(dir.path().join("absent").to_str().unwrap(), &["absent", "cannot be read"]);
    write_blank(dir.path(), "a", 100, 500);
    write_blank(dir.path(), "b", 100, 500);
    fs::remove_file(dir.path().join("b_depth.png")).unwrap();
    refuse(frames, &["b_color.png", "no partner"]);
    fs::remove_file(dir.path().join("b_color.png")).unwrap();
    fs::copy(dir.path().join("a_color.png"), dir.path().join("a-color.png")).unwrap();
    refuse(frames, &["a_color.png", "a-color.png", "keep one"]);
}

#[test]
fn images_of_the_wrong_kind_or_size_are_refused_by_name() {
    let dir = tempfile::tempdir().unwrap();
    let path = |name: &str| dir.path().join(name).display().to_string();
    write_blank(dir.path(), "a", 100, 500);
    image::GrayImage::new(320, 240).save(path("grey.png")).unwrap();
    image::RgbImage::new(64, 48).save(path("small.png")).unwrap();
    let whole = fs::read(path("a_depth.png")).unwrap();
    fs::write(path("torn.png"), &whole[..whole.len() / 2]).unwrap();
    fs::write(path("huge.png"), huge_png()).unwrap();
    let run = |color: &str, depth: &str, parts: &[&str]| {
        refuses(
            &["perceive", "--intrinsics", INTRINSICS_TEXT, "--color", &path(color), "--depth", &path(depth)],
            parts,
        );
    };
    run("a_color.png", "grey.png", &["grey.png", "8-bit grey", "16-bit grey"]);
    run("a_depth.png", "a_depth.png", &["a_depth.png", "colour"]);
    run("a_color.png", "a_color.png", &["a_color.png", "depth", "16-bit grey"]);
    run("small.png", "a_depth.png", &["small.png", "(64, 48)", "(320, 240)"]);
    run("a_color.png", "torn.png", &["torn.png"]);
    run("huge.png", "a_depth.png", &["huge.png", "too large", "60000x60000"]);
}

#[test]
fn calibration_that_no_camera_has_is_refused() {
    let dir = tempfile::tempdir().unwrap();
    write_blank(dir.path(), "a", 100, 500);
    let frames = dir.path().to_str().unwrap();
    let run = |intrinsics: &str, scale: &str, parts: &[&str]| {
        refuses(&["perceive", "--frames", frames, "--intrinsics", intrinsics, "--depth-scale", scale], parts);
    };
    run("290,290,159.5", "0.001", &["--intrinsics", "needs 4 numbers", "got 3"]);
    run("290,290,159.5,119.5,0", "0.001", &["--intrinsics", "needs 4 numbers", "got 5"]);
    run("290,x,159.5,119.5", "0.001", &["--intrinsics", "`x`"]);
    run("-290,290,159.5,119.5", "0.001", &["fx", "-290"]);
    run("290,290,1595,119.5", "0.001", &["cx", "1595", "320"]);
    run("290,290,159.5,119.5", "-1", &["depth scale", "-1"]);
    run("290,290,159.5,119.5", "nan", &["depth scale", "NaN"]);
}

#[test]
fn more_colour_than_depth_is_refused() {
    let dir = tempfile::tempdir().unwrap();
    write_blank(dir.path(), "a", 100, 500);
    let path = |kind: &str| dir.path().join(format!("a_{kind}.png")).display().to_string();
    let (color, depth) = (path("color"), path("depth"));
    refuses(
        &["perceive", "--intrinsics", INTRINSICS_TEXT, "--color", &color, "--color", &color, "--depth", &depth],
        &["2 --color", "1 --depth"],
    );
}

#[test]
fn without_its_data_the_bench_says_that_it_skipped() {
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("result.json");
    let output = acm()
        .args(["bench", "perception", "--only", "real-frames", "--json", file.to_str().unwrap()])
        .env_remove("ACM_DATA")
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    let result: Value = serde_json::from_slice(&fs::read(&file).unwrap()).unwrap();
    assert_eq!((&result["schema"], &result["bench"]), (&"acm.bench/1".into(), &"perception".into()));
    assert_eq!(result["figures"], serde_json::json!({}));
    let rows = result["rows"].as_array().unwrap();
    assert!(rows.len() == 3 && rows.iter().all(|row| row["skipped"].as_str().unwrap().contains("ACM_DATA")));
    let against = dir.path().join("targets.toml");
    refuses(&["bench", "perception", "--against", against.to_str().unwrap()], &["targets.toml", "cannot be read"]);
    fs::write(&against, "[perception]\nmosd_overlap_f = { mst = 0.9 }\n").unwrap();
    refuses(&["bench", "perception", "--against", against.to_str().unwrap()], &["targets.toml", "mst"]);
}

/// The beginning of a PNG that claims 60000 x 60000 pixels.
fn huge_png() -> Vec<u8> {
    let mut bytes = b"\x89PNG\r\n\x1a\n".to_vec();
    let size = 60_000u32.to_be_bytes();
    let header = [&size[..], &size, &[8, 2, 0, 0, 0]].concat();
    for (kind, content) in [(b"IHDR", header), (b"IDAT", vec![0x78, 0x9c])] {
        let checked = [&kind[..], &content].concat();
        bytes.extend(u32::try_from(content.len()).unwrap().to_be_bytes());
        bytes.extend(&checked);
        bytes.extend(crc32(&checked).to_be_bytes());
    }
    bytes
}

fn crc32(bytes: &[u8]) -> u32 {
    let bit = |crc: u32| if crc & 1 == 1 { (crc >> 1) ^ 0xedb8_8320 } else { crc >> 1 };
    !bytes.iter().fold(!0u32, |crc, byte| (0..8).fold(crc ^ u32::from(*byte), |crc, _| bit(crc)))
}

#[test]
fn a_tool_that_nobody_serves_is_said_and_geometry_goes_on() {
    let dir = tempfile::tempdir().unwrap();
    story(dir.path());
    // Nobody listens at a port that was just given back.
    let address = std::net::TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap();
    let config = dir.path().join("acm.toml");
    fs::write(&config, format!("[tools]\nsegmenter = 'http://{address}'\n")).unwrap();
    let (frames, config) = (dir.path().to_str().unwrap(), config.to_str().unwrap());
    let document = json(&["--frames", frames, "--config", config], 0);
    for frame in document["frames"].as_array().unwrap() {
        let call = &frame["tools"][0];
        assert_eq!((&call["asked"], &call["outcome"]), (&"segment".into(), &"failed".into()), "{call}");
        assert_eq!(call["made"], "geometry's segments");
    }
    let alone = json(&["--frames", frames], 0);
    let objects = |document: &Value| document["frames"][0]["objects"].clone();
    assert_eq!(objects(&document), objects(&alone));
    assert!(alone["frames"][0].get("tools").is_none());
    let text = perceive(&["--frames", frames, "--config", config], 0);
    assert!(text.contains("asked to segment: failed, cannot be reached"), "{text}");
}

#[test]
fn tools_that_cannot_be_opened_and_runs_with_tools_are_refused() {
    let dir = tempfile::tempdir().unwrap();
    story(dir.path());
    let config = dir.path().join("acm.toml");
    let (frames, path) = (dir.path().to_str().unwrap(), config.to_str().unwrap());
    for (text, parts) in [
        ("segmenter = 'localhost'", &["tools.segmenter", "localhost", "http://HOST:PORT"][..]),
        ("pose_estimator = 'https://a.b'", &["tools.pose_estimator", "https://a.b"]),
        ("param_estimator = 'onnx:no-such.onnx'", &["tools.param_estimator", "onnx"]),
    ] {
        fs::write(&config, format!("[tools]\n{text}\n")).unwrap();
        let arguments = ["perceive", "--intrinsics", INTRINSICS_TEXT, "--frames", frames, "--config", path];
        refuses(&arguments, &[&[path], parts].concat());
    }
    fs::write(&config, "[tools]\nsegmenter = 'http://127.0.0.1:1'\n").unwrap();
    refuses(&["run", "put-back-block", "--config", path], &[path, "tools.segmenter", "replayed", "acm perceive"]);
}
