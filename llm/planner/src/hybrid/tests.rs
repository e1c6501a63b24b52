use super::*;
use crate::planner::Planner;
use serde_json::json;

const CANONICAL: &str = "Bring the cube to the middle, press the button, then return it to where it came from.";

fn mind() -> (Planner, TemplateLibrary) {
    (Planner::new().unwrap(), acm_memory::default_library().unwrap())
}

/// The answer to the canonical instruction, with something changed.
fn faults(change: impl FnOnce(&mut Value)) -> Vec<String> {
    let (planner, library) = mind();
    let task = planner.parse(CANONICAL, &library).unwrap();
    let mut answer = serde_json::to_value(planner.answer(&task)).unwrap();
    assert_eq!(planner.understand(CANONICAL, &library, &answer), Ok(task));
    change(&mut answer);
    planner.understand(CANONICAL, &library, &answer).unwrap_err()
}

/// Everything in a schema that stands for a value.
fn visit(schema: &Value, see: &mut impl FnMut(&Value)) {
    see(schema);
    let below = schema.get("properties").and_then(Value::as_object);
    below.into_iter().flat_map(|fields| fields.values()).chain(schema.get("items")).for_each(|one| visit(one, see));
}

#[test]
fn the_schema_keeps_to_what_all_providers_take() {
    let (planner, library) = mind();
    let schema = planner.prompt(CANONICAL, &library).unwrap().schema;
    assert_eq!(schema["type"], "object");
    visit(&schema, &mut |one| {
        let fields = one.as_object().unwrap();
        let allowed = ["type", "description", "enum", "properties", "required", "additionalProperties", "items"];
        assert!(fields.keys().all(|name| allowed.contains(&name.as_str())), "{one}");
        let types: Vec<&str> = match &fields["type"] {
            Value::Array(types) => types.iter().map(|name| name.as_str().unwrap()).collect(),
            name => vec![name.as_str().unwrap()],
        };
        assert!(types.len() == 1 || (types.len() == 2 && types[1] == "null"), "a union with null alone: {one}");
        if types[0] == "object" {
            let mut names: Vec<&str> = fields["properties"].as_object().unwrap().keys().map(String::as_str).collect();
            let mut required: Vec<&str> =
                fields["required"].as_array().unwrap().iter().map(|n| n.as_str().unwrap()).collect();
            names.sort_unstable();
            required.sort_unstable();
            assert_eq!(names, required);
            assert_eq!(fields["additionalProperties"], false);
        }
        if let Some(names) = fields.get("enum") {
            let names = names.as_array().unwrap();
            assert!((1..250).contains(&names.len()) && names.iter().all(|name| name.is_null() || name.is_string()));
            assert_eq!(names.iter().any(Value::is_null), types.len() == 2, "{one}");
        }
    });
}

#[test]
fn the_schema_has_the_fields_and_the_words_of_the_form() {
    let (planner, library) = mind();
    let schema = planner.prompt(CANONICAL, &library).unwrap().schema;
    let at = |path: &str| schema.pointer(path).unwrap_or_else(|| panic!("no {path}"));
    // A full answer has exactly the schema's fields.
    let text = "Put the dark red cube on the left mat next to the can.";
    let task = planner.parse(text, &library).unwrap();
    let answer = serde_json::to_value(planner.answer(&task)).unwrap();
    let fields = |value: &Value| value.as_object().unwrap().keys().cloned().collect::<BTreeSet<_>>();
    let (thing, step) = ("/properties/things/items/properties", "/properties/steps/items/properties");
    assert_eq!(fields(&answer), fields(at("/properties")));
    assert_eq!(fields(&answer["things"][0]), fields(at(thing)));
    assert_eq!(fields(&answer["steps"][0]), fields(at(step)));
    assert_eq!(fields(&answer["steps"][0]["to"]), fields(at(&format!("{step}/to/properties"))));
    assert_eq!(fields(&answer["steps"][0]["to"]), fields(at(&format!("{thing}/located/properties"))));
    // And each word of an enumeration is one that the form reads.
    fn reads<T: serde::de::DeserializeOwned>(names: &Value) {
        for name in names.as_array().unwrap().iter().filter(|name| !name.is_null()) {
            assert!(serde_json::from_value::<T>(name.clone()).is_ok(), "{name}");
        }
    }
    reads::<form::QuantityForm>(at(&format!("{thing}/quantity/enum")));
    reads::<crate::task::Size>(at(&format!("{thing}/size/enum")));
    reads::<form::RankFrom>(at(&format!("{thing}/rank_from/enum")));
    reads::<form::GoalForm>(at(&format!("{step}/goal/enum")));
    for place in [format!("{thing}/located/properties"), format!("{step}/to/properties")] {
        reads::<form::PlaceKind>(at(&format!("{place}/kind/enum")));
        reads::<crate::task::Direction>(at(&format!("{place}/side/enum")));
        reads::<form::Past>(at(&format!("{place}/past/enum")));
    }
    assert!(at(&format!("{thing}/noun/enum")).as_array().unwrap().contains(&json!("cube")));
    assert_eq!(at(&format!("{thing}/shade/enum")), &json!(["dark", "light", null]));
}

#[test]
fn the_prompt_names_the_instruction_and_what_the_library_has() {
    let (planner, library) = mind();
    let prompt = planner.prompt(CANONICAL, &library).unwrap();
    assert_eq!((prompt.id.as_str(), prompt.version), ("parse", 2));
    assert!(prompt.user.contains(CANONICAL) && prompt.system.contains("- cube: pick, place"));
    assert!(!prompt.system.contains('{') && !prompt.user.contains('{'), "a gap was not filled");
    assert!(!prompt.schema.to_string().contains("{nouns}"));
    assert_eq!(planner.prompt("  ", &library), Err(ParseError::Empty));
    assert!(matches!(planner.prompt(&"x".repeat(5000), &library), Err(ParseError::TooLong { .. })));
}

#[test]
fn what_is_not_there_is_named() {
    type Change<'a> = &'a dyn Fn(&mut Value);
    let cases: [(Change<'_>, &str); 14] = [
        (&|a| a["things"][0]["noun"] = json!("walrus"), "no noun `walrus`"),
        (&|a| a["things"][0]["phrase"] = json!("the walrus"), "does not say \"the walrus\""),
        (&|a| a["things"][0]["occurrence"] = json!(9), "does not say \"the cube\" 9 times"),
        (&|a| a["things"][0]["color"] = json!("beigeish"), "no colour `beigeish`"),
        (&|a| a["things"][0]["shade"] = json!("dark"), "a shade needs a colour"),
        (&|a| a["things"][0]["function"] = json!("press"), "has the function press"),
        (&|a| a["things"][0]["other_than"] = json!([0]), "0 does not stand before it"),
        (&|a| a["things"][0]["rank"] = json!(0), "0 is no rank"),
        (&|a| a["steps"][0]["thing"] = json!(7), "7 is no index of `things`, which has 2"),
        (&|a| a["steps"][0]["thing"] = json!(1), "no kind of button that I know can be moved"),
        (&|a| a["steps"][1]["times"] = json!(0), "0 is not 1 to"),
        (&|a| a["steps"][0]["to"]["kind"] = json!("in-place-of"), "steps/0/to/thing"),
        (&|a| a["steps"] = json!([]), "`steps` has 0 entries"),
        (&|a| a["unclear"] = json!("which cube"), "unclear: which cube"),
    ];
    for (change, told) in cases {
        let faults = faults(change);
        assert!(faults.iter().any(|fault| fault.contains(told)), "{told}: {faults:?}");
    }
    // All that is wrong is told at once.
    assert!(faults(|a| (a["things"][0]["noun"], a["untouched"]) = (json!("walrus"), json!([9]))).len() >= 2);
}
