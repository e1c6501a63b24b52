//! Robots as data: `robots/NAME.toml`, and what they are put together from in `robots/parts`.

use crate::scenario::nearest;
use acm_concept::{
    arm::{ArmDescription, JointDescription, Joints, LinkCapsule, MAX_JOINTS},
    embodiment::{RobotDescription, SuctionCup},
    pose::Pose,
    solid::{PlacedSolid, Solid},
};
use glam::{DQuat, DVec3, EulerRot};
use include_dir::{Dir, include_dir};
use serde::{Deserialize, de::DeserializeOwned};
use std::f64::consts::PI;
use thiserror::Error;

static EMBEDDED: Dir<'_> = include_dir!("$CARGO_MANIFEST_DIR/robots");

/// Control tick of every robot, seconds.
pub(crate) const TICK_S: f64 = 0.02;
/// Most arms of a robot, and capsules of an arm.
const MAX_ARMS: usize = 4;
const MAX_CAPSULES: usize = 64;

/// Why a robot could not be built.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum RobotError {
    /// No robot of that name.
    #[error("there is no robot `{name}`{suggestion}; known: {known}")]
    Unknown {
        /// What was asked for.
        name: String,
        /// "; did you mean ...?", or nothing.
        suggestion: String,
        /// The robots there are.
        known: String,
    },
    /// A file that is not as it should be.
    #[error("robot file {file}, {field}: {reason}")]
    Field {
        /// The file.
        file: String,
        /// The field.
        field: String,
        /// What is wrong with it.
        reason: String,
    },
}

/// A robot as the simulator builds it.
#[derive(Debug, Clone)]
pub(crate) struct RobotModel {
    /// What the agent is told.
    pub(crate) description: RobotDescription,
    /// How fast the vacuum under a suction cup comes and goes, seconds.
    pub(crate) evacuation_s: f64,
    pub(crate) venting_s: f64,
}

/// Names of the robots, sorted.
fn names() -> Vec<String> {
    let files = EMBEDDED.files().filter_map(|file| file.path().file_stem()?.to_str());
    let mut names: Vec<String> = files.map(String::from).collect();
    names.sort();
    names
}

/// The robot of a name. A scenario may have another place to wait for a hand that floats, and another workspace.
pub(crate) fn open(name: &str, home: Option<DVec3>, workspace: Option<[DVec3; 2]>) -> Result<RobotModel, RobotError> {
    let file = format!("{name}.toml");
    let Some(text) = EMBEDDED.get_file(&file).and_then(|file| file.contents_utf8()) else {
        let known = names();
        let suggestion = nearest(name, known.iter().map(String::as_str));
        return Err(RobotError::Unknown { name: name.into(), suggestion, known: known.join(", ") });
    };
    build(&file, &parse(&file, text)?, home, workspace)
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct RawRobot {
    robot: String,
    #[expect(dead_code, reason = "for the reader of the file")]
    summary: String,
    hand: String,
    workspace: [[f64; 3]; 2],
    max_speed_m_s: f64,
    max_turn_rad_s: f64,
    home: Option<[f64; 3]>,
    #[serde(default)]
    arm: Vec<RawArm>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct RawArm {
    chain: String,
    position: [f64; 3],
    yaw_deg: f64,
    home_rad: Vec<f64>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct RawChain {
    flange: RawFrame,
    joint: Vec<RawJoint>,
    capsule: Vec<RawCapsule>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct RawFrame {
    translation: [f64; 3],
    rpy_deg: [f64; 3],
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct RawJoint {
    name: String,
    #[serde(default)]
    translation: [f64; 3],
    #[serde(default)]
    rpy_deg: [f64; 3],
    #[serde(default = "about_z")]
    axis: [f64; 3],
    range_rad: [f64; 2],
    max_speed_rad_s: f64,
    max_acceleration_rad_s2: f64,
    max_torque_nm: f64,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct RawCapsule {
    /// Of a chain; a hand's belong to the last link.
    #[serde(default)]
    link: usize,
    from: [f64; 3],
    to: [f64; 3],
    radius_m: f64,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields, tag = "kind", rename_all = "kebab-case")]
enum RawHand {
    TwoFinger {
        flange_to_tcp_m: f64,
        hand_m: [f64; 3],
        finger_m: [f64; 3],
        tip_m: f64,
        max_opening_m: f64,
        max_grip_force_n: f64,
        capsule: Vec<RawCapsule>,
    },
    SuctionCup {
        flange_to_tcp_m: f64,
        stem_m: RawRod,
        cup_m: RawRod,
        max_force_n: f64,
        max_tilt_deg: f64,
        evacuation_s: f64,
        venting_s: f64,
        capsule: Vec<RawCapsule>,
    },
}

#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields)]
struct RawRod {
    radius: f64,
    length: f64,
}

fn about_z() -> [f64; 3] {
    [0.0, 0.0, 1.0]
}

fn parse<T: DeserializeOwned>(file: &str, text: &str) -> Result<T, RobotError> {
    toml::from_str(text).map_err(|error: toml::de::Error| {
        let reason = error.message().to_string();
        RobotError::Field { file: file.into(), field: "format".into(), reason }
    })
}

fn part<T: DeserializeOwned>(file: &str, field: &str, name: &str) -> Result<(String, T), RobotError> {
    let path = format!("parts/{name}.toml");
    let text = EMBEDDED.get_file(&path).and_then(|file| file.contents_utf8());
    let text = text.ok_or_else(|| wrong(file, field, format!("there is no {path}")))?;
    Ok((path.clone(), parse(&path, text)?))
}

fn wrong(file: &str, field: &str, reason: impl Into<String>) -> RobotError {
    RobotError::Field { file: file.into(), field: field.into(), reason: reason.into() }
}

fn build(
    file: &str,
    raw: &RawRobot,
    home: Option<DVec3>,
    workspace: Option<[DVec3; 2]>,
) -> Result<RobotModel, RobotError> {
    let (hand_file, hand) = part::<RawHand>(file, "hand", &raw.hand)?;
    positive(file, "max_speed_m_s, max_turn_rad_s", &[raw.max_speed_m_s, raw.max_turn_rad_s])?;
    let [low, high] = workspace.unwrap_or(raw.workspace.map(DVec3::from));
    if !(low.is_finite() && high.is_finite() && low.cmplt(high).all()) {
        return Err(wrong(file, "workspace", format!("{low} to {high} m is no box")));
    }
    let mut bare = RobotDescription {
        name: raw.robot.clone(),
        workspace_min: low,
        workspace_max: high,
        max_speed_m_s: raw.max_speed_m_s,
        max_turn_rad_s: raw.max_turn_rad_s,
        tick_s: TICK_S,
        ..RobotDescription::default()
    };
    let mount = add_hand(&hand_file, &hand, &mut bare)?;
    let mut arms = Vec::new();
    if raw.arm.is_empty() {
        let at =
            home.or(raw.home.map(DVec3::from)).ok_or_else(|| wrong(file, "home", "a hand without an arm needs it"))?;
        bare.home = Pose::new(at, DQuat::from_rotation_x(PI));
        arms.push(bare);
    } else if raw.arm.len() > MAX_ARMS {
        return Err(wrong(file, "arm", format!("{} arms, at most {MAX_ARMS}", raw.arm.len())));
    } else {
        for arm in &raw.arm {
            let arm = mounted(file, arm, &mount)?;
            arms.push(RobotDescription { home: arm.tcp(&arm.home), arm: Some(arm), ..bare.clone() });
        }
    }
    if let Some(outside) = arms.iter().find(|arm| !arm.reaches(arm.home.translation)) {
        return Err(wrong(file, "workspace", format!("home at {} lies outside", outside.home.translation)));
    }
    let mut arms = arms.into_iter();
    let first = arms.next().ok_or_else(|| wrong(file, "arm", "none"))?;
    let (evacuation_s, venting_s) = mount.pump_s;
    Ok(RobotModel { description: RobotDescription { others: arms.collect(), ..first }, evacuation_s, venting_s })
}

/// What of a hand concerns the arm that carries it.
struct Mount {
    flange_to_tcp_m: f64,
    capsules: Vec<LinkCapsule>,
    pump_s: (f64, f64),
}

/// The agent's side of the hand. Its frame has its origin at the TCP.
fn add_hand(file: &str, hand: &RawHand, robot: &mut RobotDescription) -> Result<Mount, RobotError> {
    let placed = |solid, z: f64, y: f64| PlacedSolid { solid, pose: Pose::from_translation(DVec3::new(0.0, y, z)) };
    match hand {
        RawHand::TwoFinger { flange_to_tcp_m, hand_m, finger_m, tip_m, max_opening_m, max_grip_force_n, capsule } => {
            positive(
                file,
                "flange_to_tcp_m, tip_m, max_opening_m, max_grip_force_n",
                &[*flange_to_tcp_m, *tip_m, *max_opening_m, *max_grip_force_n],
            )?;
            positive(file, "hand_m", hand_m)?;
            positive(file, "finger_m", finger_m)?;
            let (palm, finger) = (DVec3::from(*hand_m), DVec3::from(*finger_m));
            let finger_top = tip_m - finger.z;
            robot.hand = vec![placed(Solid::Box { size: palm }, finger_top - 0.5 * palm.z, 0.0)];
            robot.finger = vec![placed(Solid::Box { size: finger }, tip_m - 0.5 * finger.z, 0.5 * finger.y)];
            (robot.max_opening_m, robot.max_grip_force_n) = (*max_opening_m, *max_grip_force_n);
            robot.pad_half_length_m = *tip_m;
            let capsules = capsules(file, capsule, 0)?;
            Ok(Mount { flange_to_tcp_m: *flange_to_tcp_m, capsules, pump_s: (1.0, 1.0) })
        }
        RawHand::SuctionCup {
            flange_to_tcp_m,
            stem_m,
            cup_m,
            max_force_n,
            max_tilt_deg,
            evacuation_s,
            venting_s,
            capsule,
        } => {
            positive(
                file,
                "flange_to_tcp_m, max_force_n, max_tilt_deg, evacuation_s, venting_s",
                &[*flange_to_tcp_m, *max_force_n, *max_tilt_deg, *evacuation_s, *venting_s],
            )?;
            positive(file, "stem_m, cup_m", &[stem_m.radius, stem_m.length, cup_m.radius, cup_m.length])?;
            let rod = |rod: &RawRod, end: f64| {
                placed(Solid::Cylinder { radius: rod.radius, height: rod.length }, end - 0.5 * rod.length, 0.0)
            };
            robot.hand = vec![rod(cup_m, 0.0), rod(stem_m, -cup_m.length)];
            robot.suction = Some(SuctionCup {
                radius_m: cup_m.radius,
                max_force_n: *max_force_n,
                max_tilt_rad: max_tilt_deg.to_radians(),
            });
            let capsules = capsules(file, capsule, 0)?;
            Ok(Mount { flange_to_tcp_m: *flange_to_tcp_m, capsules, pump_s: (*evacuation_s, *venting_s) })
        }
    }
}

/// A chain on its base with a hand at its end.
fn mounted(file: &str, raw: &RawArm, mount: &Mount) -> Result<ArmDescription, RobotError> {
    let (chain_file, chain) = part::<RawChain>(file, "arm.chain", &raw.chain)?;
    if chain.joint.is_empty() || chain.joint.len() > MAX_JOINTS {
        return Err(wrong(
            &chain_file,
            "joint",
            format!("{} joints, 1 to {MAX_JOINTS} are possible", chain.joint.len()),
        ));
    }
    let joints = chain.joint.iter().map(|joint| self::joint(&chain_file, joint)).collect::<Result<Vec<_>, _>>()?;
    let flange = frame(&chain.flange.translation, &chain.flange.rpy_deg);
    let on_flange = |at: DVec3| flange.transform_point(at);
    let hand = mount.capsules.iter().map(|capsule| LinkCapsule {
        link: joints.len(),
        from: on_flange(capsule.from),
        to: on_flange(capsule.to),
        ..*capsule
    });
    let home = Joints::new(&raw.home_rad).ok_or_else(|| wrong(file, "arm.home_rad", "too many joints"))?;
    let arm = ArmDescription {
        base: Pose::from_yaw(raw.position.into(), raw.yaw_deg.to_radians()),
        capsules: capsules(&chain_file, &chain.capsule, joints.len())?,
        hand: hand.collect(),
        tool: flange * Pose::from_translation(DVec3::Z * mount.flange_to_tcp_m),
        joints,
        home,
    };
    let at_home = arm.frames(&home);
    let broken = arm.limit_broken(&home, 0.0).or_else(|| arm.self_collision(&at_home, 0.0));
    broken.map_or(Ok(arm), |reason| Err(wrong(file, "arm.home_rad", reason)))
}

fn joint(file: &str, raw: &RawJoint) -> Result<JointDescription, RobotError> {
    let field = format!("joint `{}`", raw.name);
    let [min_rad, max_rad] = raw.range_rad;
    let axis = DVec3::from(raw.axis).try_normalize().ok_or_else(|| wrong(file, &field, "its axis has no direction"))?;
    if !(min_rad.is_finite() && max_rad.is_finite() && min_rad < max_rad) {
        return Err(wrong(file, &field, format!("range_rad {min_rad} to {max_rad} is no range")));
    }
    positive(file, &field, &[raw.max_speed_rad_s, raw.max_acceleration_rad_s2, raw.max_torque_nm])?;
    Ok(JointDescription {
        name: raw.name.clone(),
        frame: frame(&raw.translation, &raw.rpy_deg),
        axis,
        min_rad,
        max_rad,
        max_speed_rad_s: raw.max_speed_rad_s,
        max_acceleration_rad_s2: raw.max_acceleration_rad_s2,
        max_torque_nm: raw.max_torque_nm,
    })
}

/// As in URDF: turns about the fixed x, then y, then z axis.
fn frame(translation: &[f64; 3], rpy_deg: &[f64; 3]) -> Pose {
    let [roll, pitch, yaw] = rpy_deg.map(f64::to_radians);
    Pose::new(DVec3::from(*translation), DQuat::from_euler(EulerRot::ZYX, yaw, pitch, roll))
}

fn capsules(file: &str, raw: &[RawCapsule], links: usize) -> Result<Vec<LinkCapsule>, RobotError> {
    if raw.len() > MAX_CAPSULES {
        return Err(wrong(file, "capsule", format!("{} capsules, at most {MAX_CAPSULES}", raw.len())));
    }
    let one = |raw: &RawCapsule| {
        positive(file, "capsule.radius_m", &[raw.radius_m])?;
        if raw.link > links {
            return Err(wrong(file, "capsule.link", format!("there is no link {}", raw.link)));
        }
        Ok(LinkCapsule { link: raw.link, from: raw.from.into(), to: raw.to.into(), radius_m: raw.radius_m })
    };
    raw.iter().map(one).collect()
}

fn positive(file: &str, field: &str, values: &[f64]) -> Result<(), RobotError> {
    let bad = values.iter().find(|value| !(value.is_finite() && **value > 0.0 && **value < 1e4));
    bad.map_or(Ok(()), |value| Err(wrong(file, field, format!("{value} is not positive, or absurdly large"))))
}

#[cfg(test)]
mod tests;
