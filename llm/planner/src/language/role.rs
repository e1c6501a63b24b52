//! What a thing must be able to do to fill a gap in a goal.

use acm_concept::template::TemplateLibrary;

/// Affordance of what can carry things.
pub(crate) const SUPPORTIVE: &str = "supportive";

/// What a thing must be able to do to fill a gap in a goal.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Role {
    /// Be brought about by some function with this effect.
    Effect(&'static str),
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
            Role::Effect("holding") => format!("no kind of {name} that I know can be picked up"),
            Role::Effect(_) => format!("no kind of {name} that I know can be moved"),
            Role::Function(function) => format!("no kind of {name} that I know has the function {function}"),
            Role::Affordance(_) => format!("no kind of {name} that I know can carry things"),
            Role::Mentioned => return None,
        })
    }
}
