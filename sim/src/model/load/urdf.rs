//! URDF files, as exporters really write them.

use super::{
    Wanted,
    builder::{Builder, Form, Use},
    tidy,
};
use crate::model::{
    ObjectModel,
    joint::{Follows, Joint, JointKind},
    normalise::Original,
};
use acm_concept::pose::Pose;
use glam::{DQuat, DVec3, EulerRot};
use roxmltree::{Document, Node};
use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
};
use urdf_rs::{Geometry, JointType, Robot};

/// What a slider without a range is given, metres.
const UNNAMED_RANGE_M: [f64; 2] = [-0.5, 0.5];

pub(super) fn read(path: &Path, text: &str, wanted: Wanted) -> Result<ObjectModel, String> {
    let mut builder = Builder::of(wanted);
    let (text, masses) = mended(text, &mut builder)?;
    let robot = urdf_rs::read_from_string(&text).map_err(|e| e.to_string().replace('\n', " "))?;
    let folder = path.parent().unwrap_or(Path::new(""));
    let mut reader = Reader { robot: &robot, folder, masses, builder, made: BTreeMap::new() };
    let root = reader.root()?;
    // ROS has it that what hangs on a link called `world` is fixed.
    let fixed = root == "world";
    reader.link(&root, 0, Pose::IDENTITY, None)?;
    reader.follow();
    reader.builder.finish(format!("{} from {}", robot.name, path.display()), fixed)
}

/// The text in the order in which the parser wants it, with one `<inertial>` a link, and the masses of all of them:
/// some exporters write one for each shape, and what belongs together apart.
fn mended(text: &str, builder: &mut Builder) -> Result<(String, BTreeMap<String, f64>), String> {
    let document = Document::parse(text).map_err(|e| e.to_string())?;
    let robot = document.root_element();
    if !robot.has_tag_name("robot") {
        return Err(format!("begins with <{}>, not with <robot>", robot.tag_name().name()));
    }
    let mut masses = BTreeMap::new();
    let mut mended = format!("<robot name=\"{}\">", escaped(robot.attribute("name").unwrap_or("robot")));
    children(robot, "material").for_each(|node| mended.push_str(source(text, node)));
    for link in children(robot, "link") {
        let name = link.attribute("name").ok_or("a link has no name")?;
        let inertials = children(link, "inertial").count();
        if inertials > 1 {
            builder.warn(format!("link `{name}` has {inertials} <inertial>; their masses are added"));
        }
        let mass = |node: Node| children(node, "mass").next()?.attribute("value")?.parse::<f64>().ok();
        let known: Vec<f64> = children(link, "inertial").filter_map(mass).collect();
        if !known.is_empty() {
            masses.insert(name.to_string(), known.iter().sum());
        }
        mended.push_str(&format!("<link name=\"{}\">", escaped(name)));
        let parts =
            children(link, "inertial").take(1).chain(children(link, "visual")).chain(children(link, "collision"));
        parts.for_each(|node| mended.push_str(source(text, node)));
        mended.push_str("</link>");
    }
    for joint in children(robot, "joint") {
        let mut own = source(text, joint).to_string();
        // The parser insists on the robot's largest speed, which furniture has none of.
        let limit = children(joint, "limit").next().filter(|limit| !limit.has_attribute("velocity"));
        if let Some(limit) = limit {
            own.insert_str(limit.range().start - joint.range().start + "<limit".len(), " velocity=\"0\"");
        }
        mended.push_str(&own);
    }
    mended.push_str("</robot>");
    Ok((mended, masses))
}

fn children<'a>(node: Node<'a, 'a>, name: &'a str) -> impl Iterator<Item = Node<'a, 'a>> {
    node.children().filter(move |child| child.has_tag_name(name))
}

fn source<'a>(text: &'a str, node: Node) -> &'a str {
    text.get(node.range()).unwrap_or_default()
}

fn escaped(name: &str) -> String {
    name.replace('&', "&amp;").replace('<', "&lt;").replace('"', "&quot;")
}

struct Reader<'a> {
    robot: &'a Robot,
    folder: &'a Path,
    masses: BTreeMap<String, f64>,
    builder: Builder,
    /// Numbers of the links that hang on a joint, by its name.
    made: BTreeMap<String, usize>,
}

impl<'a> Reader<'a> {
    /// The link that hangs on nothing.
    fn root(&self) -> Result<String, String> {
        let known = |name: &str| self.robot.links.iter().any(|link| link.name == name);
        for joint in &self.robot.joints {
            if let Some(name) = [&joint.parent.link, &joint.child.link].into_iter().find(|name| !known(name)) {
                return Err(format!("joint `{}` names a link `{name}`, which is not there", joint.name));
            }
        }
        let children: Vec<&str> = self.robot.joints.iter().map(|joint| joint.child.link.as_str()).collect();
        let mut roots = self.robot.links.iter().filter(|link| !children.contains(&link.name.as_str()));
        match (roots.next(), roots.next()) {
            (Some(root), None) => Ok(root.name.clone()),
            (None, _) => Err("every link hangs on another one; there is no root".into()),
            (Some(first), Some(second)) => {
                Err(format!("links `{}` and `{}` both hang on nothing; one root is needed", first.name, second.name))
            }
        }
    }

    fn link(&mut self, name: &str, parent: usize, at: Pose, joint: Option<&'a urdf_rs::Joint>) -> Result<(), String> {
        let link = self.robot.links.iter().find(|link| link.name == name);
        let link = link.ok_or_else(|| format!("there is no link `{name}`"))?;
        let mass = self.masses.get(name).copied();
        let made = joint.and_then(|joint| self.joint(joint, &at));
        let called = joint.filter(|_| made.is_some()).map_or(name, |joint| joint.name.as_str());
        let number = self.builder.link(called, parent, mass, made)?;
        if let Some(joint) = joint {
            self.made.insert(joint.name.clone(), number);
        }
        let used = if link.collision.is_empty() { Use::Both } else { Use::Seen };
        for visual in &link.visual {
            let color = visual.material.as_ref().and_then(|material| self.color(material));
            self.shape(&visual.geometry, at * pose(&visual.origin), color, used)?;
        }
        let used = if link.visual.is_empty() { Use::Both } else { Use::Felt };
        for collision in &link.collision {
            self.shape(&collision.geometry, at * pose(&collision.origin), None, used)?;
        }
        for joint in &self.robot.joints {
            if joint.parent.link == name {
                self.link(&joint.child.link, number, at * pose(&joint.origin), Some(joint))?;
            }
        }
        Ok(())
    }

    /// A joint in the object's frame; `None` for what does not move.
    fn joint(&mut self, joint: &urdf_rs::Joint, at: &Pose) -> Option<(Joint, Original)> {
        let limit = [joint.limit.lower, joint.limit.upper];
        let limited = limit[0] < limit[1] && limit.iter().all(|end| end.is_finite());
        let (kind, range) = match joint.joint_type {
            JointType::Fixed => return None,
            JointType::Revolute if limited => (JointKind::Hinge, Some(limit)),
            JointType::Continuous => (JointKind::Hinge, None),
            JointType::Prismatic if limited => (JointKind::Slider, Some(limit)),
            JointType::Revolute => {
                self.builder.warn(format!("joint `{}` has no range; it turns without end", joint.name));
                (JointKind::Hinge, None)
            }
            JointType::Prismatic => {
                self.builder.warn(format!("joint `{}` has no range; it gets 0.5 m to either side", joint.name));
                (JointKind::Slider, Some(UNNAMED_RANGE_M))
            }
            JointType::Floating | JointType::Planar | JointType::Spherical => {
                self.builder.warn(format!("joint `{}` has several freedoms; it is fixed", joint.name));
                return None;
            }
        };
        let axis = at.transform_vector(DVec3::from(*joint.axis.xyz));
        let dynamics = joint.dynamics.as_ref();
        let original = Original {
            friction: dynamics.map_or(0.0, |dynamics| dynamics.friction),
            damping: dynamics.map_or(0.0, |dynamics| dynamics.damping),
        };
        Some((Joint::new(kind, at.translation, axis, range), original))
    }

    /// Joints that mimic others.
    fn follow(&mut self) {
        for joint in &self.robot.joints {
            let Some(mimic) = &joint.mimic else { continue };
            let (Some(own), Some(other)) = (self.made.get(&joint.name), self.made.get(&mimic.joint)) else {
                self.builder.warn(format!("joint `{}` mimics `{}`, which is not there", joint.name, mimic.joint));
                continue;
            };
            let (ratio, offset) = (mimic.multiplier.unwrap_or(1.0), mimic.offset.unwrap_or(0.0));
            if let Some(joint) = &mut self.builder.links()[*own].joint {
                joint.follows = Some(Follows::Joint { link: *other, ratio, offset });
            }
        }
    }

    fn shape(&mut self, geometry: &Geometry, at: Pose, color: Option<[u8; 3]>, used: Use) -> Result<(), String> {
        let form = match geometry {
            Geometry::Box { size } => Form::Box(DVec3::from(**size)),
            Geometry::Cylinder { radius, length } => Form::Cylinder { radius: *radius, height: *length },
            Geometry::Capsule { radius, length } => Form::Capsule { radius: *radius, height: *length },
            Geometry::Sphere { radius } => Form::Ball(*radius),
            Geometry::Mesh { filename, scale } => {
                Form::Mesh { path: self.find(filename), scale: scale.map_or(DVec3::ONE, |scale| DVec3::from(*scale)) }
            }
        };
        self.builder.shape(&form, at, color, used, None)
    }

    fn color(&self, material: &urdf_rs::Material) -> Option<[u8; 3]> {
        let named = self.robot.materials.iter().find(|known| known.name == material.name);
        let color = material.color.as_ref().or_else(|| named?.color.as_ref())?;
        let [r, g, b, _] = *color.rgba;
        Some([r, g, b].map(|channel| (255.0 * channel.clamp(0.0, 1.0)).round() as u8))
    }

    /// A mesh's file. A package is looked for among the folders above the URDF file.
    fn find(&self, name: &str) -> PathBuf {
        let name = name.strip_prefix("file://").unwrap_or(name);
        let Some(in_package) = name.strip_prefix("package://").or_else(|| name.strip_prefix("model://")) else {
            return tidy(&self.folder.join(name));
        };
        let inside = in_package.split_once('/').map_or("", |(_, inside)| inside);
        let above = || self.folder.ancestors();
        let found =
            above().flat_map(|folder| [folder.join(in_package), folder.join(inside)]).find(|path| path.is_file());
        found.unwrap_or_else(|| self.folder.join(inside))
    }
}

fn pose(raw: &urdf_rs::Pose) -> Pose {
    let [roll, pitch, yaw] = *raw.rpy;
    // Turns about fixed x, then y, then z.
    Pose::new(DVec3::from(*raw.xyz), DQuat::from_euler(EulerRot::ZYX, yaw, pitch, roll))
}
