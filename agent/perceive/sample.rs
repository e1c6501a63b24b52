//! One real photograph for the demo, where the outside data is present.

use super::input;
use acm_concept::{
    expectation::Expectation, ids::FrameId, object::GroundedObject, template::TemplateLibrary, time::Time,
};
use acm_memory::geometry::Body;
use acm_perception::{Grounder, GrounderConfig, frames, overlay};
use anyhow::Context;
use std::{
    path::{Path, PathBuf},
    sync::Arc,
};

/// Where real frames lie in the folder of outside data, one that shows much, and the calibration of its camera.
const FRAMES: &str = "rgbd_mosd/frames";
const STEM: &str = "33";
const INTRINSICS: (f64, f64, f64, f64) = (525.0, 525.0, 319.5, 239.5);

/// Grounds a photograph, draws it into `picture`, and says in a line what was found; `None` without the data, which is
/// looked for through the variable ACM_DATA and beside the working folder.
pub fn photograph(picture: &Path) -> anyhow::Result<Option<String>> {
    let places = [std::env::var_os("ACM_DATA").map(PathBuf::from), Some(PathBuf::from("../shared/data"))];
    let folder = places.into_iter().flatten().map(|data| data.join(FRAMES)).find(|folder| folder.is_dir());
    let Some(folder) = folder else { return Ok(None) };
    let Some(pair) = input::pairs_in(&folder)?.into_iter().find(|pair| pair.stem == STEM) else { return Ok(None) };
    let library = Arc::new(acm_memory::default_library()?);
    let frame = frames::read_pair(&pair.color, &pair.depth, INTRINSICS, 0.001, None, FrameId(0), Time::ZERO)?;
    let percepts = Grounder::new(Arc::clone(&library), GrounderConfig::of_unknown_camera())
        .ground(&frame, &Expectation::default());
    let drawn = overlay::draw(&frame, &percepts, &[], &library);
    drawn.save(picture).with_context(|| format!("the picture {} cannot be written", picture.display()))?;
    let things: Vec<String> = percepts.objects.iter().map(|object| thing(object, &library)).collect();
    Ok(Some(format!("{} objects: {} cm -> {}", things.len(), things.join(", "), picture.display())))
}

/// Category, largest width and height in centimetres.
fn thing(object: &GroundedObject, library: &TemplateLibrary) -> String {
    let Some(body) = Body::of(&object.parts, library) else { return object.category.clone() };
    let [width, _, height] = body.extents().map(|extent| 100.0 * extent);
    format!("{} {width:.0}x{height:.0}", object.category)
}
