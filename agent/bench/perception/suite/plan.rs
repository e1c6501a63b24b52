//! The suite file: what scenes are drawn from.

use acm_concept::template::TemplateLibrary;
use acm_render::sensor::SensorProfile;
use anyhow::{Context, bail, ensure};
use serde::{Deserialize, Deserializer, de::Error};

/// The suite that ships; its comments say what each field means.
const SUITE: &str = include_str!("../suite.toml");

/// Least and most, both included.
pub type Range<T> = [T; 2];

/// The whole file.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Plan {
    /// Scenes of the three rows together.
    pub scenes: usize,
    /// Seed of the first scene; the others follow it.
    pub first_seed: u64,
    /// Drawings of one seed before the suite is given up.
    pub attempts: usize,
    /// The rows of ten scenes, which repeat.
    pub order: [RowKind; 10],
    /// Sensor profile.
    pub profile: String,
    /// Where it looks from.
    pub camera: CameraPlan,
    /// What stands how near to what.
    pub layout: LayoutPlan,
    /// What shows where two things touch.
    pub edge: EdgePlan,
    /// Colours.
    pub look: LookPlan,
    /// The templates that are drawn from.
    #[serde(rename = "template")]
    pub templates: Vec<TemplatePlan>,
    /// What becomes of perturbed things.
    pub perturbation: PerturbationPlan,
    /// Meshes that nobody here made.
    pub foreign: ForeignPlan,
    /// The cubes in small frames.
    pub small_cubes: SmallCubesPlan,
    /// Many things in one frame.
    pub crowd: CrowdPlan,
}

/// A row of the suite.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum RowKind {
    /// Things that fit a template exactly.
    Exact,
    /// Such things with bevels, drafts and dents.
    Perturbed,
    /// Meshes that nobody here made.
    Foreign,
    /// Small cubes in small frames.
    SmallCubes,
}

impl RowKind {
    /// Its name in results.
    pub fn name(self) -> &'static str {
        match self {
            RowKind::Exact => "exact",
            RowKind::Perturbed => "perturbed",
            RowKind::Foreign => "foreign",
            RowKind::SmallCubes => "small cubes",
        }
    }
}

/// Where the camera looks from. Metres and degrees.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CameraPlan {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Full vertical opening angle.
    pub fov_y_deg: f64,
    /// From the middle of the things.
    pub distance_m: Range<f64>,
    /// Above the table, seen from the middle of the things.
    pub elevation_deg: Range<f64>,
    /// Frames of each scene, which differ in their noise alone.
    pub frames: usize,
}

/// What stands how near to what. Metres.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LayoutPlan {
    /// Things of a scene.
    pub count: Range<usize>,
    /// Largest extent of a thing.
    pub largest_m: Range<f64>,
    /// Least extent of a thing that depth shows.
    pub thinnest_m: f64,
    /// Least gap between things that do not touch.
    pub spaced_gap_m: f64,
    /// Gap of things that do.
    pub touching_gap_m: Range<f64>,
    /// Share of the touching pairs that are stacks.
    pub stacked_share: f64,
    /// Share of the other pairs that stand face to face.
    pub flush_share: f64,
    /// Least pixels of a thing that are seen.
    pub least_pixels: usize,
    /// Least share of a thing's silhouette that is seen.
    pub least_seen_share: f64,
}

/// What an edge between things that touch is.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EdgePlan {
    /// Share of the common border along which there must be one.
    pub least_share: f64,
    /// Difference in CIELAB.
    pub color: f64,
    /// Angle between the surfaces.
    pub normal_deg: f64,
    /// Step in depth beyond what the slope explains.
    pub depth_m: f64,
}

/// Colours.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LookPlan {
    /// Colours of tables, 8-bit sRGB, one of which is drawn.
    #[serde(deserialize_with = "colors")]
    pub tables: Vec<[u8; 3]>,
    /// Least distance of a thing's colour from the table's, CIELAB.
    pub off_table: f64,
    /// Share of the things that have a pattern.
    pub patterned_share: f64,
    /// Edge of a pattern's cell.
    pub pattern_cell_m: Range<f64>,
}

/// A template that is drawn from.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TemplatePlan {
    /// Its type.
    pub name: String,
    /// How often it is drawn against the others.
    pub weight: f64,
}

/// What becomes of perturbed things. Metres.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PerturbationPlan {
    /// Share of the things that have each.
    pub share: f64,
    /// Radius of the rounding of edges.
    pub bevel_m: Range<f64>,
    /// How much wider the bottom is than the top.
    pub draft_m: Range<f64>,
    /// Depth of a dent.
    pub dent_m: Range<f64>,
    /// Its radius.
    pub dent_radius_m: Range<f64>,
    /// Most that each may be of the solid's thinnest extent.
    pub most_of_solid: f64,
}

/// Meshes that nobody here made.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ForeignPlan {
    /// What the largest extent is made, metres.
    pub largest_m: Range<f64>,
    /// URDF and MJCF files, as a scenario's `model_file` names them.
    pub files: Vec<String>,
}

/// Cubes in small frames.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SmallCubesPlan {
    /// Scenes.
    pub scenes: usize,
    /// Seed of the first.
    pub first_seed: u64,
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Of the camera from the middle of the cubes, metres.
    pub distance_m: f64,
    /// Cubes of a scene.
    pub count: Range<usize>,
    /// The edges there are, metres.
    pub edges_m: Vec<f64>,
    /// The template whose lengths are all the edge.
    pub template: String,
    /// Least pixels of a cube that are seen.
    pub least_pixels: usize,
}

/// Many things in one frame.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CrowdPlan {
    /// Scenes.
    pub scenes: usize,
    /// Seed of the first.
    pub first_seed: u64,
    /// Things of a scene.
    pub count: usize,
    /// Largest extent of a thing, metres.
    pub largest_m: Range<f64>,
    /// Of the camera from the middle of the things, metres.
    pub distance_m: f64,
    /// Frames of each scene: all but the last are what memory knows it from.
    pub frames: usize,
}

impl Plan {
    /// The same with the layout of a crowd.
    pub fn crowded(&self) -> Plan {
        let crowd = &self.crowd;
        let layout = LayoutPlan { count: [crowd.count; 2], largest_m: crowd.largest_m, ..self.layout.clone() };
        let camera = CameraPlan { distance_m: [crowd.distance_m; 2], frames: crowd.frames, ..self.camera.clone() };
        Plan { layout, camera, ..self.clone() }
    }

    /// The suite that ships.
    ///
    /// # Errors
    /// The field that cannot be used.
    pub fn own(library: &TemplateLibrary) -> anyhow::Result<Plan> {
        Plan::parse("suite.toml", SUITE, library)
    }

    /// Reads a suite file.
    ///
    /// # Errors
    /// One line with the file, the field and what is wrong with it.
    pub fn parse(file: &str, text: &str, library: &TemplateLibrary) -> anyhow::Result<Plan> {
        let plan: Plan = toml::from_str(text).with_context(|| format!("the suite {file} cannot be understood"))?;
        plan.check(library).with_context(|| format!("suite {file}"))?;
        Ok(plan)
    }

    fn check(&self, library: &TemplateLibrary) -> anyhow::Result<()> {
        let ranges = [
            ("camera.distance_m", self.camera.distance_m),
            ("camera.elevation_deg", self.camera.elevation_deg),
            ("layout.largest_m", self.layout.largest_m),
            ("layout.touching_gap_m", self.layout.touching_gap_m),
            ("look.pattern_cell_m", self.look.pattern_cell_m),
            ("perturbation.bevel_m", self.perturbation.bevel_m),
            ("perturbation.draft_m", self.perturbation.draft_m),
            ("perturbation.dent_m", self.perturbation.dent_m),
            ("perturbation.dent_radius_m", self.perturbation.dent_radius_m),
            ("foreign.largest_m", self.foreign.largest_m),
            ("crowd.largest_m", self.crowd.largest_m),
            ("crowd.distance_m", [self.crowd.distance_m; 2]),
        ];
        for (field, [least, most]) in ranges {
            ensure!(
                least > 0.0 && least <= most && most.is_finite(),
                "{field}: [{least}, {most}] is no positive range"
            );
        }
        let counts = [
            ("camera.frames", [self.camera.frames; 2]),
            ("crowd.frames", [self.crowd.frames; 2]),
            ("layout.count", self.layout.count),
            ("small_cubes.count", self.small_cubes.count),
            ("crowd.count", [self.crowd.count; 2]),
        ];
        for (field, [least, most]) in counts {
            ensure!(least > 0 && least <= most && most <= 32, "{field}: [{least}, {most}] is no range from 1 to 32");
        }
        ensure!(self.crowd.frames > 1, "crowd.frames: memory knows nothing before the first");
        SensorProfile::named(&self.profile).context("profile")?;
        ensure!(self.attempts > 0, "attempts: there must be one");
        ensure!(!self.order.contains(&RowKind::SmallCubes), "order: small cubes are no row of it");
        ensure!(!self.look.tables.is_empty(), "look.tables: there is none");
        ensure!(!self.small_cubes.edges_m.is_empty(), "small_cubes.edges_m: there is none");
        ensure!(!self.foreign.files.is_empty(), "foreign.files: there is none");
        let named = self.templates.iter().map(|template| ("template.name", &template.name));
        for (field, name) in named.chain([("small_cubes.template", &self.small_cubes.template)]) {
            if library.get(name).is_none() {
                let known: Vec<&str> = library.iter().map(|template| template.name.as_str()).collect();
                bail!("{field}: there is no template `{name}`; known: {}", known.join(", "));
            }
        }
        let weights = self.templates.iter().map(|template| template.weight);
        ensure!(weights.clone().all(|w| w >= 0.0) && weights.sum::<f64>() > 0.0, "template.weight: nothing is drawn");
        Ok(())
    }

    /// Row and seed of each scene of the three rows, in order, and whether things touch in it.
    pub fn scenes(&self) -> impl Iterator<Item = (RowKind, u64, bool)> + '_ {
        (0..self.scenes).map(|at| {
            // Alternates within a row too, whatever the row's share of the ten is.
            let earlier = (0..at).filter(|other| self.order[other % 10] == self.order[at % 10]).count();
            (self.order[at % 10], self.first_seed + at as u64, earlier % 2 == 1)
        })
    }
}

/// Colours as `#rrggbb`.
fn colors<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<[u8; 3]>, D::Error> {
    let texts = Vec::<String>::deserialize(deserializer)?;
    let color = |text: &String| {
        let digits = text.strip_prefix('#').filter(|digits| digits.len() == 6)?;
        let value = u32::from_str_radix(digits, 16).ok()?;
        let [_, r, g, b] = value.to_be_bytes();
        Some([r, g, b])
    };
    texts.iter().map(|text| color(text).ok_or_else(|| D::Error::custom(format!("`{text}` is no #rrggbb")))).collect()
}
