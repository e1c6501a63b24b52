use super::*;
use crate::wire::Structured;

const STAGES: [&str; 2] = ["parse", "query"];

fn read(text: &str) -> Result<LlmConfig, String> {
    let config: LlmConfig = toml::from_str(text).map_err(|error| error.message().to_owned())?;
    config.check(&STAGES).map(|()| config)
}

const BACKEND: &str = "[backend.a]\nwire = 'openai-chat'\nmodel = 'm'\n";

#[test]
fn a_backend_is_read_with_what_is_assumed_of_it() {
    let config =
        read(&format!("default = 'a'\nfallback = ['rules']\nstages = {{ query = 'default' }}\n{BACKEND}")).unwrap();
    let backend = &config.backend["a"];
    let profile = backend.profile();
    assert_eq!((backend.base_url(), profile.structured), ("https://api.openai.com/v1", Structured::JsonSchema));
    assert!(profile.completion_tokens && profile.images && !profile.stream && profile.sampling.temperature.is_none());
    let qwen =
        read(&format!("{BACKEND}base_url = 'https://dashscope-intl.aliyuncs.com/compatible-mode/v1'\n")).unwrap();
    let profile = qwen.backend["a"].profile();
    assert_eq!((profile.structured, profile.completion_tokens), (Structured::JsonObject, false));
}

#[test]
fn mistakes_are_named_and_keys_are_not_told() {
    let a = |line: &str| format!("{BACKEND}{line}\n");
    for (text, parts) in [
        ("default = 'gpt'\n".to_owned(), &["default", "`gpt`", "rules"][..]),
        (format!("default = 'aa'\n{BACKEND}"), &["did you mean `a`"]),
        ("fallback = ['rules', 'rules']\n".into(), &["fallback", "never fails"]),
        ("stages = { quary = 'rules' }\n".into(), &["stages.quary", "did you mean `query`"]),
        ("limits = { call_ms = 999999 }\n".into(), &["limits.call_ms", "999999"]),
        ("limits = { max_usd_per_episode = -1.0 }\n".into(), &["max_usd_per_episode"]),
        (format!("default = 'a'\nlimits = {{ max_usd_per_episode = 1.0 }}\n{BACKEND}"), &["backend.a.price"]),
        ("[backend.rules]\nwire = 'ollama'\nmodel = 'm'\n".into(), &["backend.rules", "another name"]),
        (a("key = 'sk-secret-1234'"), &["unknown field `key`", "key_env"]),
        (a("key_env = 'sk-secret-1234'"), &["backend.a.key_env", "OPENAI_API_KEY"]),
        (a("headers = { Authorization = 'Bearer sk-secret-1234' }"), &["headers.Authorization", "key_env"]),
        (a("headers = { 'x y' = '1' }"), &["backend.a.headers"]),
        (a("base_url = 'https://h/v1?key=sk-secret-1234'"), &["base_url"]),
        (a("temperature = 3.0"), &["backend.a.temperature", "0..2"]),
        (a("temperature = 0.0\ncaps = { sampling = false }"), &["temperature", "caps.sampling"]),
        (a("options = { num_ctx = 1 }"), &["options", "ollama"]),
        (a("retry = { attempts = 99 }"), &["retry.attempts", "99"]),
        (a("price = { input_per_mtok = -1.0, output_per_mtok = 1.0 }"), &["price"]),
        (a("idle_timeout_ms = 0"), &["idle_timeout_ms"]),
        (a("extra_body = { stream = true }"), &["extra_body.stream"]),
        (a("max_output_tokens = 0"), &["max_output_tokens"]),
        (a("caps = { structured = 'yaml' }"), &["yaml", "prompt_only"]),
        (BACKEND.replace("'m'", "'two words'"), &["backend.a.model"]),
        (BACKEND.replace("openai-chat", "openai"), &["openai", "openai-responses"]),
        ("[backend.c]\nwire = 'anthropic'\nmodel = 'm'\ntemperature = 0.0\n".into(), &["no sampling"]),
        ("[backend.c]\nwire = 'openai-responses'\nmodel = 'm'\nseed = 1\n".into(), &["seed", "openai-responses"]),
    ] {
        let error = read(&text).expect_err(&text);
        assert!(parts.iter().all(|part| error.contains(part)), "{text}: {error}");
        assert!(!error.contains("sk-secret"), "{error}");
    }
}

#[test]
fn a_key_is_taken_from_its_variable_alone() {
    let config = read(&format!("{BACKEND}key_env = 'SOME_KEY'\n")).unwrap();
    let open = |value: Option<&str>| {
        let of = |name: &str| (name == "SOME_KEY").then_some(value?.to_owned());
        config.backend["a"].open(&of, Duration::from_secs(1), 0).err().map(|error| error.to_string())
    };
    assert_eq!(open(Some("sk-secret-1234")), None);
    assert!(open(None).unwrap().contains("SOME_KEY is not set"));
    assert!(!open(Some("sk secret 1234")).unwrap().contains("secret"));
}
