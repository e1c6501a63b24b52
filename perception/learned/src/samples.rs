//! Labelled clouds in a folder.

use crate::{
    cloud::{CONTEXT, Cloud, Normal},
    config::{FolderError, HeadSpec},
};
use candle_core::{Device, Tensor};
use serde::{Deserialize, Serialize};
use std::{collections::HashMap, path::Path};

/// The description in a folder of samples.
const DESCRIPTION_FILE: &str = "samples.toml";
/// The numbers in it.
const NUMBERS_FILE: &str = "samples.safetensors";
/// The format of descriptions.
const SCHEMA: &str = "acm.samples/1";

/// A cloud and what its head is to say of it, in the cloud's own frame.
#[derive(Debug, Clone, PartialEq)]
pub struct Sample {
    /// Points in the cloud's own frame.
    pub points: Vec<[f32; 3]>,
    /// [`Normal::context`].
    pub context: [f32; CONTEXT],
    /// Place of its head.
    pub head: usize,
    /// What the head is to say.
    pub targets: Vec<f32>,
}

impl Sample {
    /// A cloud with what is true of it.
    pub fn new(cloud: &Cloud, normal: &Normal, head: usize, targets: Vec<f32>) -> Sample {
        Sample { points: cloud.points_in(normal), context: normal.context, head, targets }
    }
}

/// Samples with the heads that they are for.
#[derive(Debug, Clone, PartialEq)]
pub struct Samples {
    /// The heads.
    pub heads: Vec<HeadSpec>,
    /// First and last seed of the scenes that the clouds are of.
    pub scenes: [u64; 2],
    /// The samples.
    pub samples: Vec<Sample>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct SamplesDescription {
    schema: String,
    scenes: [u64; 2],
    #[serde(rename = "head")]
    heads: Vec<HeadSpec>,
}

impl Samples {
    /// Writes them into a folder, which is made.
    pub fn write(&self, folder: &Path) -> Result<(), FolderError> {
        std::fs::create_dir_all(folder).map_err(|source| FolderError::file(folder, source))?;
        let path = folder.join(NUMBERS_FILE);
        let tensors = self.tensors().map_err(|e| FolderError::format(&path, e))?;
        candle_core::safetensors::save(&tensors, &path).map_err(|e| FolderError::format(&path, e))?;
        let path = folder.join(DESCRIPTION_FILE);
        let description = SamplesDescription { schema: SCHEMA.into(), scenes: self.scenes, heads: self.heads.clone() };
        let text = toml::to_string(&description).map_err(|e| FolderError::format(&path, e))?;
        std::fs::write(&path, text).map_err(|source| FolderError::file(&path, source))
    }

    /// Points end to end with the counts of each cloud's; targets filled up with zeros to the longest.
    fn tensors(&self) -> candle_core::Result<HashMap<&'static str, Tensor>> {
        let count = self.samples.len();
        let width = self.heads.iter().map(HeadSpec::outputs).max().unwrap_or(0);
        let points: Vec<f32> = self.samples.iter().flat_map(|s| s.points.iter().flatten()).copied().collect();
        let counts: Vec<u32> = self.samples.iter().map(|s| s.points.len() as u32).collect();
        let context: Vec<f32> = self.samples.iter().flat_map(|s| s.context).collect();
        let heads: Vec<u32> = self.samples.iter().map(|s| s.head as u32).collect();
        let filled =
            |s: &Sample| s.targets.iter().copied().chain(std::iter::repeat(0.0)).take(width).collect::<Vec<_>>();
        let targets: Vec<f32> = self.samples.iter().flat_map(filled).collect();
        let device = &Device::Cpu;
        Ok(HashMap::from([
            ("points", Tensor::from_vec(points.clone(), (points.len() / 3, 3), device)?),
            ("counts", Tensor::from_vec(counts, count, device)?),
            ("context", Tensor::from_vec(context, (count, CONTEXT), device)?),
            ("head", Tensor::from_vec(heads, count, device)?),
            ("targets", Tensor::from_vec(targets, (count, width), device)?),
        ]))
    }

    /// Reads a folder.
    pub fn read(folder: &Path) -> Result<Samples, FolderError> {
        let path = folder.join(DESCRIPTION_FILE);
        let text = std::fs::read_to_string(&path).map_err(|source| FolderError::file(&path, source))?;
        let description: SamplesDescription = toml::from_str(&text).map_err(|e| FolderError::format(&path, e))?;
        if description.schema != SCHEMA {
            let reason = format!("schema is `{}`, but this program reads `{SCHEMA}`", description.schema);
            return Err(FolderError::format(&path, reason));
        }
        let path = folder.join(NUMBERS_FILE);
        std::fs::metadata(&path).map_err(|source| FolderError::file(&path, source))?;
        let tensors = candle_core::safetensors::load(&path, &Device::Cpu).map_err(|e| FolderError::format(&path, e))?;
        let samples = samples_of(&tensors, &description.heads).map_err(|e| FolderError::format(&path, e))?;
        Ok(Samples { heads: description.heads, scenes: description.scenes, samples })
    }
}

fn samples_of(tensors: &HashMap<String, Tensor>, heads: &[HeadSpec]) -> candle_core::Result<Vec<Sample>> {
    let tensor =
        |name: &str| tensors.get(name).ok_or_else(|| candle_core::Error::Msg(format!("there is no tensor `{name}`")));
    let triples = |name: &str| -> candle_core::Result<Vec<[f32; 3]>> {
        let rows = tensor(name)?.to_vec2::<f32>()?;
        let triple = |row: Vec<f32>| {
            row.try_into().map_err(|row: Vec<f32>| {
                candle_core::Error::Msg(format!("tensor `{name}` has {} columns, but must have 3", row.len()))
            })
        };
        rows.into_iter().map(triple).collect()
    };
    let (points, context) = (triples("points")?, triples("context")?);
    let counts = tensor("counts")?.to_vec1::<u32>()?;
    let places = tensor("head")?.to_vec1::<u32>()?;
    let targets = tensor("targets")?.to_vec2::<f32>()?;
    let total: usize = counts.iter().map(|count| *count as usize).sum();
    if total != points.len() || [context.len(), places.len(), targets.len()].iter().any(|n| *n != counts.len()) {
        candle_core::bail!("its tensors do not belong together: they are of different numbers of clouds or points");
    }
    let (mut samples, mut rest) = (Vec::with_capacity(counts.len()), points.as_slice());
    for (((count, context), place), targets) in counts.into_iter().zip(context).zip(places).zip(targets) {
        let (own, others) = rest.split_at(count as usize);
        rest = others;
        let Some(head) = heads.get(place as usize) else { candle_core::bail!("head: {place} is none") };
        let targets: Vec<f32> = targets.into_iter().take(head.outputs()).collect();
        if own.is_empty() || targets.len() < head.outputs() {
            candle_core::bail!("a cloud has no points, or fewer targets than its head `{}`", head.template);
        }
        samples.push(Sample { points: own.to_vec(), context, head: place as usize, targets });
    }
    Ok(samples)
}
