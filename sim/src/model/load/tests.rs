#![allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]
use super::*;
use crate::model::joint::{Follows, JointKind};
use glam::DVec3;

fn load_text(name: &str, text: &str) -> Result<ObjectModel, String> {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join(name), text).unwrap();
    load(name, folder.path(), Wanted::Whole)
}

const CABINET: &str = r#"<robot name="cabinet">
  <material name="oak"><color rgba="1 0.5 0 1"/></material>
  <link name="world"/>
  <joint name="stand" type="fixed"><parent link="world"/><child link="body"/><origin xyz="1 2 3"/></joint>
  <link name="body">
    <inertial><mass value="4"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>
    <visual><geometry><box size="0.4 0.4 0.4"/></geometry><material name="oak"/></visual>
    <inertial><mass value="6"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>
  </link>
  <joint name="Door-Hinge" type="revolute">
    <parent link="body"/><child link="door"/><origin xyz="0.21 -0.2 0" rpy="0 0 1.5707963267948966"/>
    <axis xyz="0 0 2"/><limit lower="-0.5" upper="1.5"/><dynamics damping="1900" friction="10000"/>
  </joint>
  <link name="door"><visual><origin xyz="0.2 0 0"/><geometry><box size="0.4 0.02 0.4"/></geometry></visual></link>
  <joint name="dial" type="continuous">
    <parent link="body"/><child link="dial"/><axis xyz="1 0 0"/>
  </joint>
  <link name="dial"><visual><origin xyz="0.3 0 0.1"/><geometry><cylinder radius="0.02" length="0.02"/></geometry></visual></link>
  <joint name="needle" type="prismatic">
    <parent link="body"/><child link="needle"/><axis xyz="0 1 0"/><limit lower="0" upper="0.1"/>
    <mimic joint="dial" multiplier="0.5" offset="0.01"/>
  </joint>
  <link name="needle"><visual><origin xyz="0.3 0 0"/><geometry><sphere radius="0.01"/></geometry></visual></link>
</robot>"#;

#[test]
fn a_urdf_file_with_repeated_inertials_becomes_an_object() {
    let model = load_text("a.urdf", CABINET).unwrap();
    assert!(model.fixed);
    let names: Vec<&str> = model.links.iter().map(|link| link.name.as_str()).collect();
    assert_eq!(names, ["base", "body", "door_hinge", "dial", "needle"]);
    let loaded = model.loaded.clone().unwrap();
    assert!(loaded.warnings.iter().any(|warning| warning.contains("2 <inertial>")), "{:?}", loaded.warnings);
    assert_eq!(loaded.masses_kg[1], Some(10.0));
    assert_eq!(loaded.originals[2].map(|original| (original.friction, original.damping)), Some((10_000.0, 1900.0)));
    assert_eq!(model.links[1].pieces[0].color, [255, 128, 0]);
    let door = model.links[2].joint.clone().unwrap();
    assert_eq!((door.kind, door.range, door.closed), (JointKind::Hinge, Some([-0.5, 1.5]), 0.0));
    assert!(door.axis.distance(DVec3::Z) < 1e-9);
    // The door reaches from y = -0.2 along y: its hinge's x axis was turned by a right angle.
    let (low, high) = model.links[2].pieces[0].bounds(&acm_concept::pose::Pose::IDENTITY);
    assert!((high - low).distance(DVec3::new(0.02, 0.4, 0.4)) < 1e-9, "{low} {high}");
    assert!((door.origin - low).y.abs() < 1e-9);
    assert_eq!(model.links[3].joint.as_ref().unwrap().range, None);
    assert_eq!(
        model.links[4].joint.as_ref().unwrap().follows,
        Some(Follows::Joint { link: 3, ratio: 0.5, offset: 0.01 })
    );
    let lowest = model.links.iter().flat_map(|link| &link.pieces);
    let lowest = lowest.map(|piece| piece.bounds(&acm_concept::pose::Pose::IDENTITY).0.z).fold(f64::INFINITY, f64::min);
    assert!(lowest.abs() < 1e-9);
}

const KITCHEN: &str = r#"<mujoco model="kitchen">
  <compiler angle="degree" eulerseq="xyz"/>
  <include file="nowhere.xml"/>
  <default><default class="glass"><geom rgba="0 1 0 1" contype="0" conaffinity="0"/></default></default>
  <worldbody>
    <geom type="plane" size="1 1 1"/>
    <body name="microwave" pos="1 0 0" euler="0 0 90">
      <geom type="box" size="0.2 0.2 0.1" mass="5"/>
      <include file="door.xml"/>
    </body>
    <body name="cup" pos="0 1 0"><freejoint/><geom type="capsule" fromto="0 0 0 0 0 0.1" size="0.03"/></body>
  </worldbody>
  <equality><joint joint1="turn" joint2="glow" polycoef="0 174 0 0 0"/></equality>
</mujoco>"#;
const DOOR: &str = r#"<mujocoinclude>
  <body name="door" pos="-0.2 -0.2 0">
    <joint name="swing" axis="0 0 1" range="-120 0" damping="2" frictionloss="2"/>
    <geom type="box" pos="0.2 -0.01 0" size="0.2 0.01 0.1"/><geom class="glass" type="sphere" size="0.05"/>
  </body>
  <body name="knob" pos="0.1 -0.21 0"><joint name="turn" axis="0 1 0" range="-90 0"/><geom type="cylinder" size="0.02 0.01"/></body>
  <body name="burner"><joint name="glow" type="slide" axis="0 0 1" range="-0.009 0"/><geom class="glass" type="cylinder" size="0.1 0.01"/></body>
</mujocoinclude>"#;

#[test]
fn a_body_of_an_mjcf_file_becomes_an_object_whatever_is_missing() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("kitchen.xml"), KITCHEN).unwrap();
    std::fs::write(folder.path().join("door.xml"), DOOR).unwrap();
    let model = load("kitchen.xml#microwave", folder.path(), Wanted::Whole).unwrap();
    assert!(model.fixed);
    let names: Vec<&str> = model.links.iter().map(|link| link.name.as_str()).collect();
    assert_eq!(names, ["base", "swing", "turn", "glow"]);
    let warnings = &model.loaded.as_ref().unwrap().warnings;
    assert!(warnings.iter().any(|warning| warning.contains("nowhere.xml")), "{warnings:?}");
    let door = model.links[1].joint.as_ref().unwrap();
    assert!((door.range.unwrap()[0] + 120f64.to_radians()).abs() < 1e-9 && door.closed == 0.0);
    // Seen alone, felt alone.
    let uses: Vec<(bool, bool)> = model.links[1].pieces.iter().map(|piece| (piece.solid, piece.shown)).collect();
    assert_eq!(uses, [(true, false), (false, true)]);
    // The burner, which cannot be touched, follows the knob.
    let Some(Follows::Joint { link: 2, ratio, .. }) = model.links[3].joint.as_ref().unwrap().follows else {
        panic!("{:?}", model.links[3]);
    };
    assert!((ratio - 1.0 / 174.0).abs() < 1e-9);
    assert!(!load("kitchen.xml#cup", folder.path(), Wanted::Whole).unwrap().fixed);
    let error = load("kitchen.xml#oven", folder.path(), Wanted::Whole).unwrap_err();
    assert!(error.contains("no body `oven`") && error.contains("microwave"), "{error}");
    std::fs::write(folder.path().join("nowhere.xml"), "<mujoco><include file='nowhere.xml'/></mujoco>").unwrap();
    assert!(load("kitchen.xml", folder.path(), Wanted::Whole).unwrap_err().contains("includes itself"));
}

#[test]
fn bad_files_are_one_line_with_the_file() {
    let cases = [
        ("a.urdf", "<robot".to_string(), "a.urdf"),
        ("a.urdf", CABINET.replace("\"body\"/><child link=\"door\"", "\"nobody\"/><child link=\"door\""), "a.urdf"),
        ("a.urdf", CABINET.replace("0.4 0.4 0.4", "0 0 0"), "without volume"),
        ("a.urdf", CABINET.replace("0.4 0.4 0.4", "40 40 40"), "limit is 20 m"),
        ("a.xml", "<mujoco><worldbody/></mujoco>".to_string(), "nothing that could be touched"),
        ("a.xml", "<robot/>".to_string(), "mujoco"),
        ("a.obj", String::new(), ".urdf"),
    ];
    for (name, text, expected) in cases {
        let error = load_text(name, &text).unwrap_err();
        assert!(error.contains(expected) && error.contains(name) && !error.contains('\n'), "{error}");
    }
    assert!(load("b.urdf", Path::new("/nowhere"), Wanted::Whole).unwrap_err().contains("cannot be read"));
}

#[test]
fn paths_are_tidied() {
    assert_eq!(tidy(Path::new("/a/x/../../b/./c")), Path::new("/b/c"));
    assert_eq!(tidy(Path::new("../a/../b")), Path::new("../b"));
    assert_eq!(plain_name("Knob 1"), "knob_1");
    assert_eq!(plain_name("1st"), "part_1st");
}
