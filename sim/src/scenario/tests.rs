#![allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]
use super::*;

fn text(name: &str) -> &'static str {
    EMBEDDED.get_file(format!("{name}.toml")).unwrap().contents_utf8().unwrap()
}
fn message(from: &str, to: &str) -> String {
    let original = text("put-back-block");
    assert!(original.contains(from), "the test looks for `{from}`");
    Scenario::parse("s.toml", &original.replacen(from, to, 1)).unwrap_err().to_string()
}

#[test]
fn all_embedded_scenarios_are_sound() {
    assert!(Scenario::names().len() >= 2);
    for name in Scenario::names() {
        let scenario = Scenario::open(&name).unwrap();
        assert_eq!(scenario.name(), name);
        assert!(!scenario.summary().is_empty() && !scenario.paraphrases().is_empty());
    }
}

#[test]
fn a_file_beats_a_name() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("mine.toml");
    std::fs::write(&path, text("put-back-block").replace("\"put-back-block\"", "\"mine\"")).unwrap();
    assert_eq!(Scenario::open(path.to_str().unwrap()).unwrap().name(), "mine");
}

#[test]
fn mistakes_name_the_file_the_field_and_a_way_out() {
    let cases = [
        ("fov_y_deg = 50.0", "fov_y_degr = 50.0", "did you mean `fov_y_deg`"),
        ("model = \"red-cube\"", "model = \"red-cub\"", "did you mean `red-cube`"),
        ("model = \"red-cube\"", "model = \"spaceship\"", "known: bar-microwave, blue-mat, card-box-1,"),
        ("fov_y_deg = 50.0", "fov_y_deg = 500.0", "camera `head`.fov_y_deg: 500 must lie in 1 to 170"),
        ("cube_z < 0.7\"", "cbe_z < 0.7\"", "names `cbe_z`"),
        ("before = \"the cube stands in the middle\"", "before = \"never\"", "there is no stage `never`"),
        ("index = \"start_mat\"", "index = \"start_mt\"", "names `start_mt`"),
        ("name = \"cube\"", "name = \"Cube\"", "lower-case"),
        ("name = \"cube\"", "name = \"mat\"", "is taken"),
        ("count = 15", "count = \"later\"", "names `later`"),
        ("seconds = 120.0", "seconds = -1.0", "task.budgets.seconds: -1 must lie in"),
        ("moves = [\"cube\"]", "moves = [\"cub\"]", "did you mean `cube`"),
        ("size = [1.2, 0.7, 0.05]", "size = [1.2, 0.0, 0.05]", "surface `table`"),
        ("on = { object = \"mat\"", "on = { object = \"later\"", "not declared before"),
        ("kind = \"choice\"", "kind = \"choise\"", "choise"),
    ];
    for (from, to, expected) in cases {
        let message = message(from, to);
        assert!(message.contains("s.toml") && message.contains(expected), "{from} -> {to}: {message}");
    }
    assert!(Scenario::open("nowhere").unwrap_err().to_string().contains("put-back-block-jittered"));
    assert!(Scenario::parse("s.toml", &" ".repeat(MAX_SCENARIO_BYTES + 1)).is_err());
}

#[test]
fn the_schema_documents_every_field() {
    let schema: serde_json::Value = serde_json::from_str(&Scenario::schema()).unwrap();
    let definitions = schema["$defs"].as_object().unwrap();
    let mut fields = 0;
    for definition in definitions.values().chain([&schema]) {
        let variants = definition["oneOf"].as_array().into_iter().flatten();
        for object in variants.chain([definition]) {
            for (name, field) in object["properties"].as_object().into_iter().flatten() {
                let is_tag = field.get("const").is_some();
                assert!(is_tag || field["description"].is_string(), "`{name}` has no description: {field}");
                fields += 1;
            }
        }
    }
    assert!(fields > 80, "only {fields} fields");
}

#[test]
fn cameras_look_where_they_are_told() {
    let scenario = Scenario::open("put-back-block").unwrap();
    let camera = &scenario.world.cameras[0].model;
    // The left mat appears left of and as high as the right one; twice the published pixels of a 320x240 image.
    let pixel = |x, y| {
        let point = camera.pose.inverse().transform_point(glam::DVec3::new(x, y, 0.741));
        camera.intrinsics.project(point).unwrap()
    };
    assert!(pixel(0.0, -0.1).distance(glam::DVec2::new(343.6, 302.6)) < 1.5, "{}", pixel(0.0, -0.1));
    assert!(pixel(0.2, -0.1).distance(glam::DVec2::new(491.4, 302.6)) < 1.5, "{}", pixel(0.2, -0.1));
}
