//! What a thing must be able to do to fill a gap in a goal.

use crate::task::functions_with_effect;
use acm_concept::template::TemplateLibrary;

/// Affordance of what can carry things.
pub(crate) const SUPPORTIVE: &str = "supportive";
/// Affordance of what things can be put into.
pub(crate) const CONTAINS: &str = "contains";
/// Affordance of what can stand over other things and hide them.
pub(crate) const COVERING: &str = "covering";

/// What a thing must be able to do to fill a gap in a goal.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Role {
    /// Be brought about by some function with this effect.
    Effect(String),
    /// Offer this function.
    Function(String),
    /// Have this affordance.
    Affordance(&'static str),
    /// Nothing in particular.
    Mentioned,
}

impl Role {
    /// Whether some template that carries the noun can play the role; a thing without noun may.
    pub(crate) fn fits(&self, library: &TemplateLibrary, noun: Option<&str>) -> bool {
        let Some(noun) = noun else { return true };
        if let Role::Effect(predicate) = self
            && functions_with_effect(library, predicate).is_empty()
        {
            // Nothing that is known does it: that is the planner's to say, and no reason to take the noun for another.
            return true;
        }
        library.with_noun(noun).any(|template| match self {
            Role::Effect(predicate) => template
                .functions
                .iter()
                .any(|f| f.effects.iter().any(|effect| effect.predicate == *predicate && !effect.negated)),
            Role::Function(name) => template.function(name).is_some(),
            Role::Affordance(affordance) => template.affordances().any(|known| *known == **affordance),
            Role::Mentioned => true,
        })
    }

    /// Why a thing of this noun cannot play the role; `None` if it can.
    pub(crate) fn misfit(&self, library: &TemplateLibrary, noun: Option<&str>) -> Option<String> {
        let (name, false) = (noun?, self.fits(library, noun)) else { return None };
        Some(match self {
            Role::Effect(effect) => match effect.as_str() {
                "holding" => format!("no kind of {name} that I know can be picked up"),
                "at" => format!("no kind of {name} that I know can be moved"),
                other => format!("no kind of {name} that I know can be made {other}"),
            },
            Role::Function(function) => format!("no kind of {name} that I know has the function {function}"),
            Role::Affordance(CONTAINS) => format!("no kind of {name} that I know can hold things inside"),
            Role::Affordance(_) => format!("no kind of {name} that I know can carry things"),
            Role::Mentioned => return None,
        })
    }
}
