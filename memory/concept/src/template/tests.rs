use super::*;
use crate::solid::Solid;
use glam::{DQuat, DVec3};

const PUCK: &str = r#"
template = "puck"
seen_by = "depth"
affordances = ["graspable"]
constraints = ["height < 2 * radius"]
[synopsis]
description = "a low disc"
affordance = "grasp across"
intended_use = "to slide"
nouns = [{ noun = "coaster", when = "height < 0.01" }, { noun = "puck" }]
[[parameter]]
name = "radius"
unit = "m"
min = 0.01
max = 0.1
initial = "circle_radius"
[[parameter]]
name = "height"
unit = "m"
min = 0.005
max = 0.05
initial = "extent_z"
[[solid]]
shape = "cylinder"
radius = "radius"
height = "height"
position = ["0", "0", "height / 2"]
[[frame]]
name = "top"
position = ["0", "0", "height"]
[[symmetry]]
fold = 0
[[function]]
name = "pick"
kind = "grasp-from-above"
frame = "top"
arguments = { width = "2 * radius" }
preconditions = ["hand-empty()"]
effects = ["holding(?self)", "not hand-empty()"]
"#;

#[test]
fn a_template_is_read_and_evaluated() {
    let puck = Template::parse("puck.toml", PUCK).unwrap();
    let values = puck.initial_values([0.06, 0.06, 0.02, 0.03]).unwrap();
    let named = puck.named(&values);
    assert_eq!(values, [0.03, 0.02]);
    assert!(puck.admits(&named));
    assert_eq!(puck.nouns(&named), ["puck"]);
    assert_eq!(puck.yaw_symmetry(&named).unwrap(), YawSymmetry::Continuous);
    let solids = puck.solids(&named).unwrap();
    assert_eq!(solids[0].solid, Solid::Cylinder { radius: 0.03, height: 0.02 });
    assert!((puck.frame("top", &named).unwrap().unwrap().translation.z - 0.02).abs() < 1e-12);
    assert_eq!(puck.function("pick").unwrap().effects[1].to_string(), "not hand-empty()");
}

#[test]
fn a_frame_may_look_out_of_any_side() {
    let axes =
        [("x", DVec3::X), ("-x", -DVec3::X), ("y", DVec3::Y), ("-y", -DVec3::Y), ("z", DVec3::Z), ("-z", -DVec3::Z)];
    for (name, out) in axes {
        let text = PUCK.replace("name = \"top\"", &format!("name = \"top\"\nout = \"{name}\""));
        let puck = Template::parse("puck.toml", &text).unwrap();
        let frame = puck.frame("top", &puck.named(&[0.03, 0.02])).unwrap().unwrap();
        assert!(frame.transform_vector(DVec3::Z).distance(out) < 1e-12, "{name}");
        // Fingers that close along y close level, unless a turn says otherwise.
        assert!(frame.transform_vector(DVec3::Y).z.abs() < 1e-12, "{name}");
    }
    let wrong = PUCK.replace("name = \"top\"", "name = \"top\"\nout = \"up\"");
    assert!(Template::parse("puck.toml", &wrong).unwrap_err().to_string().contains("-x"));
}

#[test]
fn mistakes_are_named() {
    let error = |from: &str, to: &str| Template::parse("puck.toml", &PUCK.replace(from, to)).unwrap_err().to_string();
    assert!(error("seen_by", "sen_by").contains("did you mean `seen_by`"));
    assert!(error("max = 0.1\n", "max = 0.001\n").contains("`radius` has the range 0.01 to 0.001"));
    assert!(error("name = \"height\"", "name = \"E\"").contains("name of a constant"));
    assert!(error("max = 0.1\n", "max = 50.0\n").contains("lengths must lie in"));
    assert!(error("initial = \"extent_z\"", "initial = \"0.2\"").contains("out of its range"));
    assert!(error("frame = \"top\"", "frame = \"tip\"").contains("`tip`"));
    assert!(error("\"2 * radius\"", "\"2 * radus\"").contains("`radus`"));
    assert!(error("hand-empty()\"]", "hand empty\"]").contains("cannot read"));
}

#[test]
fn a_type_may_be_declared_once() {
    let twice = TemplateLibrary::parse([("a.toml", PUCK), ("b.toml", PUCK)]);
    assert!(matches!(twice, Err(TemplateError::Duplicate { file, .. }) if file == "b.toml"));
    let library = TemplateLibrary::parse([("a.toml", PUCK)]).unwrap();
    assert_eq!(library.with_noun("coaster").count(), 1);
}

#[test]
fn a_rest_turns_the_part_and_has_its_own_symmetry() {
    let text = format!("{PUCK}[[rest]]\nup = \"y\"\nfold = 2\n");
    let puck = Template::parse("puck.toml", &text).unwrap();
    let [rest] = puck.rests[..] else { panic!("one rest") };
    assert!((rest.turn() * DVec3::Y).distance(DVec3::Z) < 1e-12);
    assert_eq!((rest.prior, rest.like_upright), (0.2, false));
    let values = [("radius", 0.03), ("height", 0.02)];
    let symmetry = |rotation: DQuat| puck.symmetry_at(&values, rotation).unwrap();
    let heading = DQuat::from_rotation_z(0.7);
    assert_eq!(symmetry(heading), YawSymmetry::Continuous);
    assert_eq!(symmetry(heading * rest.turn()), YawSymmetry::Fold(2));
    assert_eq!(symmetry(heading * DQuat::from_rotation_y(1.5)), YawSymmetry::Fold(1));
    let refused =
        |rest: &str| Template::parse("puck.toml", &format!("{PUCK}[[rest]]\n{rest}\n")).unwrap_err().to_string();
    assert!(refused("up = \"z\"").contains("`z`"));
    assert!(refused("up = \"x\"\nprior = 0.0").contains("prior 0"));
}

/// A box with a flap that opens about its -x edge.
const CASE: &str = r#"
template = "case"
seen_by = "depth"
affordances = ["supportive"]
[synopsis]
description = "a box with a flap"
affordance = "the flap opens"
intended_use = "to keep things"
nouns = [{ noun = "case" }]
[[parameter]]
name = "length"
unit = "m"
min = 0.05
max = 0.3
initial = "extent_x"
[[parameter]]
name = "opening"
unit = "rad"
min = 0.0
max = 1.6
initial = "0.5"
[[part]]
name = "body"
[[part]]
name = "flap"
affordances = ["openable"]
position = ["-length / 2", "0", "0.04"]
tilt = "-opening"
[[solid]]
part = "body"
shape = "box"
size = ["length", "0.1", "0.04"]
position = ["0", "0", "0.02"]
[[solid]]
part = "flap"
shape = "box"
size = ["length", "0.1", "0.01"]
position = ["length / 2", "0", "0.005"]
"#;

#[test]
fn parts_move_with_the_parameters() {
    let case = Template::parse("case.toml", CASE).unwrap();
    let values = [("length", 0.2), ("opening", std::f64::consts::FRAC_PI_2)];
    let frames = case.part_frames(&values).unwrap();
    // Opened by a right angle the flap points straight up from the hinge.
    let tip = frames[1].transform_point(DVec3::new(0.2, 0.0, 0.0));
    assert!(tip.distance(DVec3::new(-0.1, 0.0, 0.24)) < 1e-12, "{tip}");
    let solids = case.solids(&values).unwrap();
    assert!((solids[1].half_extents() - DVec3::new(0.005, 0.05, 0.1)).length() < 1e-12);
    assert_eq!(case.part_solids("flap", &values).unwrap().len(), 1);
    assert!(case.part_solids("lid", &values).unwrap().is_empty());
    assert_eq!(case.parts[0].affordances, ["supportive"], "the template's own affordances are the main part's");
    assert_eq!(case.affordances().collect::<Vec<_>>(), ["supportive", "openable"]);
    // A frame may move with a part.
    let edge = "[[frame]]\nname = \"edge\"\npart = \"flap\"\nposition = [\"length\", \"0\", \"0\"]\nout = \"x\"\n";
    let with_edge = Template::parse("case.toml", &format!("{CASE}{edge}")).unwrap();
    let edge = with_edge.frame("edge", &values).unwrap().unwrap();
    assert!(edge.translation.distance(tip) < 1e-12 && edge.transform_vector(DVec3::Z).distance(DVec3::Z) < 1e-12);
    let error = |from: &str, to: &str| Template::parse("case.toml", &CASE.replace(from, to)).unwrap_err().to_string();
    assert!(error("part = \"flap\"", "part = \"flip\"").contains("`flip`, which is not among: body, flap"));
    assert!(error("name = \"flap\"", "name = \"body\"").contains("`body` is declared twice"));
}

#[test]
fn the_common_symmetry_holds_at_all_values() {
    let fold = |rules: &str| {
        let text = PUCK.replace("[[symmetry]]\nfold = 0\n", rules);
        Template::parse("puck.toml", &text).unwrap().common_symmetry()
    };
    let rule = |fold: u32, when: &str| format!("[[symmetry]]\nfold = {fold}\n{when}\n");
    let flat = "when = \"height < 0.01\"";
    assert_eq!(fold(&rule(0, "")), YawSymmetry::Continuous);
    assert_eq!(fold(&(rule(4, flat) + &rule(2, ""))), YawSymmetry::Fold(2));
    assert_eq!(fold(&(rule(0, flat) + &rule(3, ""))), YawSymmetry::Fold(3));
    assert_eq!(fold(&rule(4, flat)), YawSymmetry::Fold(1));
    assert_eq!(fold(""), YawSymmetry::Fold(1));
}

#[test]
fn solids_may_be_hollow_lie_and_be_turned() {
    let solids = |solid: &str| {
        let text = PUCK.replace("shape = \"cylinder\"\nradius = \"radius\"\nheight = \"height\"", solid);
        let puck = Template::parse("puck.toml", &text).map_err(|e| e.to_string())?;
        puck.solids(&[("radius", 0.05), ("height", 0.04)]).map_err(|e| e.to_string())
    };
    let distance = |solid: &str, at: [f64; 3]| {
        solids(solid).unwrap().iter().map(|s| s.signed_distance(at.into())).fold(f64::INFINITY, f64::min)
    };
    // A cup: 4 mm of floor, and nothing above its middle.
    let cup = "shape = \"cone\"\nradius_bottom = \"radius - 0.01\"\nradius_top = \"radius\"\nheight = \"height\"\nwall = \"0.004\"";
    assert!((distance(cup, [0.0, 0.0, 0.014]) - 0.01).abs() < 1e-12);
    assert!(distance(cup, [0.0475, 0.0, 0.039]) < 0.0);
    // A box without a lid is its floor and four walls.
    let tray = "shape = \"box\"\nsize = [\"0.2\", \"0.1\", \"height\"]\nwall = \"0.004\"";
    assert_eq!(solids(tray).unwrap().len(), 5);
    assert!((distance(tray, [0.0, 0.0, 0.024]) - 0.02).abs() < 1e-12);
    assert!(distance(tray, [0.099, 0.0, 0.03]) < 0.0 && distance(tray, [0.0, 0.099, 0.03]) > 0.04);
    // A rod along y, and one along x that is turned by a right angle: the same.
    let rod = "shape = \"cylinder\"\nradius = \"0.01\"\nheight = \"0.2\"\naxis = ";
    for rod in [format!("{rod}\"y\""), format!("{rod}\"x\"\nyaw = \"PI / 2\"")] {
        assert!((distance(&rod, [0.0, 0.11, 0.02]) - 0.01).abs() < 1e-9, "{rod}");
    }
    // A profile says itself how high it is.
    let ring = "shape = \"revolved\"\nprofile = [[\"radius / 2\", \"0\"], [\"radius\", \"0\"], [\"radius\", \"height\"], [\"radius / 2\", \"height\"]]";
    assert!((distance(ring, [0.0, 0.0, 0.04]) - 0.025).abs() < 1e-12);
    let egg = "shape = \"ellipsoid\"\nsize = [\"0.06\", \"0.04\", \"height\"]";
    assert!(distance(egg, [0.03, 0.0, 0.02]).abs() < 1e-9);
    assert!(
        solids("shape = \"cone\"\nradius_top = \"radius\"\nheight = \"height\"")
            .unwrap_err()
            .contains("needs `radius_bottom`")
    );
    assert!(solids("shape = \"ellipsoid\"\nradius = \"radius\"").unwrap_err().contains("`ellipsoid` has no `radius`"));
    assert!(solids("shape = \"revolved\"\nprofile = [[\"0\", \"0\"]]").unwrap_err().contains("not 1"));
}

#[test]
fn typical_values_are_the_middle_unless_a_constraint_forbids_it() {
    let typical = |constraints: &str| {
        let text = PUCK.replace("constraints = [\"height < 2 * radius\"]", &format!("constraints = [{constraints}]"));
        Template::parse("puck.toml", &text).unwrap().typical()
    };
    let middle = [(0.01f64 * 0.1).sqrt(), (0.005f64 * 0.05).sqrt()];
    let near = |a: Option<Vec<f64>>, b: [f64; 2]| a.unwrap().iter().zip(b).all(|(a, b)| (a / b - 1.0).abs() < 0.02);
    assert!(near(typical(""), middle));
    // The nearest to the middle on the line where both are equal.
    let both = (middle[0] * middle[1]).sqrt();
    assert!(near(typical("\"height > radius\""), [both, both]));
    assert_eq!(typical("\"height > radius\", \"radius > 2 * height\""), None);
}
