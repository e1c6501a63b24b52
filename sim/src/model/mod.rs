//! The simulator's own object models: links with solids, material and joints, read from text files or from robotics
//! formats. They are not the agent's templates and share no code or data with them.
//!
//! | module | holds |
//! |---|---|
//! | `raw`, `meaning` | model files: text to checked meaning |
//! | `load`, `normalise` | URDF and MJCF files, and what their dynamics are made into |
//! | `shape`, `joint` | what a link is made of, and how it hangs on its parent |
//! | `variables`, `info` | names of an object's state, and a description for people |

pub(crate) mod info;
pub(crate) mod joint;
pub(crate) mod load;
mod meaning;
pub(crate) mod normalise;
mod raw;
pub(crate) mod shape;
pub(crate) mod variables;

pub(crate) use raw::RawModel;

use crate::scenario::ScenarioError;
use acm_concept::{pose::Pose, suggest::suggest};
use glam::DVec3;
use include_dir::{Dir, include_dir};
use joint::{Follows, Joint};
use rapier3d::parry::query;
use shape::Shape;
use std::{collections::BTreeMap, path::Path, sync::Arc};

static EMBEDDED: Dir<'_> = include_dir!("$CARGO_MANIFEST_DIR/scenarios/objects");

/// Links that are nearer to each other than this when all is at its start pass through each other, metres.
const TOUCHING_M: f32 = 0.0002;

/// A kind of object that scenarios place. Its base frame lies at the middle of its bottom, z up.
#[derive(Debug, Clone)]
pub(crate) struct ObjectModel {
    /// Name that scenario files refer to.
    pub(crate) model: String,
    pub(crate) summary: String,
    /// Whether its base stands still whatever touches it.
    pub(crate) fixed: bool,
    /// The base first, parents before their children.
    pub(crate) links: Vec<Link>,
    /// Pairs of links, lower number first, that do not feel each other.
    pub(crate) passing: Vec<(usize, usize)>,
    /// Of one that was read from a robotics format.
    pub(crate) loaded: Option<Arc<Loaded>>,
}

/// What a file said of an object, before it was made fit to be simulated.
#[derive(Debug)]
pub(crate) struct Loaded {
    /// What could not be taken as it was.
    pub(crate) warnings: Vec<String>,
    /// Of the joint of each link.
    pub(crate) originals: Vec<Option<normalise::Original>>,
    /// Of each link; `None` where the file says nothing.
    pub(crate) masses_kg: Vec<Option<f64>>,
}

/// A rigid part of an object.
#[derive(Debug, Clone)]
pub(crate) struct Link {
    pub(crate) name: String,
    /// The base is its own parent.
    pub(crate) parent: usize,
    pub(crate) weight: Weight,
    /// Coulomb friction of its surface.
    pub(crate) friction: f64,
    pub(crate) pieces: Vec<Piece>,
    /// `None` for the base and for what is fixed to its parent.
    pub(crate) joint: Option<Joint>,
}

/// How heavy a link is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Weight {
    /// kg/m3.
    Density(f64),
    /// Kilograms.
    Mass(f64),
}

/// A shape of a link.
#[derive(Debug, Clone)]
pub(crate) struct Piece {
    pub(crate) shape: Shape,
    /// In the link's frame, which is the base frame when all joints are at zero.
    pub(crate) pose: Pose,
    /// Width of the bevel at a box's edges, metres; 0 for sharp edges.
    pub(crate) bevel_m: f64,
    pub(crate) color: [u8; 3],
    /// Whether it is felt.
    pub(crate) solid: bool,
    /// Whether it is seen.
    pub(crate) shown: bool,
    pub(crate) lamp: Option<Lamp>,
}

/// A piece whose colour shows something: its own colour for 0, the first of `colors` for 1, and so on.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Lamp {
    pub(crate) name: String,
    pub(crate) colors: Vec<[u8; 3]>,
    /// Expression over the object's own variables.
    pub(crate) shows: Option<String>,
}

impl Piece {
    /// A plain piece that is felt and seen.
    pub(crate) fn new(shape: Shape, pose: Pose, color: [u8; 3]) -> Piece {
        Piece { shape, pose, bevel_m: 0.0, color, solid: true, shown: true, lamp: None }
    }
    /// Smallest and largest coordinates in the frame in which its link stands at `link`.
    pub(crate) fn bounds(&self, link: &Pose) -> (DVec3, DVec3) {
        self.shape.bounds(&(*link * self.pose))
    }
}

impl Link {
    /// Kilograms.
    pub(crate) fn mass_kg(&self) -> f64 {
        match self.weight {
            Weight::Mass(mass) => mass,
            Weight::Density(density) => density * self.volume(),
        }
    }
    /// Volume of what is felt of it, cubic metres.
    pub(crate) fn volume(&self) -> f64 {
        self.pieces.iter().filter(|piece| piece.solid).map(|piece| piece.shape.volume()).sum()
    }
}

impl ObjectModel {
    /// Puts links together and finds out which of them pass through each other.
    pub(crate) fn new(model: String, summary: String, fixed: bool, links: Vec<Link>) -> ObjectModel {
        let passing = passing(&links);
        ObjectModel { model, summary, fixed, links, passing, loaded: None }
    }

    /// Reads one model file.
    pub(crate) fn parse(file: &str, text: &str) -> Result<ObjectModel, ScenarioError> {
        let wrong = |reason: String| ScenarioError::Model { file: file.into(), reason };
        let raw: RawModel = toml::from_str(text).map_err(|e| wrong(suggest(e.to_string())))?;
        raw.meaning().map_err(wrong)
    }

    /// Links with joints, in order.
    pub(crate) fn joints(&self) -> impl Iterator<Item = (usize, &Joint)> {
        self.links.iter().enumerate().filter_map(|(at, link)| Some((at, link.joint.as_ref()?)))
    }

    /// The first link that counts presses.
    pub(crate) fn counter(&self) -> Option<usize> {
        self.joints().find(|(_, joint)| joint.press.is_some()).map(|(at, _)| at)
    }

    /// Names of lamps and gauges, and what they show.
    pub(crate) fn shows(&self) -> impl Iterator<Item = (&str, Option<&str>)> {
        self.links.iter().flat_map(|link| {
            let gauge = match link.joint.as_ref().and_then(|joint| joint.follows.as_ref()) {
                Some(Follows::Expression(text)) => Some((link.name.as_str(), text.as_deref())),
                _ => None,
            };
            let lamps = link.pieces.iter().filter_map(|piece| piece.lamp.as_ref());
            gauge.into_iter().chain(lamps.map(|lamp| (lamp.name.as_str(), lamp.shows.as_deref())))
        })
    }
}

/// Poses of all links in the base frame when their joints are at the given positions.
pub(crate) fn poses(links: &[Link], position: impl Fn(usize, &Joint) -> f64) -> Vec<Pose> {
    let mut poses: Vec<Pose> = Vec::with_capacity(links.len());
    for (at, link) in links.iter().enumerate() {
        let parent = poses.get(link.parent).copied().unwrap_or(Pose::IDENTITY);
        let motion = link.joint.as_ref().map_or(Pose::IDENTITY, |joint| joint.motion(position(at, joint)));
        poses.push(parent * motion);
    }
    poses
}

/// The link with whose body a link moves: itself if it has a joint, else the one that it is fixed to.
pub(crate) fn carrier(links: &[Link], at: usize) -> usize {
    let mut at = at;
    while links[at].joint.is_none() && at != 0 {
        at = links[at].parent;
    }
    at
}

fn passing(links: &[Link]) -> Vec<(usize, usize)> {
    let poses = poses(links, |_, joint| joint.start);
    let shapes = |at: usize| {
        let pose = poses[at];
        links[at].pieces.iter().filter(|piece| piece.solid).filter_map(move |piece| {
            let (turn, shape) = piece.shape.collision(0.0)?;
            Some((piece.bounds(&pose), pose * piece.pose * turn, shape))
        })
    };
    let all: Vec<Vec<_>> = (0..links.len()).map(|at| shapes(at).collect()).collect();
    let mut found = Vec::new();
    for first in 0..links.len() {
        for second in first + 1..links.len() {
            let pair = (carrier(links, first), carrier(links, second));
            // A joint keeps its two links from feeling each other anyway.
            if pair.0 == pair.1 || carrier(links, links[pair.1].parent) == pair.0 {
                continue;
            }
            let touch = all[first].iter().any(|(low_high, pose, shape)| {
                all[second].iter().any(|(other, other_pose, other_shape)| {
                    let margin = DVec3::splat(f64::from(TOUCHING_M));
                    let apart =
                        (low_high.0 - margin).cmpgt(other.1).any() || (other.0 - margin).cmpgt(low_high.1).any();
                    let poses = (crate::convert::to_engine(pose), crate::convert::to_engine(other_pose));
                    !apart
                        && query::distance(&poses.0, &**shape, &poses.1, &**other_shape)
                            .is_ok_and(|distance| distance.distance < TOUCHING_M)
                })
            });
            let pair = (pair.0.min(pair.1), pair.0.max(pair.1));
            if touch && !found.contains(&pair) {
                found.push(pair);
            }
        }
    }
    found
}

/// Whether something can be named so: a lower-case letter first, then lower-case letters, digits, underscores.
pub(crate) fn is_name(name: &str) -> bool {
    name.starts_with(|c: char| c.is_ascii_lowercase())
        && name.len() <= 40
        && name.chars().all(|c| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_')
}

/// The models that a scenario may name.
#[derive(Debug, Clone, Default)]
pub(crate) struct ModelLibrary {
    models: BTreeMap<String, Arc<ObjectModel>>,
}

impl ModelLibrary {
    /// The models that ship with the simulator.
    pub(crate) fn embedded() -> Result<ModelLibrary, ScenarioError> {
        let mut library = ModelLibrary::default();
        for file in EMBEDDED.files() {
            let name = file.path().display().to_string();
            library.add(ObjectModel::parse(&name, file.contents_utf8().unwrap_or_default())?);
        }
        Ok(library)
    }
    /// The model of a file, read once; `folder` is where relative paths begin.
    pub(crate) fn load(&mut self, name: &str, folder: &Path) -> Result<Arc<ObjectModel>, String> {
        let key = format!("file {name}");
        if let Some(known) = self.models.get(&key) {
            return Ok(known.clone());
        }
        let loaded = Arc::new(load::load(name, folder, load::Wanted::Whole)?);
        self.models.insert(key, loaded.clone());
        Ok(loaded)
    }
    /// Adds a model; one of the same name is replaced.
    pub(crate) fn add(&mut self, model: ObjectModel) {
        self.models.insert(model.model.clone(), Arc::new(model));
    }
    pub(crate) fn get(&self, name: &str) -> Option<&Arc<ObjectModel>> {
        self.models.get(name)
    }
    pub(crate) fn names(&self) -> impl Iterator<Item = &str> {
        self.models.keys().map(String::as_str)
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]
    use super::*;

    const MAT: &str = "model = 'm'\nsummary = ''\nfixed = true\n[[solid]]\nshape = 'box'\nsize = [0.1, 0.1, 0.001]\n\
                       position = [0, 0, 0.0005]\ncolor = '#0080ff'\n";
    const DOOR: &str = "[[link]]\nname = 'door'\n[link.joint]\nkind = 'hinge'\naxis = [0, 0, 1]\nrange = [0, 1.5]\n\
                        [[link.solid]]\nshape = 'box'\nsize = [0.1, 0.1, 0.001]\nposition = [0, 0, 0.0025]\n\
                        color = '#0080ff'\n";

    #[test]
    fn the_embedded_models_are_sound() {
        let library = ModelLibrary::embedded().unwrap();
        assert!(library.names().count() >= 3);
        for name in library.names() {
            let model = library.get(name).unwrap();
            let pieces = model.links.iter().flat_map(|link| &link.pieces);
            let lowest = pieces.map(|piece| piece.bounds(&Pose::IDENTITY).0.z).fold(f64::INFINITY, f64::min);
            assert!(lowest.abs() < 1e-9, "{name} does not stand on its base frame");
        }
    }

    #[test]
    fn the_worked_model_is_accepted() {
        let guide = include_str!("../../../docs/objects.md");
        let example = guide.split("```toml\n").nth(1).and_then(|rest| rest.split("```").next()).unwrap();
        let safe = ObjectModel::parse("docs/objects.md", example).unwrap();
        assert_eq!((safe.links.len(), safe.shows().count()), (2, 1));
    }

    #[test]
    fn bad_models_say_what_is_wrong() {
        assert!(ObjectModel::parse("a.toml", MAT).is_ok());
        let message = |text: &str| ObjectModel::parse("a.toml", text).unwrap_err().to_string();
        assert!(message(&MAT.replace("fixed", "fixd")).contains("did you mean `fixed`"));
        assert!(message(&MAT.replace("0.001]", "-0.001]")).contains("size"));
        assert!(message(&MAT.replace("#0080ff", "blue")).contains("#rrggbb"));
        assert!(message("model = 'm'\nsummary = ''\nsolid = []\n").contains("1 to 64 solids"));
    }

    #[test]
    fn bad_links_say_what_is_wrong() {
        let with = |from: &str, to: &str| ObjectModel::parse("a.toml", &format!("{MAT}{}", DOOR.replace(from, to)));
        assert!(with("", "").is_ok());
        let cases = [
            ("'door'", "'Door'", "lower-case"),
            ("'door'", "'base'", "two of that name"),
            ("[0, 0, 1]", "[0, 0, 0]", "no direction"),
            ("[0, 1.5]", "[1.5, 0]", "must ascend"),
            ("[0, 1.5]", "[-3.2, 3.2]", "free turn"),
            ("range = [0, 1.5]", "start = 2.0\nrange = [0, 1.5]", "joint.start = 2 lies outside"),
            ("axis", "latch = { force = 1.0, within = 9.0 }\naxis", "latch.within"),
            ("axis", "press = { pressed = 0.1, rearmed = 0.2 }\naxis", "rearmed < pressed"),
            ("axis", "follows = { joint = 'base', ratio = 1.0 }\naxis", "`base` has no joint"),
            ("axis", "shows = 'window_open'\naxis", "names `window_open`"),
            ("axis", "detents = { force = 1.0 }\naxis", "detents needs either"),
            ("name = 'door'", "name = 'door'\nparent = 'wall'", "no link `wall`"),
        ];
        for (from, to, expected) in cases {
            let error = with(from, to).unwrap_err().to_string();
            assert!(error.contains("a.toml") && error.contains(expected), "{from} -> {to}: {error}");
        }
    }

    #[test]
    fn links_that_touch_at_the_start_pass_through_each_other() {
        let twin = DOOR.replace("'door'", "'twin'");
        let above = twin.replace("0.0025]", "0.0100]");
        let links = |more: &str| ObjectModel::parse("a.toml", &format!("{MAT}{DOOR}{more}")).unwrap().passing;
        assert_eq!(links(&twin), [(1, 2)]);
        assert!(links(&above).is_empty());
    }
}
