//! What can be done and what follows from what: operator schemata and derived predicates, read from data.

use super::{
    formula::{Formula, Variable},
    sexpr::{Expression, ExpressionError},
};
use acm_concept::literal::{Literal, Term};
use serde::Deserialize;
use std::collections::{BTreeMap, BTreeSet};
use thiserror::Error;

/// The operators that ship inside the binary.
const MANIPULATION: &str = include_str!("../../operators/manipulation.toml");
/// Largest file of operators, bytes.
const MAX_BYTES: usize = 256 * 1024;
/// Most arguments of a predicate.
pub const MAX_ARITY: usize = 3;

/// What can be done, and what follows from what holds.
#[derive(Debug, Clone, PartialEq)]
pub struct Domain {
    /// The operator schemata.
    pub operators: Vec<Operator>,
    /// The derived predicates.
    pub derived: Vec<Derived>,
}

/// An action with parameters.
#[derive(Debug, Clone, PartialEq)]
pub struct Operator {
    /// Name, in kebab case.
    pub name: String,
    /// The step in a sentence, with the parameters' names in braces.
    pub words: String,
    /// Different parameters stand for different objects.
    pub parameters: Vec<Variable>,
    /// What must hold.
    pub precondition: Formula,
    /// What holds afterwards; everything else stays. Where two effects disagree, what becomes true wins.
    pub effects: Vec<Effect>,
}

/// A literal that an operator makes true, for every object that the variables run over.
#[derive(Debug, Clone, PartialEq)]
pub struct Effect {
    /// The universally quantified variables.
    pub variables: Vec<Variable>,
    /// What becomes so.
    pub literal: Literal,
}

/// A predicate that is not changed by operators but follows from others.
#[derive(Debug, Clone, PartialEq)]
pub struct Derived {
    /// Name, in kebab case.
    pub name: String,
    /// Its arguments.
    pub parameters: Vec<Variable>,
    /// It holds exactly where this does; derived predicates stand in it without negation.
    pub when: Formula,
}

/// Operators that cannot be used.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum DomainError {
    /// More text than is read.
    #[error("the operators take {bytes} bytes; at most {MAX_BYTES} are read")]
    TooLong {
        /// Their length.
        bytes: usize,
    },
    /// The text is no table of operators.
    #[error("the operators cannot be understood: {0}")]
    Toml(String),
    /// A formula cannot be read.
    #[error("{field} of `{name}`: {error}")]
    Formula {
        /// Operator or derived predicate.
        name: String,
        /// The field it stands in.
        field: &'static str,
        /// What is wrong with it.
        error: ExpressionError,
    },
    /// An operator contradicts itself or another.
    #[error("`{name}`: {problem}")]
    Meaning {
        /// Operator or derived predicate.
        name: String,
        /// What is wrong with it.
        problem: String,
    },
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawDomain {
    #[serde(default)]
    operator: Vec<RawOperator>,
    #[serde(default)]
    derived: Vec<RawDerived>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawOperator {
    name: String,
    words: String,
    parameters: Vec<String>,
    precondition: String,
    effect: String,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawDerived {
    name: String,
    parameters: Vec<String>,
    when: String,
}

impl Domain {
    /// Taking, placing, opening and switching with one hand.
    ///
    /// # Errors
    /// None, unless the file that ships inside the binary is broken.
    pub fn manipulation() -> Result<Domain, DomainError> {
        Domain::parse(MANIPULATION)
    }
    /// Reads the text of a file such as `llm/planner/operators/manipulation.toml`.
    ///
    /// # Errors
    /// The text cannot be read, a variable is bound by nothing, a predicate is used with different numbers of arguments,
    /// or a derived one is an effect or stands negated in the rule of another.
    pub fn parse(text: &str) -> Result<Domain, DomainError> {
        if text.len() > MAX_BYTES {
            return Err(DomainError::TooLong { bytes: text.len() });
        }
        let raw: RawDomain = toml::from_str(text).map_err(|error| DomainError::Toml(error.to_string()))?;
        let operators = raw.operator.into_iter().map(read_operator).collect::<Result<_, _>>()?;
        let derived = raw.derived.into_iter().map(read_derived).collect::<Result<_, _>>()?;
        let domain = Domain { operators, derived };
        domain.check()?;
        Ok(domain)
    }
    /// The operator of a name.
    pub fn operator(&self, name: &str) -> Option<&Operator> {
        self.operators.iter().find(|operator| operator.name == name)
    }

    fn check(&self) -> Result<(), DomainError> {
        let mut arities = BTreeMap::new();
        let mut names = BTreeSet::new();
        let derived: BTreeSet<&str> = self.derived.iter().map(|derived| derived.name.as_str()).collect();
        for operator in &self.operators {
            let check = Check { name: &operator.name, parameters: &operator.parameters };
            if !names.insert(&operator.name) {
                return Err(check.error("stands there twice"));
            }
            check.formula(&operator.precondition, &mut Vec::new(), &mut arities)?;
            for effect in &operator.effects {
                if derived.contains(effect.literal.predicate.as_str()) {
                    return Err(check.error(format!("{} is derived and cannot be an effect", effect.literal)));
                }
                check.literal(&effect.literal, &mut effect.variables.iter().collect(), &mut arities)?;
            }
        }
        for rule in &self.derived {
            let check = Check { name: &rule.name, parameters: &rule.parameters };
            if !names.insert(&rule.name) {
                return Err(check.error("stands there twice"));
            }
            let head = rule.parameters.iter().map(|parameter| Term::Variable(parameter.name.clone())).collect();
            check.literal(&Literal::new(&rule.name, head), &mut Vec::new(), &mut arities)?;
            check.formula(&rule.when, &mut Vec::new(), &mut arities)?;
            if let Some(name) = negated_among(&rule.when, &derived, false) {
                return Err(check.error(format!("the derived `{name}` must not be negated in a rule")));
            }
        }
        Ok(())
    }
}

/// What is checked of an operator or a rule.
struct Check<'d> {
    name: &'d str,
    parameters: &'d [Variable],
}

impl<'d> Check<'d> {
    fn error(&self, problem: impl Into<String>) -> DomainError {
        DomainError::Meaning { name: self.name.into(), problem: problem.into() }
    }
    fn formula(
        &self,
        formula: &'d Formula,
        bound: &mut Vec<&'d Variable>,
        arities: &mut BTreeMap<String, usize>,
    ) -> Result<(), DomainError> {
        let depth = bound.len();
        let (variables, bodies): (Vec<&Variable>, Vec<&Formula>) = match formula {
            Formula::Literal(literal) => return self.literal(literal, bound, arities),
            Formula::All(list) | Formula::Any(list) => (Vec::new(), list.iter().collect()),
            Formula::Not(body) => (Vec::new(), vec![body]),
            Formula::Implies(both) => (Vec::new(), vec![&both.0, &both.1]),
            Formula::ForAll(variable, body) | Formula::Exists(variable, body) | Formula::Exactly(_, variable, body) => {
                (vec![variable], vec![body])
            }
            Formula::Pairs(_, first, second, body) => (vec![first, second], vec![body]),
        };
        bound.extend(variables);
        for body in bodies {
            self.formula(body, bound, arities)?;
        }
        bound.truncate(depth);
        Ok(())
    }
    fn literal(
        &self,
        literal: &Literal,
        bound: &mut Vec<&'d Variable>,
        arities: &mut BTreeMap<String, usize>,
    ) -> Result<(), DomainError> {
        let known = |name: &str| {
            self.parameters.iter().any(|variable| variable.name == name) || bound.iter().any(|v| v.name == name)
        };
        let unbound = literal.arguments.iter().find_map(|term| match term {
            Term::Variable(name) if !known(name) => Some(name),
            _ => None,
        });
        if let Some(name) = unbound {
            return Err(self.error(format!("?{name} in {literal} is no parameter and nothing quantifies it")));
        }
        let arity = literal.arguments.len();
        if arity > MAX_ARITY {
            return Err(self.error(format!("{literal} has more than {MAX_ARITY} arguments")));
        }
        let first = *arities.entry(literal.predicate.clone()).or_insert(arity);
        if first != arity {
            return Err(
                self.error(format!("{literal} has {arity} arguments, elsewhere `{}` has {first}", literal.predicate))
            );
        }
        Ok(())
    }
}

/// The first of the predicates that stands under an odd number of negations.
fn negated_among<'f>(formula: &'f Formula, names: &BTreeSet<&str>, negated: bool) -> Option<&'f str> {
    let each = |list: &'f [Formula]| list.iter().find_map(|item| negated_among(item, names, negated));
    match formula {
        Formula::Literal(literal) => {
            (literal.negated != negated && names.contains(literal.predicate.as_str())).then_some(&literal.predicate)
        }
        Formula::All(list) | Formula::Any(list) => each(list),
        Formula::Not(body) => negated_among(body, names, !negated),
        Formula::Implies(both) => {
            negated_among(&both.0, names, !negated).or_else(|| negated_among(&both.1, names, negated))
        }
        Formula::ForAll(_, body) | Formula::Exists(_, body) | Formula::Pairs(_, _, _, body) => {
            negated_among(body, names, negated)
        }
        // An exact count asks for some and against the others.
        Formula::Exactly(_, _, body) => {
            negated_among(body, names, negated).or_else(|| negated_among(body, names, !negated))
        }
    }
}

fn read_operator(raw: RawOperator) -> Result<Operator, DomainError> {
    let name = raw.name;
    let effect = read_formula(&name, "effect", &raw.effect)?;
    let mut effects = Vec::new();
    collect_effects(&effect, &mut Vec::new(), &mut effects)
        .map_err(|problem| DomainError::Meaning { name: name.clone(), problem })?;
    Ok(Operator {
        parameters: read_parameters(&name, &raw.parameters)?,
        precondition: read_formula(&name, "precondition", &raw.precondition)?,
        words: raw.words,
        effects,
        name,
    })
}

fn read_derived(raw: RawDerived) -> Result<Derived, DomainError> {
    let parameters = read_parameters(&raw.name, &raw.parameters)?;
    Ok(Derived { parameters, when: read_formula(&raw.name, "when", &raw.when)?, name: raw.name })
}

fn read_formula(name: &str, field: &'static str, text: &str) -> Result<Formula, DomainError> {
    Formula::parse(text).map_err(|error| DomainError::Formula { name: name.into(), field, error })
}

fn read_parameters(name: &str, texts: &[String]) -> Result<Vec<Variable>, DomainError> {
    let read = |text: &String| {
        let error = |error| DomainError::Formula { name: name.into(), field: "parameters", error };
        let list = Expression::parse(&format!("({text})")).map_err(error)?;
        Variable::read(list.first().ok_or(error(ExpressionError::Empty))?).map_err(error)
    };
    texts.iter().map(read).collect()
}

fn collect_effects(formula: &Formula, outer: &mut Vec<Variable>, effects: &mut Vec<Effect>) -> Result<(), String> {
    match formula {
        Formula::Literal(literal) => effects.push(Effect { variables: outer.clone(), literal: literal.clone() }),
        Formula::Not(body) => match body.as_ref() {
            Formula::Literal(literal) => {
                effects.push(Effect { variables: outer.clone(), literal: literal.clone().negate() });
            }
            other => return Err(format!("only a literal can be negated in an effect, not {other}")),
        },
        Formula::All(list) => list.iter().try_for_each(|item| collect_effects(item, outer, effects))?,
        Formula::ForAll(variable, body) => {
            outer.push(variable.clone());
            collect_effects(body, outer, effects)?;
            outer.pop();
        }
        other => return Err(format!("an effect is made of literals, `and` and `forall`, not {other}")),
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)] // a failed step is a failed test
    use super::*;

    #[test]
    fn the_operators_that_ship_can_be_read() {
        let domain = Domain::manipulation().unwrap();
        let pick = domain.operator("pick").unwrap();
        assert_eq!((pick.parameters.len(), pick.effects.len()), (1, 8));
        assert!(pick.effects.iter().any(|effect| effect.variables.len() == 1 && effect.literal.negated));
    }

    #[test]
    fn what_cannot_be_meant_is_said() {
        let operator = |precondition: &str, effect: &str| {
            format!(
                "[[operator]]\nname = 'push'\nwords = 'push'\nparameters = ['?self - thing']\nprecondition = '{precondition}'\n\
                 effect = '{effect}'\n[[derived]]\nname = 'far'\nparameters = ['?a - thing']\nwhen = '(gone ?a)'\n"
            )
        };
        for (text, words) in [
            (operator("(and)", "(moved ?other)"), "?other in moved(?other) is no parameter"),
            (operator("(near ?self)", "(near ?self ?self)"), "elsewhere `near` has 1"),
            (operator("(and)", "(far ?self)"), "is derived and cannot be an effect"),
            (operator("(and)", "(or (moved ?self))"), "an effect is made of literals"),
            (operator("(not)", "(moved ?self)"), "precondition of `push`: line 1: `not` has 0 arguments"),
            (
                operator("(and)", "(moved ?self)").replace("(gone ?a)", "(not (far ?a))"),
                "must not be negated in a rule",
            ),
            ("[[operator]]\nnam = 'x'".into(), "cannot be understood"),
        ] {
            let error = Domain::parse(&text).unwrap_err().to_string();
            assert!(error.contains(words), "{error}");
        }
    }
}
