//! The order of questions before each step.

use crate::{
    decision::{Decision, GiveUpCause, PlanOptions, Situation, Unknown},
    lexicon::Lexicon,
    task::Task,
};
use acm_memory::MemoryView;

pub(crate) fn decide(
    _lexicon: &Lexicon,
    _task: &Task,
    _view: &dyn MemoryView,
    _situation: &Situation,
    _options: &PlanOptions,
) -> Decision {
    Decision::GiveUp {
        unknown: Unknown { cause: GiveUpCause::Plan, text: "the search is not part of this version".into() },
    }
}
