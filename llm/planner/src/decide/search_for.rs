//! Where a thing is not seen, what may hide it is opened or taken away: each once, and not what is known to hide
//! something else.

use super::{Grounded, Mind};
use crate::{
    decision::Decision,
    ground::{Stuck, has_effect},
    search::{Want, believed, covered_by, is_cover, shuts},
    task::Subtask,
};
use acm_concept::{
    ids::ObjectId,
    literal::{Literal, Term, Truth},
};
use acm_memory::entry::{ObjectEntry, Presence};

impl Mind<'_> {
    /// The next step of a search for something that no look has shown. Where nothing is left that may hide it, says so.
    pub(super) fn search_for(&self, subtask: &Subtask, mut stuck: Stuck) -> Result<Decision, Stuck> {
        let untouched = self.ground.untouched();
        let mut searched: Vec<ObjectId> = Vec::new();
        for entry in self.view.objects() {
            if self.was_unveiled(entry) {
                searched.push(entry.id);
                continue;
            }
            let Some((want, literal)) = self.unveiled(entry) else { continue };
            if untouched.contains(&entry.id) || entry.presence != Presence::Present {
                continue;
            }
            let belief = believed(self.view, &literal);
            let goal = Grounded { wants: vec![want], literals: vec![(literal, belief)], times: 1, guessed: false };
            self.note(format!("{}: it may be in or under {}", stuck.unknown.text, entry.id));
            self.within_budget(subtask)?;
            if let Ok(decision) = self.act(subtask, &goal) {
                return Ok(decision);
            }
            self.notes.borrow_mut().pop();
        }
        if !searched.is_empty() {
            let names = searched.iter().map(ToString::to_string).collect::<Vec<_>>().join(", ");
            stuck.unknown.text += &format!("; I looked in or under {names}");
        }
        Err(stuck)
    }

    /// What must be brought about to see what a thing may hide; `None` for one that hides nothing, or nothing unknown.
    fn unveiled(&self, entry: &ObjectEntry) -> Option<(Want, Literal)> {
        let about = || vec![Term::Object(entry.id)];
        if is_cover(entry) {
            let known = !covered_by(self.view, entry.id).is_empty();
            return (!known).then(|| (Want::Away(entry.id), Literal::new("moved", about())));
        }
        let open = Literal::new("open", about());
        let shut =
            shuts(entry) && has_effect(self.view, entry, "open") && believed(self.view, &open).truth != Truth::Yes;
        shut.then(|| (Want::Holds(open.clone()), open))
    }

    /// Whether a thing was opened or lifted in this episode: what it hid was seen then.
    fn was_unveiled(&self, entry: &ObjectEntry) -> bool {
        if !is_cover(entry) && !shuts(entry) {
            return false;
        }
        let episode = self.view.progress().instructed.episode;
        let unveils = |literal: &Literal| {
            !literal.negated
                && matches!(literal.predicate.as_str(), "open" | "holding")
                && literal.subject() == Some(entry.id)
        };
        let own = self.view.transitions().iter().filter(|t| t.moment.episode == episode);
        own.into_iter().any(|t| super::tries::took_effect(t) && t.predicted.iter().any(unveils))
    }
}
