//! The sizes of the network, and the file beside its weights that says what they are.

use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use thiserror::Error;

/// Name of the description in a folder of weights.
pub const DESCRIPTION_FILE: &str = "estimator.toml";
/// Name of the weights in it.
pub const WEIGHTS_FILE: &str = "weights.safetensors";
/// The format of descriptions.
pub const SCHEMA: &str = "acm.estimator/1";
/// Most templates of one estimator, and most of everything else that a description counts.
const MOST: usize = 4096;

/// The shape of the encoder.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Shape {
    /// Points that are drawn from a cloud.
    pub points: usize,
    /// Groups that the points are cut into; their middles are chosen by farthest point sampling.
    pub groups: usize,
    /// Points of a group: the nearest to its middle.
    pub group_size: usize,
    /// Width of the mini-PointNet that makes a token of a group: of its first layer, then twice and four times as wide.
    pub token_width: usize,
    /// Attention layers.
    pub layers: usize,
    /// Heads of each.
    pub heads: usize,
    /// Width of a token.
    pub width: usize,
}

impl Shape {
    /// That of the paper: 128 groups of 32 points, 12 layers of 6 heads; the width is Point-BERT's.
    pub const PAPER: Shape =
        Shape { points: 2048, groups: 128, group_size: 32, token_width: 128, layers: 12, heads: 6, width: 384 };
    /// One that two processors train within an hour.
    pub const SMALL: Shape =
        Shape { points: 1024, groups: 64, group_size: 32, token_width: 64, layers: 4, heads: 6, width: 192 };
    /// One for tests and first looks.
    pub const TINY: Shape =
        Shape { points: 512, groups: 32, group_size: 16, token_width: 32, layers: 3, heads: 4, width: 96 };

    /// What keeps it from being built, with the field's name.
    pub fn check(&self) -> Result<(), String> {
        let fields = [
            ("points", self.points),
            ("groups", self.groups),
            ("group_size", self.group_size),
            ("token_width", self.token_width),
            ("layers", self.layers),
            ("heads", self.heads),
            ("width", self.width),
        ];
        if let Some((name, value)) = fields.into_iter().find(|(_, value)| !(1..=MOST).contains(value)) {
            return Err(format!("shape.{name} is {value}, but must lie in 1..={MOST}"));
        }
        if !self.width.is_multiple_of(self.heads) {
            return Err(format!("shape.width is {}, which is no multiple of shape.heads, {}", self.width, self.heads));
        }
        if self.groups.max(self.group_size) > self.points {
            return Err(format!("shape.points is {}: fewer than there are groups, or points of one", self.points));
        }
        Ok(())
    }
}

/// What one head estimates.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HeadSpec {
    /// The template's type.
    pub template: String,
    /// Its fitted parameters, in its order.
    pub parameters: Vec<String>,
    /// Headings repeat this many times a turn; 0 stands for any.
    pub fold: u32,
}

impl HeadSpec {
    /// Numbers that the head estimates; it gives twice as many, a mean and a logarithm of a deviation of each.
    pub fn outputs(&self) -> usize {
        self.parameters.len() + 2 + if self.fold == 0 { 0 } else { 2 }
    }
}

/// How weights came about.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Origin {
    /// Seed of the first weights and of the order of the samples.
    pub seed: u64,
    /// First and last seed of the scenes whose things were learned from.
    pub scenes: [u64; 2],
    /// Samples.
    pub samples: usize,
    /// Steps.
    pub steps: usize,
    /// Samples of a step.
    pub batch: usize,
}

/// What weights are: the file [`DESCRIPTION_FILE`] beside them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Description {
    /// [`SCHEMA`].
    pub schema: String,
    /// The encoder.
    pub shape: Shape,
    /// How they came about.
    pub origin: Origin,
    /// The heads.
    #[serde(rename = "head")]
    pub heads: Vec<HeadSpec>,
}

/// Why a folder holds no estimator or no samples. One line each.
#[derive(Debug, Error)]
pub enum FolderError {
    /// A file cannot be read or written.
    #[error("{}: {source}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// The system's message.
        source: std::io::Error,
    },
    /// A file that is not what its name says.
    #[error("{}: {reason}", path.display())]
    Format {
        /// The file.
        path: PathBuf,
        /// What is wrong, on one line.
        reason: String,
    },
}

impl FolderError {
    /// A file that is not what its name says; of a parser's message the first line that says something is kept.
    pub fn format(path: &Path, reason: impl ToString) -> FolderError {
        let reason = reason.to_string();
        let lines = reason.lines().map(str::trim).filter(|line| !line.is_empty() && !line.contains('|'));
        FolderError::Format { path: path.to_path_buf(), reason: lines.collect::<Vec<_>>().join(": ") }
    }
    /// A file that cannot be read or written.
    pub fn file(path: &Path, source: std::io::Error) -> FolderError {
        FolderError::File { path: path.to_path_buf(), source }
    }
}

impl Description {
    /// Reads the description in a folder.
    pub fn read(folder: &Path) -> Result<Description, FolderError> {
        let path = folder.join(DESCRIPTION_FILE);
        let text = std::fs::read_to_string(&path).map_err(|source| FolderError::file(&path, source))?;
        let description: Description = toml::from_str(&text).map_err(|e| FolderError::format(&path, e))?;
        description.check().map_err(|reason| FolderError::format(&path, reason))?;
        Ok(description)
    }

    /// Writes it into a folder.
    pub fn write(&self, folder: &Path) -> Result<(), FolderError> {
        let path = folder.join(DESCRIPTION_FILE);
        let text = toml::to_string(self).map_err(|e| FolderError::format(&path, e))?;
        std::fs::write(&path, text).map_err(|source| FolderError::file(&path, source))
    }

    fn check(&self) -> Result<(), String> {
        if self.schema != SCHEMA {
            return Err(format!("schema is `{}`, but this program reads `{SCHEMA}`", self.schema));
        }
        self.shape.check()?;
        if self.heads.is_empty() || self.heads.len() > MOST {
            return Err(format!("head: there are {}, but must be 1 to {MOST}", self.heads.len()));
        }
        let empty = self.heads.iter().find(|head| head.parameters.is_empty() || head.parameters.len() > MOST);
        empty
            .map_or(Ok(()), |head| Err(format!("head `{}`: parameters: there is none, or far too many", head.template)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sizes_can_be_built_and_mistakes_are_named() {
        for shape in [Shape::PAPER, Shape::SMALL, Shape::TINY] {
            assert_eq!(shape.check(), Ok(()));
        }
        let odd = Shape { heads: 5, ..Shape::SMALL };
        assert!(odd.check().is_err_and(|e| e.contains("shape.width is 192")));
        let none = Shape { layers: 0, ..Shape::SMALL };
        assert!(none.check().is_err_and(|e| e.contains("shape.layers is 0")));
        let few = Shape { points: 20, ..Shape::SMALL };
        assert!(few.check().is_err_and(|e| e.contains("shape.points is 20")));
    }
}
