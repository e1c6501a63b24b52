//! A foreign articulated object without a world: what it looks like with its joints anywhere, and where their axes are.

use crate::{
    model::{
        self, Link, ObjectModel,
        joint::{Follows, Joint, JointKind},
        load::{self, Wanted},
    },
    surfaces::{Surface, SurfacesError, of_piece},
};
use acm_concept::pose::Pose;
use glam::DVec3;
use std::path::Path;

/// An object of a URDF or MJCF file whose joints can be put anywhere. It has no dynamics.
#[derive(Debug, Clone)]
pub struct Mechanism {
    model: ObjectModel,
    /// Link, and a surface in its frame.
    surfaces: Vec<(usize, Surface)>,
}

/// A joint of a [`Mechanism`]. Positions are radians for a hinge and metres for a slider.
#[derive(Debug, Clone, PartialEq)]
pub struct MechanismJoint {
    /// The link that hangs on it.
    pub link: usize,
    /// That link's name.
    pub name: String,
    /// Whether it turns; else it slides.
    pub is_hinge: bool,
    /// Smallest and largest position; `None` without end.
    pub range: Option<[f64; 2]>,
    /// Where it stands when nobody moves it.
    pub rest: f64,
}

impl Mechanism {
    /// Reads an object, named as a scenario's `model_file` names it.
    ///
    /// # Errors
    /// One line with the file and what of it is wrong.
    pub fn load(model_file: &str) -> Result<Mechanism, SurfacesError> {
        let model = load::load(model_file, Path::new(""), Wanted::Surfaces).map_err(SurfacesError::Load)?;
        let mut surfaces = Vec::new();
        for (at, link) in model.links.iter().enumerate() {
            for piece in link.pieces.iter().filter(|piece| piece.shown) {
                surfaces.extend(of_piece(piece, &Pose::IDENTITY)?.into_iter().map(|surface| (at, surface)));
            }
        }
        if surfaces.is_empty() {
            Err(SurfacesError::Empty(model_file.into()))
        } else {
            Ok(Mechanism { model, surfaces })
        }
    }

    /// The joints that can be moved by hand: those that follow others are left out.
    pub fn joints(&self) -> Vec<MechanismJoint> {
        let free = self.model.joints().filter(|(_, joint)| joint.follows.is_none());
        let told = |(link, joint): (usize, &Joint)| MechanismJoint {
            link,
            name: self.link(link).map(|link| link.name.clone()).unwrap_or_default(),
            is_hinge: joint.kind == JointKind::Hinge,
            range: joint.range,
            rest: joint.start,
        };
        free.map(told).collect()
    }

    /// What is seen when the joint of `link` stands at `position`, what follows it does, and all others rest: link and
    /// surface, whose pose is in the base frame.
    pub fn surfaces(&self, link: usize, position: f64) -> Vec<(usize, Surface)> {
        let poses = self.poses(link, position);
        let placed = |(at, surface): &(usize, Surface)| {
            let pose = poses.get(*at).copied().unwrap_or(Pose::IDENTITY) * surface.pose;
            (*at, Surface { pose, ..surface.clone() })
        };
        self.surfaces.iter().map(placed).collect()
    }

    /// A point of a joint's axis in the base frame, metres, and its direction: positive positions turn by the right hand
    /// about it, or slide along it. `None` for a link without a joint.
    pub fn axis(&self, link: usize) -> Option<(DVec3, DVec3)> {
        let joint = self.link(link)?.joint.as_ref()?;
        let parent = self.poses(link, joint.start).get(self.link(link)?.parent).copied()?;
        Some((parent.transform_point(joint.origin), parent.transform_vector(joint.axis)))
    }

    /// Whether `other` is moved rigidly by the joint of `link`: it is that link, or hangs on it.
    pub fn moves(&self, link: usize, other: usize) -> bool {
        let mut at = other;
        for _ in 0..self.model.links.len() {
            if at == link {
                return true;
            }
            at = self.link(at).map_or(0, |link| link.parent);
        }
        false
    }

    fn link(&self, at: usize) -> Option<&Link> {
        self.model.links.get(at)
    }

    fn poses(&self, link: usize, position: f64) -> Vec<Pose> {
        let place = |at: usize, joint: &Joint| if at == link { position } else { joint.start };
        model::poses(&self.model.links, |at, joint| match joint.follows {
            Some(Follows::Joint { link: lead, ratio, offset }) => {
                let lead_at =
                    self.link(lead).and_then(|link| link.joint.as_ref()).map_or(0.0, |joint| place(lead, joint));
                joint.clamp(ratio * lead_at + offset)
            }
            _ => place(at, joint),
        })
    }
}
