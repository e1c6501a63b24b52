//! Which frames are read and with what calibration, and where pictures of them go.

use crate::cli::PerceiveArgs;
use acm_concept::pose::Pose;
use anyhow::{Context, bail};
use glam::{DQuat, DVec3};
use std::{
    cmp::Ordering,
    collections::BTreeMap,
    path::{Path, PathBuf},
};

/// Most frames of one call.
pub const MAX_FRAMES: usize = 20_000;
/// Largest file of camera poses, bytes.
const MAX_POSES_BYTES: u64 = 16 * 1024 * 1024;
/// What stands between a stem and the kind of an image.
const SEPARATORS: [char; 3] = ['_', '-', '.'];
/// How far the length of a written quaternion may be from one: files round their numbers.
const UNIT_TOLERANCE: f64 = 0.01;

/// The two files of one frame.
#[derive(Debug, Clone, PartialEq)]
pub struct FramePair {
    /// What the files' names share; pictures of the frame are named by it.
    pub stem: String,
    /// The colour image.
    pub color: PathBuf,
    /// The registered depth image.
    pub depth: PathBuf,
    /// Pose of the camera in the world, if it was given.
    pub camera_pose: Option<Pose>,
}

/// All frames of one call, in order, with what they share.
#[derive(Debug, Clone, PartialEq)]
pub struct Input {
    /// The frames.
    pub frames: Vec<FramePair>,
    /// fx, fy, cx, cy in pixels.
    pub intrinsics: (f64, f64, f64, f64),
    /// Metres per unit of the depth images.
    pub depth_scale_m: f64,
}

impl Input {
    /// Reads the arguments, the folder and the poses; no image is opened yet. Errors name the argument or the files.
    pub fn read(args: &PerceiveArgs) -> anyhow::Result<Input> {
        let [fx, fy, cx, cy] = numbers("--intrinsics", "fx,fy,cx,cy", &args.intrinsics)?;
        let mut frames = match &args.frames {
            Some(folder) => pairs_in(folder)?,
            None => pairs_of(&args.color, &args.depth)?,
        };
        if frames.len() > MAX_FRAMES {
            bail!("{} frames are more than {MAX_FRAMES}: perceive them in parts over one --memory", frames.len());
        }
        if let Some(text) = &args.camera_pose {
            let pose = pose("--camera-pose", numbers("--camera-pose", "x,y,z,qx,qy,qz,qw", text)?)?;
            frames.iter_mut().for_each(|frame| frame.camera_pose = Some(pose));
        }
        if let Some(path) = &args.camera_poses {
            take_poses(path, &mut frames)?;
        }
        Ok(Input { frames, intrinsics: (fx, fy, cx, cy), depth_scale_m: args.depth_scale })
    }
}

/// `N` finite numbers separated by commas.
fn numbers<const N: usize>(argument: &str, names: &str, text: &str) -> anyhow::Result<[f64; N]> {
    let parts: Vec<&str> = text.split(',').map(str::trim).collect();
    let read = |part: &&str| part.parse::<f64>().ok().filter(|number| number.is_finite());
    if let Some(wrong) = parts.iter().find(|part| read(part).is_none()) {
        bail!("{argument} holds `{wrong}`, which is not a number: write {names}");
    }
    let values: Vec<f64> = parts.iter().filter_map(read).collect();
    let count = values.len();
    values.try_into().ok().with_context(|| format!("{argument} needs {N} numbers {names}, got {count}"))
}

fn pose(place: &str, [x, y, z, qx, qy, qz, qw]: [f64; 7]) -> anyhow::Result<Pose> {
    let rotation = DQuat::from_xyzw(qx, qy, qz, qw);
    if (rotation.length() - 1.0).abs() > UNIT_TOLERANCE {
        bail!("{place}: the quaternion qx,qy,qz,qw has length {:.3}, but a rotation has length 1", rotation.length());
    }
    Ok(Pose::new(DVec3::new(x, y, z), rotation.normalize()))
}

/// Colour and depth files in the order in which they were named.
fn pairs_of(color: &[PathBuf], depth: &[PathBuf]) -> anyhow::Result<Vec<FramePair>> {
    if color.len() != depth.len() {
        bail!("{} --color but {} --depth: every frame needs one of each", color.len(), depth.len());
    }
    let pair = |(color, depth): (&PathBuf, &PathBuf)| {
        let name = color.file_name().map_or_else(|| "frame".into(), |name| name.to_string_lossy().into_owned());
        let stem = split_name(&name).map_or_else(|| without_suffix(&name), |(stem, _)| stem);
        FramePair { stem: stem.into(), color: color.clone(), depth: depth.clone(), camera_pose: None }
    };
    let mut pairs: Vec<FramePair> = color.iter().zip(depth).map(pair).collect();
    // Files of several folders may share a name.
    for index in 1..pairs.len() {
        let (before, rest) = pairs.split_at_mut(index);
        if let Some(pair) = rest.first_mut().filter(|pair| before.iter().any(|other| other.stem == pair.stem)) {
            pair.stem = format!("{}_{}", pair.stem, index + 1);
        }
    }
    Ok(pairs)
}

fn without_suffix(name: &str) -> &str {
    name.rsplit_once('.').map_or(name, |(stem, _)| stem)
}

/// The role of a file in a folder of frames.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Role {
    Color,
    Depth,
}

/// Stem and role of a file name, if it has one: `07_color.png`, `07-depth.png`, `07.color.png`.
fn split_name(name: &str) -> Option<(&str, Role)> {
    let base = name.strip_suffix(".png")?;
    let of = |kind: &str, role| {
        let stem = base.strip_suffix(kind)?.strip_suffix(SEPARATORS)?;
        (!stem.is_empty()).then_some((stem, role))
    };
    of("color", Role::Color).or_else(|| of("depth", Role::Depth))
}

/// The frames of a folder, sorted.
pub(crate) fn pairs_in(folder: &Path) -> anyhow::Result<Vec<FramePair>> {
    let cannot_read = || format!("the folder {} cannot be read; check the path", folder.display());
    let mut found: BTreeMap<String, [Option<PathBuf>; 2]> = BTreeMap::new();
    for entry in std::fs::read_dir(folder).with_context(cannot_read)? {
        let path = entry.with_context(cannot_read)?.path();
        let name = path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
        let Some((stem, role)) = split_name(&name) else { continue };
        let [color, depth] = found.entry(stem.into()).or_default();
        let slot = if role == Role::Color { color } else { depth };
        if let Some(other) = slot.replace(path.clone()) {
            bail!("{} and {} claim to be the same image of one frame; keep one", other.display(), path.display());
        }
    }
    let (mut pairs, mut alone) = (Vec::new(), Vec::new());
    for (stem, files) in found {
        match files {
            [Some(color), Some(depth)] => pairs.push(FramePair { stem, color, depth, camera_pose: None }),
            files => alone.extend(files.into_iter().flatten().map(|path| path.display().to_string())),
        }
    }
    if let Some(first) = alone.first() {
        let more = if alone.len() > 1 { format!(" (and {} more)", alone.len() - 1) } else { String::new() };
        bail!("{first}{more} has no partner: every STEM_color.png needs a STEM_depth.png and the other way round");
    }
    if pairs.is_empty() {
        bail!("the folder {} holds no frames: no STEM_color.png with a STEM_depth.png", folder.display());
    }
    pairs.sort_by(|a, b| by_number(&a.stem, &b.stem));
    Ok(pairs)
}

/// Order of names in which runs of digits count by their value: `frame9` comes before `frame10`.
fn by_number(a: &str, b: &str) -> Ordering {
    let (mut left, mut right) = (a, b);
    loop {
        let digits = |text: &str| text.chars().take_while(char::is_ascii_digit).count();
        let (m, n) = (digits(left), digits(right));
        let order = if m > 0 && n > 0 {
            let (x, y) = (left[..m].trim_start_matches('0'), right[..n].trim_start_matches('0'));
            let order = x.len().cmp(&y.len()).then(x.cmp(y));
            (left, right) = (&left[m..], &right[n..]);
            order
        } else {
            let (mut x, mut y) = (left.chars(), right.chars());
            let (first, second) = (x.next(), y.next());
            if first.is_none() && second.is_none() {
                return a.cmp(b);
            }
            (left, right) = (x.as_str(), y.as_str());
            first.cmp(&second)
        };
        if order != Ordering::Equal {
            return order;
        }
    }
}

/// Gives every frame its pose from a file with a line for each.
fn take_poses(path: &Path, frames: &mut [FramePair]) -> anyhow::Result<()> {
    let cannot_read = || format!("the camera poses {} cannot be read; check the path", path.display());
    let bytes = std::fs::metadata(path).with_context(cannot_read)?.len();
    if bytes > MAX_POSES_BYTES {
        bail!("{} is too large: {bytes} bytes, at most {MAX_POSES_BYTES}", path.display());
    }
    let text = std::fs::read_to_string(path).with_context(cannot_read)?;
    let mut poses: BTreeMap<&str, Pose> = BTreeMap::new();
    for (index, line) in text.lines().enumerate() {
        let line = line.split('#').next().unwrap_or_default().trim();
        if line.is_empty() {
            continue;
        }
        let place = format!("{} line {}", path.display(), index + 1);
        let (stem, rest) = line
            .split_once(|c: char| c.is_whitespace() || c == ',')
            .with_context(|| format!("{place} holds `{line}`: write STEM x y z qx qy qz qw"))?;
        let commas = rest.split(|c: char| c.is_whitespace() || c == ',').filter(|p| !p.is_empty());
        let values = numbers(&place, "STEM x y z qx qy qz qw", &commas.collect::<Vec<_>>().join(","))?;
        poses.insert(stem, pose(&place, values)?);
    }
    for frame in frames {
        let known = poses.get(frame.stem.as_str());
        let missing = || format!("{} has no line for the frame `{}`", path.display(), frame.stem);
        frame.camera_pose = Some(*known.with_context(missing)?);
    }
    Ok(())
}

/// Where pictures of the frames go.
#[derive(Debug, Clone, PartialEq)]
pub struct Pictures {
    overlay: Option<Target>,
    labels: Option<Target>,
}

#[derive(Debug, Clone, PartialEq)]
enum Target {
    File(PathBuf),
    Folder(PathBuf),
}

impl Pictures {
    /// One frame that was named by its files gets a file; the frames of a folder, or several, get a folder, which is
    /// made.
    pub fn prepare(args: &PerceiveArgs, frames: usize) -> anyhow::Result<Pictures> {
        let folder = args.frames.is_some() || frames > 1;
        let target = |path: &Option<PathBuf>, argument: &str| -> anyhow::Result<Option<Target>> {
            let Some(path) = path else { return Ok(None) };
            if !folder {
                if path.is_dir() {
                    bail!("{argument} {} is a folder, but one frame gives one file: name a PNG", path.display());
                }
                return Ok(Some(Target::File(path.clone())));
            }
            let cannot_make =
                || format!("{argument} {} must be a folder for several frames and cannot be made", path.display());
            std::fs::create_dir_all(path).with_context(cannot_make)?;
            Ok(Some(Target::Folder(path.clone())))
        };
        Ok(Pictures { overlay: target(&args.overlay, "--overlay")?, labels: target(&args.labels, "--labels")? })
    }
    /// The file for a frame's overlay, if one is asked for.
    pub fn overlay(&self, stem: &str) -> Option<PathBuf> {
        self.overlay.as_ref().map(|target| target.path(stem, "overlay"))
    }
    /// The file for a frame's labels, if they are asked for.
    pub fn labels(&self, stem: &str) -> Option<PathBuf> {
        self.labels.as_ref().map(|target| target.path(stem, "label"))
    }
}

impl Target {
    fn path(&self, stem: &str, kind: &str) -> PathBuf {
        match self {
            Target::File(path) => path.clone(),
            Target::Folder(folder) => folder.join(format!("{stem}_{kind}.png")),
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)] // a failed step is a failed test
    use super::*;

    #[test]
    fn names_are_ordered_by_the_numbers_in_them() {
        let mut names = ["f10", "f9", "f09b", "e2", "f9a", "f", "12", "3"];
        names.sort_by(|a, b| by_number(a, b));
        assert_eq!(names, ["3", "12", "e2", "f", "f9", "f9a", "f09b", "f10"]);
    }

    #[test]
    fn a_name_gives_its_stem_and_role() {
        assert_eq!(split_name("07_color.png"), Some(("07", Role::Color)));
        assert_eq!(split_name("frame-000.depth.png"), Some(("frame-000", Role::Depth)));
        assert_eq!(split_name("000001-color.png"), Some(("000001", Role::Color)));
        assert_eq!(split_name("_color.png"), None);
        assert_eq!(split_name("07_label.png"), None);
        assert_eq!(split_name("07color.png"), None);
    }

    #[test]
    fn numbers_are_counted_and_named() {
        assert_eq!(numbers::<2>("--x", "a,b", "1, -2.5").unwrap(), [1.0, -2.5]);
        let message = |text: &str| numbers::<2>("--x", "a,b", text).unwrap_err().to_string();
        assert!(message("1").contains("needs 2 numbers a,b, got 1"));
        assert!(message("1,two").contains("`two`"));
        assert!(message("1,nan").contains("`nan`"));
    }

    #[test]
    fn a_rounded_quaternion_is_taken_and_a_wrong_one_refused() {
        let rounded = pose("p", [0.0, 0.0, 1.0, 0.707, 0.0, 0.0, 0.707]).unwrap();
        assert!(rounded.is_valid());
        assert!(pose("p", [0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0]).unwrap_err().to_string().contains("length 1.414"));
    }
}
