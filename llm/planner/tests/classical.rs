//! Plans over small households: what must come out, and that every plan can be followed.

#![allow(clippy::unwrap_used)] // a failed step is a failed test
#![allow(clippy::tests_outside_test_module)] // the whole file is tests

use acm_concept::literal::{Literal, Term};
use acm_planner::classical::{
    Call, Domain, Effort, Formula, NoPlan, Plan, Problem, Purpose, Tries, Violation, holds_at_first, plan, simulate,
};
use proptest::prelude::*;

/// Objects as `name: kind kind`, facts and the goal as formulas.
fn problem(objects: &[(&str, &str)], init: &[&str], goal: &str) -> Problem {
    let kinds = |kinds: &str| kinds.split_whitespace().map(str::to_string).collect();
    let objects = objects.iter().map(|(name, list)| (name.to_string(), kinds(list)));
    let fact = |text: &&str| match Formula::parse(text).unwrap() {
        Formula::Literal(literal) => literal,
        other => panic!("{other} is no fact"),
    };
    Problem::new(objects.collect(), init.iter().map(fact).collect(), Formula::parse(goal).unwrap())
}

const KITCHEN: &[(&str, &str)] = &[
    ("table", "supportive fixed"),
    ("shelf", "supportive fixed"),
    ("fridge", "container openable fixed"),
    ("box", "container openable movable"),
    ("tray", "supportive movable"),
    ("cup", "movable cup"),
    ("mug", "movable cup"),
    ("lamp", "toggleable fixed"),
];
const AT_FIRST: &[&str] =
    &["(hand-empty)", "(on cup tray)", "(on tray table)", "(inside mug box)", "(inside box fridge)"];

fn solve(problem: &Problem) -> Plan {
    let domain = Domain::manipulation().unwrap();
    let found = plan(&domain, problem, &Effort::default()).unwrap();
    simulate(&domain, problem, &found.calls()).unwrap();
    found
}

fn steps(plan: &Plan) -> Vec<String> {
    plan.steps.iter().map(|step| step.call.to_string()).collect()
}

#[test]
fn what_is_shut_in_twice_is_opened_twice() {
    let found = solve(&problem(KITCHEN, AT_FIRST, "(on mug table)"));
    assert_eq!(steps(&found), ["open(fridge)", "open(box)", "pick(mug)", "place-on(mug, table)"]);
    assert_eq!(found.steps[0].purpose.to_string(), "step 2 needs not shut-in(box)");
    assert!(matches!(&found.steps[3].purpose, Purpose::Goal(goal) if goal.to_string() == "on(mug, table)"));
    assert_eq!(found.steps[3].words, "put mug on table");
}

#[test]
fn what_is_open_is_not_opened_again() {
    let open: Vec<&str> = AT_FIRST.iter().copied().chain(["(open fridge)", "(open box)"]).collect();
    let found = solve(&problem(KITCHEN, &open, "(on mug table)"));
    assert_eq!(steps(&found), ["pick(mug)", "place-on(mug, table)"]);
}

#[test]
fn what_carries_something_is_cleared_first() {
    let found = solve(&problem(KITCHEN, AT_FIRST, "(and (on tray shelf) (on cup tray))"));
    assert_eq!(found.steps.len(), 6, "{found}");
    assert_eq!(steps(&found)[0], "pick(cup)");
    assert_eq!(steps(&found)[5], "place-on(cup, tray)");
}

#[test]
fn a_container_goes_with_what_is_in_it_and_never_into_itself() {
    let found = solve(&problem(KITCHEN, AT_FIRST, "(and (on box table) (inside mug box))"));
    assert_eq!(steps(&found), ["open(fridge)", "pick(box)", "place-on(box, table)"]);
    let domain = Domain::manipulation().unwrap();
    let within = problem(KITCHEN, AT_FIRST, "(and (within mug fridge) (not (inside mug box)) (not (open fridge)))");
    assert!(!holds_at_first(&domain, &within).unwrap());
    let found = solve(&within);
    assert_eq!(steps(&found).last().unwrap(), "close(fridge)");
    let itself = problem(KITCHEN, AT_FIRST, "(inside box mug)");
    assert!(matches!(plan(&domain, &itself, &Effort::default()), Err(NoPlan::Unreachable { .. })));
}

#[test]
fn quantified_goals_are_reached() {
    for (goal, number) in [
        ("(forall (?cup - cup) (on ?cup shelf))", 6),
        ("(exists (?cup - cup) (on ?cup shelf))", 2),
        ("(forn (1) (?cup - cup) (on ?cup tray))", 0),
        ("(forn (2) (?cup - cup) (on ?cup tray))", 4),
        ("(forn (0) (?cup - cup) (on ?cup tray))", 1),
        ("(forpairs (?cup - cup) (?place - fixed) (on ?cup ?place))", 6),
        ("(fornpairs (1) (?cup - cup) (?place - fixed) (on ?cup ?place))", 2),
        ("(imply (on cup tray) (turned-on lamp))", 1),
        ("(or (on mug table) (next-to cup mug) (turned-on lamp))", 1),
        ("(not (exists (?cup - cup) (within ?cup fridge)))", 2),
    ] {
        let found = solve(&problem(KITCHEN, AT_FIRST, goal));
        assert_eq!(found.steps.len(), number, "{goal}:\n{found}");
    }
}

#[test]
fn what_failed_before_is_done_in_another_way() {
    let goal = "(exists (?place - fixed) (and (supportive ?place) (on mug ?place)))";
    let open: Vec<&str> = AT_FIRST.iter().copied().chain(["(open fridge)", "(open box)"]).collect();
    let mut question = problem(KITCHEN, &open, "(or (turned-on lamp) (on cup shelf))");
    assert_eq!(steps(&solve(&question)), ["turn-on(lamp)"]);
    let tried = |tries, successes| Tries { tries, successes };
    question.experience.insert(("turn-on".into(), "lamp".into()), tried(12, 0));
    question.experience.insert(("pick".into(), "cup".into()), tried(12, 12));
    question.experience.insert(("place-on".into(), "cup".into()), tried(12, 12));
    assert_eq!(steps(&solve(&question)), ["pick(cup)", "place-on(cup, shelf)"]);
    assert_eq!(solve(&problem(KITCHEN, &open, goal)).steps.len(), 2);
}

#[test]
fn a_violated_plan_is_told_by_its_first_fault() {
    let domain = Domain::manipulation().unwrap();
    let question = problem(KITCHEN, AT_FIRST, "(on mug table)");
    let call = |operator: &str, arguments: &[&str]| Call {
        operator: operator.into(),
        arguments: arguments.iter().map(|name| name.to_string()).collect(),
    };
    let fault = |calls: &[Call]| simulate(&domain, &question, calls).unwrap_err().to_string();
    assert_eq!(fault(&[call("pick", &["mug"])]), "step 1, pick(mug), needs not shut-in(mug)");
    assert_eq!(fault(&[call("pick", &["tray"])]), "step 1, pick(tray), needs not on(cup, tray)");
    let second = [call("pick", &["cup"]), call("open", &["fridge"])];
    assert_eq!(fault(&second), "step 2, open(fridge), needs hand-empty()");
    assert_eq!(fault(&[call("pick", &["fridge"])]), "step 1, pick(fridge): fridge is not movable");
    assert_eq!(fault(&[call("pick", &["jug"])]), "step 1, pick(jug): there is no object `jug`");
    assert!(fault(&[call("wash", &["cup"])]).starts_with("step 1, wash(cup): there is no operator `wash`, only pick"));
    assert_eq!(fault(&[call("pick", &["cup"])]), "after all 1 steps the goal still lacks on(mug, table)");
    assert!(matches!(simulate(&domain, &question, &[]), Err(Violation::Goal { steps: 0, .. })));
}

#[test]
fn limits_end_a_search_and_broken_problems_are_told() {
    let domain = Domain::manipulation().unwrap();
    let question = problem(KITCHEN, AT_FIRST, "(forall (?cup - cup) (on ?cup shelf))");
    let short = Effort { states: 2, ..Effort::default() };
    assert!(matches!(plan(&domain, &question, &short), Err(NoPlan::GivenUp { .. })));
    let late = Effort { expired: &|| true, ..Effort::default() };
    assert!(matches!(plan(&domain, &question, &late), Err(NoPlan::GivenUp { .. })));
    let error = |init: &[&str], goal: &str| {
        plan(&domain, &problem(KITCHEN, init, goal), &Effort::default()).unwrap_err().to_string()
    };
    assert!(error(&[], "(on jug table)").contains("names `jug`"));
    assert!(error(&[], "(on ?x table)").contains("?x in on(?x, table)"));
    assert!(error(&["(on cup)"], "(on cup table)").contains("1 arguments; 2 are expected"));
    assert!(error(&["(shut-in cup)"], "(on cup table)").contains("derived"));
}

/// A household drawn at random: where each thing is, which of the containers are open, and what is wanted.
fn households() -> impl Strategy<Value = Problem> {
    let place = (0..7_usize, any::<bool>());
    (
        proptest::collection::vec(place, 5),
        proptest::collection::vec((0..5_usize, 0..9_usize, any::<bool>()), 1..4),
        any::<[bool; 2]>(),
    )
        .prop_map(|(places, wanted, open)| {
            let kinds = |list: &str| list.split_whitespace().map(str::to_string).collect();
            let things = ["cup", "mug", "tray", "box", "bag"];
            let all = ["table", "shelf", "fridge", "tray", "box", "bag", "cup", "mug", "lamp"];
            let objects = [
                ("table", "supportive fixed"),
                ("shelf", "supportive fixed"),
                ("fridge", "container openable fixed supportive"),
                ("box", "container openable movable supportive"),
                ("bag", "container movable"),
                ("tray", "supportive movable"),
                ("cup", "movable"),
                ("mug", "movable"),
                ("lamp", "toggleable fixed"),
            ];
            let two = |predicate: &str, a: &str, b: &str| {
                Literal::new(predicate, vec![Term::Symbol(a.into()), Term::Symbol(b.into())])
            };
            let mut init = vec![Literal::new("hand-empty", Vec::new())];
            for (number, (place, inside)) in places.iter().enumerate() {
                // Later things may be on or in earlier ones, so that nothing is in itself.
                let possible: Vec<&str> =
                    ["table", "shelf", "fridge"].into_iter().chain(things[..number].iter().copied()).collect();
                let support = possible[place % possible.len()];
                let container = ["fridge", "box", "bag"].contains(&support);
                let predicate = if container && *inside { "inside" } else { "on" };
                init.push(two(
                    predicate,
                    things[number],
                    if predicate == "on" && support == "bag" { "table" } else { support },
                ));
            }
            let opened = ["fridge", "box"].into_iter().zip(open).filter(|(_, open)| *open);
            init.extend(opened.map(|(name, _)| Literal::new("open", vec![Term::Symbol(name.into())])));
            let wanted = wanted.iter().map(|(thing, other, inside)| {
                let predicate = if *inside { "within" } else { "on" };
                Formula::Literal(two(predicate, things[*thing], all[*other]))
            });
            let objects = objects.map(|(name, list)| (name.to_string(), kinds(list)));
            Problem::new(objects.into(), init, Formula::All(wanted.collect()))
        })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 96, failure_persistence: None, ..ProptestConfig::default() })]
    #[test]
    fn every_plan_can_be_followed_needs_all_its_steps_and_is_found_again(question in households()) {
        let domain = Domain::manipulation().unwrap();
        let effort = Effort { states: 4000, ..Effort::default() };
        let first = plan(&domain, &question, &effort);
        prop_assert_eq!(format!("{:?}", first), format!("{:?}", plan(&domain, &question, &effort)));
        if let Ok(found) = first {
            let calls = found.calls();
            prop_assert!(simulate(&domain, &question, &calls).is_ok(), "{}", found);
            prop_assert_eq!(calls.is_empty(), holds_at_first(&domain, &question).unwrap());
            for left_out in 0..calls.len() {
                let rest: Vec<Call> = calls.iter().enumerate().filter(|(at, _)| *at != left_out).map(|(_, call)| call.clone()).collect();
                prop_assert!(simulate(&domain, &question, &rest).is_err(), "step {} is not needed:\n{}", left_out + 1, found);
            }
        }
    }
}
