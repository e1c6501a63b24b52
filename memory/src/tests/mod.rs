//! Tests of the whole memory through its trait, over hand-made percepts.
#![allow(clippy::unwrap_used, clippy::expect_used)] // a failed step is a failed test

mod constellation;
mod doors;
mod durability;
mod episodes;
mod identity;
mod joints;
mod places;
mod regroup;
mod retrieval;
mod staplers;
mod story;
mod updates;

use crate::{AcmMemory, Memory, default_library, entry::ObjectEntry, staging};
use acm_concept::{
    ids::ObjectId,
    literal::{Literal, Truth},
};
use std::sync::{Arc, LazyLock};

static LIBRARY: LazyLock<Arc<acm_concept::template::TemplateLibrary>> =
    LazyLock::new(|| Arc::new(default_library().unwrap()));

const RED: [u8; 3] = [200, 30, 30];
const BLUE: [u8; 3] = [30, 60, 200];

fn memory() -> AcmMemory {
    let mut memory = AcmMemory::in_memory(Arc::clone(&LIBRARY));
    staging::begin(&mut memory).unwrap();
    memory
}

fn truth(memory: &dyn Memory, literal: &str) -> Truth {
    memory.view().belief(&Literal::parse(literal).unwrap()).truth
}

fn object(memory: &dyn Memory, id: ObjectId) -> ObjectEntry {
    memory.view().object(id).unwrap_or_else(|| panic!("{id} is not remembered")).clone()
}
