//! `acm perceive` over real frames, which are found through the variable ACM_DATA.

use crate::acm;
use serde::Deserialize;
use serde_json::Value;
use std::{collections::BTreeMap, fs, path::PathBuf};

/// The folder with the real frames, or a message that the test is skipped.
fn frames() -> Option<PathBuf> {
    let data = std::env::var_os("ACM_DATA").map(|data| PathBuf::from(data).join("rgbd_mosd/frames"));
    let found = data.filter(|folder| folder.is_dir());
    if found.is_none() {
        println!("skipped: ACM_DATA names no folder with rgbd_mosd/frames");
    }
    found
}

/// Perceives frames of the folder one after the other over one memory; their reports.
fn perceive(stems: &[&str]) -> Option<Vec<Value>> {
    let folder = frames()?;
    let path = |stem: &str, kind: &str| folder.join(format!("{stem}_{kind}.png")).display().to_string();
    let mut command = acm();
    command.args(["perceive", "--intrinsics", "525,525,319.5,239.5", "--json"]);
    for stem in stems {
        command.args(["--color", &path(stem, "color"), "--depth", &path(stem, "depth")]);
    }
    let output = command.output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    let document: Value = serde_json::from_slice(&output.stdout).unwrap();
    Some(document["frames"].as_array().unwrap().clone())
}

#[derive(Deserialize)]
struct ByHand {
    thing: Vec<Measured>,
}

#[derive(Deserialize)]
struct Measured {
    name: String,
    left: [f64; 2],
    right: [f64; 2],
    diameter: f64,
    least: Option<f64>,
    height: f64,
}

fn by_hand() -> Vec<Measured> {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/command_line/frame_33_by_hand.toml");
    toml::from_str::<ByHand>(&fs::read_to_string(path).unwrap()).unwrap().thing
}

/// The objects of a frame that lie between the left and right picks of the things, by the things' names.
fn named(frame: &Value) -> BTreeMap<String, Value> {
    let middle = |object: &Value| {
        let bound = |index: usize| object["bounds"][index].as_f64().unwrap();
        [(bound(0) + bound(2)) / 2.0, (bound(1) + bound(3)) / 2.0]
    };
    let objects = frame["objects"].as_array().unwrap();
    let mut named = BTreeMap::new();
    for thing in by_hand() {
        let at = |axis: usize| (thing.left[axis] + thing.right[axis]) / 2.0;
        let offset = |object: &&Value| (middle(object)[0] - at(0)).hypot(middle(object)[1] - at(1));
        let nearest = objects.iter().min_by(|a, b| offset(a).total_cmp(&offset(b))).unwrap();
        assert!(offset(&nearest) < 40.0, "nothing is seen where the {} is", thing.name);
        named.insert(thing.name, nearest.clone());
    }
    named
}

fn id(object: &Value) -> String {
    object["id"].as_str().expect("an identity").to_string()
}

#[test]
fn the_five_things_of_a_frame_have_the_sizes_measured_by_hand() {
    let Some(reports) = perceive(&["33"]) else { return };
    assert_eq!(reports[0]["objects"].as_array().unwrap().len(), 5, "{}", reports[0]);
    let seen = named(&reports[0]);
    for thing in by_hand() {
        let part = &seen[&thing.name]["parts"][0];
        assert_eq!(part["template"], "cylinder", "{}", thing.name);
        compare(&thing, part);
    }
}

/// The sizes are within 8 mm or 10 % of those measured by hand, or between the two of a thing that has two.
fn compare(thing: &Measured, part: &Value) {
    let value = |index: usize| part["parameters"][index]["value"].as_f64().unwrap();
    let diameter = 2.0 * value(0);
    let nearest = diameter.clamp(thing.least.unwrap_or(thing.diameter), thing.diameter);
    for (what, fitted, hand) in [("diameter", diameter, nearest), ("height", value(1), thing.height)] {
        let off = (fitted - hand).abs();
        println!("{}: {what} {:.1} mm, by hand {:.1} mm", thing.name, 1e3 * fitted, 1e3 * hand);
        assert!(off <= 0.008 || off <= 0.1 * hand, "{}: {what} {fitted:.4} m, by hand {hand:.4} m", thing.name);
    }
}

#[test]
fn rearranged_things_keep_their_identities_and_the_mugs_are_missed() {
    let Some(reports) = perceive(&["33", "34"]) else { return };
    let before = named(&reports[0]);
    // By eye on frame 34: the tin stands on its edge on the left, the lidded box is behind, the bowl in front.
    let places = [("tin", [215.0, 255.0]), ("lidded box", [372.0, 240.0]), ("bowl", [362.0, 365.0])];
    let objects = reports[1]["objects"].as_array().unwrap();
    assert_eq!(objects.len(), places.len(), "{}", reports[1]);
    for (name, [column, row]) in places {
        let covers = |object: &&Value| {
            let bound = |index: usize| object["bounds"][index].as_f64().unwrap();
            (bound(0)..=bound(2)).contains(&column) && (bound(1)..=bound(3)).contains(&row)
        };
        let object = objects.iter().find(covers).unwrap_or_else(|| panic!("the {name} is not seen"));
        let candidates = object["candidates"].as_array().unwrap().iter().map(id);
        let known = id(&before[name]);
        // The sizes are the things' own, upright or tipped over.
        assert_eq!(object["parts"][0]["template"], "cylinder", "{name}");
        let thing = by_hand().into_iter().find(|thing| thing.name == name).unwrap();
        compare(&thing, &object["parts"][0]);
        match object["status"].as_str() {
            Some("kept") => assert_eq!(id(object), known, "{name}"),
            Some("ambiguous") => assert!(candidates.into_iter().any(|c| c == known), "{name}: {object}"),
            other => panic!("the {name} is {other:?}"),
        }
    }
    let mut missing: Vec<(String, String)> = reports[1]["absent"]
        .as_array()
        .unwrap()
        .iter()
        .map(|absent| (id(absent), absent["status"].as_str().unwrap().to_string()))
        .collect();
    missing.sort();
    let mut mugs: Vec<(String, String)> =
        ["near mug", "far mug"].map(|name| (id(&before[name]), "missing".to_string())).to_vec();
    mugs.sort();
    assert_eq!(missing, mugs);
}

#[test]
fn five_frames_of_the_same_things_know_five_things() {
    // In 35 to 37 they are rearranged again: the tin upright and on its edge, the box and the bowl upside down.
    let Some(reports) = perceive(&["33", "34", "35", "36", "37"]) else { return };
    let known: Vec<String> = reports[0]["objects"].as_array().unwrap().iter().map(id).collect();
    for report in &reports[1..] {
        for object in report["objects"].as_array().unwrap() {
            assert!(known.contains(&id(object)), "a new identity in frame {}: {object}", report["stem"]);
        }
    }
}

#[test]
fn a_real_frame_seen_again_adds_no_identity() {
    let stems = ["33", "21", "26", "36"];
    for stem in stems {
        let Some(reports) = perceive(&[stem, stem, stem]) else { return };
        let ids = |report: &Value| -> Vec<String> {
            let mut ids: Vec<String> = report["objects"].as_array().unwrap().iter().map(id).collect();
            ids.sort();
            ids
        };
        for report in &reports[1..] {
            assert_eq!(ids(report), ids(&reports[0]), "frame {stem}");
            let kept = report["objects"].as_array().unwrap().iter().all(|object| object["status"] == "kept");
            assert!(kept && report["absent"].as_array().unwrap().is_empty(), "frame {stem}: {report}");
        }
    }
}
