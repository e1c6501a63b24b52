//! Fifty doors are opened, or not; what they have in common carries over to doors that were never touched.

use super::*;
use crate::{
    entry::SkillEntry,
    library_of,
    observation::{Executed, Note, Outcome},
    query::SkillCandidate,
    staging::{Thing, look, open_hand, report, verify},
};
use acm_concept::{
    ids::TransitionId,
    literal::Term,
    object::{Observability, ParameterEstimate, Visibility},
    skill::FailureCause,
    template::TemplateLibrary,
    time::Time,
};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::collections::BTreeMap;

static DOORS: LazyLock<Arc<TemplateLibrary>> = LazyLock::new(|| Arc::new(library_of(&["core", "parts"]).unwrap()));

/// A door as it is: what a camera sees of it, and what only trying tells.
#[derive(Debug, Clone)]
struct Door {
    geometry: BTreeMap<&'static str, f64>,
    is_latched: bool,
    slips: bool,
    is_warm: bool,
    /// Whether the hand that pushes its handle can tell if the latch gives.
    latch_is_felt: bool,
}

impl Door {
    fn draw(rng: &mut ChaCha8Rng) -> Door {
        let ranges = [
            ("width", 0.4..1.0),
            ("height", 0.5..2.0),
            ("thickness", 0.02..0.06),
            ("handle_inset", 0.03..0.1),
            ("handle_length", 0.08..0.3),
            ("handle_width", 0.01..0.028),
            ("handle_stand_off", 0.03..0.06),
        ];
        let mut geometry: BTreeMap<_, _> =
            ranges.into_iter().map(|(name, range)| (name, rng.random_range(range))).collect();
        geometry.insert("opening", 0.0);
        Door {
            geometry,
            is_latched: rng.random_bool(0.3),
            slips: rng.random_bool(0.08),
            is_warm: rng.random_bool(0.5),
            latch_is_felt: rng.random_bool(0.95),
        }
    }
    /// From the hinge to the handle, metres.
    fn radius(&self) -> f64 {
        self.geometry["width"] - self.geometry["handle_inset"]
    }
    fn thing(&self) -> Thing {
        let mut thing = Thing::block([0.05, self.geometry["width"], self.geometry["height"]]);
        let estimate = |(name, value): (&&str, &f64)| ParameterEstimate {
            name: (*name).into(),
            value: *value,
            sigma: 0.003,
            observability: Observability::Observed,
        };
        thing.nouns = vec![("door".into(), 1.0)];
        (thing.part.template, thing.part.name) = ("door-left".into(), "leaf".into());
        thing.part.parameters = self.geometry.iter().map(estimate).collect();
        thing.part.affordances = vec!["openable".into(), "closable".into()];
        thing.part.functions = vec!["open".into(), "close".into()];
        thing
    }
}

fn says(predicate: &str, object: ObjectId, holds: bool) -> Literal {
    let literal = Literal::new(predicate, vec![Term::Object(object)]);
    if holds { literal } else { literal.negate() }
}

fn begin(memory: &mut AcmMemory) {
    memory.note(&Note::EpisodeBegan).unwrap();
    memory.note(&Note::Instructed { time: Time::ZERO, text: "open the door".into() }).unwrap();
}

/// All doors of a corridor are seen, twice. They are then the objects 1, 2, and so on.
fn walk_past(memory: &mut AcmMemory, doors: &[Door]) {
    begin(memory);
    let things: Vec<Thing> =
        (0u32..).zip(doors).map(|(n, door)| door.thing().at(2.0 * f64::from(n), 0.0, 0.0)).collect();
    for view in 0..2u8 {
        let seen = look(memory, view.into(), view.into(), &things, &[], &open_hand(view.into())).unwrap();
        let ids = seen.resolved.iter().map(|resolved| resolved.object.0);
        assert!(ids.eq(1..=doors.len() as u64), "every door is an object of its own");
    }
}

/// A run before a door: a look, then the hand feels its handle.
fn meet(memory: &mut AcmMemory, number: u32, door: &Door) -> ObjectId {
    begin(memory);
    let id = ObjectId(u64::from(number) + 1);
    let others = memory.view().objects().iter().map(|entry| entry.id).filter(|other| *other != id).collect::<Vec<_>>();
    let others: Vec<_> = others.into_iter().map(|other| (other, Visibility::OutOfView, 0.0)).collect();
    let thing = door.thing().at(2.0 * f64::from(number), 0.0, 0.0);
    let seen = look(memory, 10 + u64::from(number), 1.0, &[thing], &others, &open_hand(1.0)).unwrap();
    assert_eq!(seen.resolved[0].object, id);
    let mut touched = report(&*memory.view(), "close", id, 4.0).unwrap();
    touched.report.invocation.skill = "unlatch".into();
    touched.report.invocation.kind = "press-down".into();
    touched = touched.feeling(says("warm", id, door.is_warm)).feeling(Literal::new("hand-empty", Vec::new()));
    if door.latch_is_felt {
        touched = touched.feeling(says("latched", id, door.is_latched));
    }
    memory.record(&touched).unwrap();
    id
}

fn opening(memory: &AcmMemory, id: ObjectId) -> SkillCandidate {
    let all = memory.view().skill_candidates(id, None);
    all.into_iter().find(|candidate| candidate.skill == "open").unwrap()
}

/// Pulls the handle; the world decides.
fn open(memory: &mut AcmMemory, id: ObjectId, door: &Door, rng: &mut ChaCha8Rng) -> (TransitionId, bool) {
    let mut executed: Executed = report(&*memory.view(), "open", id, 8.0).unwrap().predicting(&opening(memory, id));
    executed.report.invocation.arguments = BTreeMap::from([("grip_width".into(), door.geometry["handle_width"])]);
    if door.slips {
        executed = executed.failing(FailureCause::Grasp, "the handle slipped out of the fingers");
    } else if door.is_latched {
        executed = executed.failing(FailureCause::Motion, "the door did not follow");
    } else {
        let noise = (0..4).map(|_| rng.random_range(-0.002..0.002)).sum::<f64>() / 2.0;
        executed.report.measured.insert("hinge_radius_m".into(), door.radius() + noise);
        executed.report.measured.insert("swing_rad".into(), 1.2 + rng.random_range(-0.05..0.05));
        executed = executed.feeling(says("open", id, true)).feeling(Literal::new("hand-empty", Vec::new()));
    }
    let transition = memory.record(&executed).unwrap();
    let went_well = verify(memory, transition).unwrap() == Outcome::Verified;
    assert_eq!(went_well, !door.slips && !door.is_latched);
    if went_well {
        memory.note(&Note::SubtaskDone { time: Time::from_seconds(9.0), index: 0 }).unwrap();
    }
    (transition, went_well)
}

fn skill(memory: &AcmMemory) -> SkillEntry {
    memory.view().skills().iter().find(|entry| entry.skill == "open").unwrap().clone()
}

/// Fifty drawn doors, the last of which opens, and behind them three that nobody touches.
fn corridor(seed: u64) -> (Vec<Door>, ChaCha8Rng) {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut doors: Vec<Door> = (0..53).map(|_| Door::draw(&mut rng)).collect();
    (doors[49].is_latched, doors[49].slips) = (false, false);
    for (door, latched) in doors[50..].iter_mut().zip([Some(true), Some(false), None]) {
        (door.latch_is_felt, door.is_latched) = (latched.is_some(), latched.unwrap_or_default());
    }
    (doors, rng)
}

fn try_all(memory: &mut AcmMemory, doors: &[Door], rng: &mut ChaCha8Rng) -> Vec<(Door, TransitionId, bool)> {
    let one = |(number, door): (u32, &Door)| {
        let id = meet(memory, number, door);
        let (transition, went_well) = open(memory, id, door, rng);
        (door.clone(), transition, went_well)
    };
    (0..).zip(doors).map(one).collect()
}

#[test]
fn fifty_door_openings_become_one_skill_that_carries_over() {
    for seed in 0..5 {
        let mut memory = AcmMemory::in_memory(Arc::clone(&DOORS));
        let (doors, mut rng) = corridor(seed);
        walk_past(&mut memory, &doors);
        let done = try_all(&mut memory, &doors[..50], &mut rng);
        let entry = skill(&memory);
        let opened = done.iter().filter(|(.., went_well)| *went_well).count();
        assert_eq!((entry.tries, entry.successes as usize), (50, opened));
        let ids = |good: bool| -> Vec<TransitionId> { done.iter().filter(|d| d.2 == good).map(|d| d.1).collect() };
        assert_eq!((&entry.transitions, &entry.failures), (&ids(true), &ids(false)));
        let general = entry.general.clone().unwrap();

        // Of what was believed before (latched, warm, hand-empty, clear, open) one literal tells.
        let felt_latched = done.iter().filter(|(d, ..)| d.is_latched && d.latch_is_felt).count();
        let slipped = done.iter().filter(|(d, ..)| d.slips && !d.is_latched && d.latch_is_felt).count();
        let learned = &general.learned;
        assert_eq!(learned.len(), 1, "seed {seed}: {learned:?}");
        assert_eq!(learned[0].literal.to_string(), "not latched(?self)");
        assert_eq!((learned[0].failures_without as usize, learned[0].failures_with as usize), (felt_latched, slipped));
        assert_eq!(general.sound.0 as usize, 50 - felt_latched);

        // The schema says on what it was done.
        assert_eq!(general.target.categories, ["door"]);
        assert_eq!(general.target.affordances, ["closable", "openable"]);
        let widths = done.iter().filter(|d| d.2).map(|(d, ..)| d.geometry["width"]);
        let (low, high) = widths.fold((f64::MAX, 0.0f64), |(low, high), w| (low.min(w), high.max(w)));
        let found = general.target.parameters.iter().find(|(name, ..)| name == "width").unwrap();
        // Noiseless views: the fused value is what was shown.
        assert!((found.1 - low).abs() < 1e-9 && (found.2 - high).abs() < 1e-9, "{found:?}, not {low} to {high}");

        // Phi: the radius follows from two sizes, the grip from one, the swing from none.
        let names: Vec<&str> = general.laws.iter().map(|law| law.name.as_str()).collect();
        assert_eq!(names, ["grip_width", "hinge_radius_m"], "seed {seed}");
        let mut rng = ChaCha8Rng::seed_from_u64(1000 + seed);
        let mean = entry.parameters.iter().find(|(name, _)| name == "hinge_radius_m").unwrap().1;
        let (mut worst, mut by_mean) = (0.0f64, 0.0);
        for _ in 0..50 {
            let door = Door::draw(&mut rng);
            let (radius, residual) = entry.bound("hinge_radius_m", &|name| door.geometry.get(name).copied()).unwrap();
            worst = worst.max((radius - door.radius()).abs());
            assert!(residual.unwrap() < 0.002);
            by_mean += (mean - door.radius()).abs() / 50.0;
        }
        assert!(worst < 0.004 && by_mean > 0.1, "seed {seed}: {worst} m by the law, {by_mean} m by the mean");

        // Doors that were never opened: what is felt of them counts.
        let chances = [50, 51, 52].map(|number| {
            let id = meet(&mut memory, number, &doors[number as usize]);
            let candidate = opening(&memory, id);
            assert_eq!(memory.view().predict(&candidate).success, candidate.success);
            candidate.success
        });
        let [latched, free, unknown] = chances;
        assert!(latched < 0.15 && free > 0.75 && latched < unknown && unknown < free, "seed {seed}: {chances:?}");
    }
}

#[test]
fn what_goes_with_failure_by_accident_is_no_condition() {
    // Nothing but slipping makes a door fail, and nothing foretells it.
    let mut wrong = 0;
    for seed in 0..10 {
        let mut memory = AcmMemory::in_memory(Arc::clone(&DOORS));
        let (mut doors, mut rng) = corridor(50 + seed);
        doors.truncate(30);
        for door in &mut doors {
            (door.is_latched, door.slips) = (false, rng.random_bool(0.3));
        }
        doors[29].slips = false;
        walk_past(&mut memory, &doors);
        try_all(&mut memory, &doors, &mut rng);
        wrong += skill(&memory).general.unwrap().learned.len();
    }
    assert_eq!(wrong, 0);
}

#[test]
fn a_consolidation_can_be_undone_and_done_again() {
    let folder = tempfile::tempdir().unwrap();
    let mut memory = AcmMemory::open(folder.path(), Arc::clone(&DOORS)).unwrap();
    let (mut doors, mut rng) = corridor(3);
    doors.truncate(12);
    walk_past(&mut memory, &doors);
    let (mut before, mut last) = (Vec::new(), Vec::new());
    for (number, door) in (0..).zip(&mut doors) {
        (door.is_latched, door.slips) = (number % 4 == 3, false);
        before = memory.view().skills().to_vec();
        let id = meet(&mut memory, number, door);
        let (first, went_well) = open(&mut memory, id, door, &mut rng);
        last = vec![first];
        if number == 11 {
            // The same run tries again once the latch gives.
            assert!(!went_well);
            door.is_latched = false;
            last.push(open(&mut memory, id, door, &mut rng).0);
        }
    }
    let (after, id) = (memory.view().skills().to_vec(), skill(&memory).id);
    assert_eq!(memory.undo_consolidation(id).unwrap(), last);
    assert_eq!(memory.view().skills(), before);
    assert!(last.iter().all(|id| memory.view().transitions().iter().any(|t| t.id == *id)));
    memory.take_back(&last, true).unwrap();
    assert_eq!(memory.view().skills(), after);
    // All the way back: a skill that came with its executions goes with them.
    let all: Vec<TransitionId> = memory.view().transitions().iter().map(|t| t.id).collect();
    memory.take_back(&all, false).unwrap();
    assert!(memory.view().skills().is_empty());
    assert!(memory.undo_consolidation(id).is_err() && memory.take_back(&[TransitionId(999)], false).is_err());
    drop(memory);
    let mut memory = AcmMemory::open(folder.path(), Arc::clone(&DOORS)).unwrap();
    assert!(memory.view().skills().is_empty());
    memory.take_back(&all, true).unwrap();
    let again: Vec<SkillEntry> = memory.view().skills().to_vec();
    assert!(again.len() == after.len() && again[0].id > after[0].id);
    assert_eq!(
        again.iter().map(|e| &e.general).collect::<Vec<_>>(),
        after.iter().map(|e| &e.general).collect::<Vec<_>>()
    );
}
