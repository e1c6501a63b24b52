#![allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]
use super::*;
use acm_concept::arm::MAX_JOINTS;

fn described(name: &str) -> RobotDescription {
    open(name, None, None).unwrap().description
}

#[test]
fn every_robot_is_whole() {
    for name in names() {
        let robot = described(&name);
        assert_eq!(robot.name, name);
        for arm in 0..robot.arms() {
            let one = robot.only(arm);
            assert!(one.home.transform_vector(DVec3::Z).z < -0.999, "{name}: at home the hand looks down");
            assert_eq!(one.suction.is_some(), one.max_opening_m == 0.0, "{name}: a cup or fingers");
        }
    }
    assert_eq!(described("dual-panda").arms(), 2);
}

#[test]
fn a_wrong_name_or_home_is_told_with_its_field() {
    let error = open("pandas", None, None).unwrap_err().to_string();
    assert!(error.contains("did you mean `panda`?") && error.contains("dual-panda"), "{error}");
    let error = open("floating-gripper", Some(DVec3::Z * 5.0), None).unwrap_err().to_string();
    assert!(error.starts_with("robot file floating-gripper.toml, workspace: home at"), "{error}");
    let error = open("panda", None, Some([DVec3::ONE, DVec3::ZERO])).unwrap_err().to_string();
    assert!(error.contains("workspace") && error.contains("no box"), "{error}");
}

#[test]
fn a_robot_file_that_makes_no_sense_is_refused() {
    let text = EMBEDDED.get_file("panda.toml").and_then(|file| file.contents_utf8()).unwrap();
    for (old, new, told) in [
        ("-0.785, 0.0", "-1.8, 0.0", "arm.home_rad: joint 2 at -1.8000 rad is not in -1.7628 to 1.7628 rad"),
        ("franka-panda", "frankas", "arm.chain: there is no parts/frankas.toml"),
        ("max_speed_m_s = 0.5", "max_speed_m_s = nan", "max_speed_m_s, max_turn_rad_s: NaN is not positive"),
        ("yaw_deg = 90.0", "yaw_deg = 90.0\nroll = 1", "unknown field `roll`"),
    ] {
        let text = text.replace(old, new);
        let error = parse::<RawRobot>("p.toml", &text).and_then(|raw| build("p.toml", &raw, None, None)).unwrap_err();
        assert!(error.to_string().contains(told), "{error}");
    }
}

/// An attribute of the first element that begins with `element`, in this piece of XML.
fn attribute<'a>(xml: &'a str, element: &str, name: &str) -> Option<&'a str> {
    let body = xml.split_once(&format!("<{element}"))?.1.split_once('>')?.0;
    body.split_once(&format!("{name}=\""))?.1.split_once('"').map(|(value, _)| value)
}

fn numbers(text: Option<&str>) -> [f64; 3] {
    let mut values = text.unwrap_or("0 0 0").split_whitespace().map(|number| number.parse().unwrap());
    [0; 3].map(|_: i32| values.next().unwrap())
}

/// The maker's own description, read independently, gives the same frames and limits.
#[test]
fn the_panda_is_the_one_its_maker_describes() {
    let Some(data) = std::env::var_os("ACM_DATA") else {
        println!("skipped: ACM_DATA is not set");
        return;
    };
    let file = std::path::Path::new(&data).join("robots/panda_description/urdf/panda.urdf");
    let text = std::fs::read_to_string(&file).unwrap();
    let joint = |name: &str| {
        let from = text.split_once(&format!("<joint name=\"{name}\"")).unwrap().1;
        from.split_once("</joint>").unwrap().0
    };
    let pose = |xml: &str| {
        let [roll, pitch, yaw] = numbers(attribute(xml, "origin", "rpy"));
        let turn = DQuat::from_rotation_z(yaw) * DQuat::from_rotation_y(pitch) * DQuat::from_rotation_x(roll);
        Pose::new(numbers(attribute(xml, "origin", "xyz")).into(), turn)
    };
    let arm = ArmDescription { base: Pose::IDENTITY, ..described("panda").arm.unwrap() };
    assert_eq!(arm.joints.len(), 7);
    for (index, ours) in arm.joints.iter().enumerate() {
        let xml = joint(&format!("panda_joint{}", index + 1));
        let limit = |name| attribute(xml, "limit", name).unwrap().parse::<f64>().unwrap();
        let theirs = [limit("lower"), limit("upper"), limit("velocity"), limit("effort")];
        assert_eq!([ours.min_rad, ours.max_rad, ours.max_speed_rad_s, ours.max_torque_nm], theirs, "{}", ours.name);
        assert_eq!(ours.axis, DVec3::from(numbers(attribute(xml, "axis", "xyz"))));
    }
    // Forward kinematics over the whole range, joint by joint as the file says.
    let mut seed = 1u64;
    let mut random = || {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (seed >> 11) as f64 / (1u64 << 53) as f64
    };
    for _ in 0..200 {
        let joints =
            arm.home.map(|i| arm.joints[i].min_rad + random() * (arm.joints[i].max_rad - arm.joints[i].min_rad));
        let mut at = Pose::IDENTITY;
        for (index, turn) in joints.iter().enumerate() {
            at = at * pose(joint(&format!("panda_joint{}", index + 1))) * Pose::from_yaw(DVec3::ZERO, *turn);
        }
        for fixed in ["panda_joint8", "panda_hand_joint", "panda_hand_tcp_joint"] {
            at = at * pose(joint(fixed));
        }
        let ours = arm.tcp(&joints);
        assert!(ours.translation.distance(at.translation) < 1e-9 && ours.angle_to(&at) < 1e-6, "{ours:?} {at:?}");
    }
    assert!(arm.joints.len() <= MAX_JOINTS);
}
