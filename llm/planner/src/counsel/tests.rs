use super::*;

#[test]
fn the_files_are_well_formed_and_the_schemas_take_the_names() {
    for question in [Question::Select, Question::Reflect] {
        let (text, schema) = file(question).unwrap();
        assert_eq!((text.id.as_str(), text.version), (question.stage(), 1));
        let names = names(question, 3, true);
        let schema = filled(schema.clone(), &names);
        assert_eq!(schema["properties"]["way"]["enum"], serde_json::json!(names));
        let required: BTreeSet<&str> =
            schema["required"].as_array().unwrap().iter().filter_map(Value::as_str).collect();
        let properties: BTreeSet<&str> = schema["properties"].as_object().unwrap().keys().map(String::as_str).collect();
        assert_eq!(required, properties, "everything is required, as some providers ask for");
        assert_eq!(schema["additionalProperties"], false);
    }
    assert_eq!(names(Question::Select, 2, true), ["W1", "W2"]);
    assert_eq!(names(Question::Reflect, 1, false), ["W1", GIVE_UP]);
}
