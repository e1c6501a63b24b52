//! Methods by name, as `--method` takes them.

use crate::{FullHistory, Perceive, Pruned, Shuffled, keeping::KEEPINGS};
use acm_concept::template::TemplateLibrary;
use acm_memory::{AcmMemory, IdentityRule, Memory, MemoryError};
use std::{path::Path, sync::Arc};
use thiserror::Error;

/// The names that [`by_name`] knows.
pub const METHODS: [&str; 13] = [
    "acm",
    "paper-identity",
    "reactive",
    "first-frame",
    "window",
    "window-2",
    "action-log",
    "keyframe",
    "embedding",
    "text-summary",
    "semantic",
    "full-history",
    "shuffled",
];

/// A name that is no method.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("there is no method `{name}`{suggestion}; the methods are: {}", METHODS.join(", "))]
pub struct UnknownMethod {
    name: String,
    suggestion: String,
}

/// Why a method could not be had.
#[derive(Debug, Error)]
pub enum MethodError {
    /// No method of that name.
    #[error(transparent)]
    Unknown(#[from] UnknownMethod),
    /// Its memory folder could not be opened.
    #[error(transparent)]
    Memory(#[from] MemoryError),
}

/// The memory of a method. Those that keep everything keep it in `dir`, if one is given; the others keep nothing from one
/// run to the next and leave `dir` alone. `perceive` is for `full-history`, which perceives stored frames again.
///
/// ```
/// let library = std::sync::Arc::new(acm_memory::default_library().unwrap());
/// assert_eq!(acm_baselines::by_name("reactive", library.clone(), None, None).unwrap().name(), "reactive");
/// let error = acm_baselines::by_name("reactve", library, None, None).err().unwrap();
/// assert!(error.to_string().contains("did you mean `reactive`?"));
/// ```
pub fn by_name(
    name: &str,
    library: Arc<TemplateLibrary>,
    dir: Option<&Path>,
    perceive: Option<Perceive>,
) -> Result<Box<dyn Memory>, MethodError> {
    let acm = |library| match dir {
        Some(dir) => AcmMemory::open(dir, library),
        None => Ok(AcmMemory::in_memory(library)),
    };
    if let Some(keeping) = KEEPINGS.iter().find(|keeping| keeping.name == name) {
        return Ok(Box::new(Pruned::new(*keeping, library)));
    }
    Ok(match name {
        "acm" => Box::new(acm(library)?),
        "paper-identity" => Box::new(acm(library)?.with_identity(IdentityRule::Paper)),
        "full-history" => Box::new(FullHistory::new(library, perceive)),
        "shuffled" => Box::new(Shuffled::new(acm(Arc::clone(&library))?, library)),
        _ => return Err(unknown(name).into()),
    })
}

fn unknown(name: &str) -> UnknownMethod {
    let distance = |known: &&str| strsim::damerau_levenshtein(name, known);
    let nearest = METHODS.into_iter().min_by_key(distance).filter(|known| distance(known) <= 1 + name.len() / 3);
    let suggestion = nearest.map_or_else(String::new, |known| format!(", did you mean `{known}`?"));
    UnknownMethod { name: name.chars().take(40).collect(), suggestion }
}
