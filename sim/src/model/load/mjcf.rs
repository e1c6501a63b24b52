//! MJCF files, leniently: what is missing or cannot be shown is left out with a warning.

use super::{
    Wanted,
    builder::{Builder, Form, Use},
    tidy,
};
use crate::model::{
    ObjectModel,
    joint::{Follows, Joint, JointKind, Spring},
    normalise::Original,
};
use acm_concept::pose::Pose;
use glam::{DQuat, DVec3};
use mjcf_rs::{
    Model,
    body::{Geom, GeomType, JointType},
    equality::{Equality, EqualityJoint},
};
use roxmltree::{Document, Node};
use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
};

/// Most files that one file includes, directly or not.
const MAX_INCLUDES: usize = 64;
const MAX_EXPANDED_BYTES: usize = 8 * 1024 * 1024;
/// Density of a shape for which a file gives neither mass nor density, kg/m3: MuJoCo's own.
const DENSITY: f64 = 1000.0;

/// Reads the whole world, or one of its bodies with all that hangs on it.
pub(super) fn read(path: &Path, text: &str, part: Option<&str>, wanted: Wanted) -> Result<ObjectModel, String> {
    let folder = path.parent().unwrap_or(Path::new(""));
    let mut builder = Builder::of(wanted);
    let mut includes = Includes { main: folder, files: 0, builder: &mut builder };
    let expanded = includes.expand(text, folder, &mut Vec::new())?;
    let model = Model::from_str(&expanded, folder).map_err(|e| e.to_string().replace('\n', " "))?;
    let root = match part {
        None => 0,
        Some(name) => model.body_id_by_name(name).ok_or_else(|| {
            let known: Vec<&str> = model.bodies_iter().filter_map(|(_, entry)| entry.body.name.as_deref()).collect();
            format!("there is no body `{name}`; known: {}", known.join(", "))
        })?,
    };
    let felt_alone = has_seen_alone(&model, root);
    let free = model.bodies.iter().enumerate().any(|(at, entry)| {
        let below_root = at == root || (root == 0 && entry.parent == Some(0));
        below_root && entry.body.joints.iter().any(|joint| joint.type_ == JointType::Free)
    });
    let mut reader = Reader { model: &model, folder, builder, made: BTreeMap::new(), felt_alone };
    reader.body(root, 0, Pose::IDENTITY, true)?;
    reader.couple();
    let name = part.or(model.name.as_deref()).unwrap_or("object");
    reader.builder.finish(format!("{name} from {}", path.display()), !free)
}

/// Files within files, put in their places. The parser would take them at the top only, and stop at a missing one.
struct Includes<'a> {
    main: &'a Path,
    files: usize,
    builder: &'a mut Builder,
}

impl Includes<'_> {
    fn expand(&mut self, text: &str, folder: &Path, within: &mut Vec<PathBuf>) -> Result<String, String> {
        let document = Document::parse(text).map_err(|e| e.to_string())?;
        let mut found: Vec<Node> = document.descendants().filter(|node| node.has_tag_name("include")).collect();
        found.sort_by_key(|node| std::cmp::Reverse(node.range().start));
        let mut expanded = text.to_string();
        for node in found {
            let name = node.attribute("file").unwrap_or_default();
            // MuJoCo looks from the main file; older files were written for a look from their own folder.
            let candidates = [tidy(&folder.join(name)), tidy(&self.main.join(name))];
            let inside = match candidates.iter().find(|path| path.is_file()) {
                None => {
                    self.builder.warn(format!("included file `{name}` is not there"));
                    String::new()
                }
                Some(path) if within.contains(path) => return Err(format!("`{name}` includes itself")),
                Some(path) => self.inside(path, within)?,
            };
            expanded.replace_range(node.range(), &inside);
            if expanded.len() > MAX_EXPANDED_BYTES {
                return Err(format!("with all included files larger than {MAX_EXPANDED_BYTES} bytes"));
            }
        }
        Ok(expanded)
    }

    fn inside(&mut self, path: &Path, within: &mut Vec<PathBuf>) -> Result<String, String> {
        self.files += 1;
        if self.files > MAX_INCLUDES {
            return Err(format!("includes more than {MAX_INCLUDES} files"));
        }
        let text = super::read_text(path)?;
        within.push(path.to_path_buf());
        let folder = path.parent().unwrap_or(Path::new("")).to_path_buf();
        let expanded = self.expand(&text, &folder, within)?;
        within.pop();
        let document = Document::parse(&expanded).map_err(|e| format!("{}: {e}", path.display()))?;
        let children = document.root_element().children();
        Ok(children.map(|child| expanded.get(child.range()).unwrap_or_default()).collect())
    }
}

/// Whether some shapes are there to be seen alone; then the others are there to be felt alone.
fn has_seen_alone(model: &Model, root: usize) -> bool {
    let inside = |at: usize| std::iter::successors(Some(at), |at| model.bodies[*at].parent).any(|at| at == root);
    let seen_alone = |geom: &Geom| geom.contype == 0 && geom.conaffinity == 0;
    (0..model.bodies.len()).filter(|at| inside(*at)).any(|at| model.bodies[at].body.geoms.iter().any(seen_alone))
}

struct Reader<'a> {
    model: &'a Model,
    folder: &'a Path,
    builder: Builder,
    /// Numbers of the links that hang on a joint, by its name.
    made: BTreeMap<String, usize>,
    felt_alone: bool,
}

impl Reader<'_> {
    fn body(&mut self, at: usize, parent: usize, frame: Pose, is_root: bool) -> Result<(), String> {
        let body = &self.model.bodies[at].body;
        let mass = body.inertial.as_ref().map(|inertial| inertial.mass).or_else(|| mass_of(&body.geoms));
        let (joint, name) = if is_root { (None, None) } else { self.joint(body, &frame) };
        let called = name.as_deref().or(body.name.as_deref()).unwrap_or("part");
        let number = self.builder.link(called, parent, mass, joint)?;
        if let Some(name) = name {
            self.made.insert(name, number);
        }
        for geom in &body.geoms {
            self.geom(geom, &frame)?;
        }
        for (child, entry) in self.model.bodies.iter().enumerate() {
            if entry.parent == Some(at) {
                self.body(child, number, frame * pose(&entry.body.pose), false)?;
            }
        }
        Ok(())
    }

    /// The first joint that turns or slides, in the object's frame, and its name.
    fn joint(&mut self, body: &mjcf_rs::body::Body, frame: &Pose) -> (Option<(Joint, Original)>, Option<String>) {
        let body_name = body.name.as_deref().unwrap_or("part");
        let kind = |joint: &mjcf_rs::body::Joint| match joint.type_ {
            JointType::Hinge => Some(JointKind::Hinge),
            JointType::Slide => Some(JointKind::Slider),
            JointType::Ball | JointType::Free => None,
        };
        let mut moving = body.joints.iter().filter_map(|joint| Some((joint, kind(joint)?)));
        let first = moving.next();
        let unused = body.joints.iter().filter(|joint| joint.type_ == JointType::Ball).count() + moving.count();
        if unused > 0 {
            self.builder.warn(format!("body `{body_name}` has {unused} further joints, which are left out"));
        }
        let Some((raw, kind)) = first else { return (None, None) };
        let limited = raw.limited.resolve(self.model.compiler.autolimits, raw.range.is_some());
        // A file's positions begin at `ref`, ours where the file draws the body.
        let range = raw.range.filter(|[low, high]| limited && low < high).map(|range| range.map(|end| end - raw.ref_));
        if kind == JointKind::Slider && range.is_none() {
            self.builder.warn(format!("slider of body `{body_name}` has no range; it gets 0.5 m to either side"));
        }
        let range = range.or((kind == JointKind::Slider).then_some([-0.5, 0.5]));
        let axis = frame.transform_vector(DVec3::from(raw.axis));
        let mut joint = Joint::new(kind, frame.transform_point(DVec3::from(raw.pos)), axis, range);
        if raw.stiffness > 0.0 && raw.stiffness <= 1e4 {
            let rest = joint.clamp(raw.springref - raw.ref_);
            joint.spring = Some(Spring { stiffness: raw.stiffness, rest, preload: 0.0 });
        }
        let original = Original { friction: raw.frictionloss, damping: raw.damping };
        let name = raw.name.clone().unwrap_or_else(|| body_name.to_string());
        (Some((joint, original)), Some(name))
    }

    fn geom(&mut self, geom: &Geom, frame: &Pose) -> Result<(), String> {
        let used = match (geom.contype == 0 && geom.conaffinity == 0, self.felt_alone) {
            (true, _) => Use::Seen,
            (false, true) => Use::Felt,
            (false, false) => Use::Both,
        };
        let ends = geom.fromto.map(|[a, b, c, d, e, f]| (DVec3::new(a, b, c), DVec3::new(d, e, f)));
        let length = ends.map(|(from, to)| from.distance(to));
        let at = match ends {
            None => pose(&geom.pose),
            Some((from, to)) => {
                let turn = DQuat::from_rotation_arc(DVec3::Z, (to - from).normalize_or(DVec3::Z));
                Pose::new(0.5 * (from + to), turn)
            }
        };
        let [x, y, z] = geom.size;
        let form = match geom.type_ {
            GeomType::Box => {
                Form::Box(2.0 * length.map_or(DVec3::new(x, y, z), |length| DVec3::new(x, x, 0.5 * length)))
            }
            GeomType::Cylinder => Form::Cylinder { radius: x, height: length.unwrap_or(2.0 * y) },
            GeomType::Capsule => Form::Capsule { radius: x, height: length.unwrap_or(2.0 * y) },
            GeomType::Sphere => Form::Ball(x),
            GeomType::Ellipsoid => Form::Ellipsoid(DVec3::new(x, y, z)),
            GeomType::Mesh => match self.mesh(geom) {
                Some(form) => form,
                None => return Ok(()),
            },
            GeomType::Plane | GeomType::Hfield | GeomType::Sdf => {
                self.builder.warn(format!("shapes of kind {:?} are left out", geom.type_));
                return Ok(());
            }
        };
        let color = self.color(geom);
        self.builder.shape(&form, *frame * at, color, used, Some(geom.friction[0]))
    }

    fn mesh(&mut self, geom: &Geom) -> Option<Form> {
        let name = geom.mesh.as_deref().unwrap_or_default();
        let Some(mesh) = self.model.assets.mesh(name) else {
            self.builder.warn(format!("there is no mesh `{name}`; shapes of it are left out"));
            return None;
        };
        let Some(path) = self.model.resolve_mesh_file(mesh, self.folder) else {
            self.builder.warn(format!("mesh `{name}` has no file; shapes of it are left out"));
            return None;
        };
        Some(Form::Mesh { path: tidy(&path), scale: DVec3::from(mesh.scale) })
    }

    fn color(&self, geom: &Geom) -> Option<[u8; 3]> {
        let of_material = || self.model.assets.material(geom.material.as_deref()?)?.rgba;
        let [r, g, b, _] = geom.rgba.or_else(of_material)?;
        Some([r, g, b].map(|channel| (255.0 * channel.clamp(0.0, 1.0)).round() as u8))
    }

    /// Joints that an equality couples. What cannot be touched follows what can.
    fn couple(&mut self) {
        for equality in &self.model.equality {
            let Equality::Joint(coupled) = equality else {
                self.builder.warn("couplings other than between two joints are left out");
                continue;
            };
            if !coupled.common.active {
                continue;
            }
            let numbers = (self.made.get(&coupled.joint1), coupled.joint2.as_ref().and_then(|j| self.made.get(j)));
            // One of a body that was not chosen.
            let (Some(&first), Some(&second)) = numbers else { continue };
            let EqualityJoint { polycoef: [offset, ratio, more @ ..], .. } = coupled;
            if *ratio == 0.0 || more.iter().any(|factor| *factor != 0.0) {
                self.builder.warn(format!("coupling of `{}` is not a straight one and is left out", coupled.joint1));
                continue;
            }
            // MuJoCo: first = offset + ratio * second.
            let links = self.builder.links();
            let touchable = links[second].pieces.iter().any(|piece| piece.solid);
            let (follower, follows) = if touchable {
                (first, Follows::Joint { link: second, ratio: *ratio, offset: *offset })
            } else {
                (second, Follows::Joint { link: first, ratio: 1.0 / ratio, offset: -offset / ratio })
            };
            if let Some(joint) = &mut links[follower].joint {
                joint.spring = None;
                joint.follows = Some(follows);
            }
        }
    }
}

/// Mass of shapes, as MuJoCo makes it of what they say; `None` if none says anything.
fn mass_of(geoms: &[Geom]) -> Option<f64> {
    let volume = |geom: &Geom| {
        let [x, y, z] = geom.size;
        match geom.type_ {
            GeomType::Box => 8.0 * x * y * z,
            GeomType::Cylinder | GeomType::Capsule => 2.0 * std::f64::consts::PI * x * x * y,
            GeomType::Sphere => 4.0 / 3.0 * std::f64::consts::PI * x.powi(3),
            _ => 0.0,
        }
    };
    let felt = || geoms.iter().filter(|geom| geom.contype != 0 || geom.conaffinity != 0);
    let of = |geom: &Geom| geom.mass.unwrap_or_else(|| geom.density.unwrap_or(DENSITY) * volume(geom));
    felt().any(|geom| geom.mass.is_some() || geom.density.is_some()).then(|| felt().map(of).sum())
}

fn pose(raw: &mjcf_rs::Pose) -> Pose {
    let (at, turn) = (raw.translation, raw.rotation);
    Pose::new(DVec3::new(at.x, at.y, at.z), DQuat::from_xyzw(turn.x, turn.y, turn.z, turn.w).normalize())
}
