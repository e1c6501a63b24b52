use super::*;
use crate::tools::Identity;

fn trial() -> Trial {
    Trial::new().unwrap()
}

#[test]
fn geometry_answers_all_that_is_asked() {
    let trial = trial();
    assert_eq!(trial.things.len(), 2);
    let told = answers(&geometric(&trial), &trial).unwrap();
    assert_eq!(told.len(), 2 + 3 * trial.things.len());
    let abstained: Vec<&Told> = told.iter().filter(|told| told.outcome != Outcome::Ok(())).collect();
    assert!(abstained.is_empty(), "{abstained:?}");
}

#[test]
fn geometry_refuses_what_cannot_be_answered() {
    let trial = trial();
    let told = unfit_requests(&geometric(&trial), &trial).unwrap();
    assert_eq!(told.len(), 7 * (2 + 3 * trial.things.len()));
    let of_blind_frames = told.split_at(3 * (2 + 3 * trial.things.len())).1;
    assert!(of_blind_frames.iter().all(|told| matches!(told.outcome, Outcome::Abstain(Reason::Blind(_)))), "{told:?}");
}

#[test]
fn no_fault_reaches_the_percepts() {
    let trial = trial();
    for fault in Fault::ALL {
        let told = withstands(&Faulty::tools(Geometric::new(grounder(&trial)), fault), &trial, fault).unwrap();
        assert_eq!(told.len(), 2 + 3 * trial.things.len(), "{fault:?}");
    }
}

#[test]
fn tools_that_are_geometry_change_no_template_and_hardly_a_size() {
    let trial = trial();
    let expectation = Expectation::default();
    let alone = grounder(&trial).ground(&trial.frame, &expectation);
    let assisted = grounder(&trial).with_tools(geometric(&trial)).ground(&trial.frame, &expectation);
    assert_eq!(alone.objects.len(), 2);
    for (a, b) in alone.objects.iter().zip(&assisted.percepts.objects) {
        assert_eq!((&a.category, &a.support), (&b.category, &b.support));
        for (one, other) in a.parts[0].parameters.iter().zip(&b.parts[0].parameters) {
            assert!((one.value - other.value).abs() < 1e-3, "{one:?} {other:?}");
        }
    }
    let asked: Vec<&str> = assisted.calls.iter().map(|call| call.asked).collect();
    let each = ["recognise", "params", "pose"];
    assert_eq!(asked, [&["detect", "segment"][..], &each, &each].concat());
    let mut numbers: Vec<u64> = assisted.calls.iter().map(|call| call.meta.request).collect();
    numbers.sort_unstable();
    numbers.dedup();
    assert_eq!(numbers.len(), assisted.calls.len());
}

/// A segmenter that knows one mask.
struct One(PixelSupport, bool);

impl crate::tools::Tool for One {
    fn identity(&self) -> Identity {
        Identity { tool: "one".into(), version: "1".into(), model_digest: None }
    }
}

impl crate::tools::Segmenter for One {
    fn segment(&self, _: &Request, _: &Prompts) -> Outcome<Vec<crate::tools::Mask>> {
        let value = vec![crate::tools::Mask { support: self.0.clone(), score: 1.0, evidence: Default::default() }];
        match self.1 {
            true => Outcome::Partial { value, missing: vec![crate::tools::Gap("the rest".into())] },
            false => Outcome::Ok(value),
        }
    }
}

#[test]
fn masks_take_the_place_of_segments_and_partial_ones_stand_beside_them() {
    let trial = trial();
    let ground = |partial| {
        let one: Arc<dyn crate::tools::Segmenter> = Arc::new(One(trial.things[1].mask.clone(), partial));
        let tools = Tools { segmenter: Some(one), ..Tools::default() };
        let assisted = grounder(&trial).with_tools(tools).ground(&trial.frame, &Expectation::default());
        let mut categories: Vec<String> = assisted.percepts.objects.into_iter().map(|o| o.category).collect();
        categories.sort();
        (categories, assisted.calls[0].made.clone())
    };
    assert_eq!(ground(false), (vec!["can".into()], "1 of 1 masks, those that stand on the surface".into()));
    assert_eq!(ground(true).0, ["block", "can"]);
}

#[test]
fn a_tool_that_hangs_costs_its_deadline_once_a_frame() {
    let trial = trial();
    let tools = Faulty::tools(Geometric::new(grounder(&trial)), Fault::Late);
    let calls = grounder(&trial).with_tools(tools).ground(&trial.frame, &Expectation::default()).calls;
    let asked: Vec<&str> = calls.iter().map(|call| call.asked).collect();
    assert_eq!(asked, ["detect", "segment", "recognise", "params", "pose"]);
    assert!(calls[4].made.ends_with("not asked again in this frame"), "{calls:?}");
}

/// A pose estimator that is sure of a place 6 cm off.
struct Elsewhere(Geometric);

impl crate::tools::Tool for Elsewhere {
    fn identity(&self) -> Identity {
        Identity { tool: "elsewhere".into(), version: "1".into(), model_digest: None }
    }
}

impl crate::tools::PoseEstimator for Elsewhere {
    fn pose(
        &self,
        request: &Request,
        part: &PartView,
        prior: Option<&crate::tools::PoseBelief>,
    ) -> Outcome<crate::tools::PoseBelief> {
        self.0.pose(request, part, prior).map(|mut belief| {
            belief.pose.translation.x += 0.06;
            belief.covariance = [[0.0; 6]; 6];
            belief
        })
    }
}

#[test]
fn a_wrong_pose_is_not_the_last_word() {
    let trial = trial();
    let pose_estimator: Arc<dyn crate::tools::PoseEstimator> = Arc::new(Elsewhere(Geometric::new(grounder(&trial))));
    let tools = Tools { pose_estimator: Some(pose_estimator), ..Tools::default() };
    let alone = grounder(&trial).ground(&trial.frame, &Expectation::default());
    let assisted = grounder(&trial).with_tools(tools).ground(&trial.frame, &Expectation::default());
    for (a, b) in alone.objects.iter().zip(&assisted.percepts.objects) {
        let off = a.pose().unwrap().pose.translation.distance(b.pose().unwrap().pose.translation);
        assert!(off < 1e-3, "{off}");
    }
}
