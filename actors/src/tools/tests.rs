use super::wire::{About, REQUEST, WireFrame, WirePart, WirePose, WireReply, WireRequest, templates};
use acm_perception::tools::{
    Outcome, PartView, Request, Tools,
    conformance::{self, Trial},
};
use jsonschema::Validator;
use serde_json::{Value, json};

fn schema(text: &str) -> Validator {
    jsonschema::validator_for(&serde_json::from_str(text).unwrap()).unwrap()
}

fn request_schema() -> Validator {
    schema(include_str!("../../../docs/perception-tools/request.schema.json"))
}

fn reply_schema() -> Validator {
    schema(include_str!("../../../docs/perception-tools/reply.schema.json"))
}

#[test]
fn every_request_keeps_to_its_schema() {
    let trial = Trial::new().unwrap();
    let frame = WireFrame::of(&trial.frame).unwrap();
    let (nouns, thing) = (["can".to_owned()], &trial.things[1]);
    let part = PartView { mask: &thing.mask, template: trial.template(thing), values: &thing.values };
    let request = Request { id: 1, frame: &trial.frame, limit: Tools::DEFAULT_LIMIT };
    let tools = conformance::geometric(&trial);
    let Outcome::Ok(pose) = tools.pose(&request, &part, None).unwrap().outcome else { panic!("no pose") };
    let Outcome::Ok(params) = tools.params(&request, &part, None).unwrap().outcome else { panic!("no values") };
    let mask = thing.mask.runs.as_slice();
    let wire = || WirePart::of(&part).unwrap();
    let prior = WirePose::of(&pose, &trial.frame.header.camera_pose);
    let all = [
        About::Detect { nouns: &nouns },
        About::Segment { nouns: &nouns, boxes: vec![[1, 2, 3, 4]] },
        About::Recognise { mask, templates: templates(&trial.library) },
        About::Pose { mask, part: wire(), prior: Some(Box::new(prior)) },
        About::Params { mask, part: wire(), prior: Some(&params) },
        About::Params { mask, part: wire(), prior: None },
    ];
    let schema = request_schema();
    for about in all {
        let request = WireRequest { schema: REQUEST, id: 3, limit_ms: 500, frame: &frame, about };
        let value = serde_json::to_value(&request).unwrap();
        let faults: Vec<String> = schema.iter_errors(&value).map(|error| error.to_string()).collect();
        assert!(faults.is_empty(), "{faults:?}");
    }
    assert!(!schema.is_valid(&json!({ "schema": REQUEST, "id": 3, "limit_ms": 500 })));
}

fn reply(fields: Value) -> Value {
    let mut reply = json!({ "schema": "acm.tool-reply/1", "id": 3, "tool": "t", "version": "1", "outcome": "ok" });
    reply.as_object_mut().unwrap().extend(fields.as_object().unwrap().clone());
    reply
}

#[test]
fn the_schema_of_replies_and_the_reader_agree() {
    let covariance = vec![vec![0.0; 6]; 6];
    let pose = json!({ "translation": [0, 0, 1], "rotation": [0, 0, 0, 1], "covariance": covariance });
    let params = json!({ "mean": [0.1], "covariance": [[0.1]], "observability": [{ "interval": { "low": 0, "high": 1 } }],
        "support_px": 3 });
    let sound = [
        json!({ "outcome": "abstain", "reason": "too dark" }),
        json!({ "masks": [{ "runs": [1, 2], "score": 0.5, "evidence": { "stability": 0.9 } }] }),
        json!({ "outcome": "partial", "missing": ["the left half"], "detections": [] }),
        json!({ "detections": [{ "bounds": [0, 0, 1, 1], "labels": [["can", 0.5]] }] }),
        json!({ "hypotheses": [{ "template": "can", "log_likelihood": -3.5 }] }),
        json!({ "pose": pose }),
        json!({ "params": params, "model_sha256": "0".repeat(64) }),
    ];
    let broken = [
        json!({ "outcome": "fine" }),
        json!({ "extra": 1 }),
        json!({ "masks": [{ "runs": [-1, 2], "score": 0.5 }] }),
        json!({ "masks": [{ "runs": [1, 2] }] }),
        json!({ "detections": [{ "bounds": [0, 0, 1], "labels": [] }] }),
        json!({ "hypotheses": [{ "template": "can", "log_likelihood": null }] }),
        json!({ "pose": { "translation": [0, 0], "rotation": [0, 0, 0, 1], "covariance": covariance } }),
        json!({ "params": { "mean": [0.1] } }),
    ];
    let schema = reply_schema();
    let readable = |value: &Value| serde_json::from_str::<WireReply>(&value.to_string()).is_ok();
    for value in sound.map(reply) {
        let faults: Vec<String> = schema.iter_errors(&value).map(|error| error.to_string()).collect();
        assert!(faults.is_empty() && readable(&value), "{value} {faults:?}");
    }
    for value in broken.map(reply) {
        assert!(!schema.is_valid(&value) && !readable(&value), "{value}");
    }
}

#[test]
fn a_pose_comes_back_as_it_went() {
    let trial = Trial::new().unwrap();
    let thing = &trial.things[0];
    let part = PartView { mask: &thing.mask, template: trial.template(thing), values: &thing.values };
    let request = Request { id: 1, frame: &trial.frame, limit: Tools::DEFAULT_LIMIT };
    let Outcome::Ok(mut pose) = conformance::geometric(&trial).pose(&request, &part, None).unwrap().outcome else {
        panic!("no pose")
    };
    (pose.covariance[0][4], pose.covariance[4][0]) = (1e-5, 1e-5);
    let camera = trial.frame.header.camera_pose;
    let value = reply(json!({ "pose": WirePose::of(&pose, &camera) }));
    let back = serde_json::from_value::<WireReply>(value).unwrap().pose(&camera).unwrap();
    assert!(back.pose.translation.distance(pose.pose.translation) < 1e-9 && back.pose.angle_to(&pose.pose) < 1e-6);
    let entries = back.covariance.iter().flatten().zip(pose.covariance.iter().flatten());
    assert!(entries.into_iter().all(|(a, b)| (a - b).abs() < 1e-12));
    assert_eq!(back.symmetry, pose.symmetry);
}
