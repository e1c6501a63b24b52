//! `acm library`: lists the templates that ship in the program, and draws the gallery of docs/library.md.

use crate::cli::{Exit, LibraryArgs};
use acm_concept::{
    solid::PlacedSolid,
    template::{ParameterSpec, Template, TemplateLibrary, Unit},
};
use anyhow::Context;
use glam::{DVec2, DVec3};
use image::{
    Rgb, RgbImage,
    codecs::png::{CompressionType, FilterType, PngEncoder},
};
use std::{fmt::Write as _, fs, io::Write as _, path::Path};

/// Pixels of a picture.
const SIZE: (u32, u32) = (160, 120);
/// Rays a side of a pixel.
const RAYS: u32 = 2;
/// Share of the picture that stays free at each side.
const MARGIN: f64 = 0.06;
/// Where the eye is, seen from the thing: before it, to its right and above.
const EYE: DVec3 = DVec3::new(0.6, -0.62, 0.5);
const LIGHT: DVec3 = DVec3::new(0.25, -0.55, 0.8);
/// Steps of brightness: few, so that a picture stays small.
const SHADES: f64 = 16.0;
/// Steps of the colours' channels.
const CHANNEL_STEP: f64 = 12.0;
/// One colour a part, in order.
const COLORS: [DVec3; 3] =
    [DVec3::new(120.0, 160.0, 205.0), DVec3::new(225.0, 165.0, 95.0), DVec3::new(140.0, 190.0, 130.0)];

/// Runs `acm library`.
pub fn run(args: &LibraryArgs) -> anyhow::Result<Exit> {
    if let Some(dir) = &args.gallery {
        let count = write_gallery(dir)?;
        println!("{count} templates -> {}", dir.join("library.md").display());
        return Ok(Exit::Success);
    }
    let asked: Vec<&str> = args.groups.iter().map(String::as_str).collect();
    let groups = if asked.is_empty() { acm_memory::library_groups() } else { asked };
    let mut out = std::io::stdout().lock();
    for group in groups {
        for template in acm_memory::library_of(&[group])?.iter() {
            writeln!(out, "{group:<10} {:<16} {}", template.name, nouns(template))?;
        }
    }
    Ok(Exit::Success)
}

/// Writes library.md and the pictures in library/ below a folder; returns the number of templates.
fn write_gallery(dir: &Path) -> anyhow::Result<usize> {
    let pictures = dir.join("library");
    fs::create_dir_all(&pictures).with_context(|| format!("the folder {} cannot be made", pictures.display()))?;
    let page = dir.join("library.md");
    fs::write(&page, gallery()?).with_context(|| format!("{} cannot be written", page.display()))?;
    let all = acm_memory::library_of(&acm_memory::library_groups())?;
    for template in all.iter() {
        let file = pictures.join(format!("{}.png", template.name));
        write(&picture(template)?, &file).with_context(|| format!("{} cannot be written", file.display()))?;
    }
    Ok(all.iter().count())
}

/// Writes a picture as small as PNG allows.
fn write(picture: &RgbImage, file: &Path) -> anyhow::Result<()> {
    let out = std::io::BufWriter::new(fs::File::create(file)?);
    let encoder = PngEncoder::new_with_quality(out, CompressionType::Best, FilterType::NoFilter);
    Ok(picture.write_with_encoder(encoder)?)
}

/// The text of docs/library.md.
pub fn gallery() -> anyhow::Result<String> {
    let mut page = String::from(
        "# The template library\n\n\
         Written by `acm library --gallery docs` from the files in `memory/library`; a test compares. How to read and write \
         such\na file is told in [templates.md](templates.md). Each picture shows the middle of the ranges, as far as the \
         constraints\nallow it; parts have colours of their own.\n\n\
         The group `core` is what perception tries on every segment; `acm library GROUP` lists another one. Templates that\n\
         never stand alone, such as doors, are parts of furniture.\n",
    );
    for group in acm_memory::library_groups() {
        let library = acm_memory::library_of(&[group])?;
        write!(page, "\n## {group}\n\n{}", table(&library))?;
    }
    Ok(page)
}

fn table(library: &TemplateLibrary) -> String {
    let row = |template: &Template| {
        let parameters: Vec<String> = template.parameters.iter().map(parameter).collect();
        let alone = if template.stands_alone { "" } else { " (part)" };
        let Template { name, synopsis, .. } = template;
        let picture = format!("![{}](library/{name}.png)", synopsis.description);
        format!("| `{name}`{alone} | {picture} | {} | {} |\n", parameters.join(", "), nouns(template))
    };
    let head = "| template | picture | parameters | nouns |\n|---|---|---|---|\n";
    head.chars().chain(library.iter().map(row).collect::<String>().chars()).collect()
}

fn nouns(template: &Template) -> String {
    let mut nouns: Vec<&str> = template.synopsis.nouns.iter().map(|noun| noun.noun.as_str()).collect();
    nouns.dedup();
    nouns.join(", ")
}

/// A parameter with its range: millimetres, degrees.
fn parameter(spec: &ParameterSpec) -> String {
    let number = |value: f64| format!("{}", (value * 10.0).round() / 10.0);
    let (scale, unit) = match spec.unit {
        Unit::M => (1e3, " mm"),
        Unit::Rad => (180.0 / std::f64::consts::PI, "°"),
        Unit::One => (1.0, ""),
    };
    format!("{} {}-{}{unit}", spec.name, number(spec.min * scale), number(spec.max * scale))
}

/// A template at typical values, seen from before, the right and above without perspective.
pub fn picture(template: &Template) -> anyhow::Result<RgbImage> {
    let values = template.typical().with_context(|| format!("{}: no values meet its constraints", template.name))?;
    let named = template.named(&values);
    let frames = template.part_frames(&named)?;
    let mut solids: Vec<(PlacedSolid, DVec3)> = Vec::new();
    for ((part, frame), color) in template.parts.iter().zip(frames).zip(COLORS.iter().cycle()) {
        let own = template.part_solids(&part.name, &named)?;
        solids.extend(own.iter().map(|s| (PlacedSolid { solid: s.solid, pose: frame * s.pose }, *color)));
    }
    let view = View::of(&solids);
    let pixel = |column: u32, row: u32| {
        let offsets = (0..RAYS * RAYS).map(|i| DVec2::new(f64::from(i % RAYS), f64::from(i / RAYS)) + 0.5);
        let at = DVec2::new(f64::from(column), f64::from(row));
        let sum: DVec3 = offsets.map(|off| view.color(&solids, at + off / f64::from(RAYS))).sum();
        let mean = sum / f64::from(RAYS * RAYS);
        // What is between two shades becomes one of them; white stays white.
        Rgb(mean
            .to_array()
            .map(|value| (255.0 - ((255.0 - value) / CHANNEL_STEP).round() * CHANNEL_STEP).max(0.0) as u8))
    };
    Ok(RgbImage::from_fn(SIZE.0, SIZE.1, pixel))
}

/// An eye at infinity.
struct View {
    right: DVec3,
    down: DVec3,
    ahead: DVec3,
    /// What the middle of the picture shows, in metres along `right` and `down`.
    middle: DVec2,
    /// Metres a pixel.
    step: f64,
    /// Farther from the origin than any solid, metres.
    far: f64,
}

impl View {
    /// The view that shows all of some solids.
    fn of(solids: &[(PlacedSolid, DVec3)]) -> View {
        let ahead = -EYE.normalize();
        let right = ahead.cross(DVec3::Z).normalize();
        let down = ahead.cross(right);
        let reach = |way: DVec3| {
            let along = |s: &PlacedSolid| s.pose.translation.dot(way) + s.solid.reach(s.pose.rotation.inverse() * way);
            solids.iter().map(|(solid, _)| along(solid)).fold(f64::NEG_INFINITY, f64::max)
        };
        let (low, high) = (DVec2::new(-reach(-right), -reach(-down)), DVec2::new(reach(right), reach(down)));
        let room = DVec2::new(f64::from(SIZE.0), f64::from(SIZE.1)) * (1.0 - 2.0 * MARGIN);
        let step = ((high - low) / room).max_element();
        View { right, down, ahead, middle: 0.5 * (low + high), step, far: reach(-ahead) + 1.0 }
    }
    /// The colour at a point of the picture, 0-255.
    fn color(&self, solids: &[(PlacedSolid, DVec3)], at: DVec2) -> DVec3 {
        let place = self.middle + (at - DVec2::new(f64::from(SIZE.0), f64::from(SIZE.1)) * 0.5) * self.step;
        let origin = self.right * place.x + self.down * place.y - self.ahead * self.far;
        let hit = |(solid, color): &(PlacedSolid, DVec3)| {
            let (enter, _) = solid.intersect_ray(origin, self.ahead)?;
            Some((enter, *solid, *color))
        };
        let Some((enter, solid, color)) = solids.iter().filter_map(hit).min_by(|a, b| a.0.total_cmp(&b.0)) else {
            return DVec3::splat(255.0);
        };
        let (point, near) = (origin + self.ahead * enter, 1e-3 * self.step);
        let slope =
            |axis: DVec3| solid.signed_distance(point + axis * near) - solid.signed_distance(point - axis * near);
        let normal = DVec3::new(slope(DVec3::X), slope(DVec3::Y), slope(DVec3::Z)).normalize_or_zero();
        let lit = 0.4 + 0.6 * normal.dot(LIGHT.normalize()).max(0.0);
        color * ((lit * SHADES).round() / SHADES)
    }
}
