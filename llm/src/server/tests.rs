//! A server of a few lines that misbehaves as it is told to.

use super::*;
use crate::{chat::tests::request, wire::Wire};
use serde_json::{Value, json};
use std::sync::Arc;
use tokio::{
    io::{AsyncReadExt, AsyncWriteExt},
    net::{TcpListener, TcpStream},
    sync::mpsc,
};

const SECRET: &str = "sk-never-to-be-seen-0123456789";

/// What the server does with one request.
#[derive(Clone)]
enum Does {
    Answers(u16, &'static str, String),
    /// Sends headers and half of what they promise.
    Breaks,
    /// Reads the request and says nothing.
    Hangs,
    /// Sends so many bytes of text.
    Floods(usize),
}

struct Peer {
    address: String,
    /// Bodies that came, and whether the other side hung up before it was answered.
    seen: mpsc::Receiver<(Value, bool)>,
    headers: mpsc::Receiver<String>,
}

/// A server that does these things one after the other, the last one for ever.
#[expect(clippy::disallowed_methods, reason = "the server is another program, and this one ends with the test's")]
async fn peer(does: Vec<Does>) -> Peer {
    let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
    let address = format!("http://{}", listener.local_addr().unwrap());
    let (tell, seen) = mpsc::channel(100);
    let (tell_headers, headers) = mpsc::channel(100);
    let serve = async move {
        for at in 0.. {
            let (mut stream, _) = listener.accept().await.unwrap();
            let (head, body) = read(&mut stream).await;
            tell_headers.send(head).await.ok();
            let gone = match does.get(at).or(does.last()).unwrap() {
                Does::Answers(status, headers, body) => {
                    let text = format!("HTTP/1.1 {status} X\r\n{headers}content-length: {}\r\n\r\n{body}", body.len());
                    stream.write_all(text.as_bytes()).await.is_err()
                }
                Does::Breaks => stream.write_all(b"HTTP/1.1 200 OK\r\ncontent-length: 99\r\n\r\n{\"cho").await.is_err(),
                Does::Hangs => stream.read(&mut [0]).await.is_ok_and(|count| count == 0),
                Does::Floods(bytes) => {
                    stream.write_all(b"HTTP/1.1 200 OK\r\n\r\n").await.unwrap();
                    stream.write_all(&vec![b'x'; *bytes]).await.is_err()
                }
            };
            tell.send((body, gone)).await.ok();
        }
    };
    drop(tokio::spawn(serve));
    Peer { address, seen, headers }
}

async fn read(stream: &mut TcpStream) -> (String, Value) {
    let mut bytes = Vec::new();
    loop {
        let text = String::from_utf8_lossy(&bytes).into_owned();
        if let Some((head, body)) = text.split_once("\r\n\r\n") {
            let length =
                head.to_lowercase().lines().find_map(|line| line.strip_prefix("content-length: ")?.parse().ok());
            if body.len() >= length.unwrap_or(0) {
                return (head.to_owned(), serde_json::from_str(body).unwrap_or_default());
            }
        }
        let mut piece = [0; 4096];
        let count = stream.read(&mut piece).await.unwrap();
        assert!(count > 0, "the request ends too early: {text}");
        bytes.extend_from_slice(&piece[..count]);
    }
}

fn right() -> Does {
    let body = json!({"model": "m-1", "choices": [{"finish_reason": "stop", "message": {"content": "{\"count\": 2}"}}],
        "usage": {"prompt_tokens": 1000, "completion_tokens": 10}});
    Does::Answers(200, "", body.to_string())
}

fn refuses(parameter: &str) -> Does {
    let error = json!({"error": {"message": format!("Unsupported value: '{parameter}'"), "param": parameter}});
    Does::Answers(400, "", error.to_string())
}

fn config(peer: &Peer) -> ServerConfig {
    let retry = RetryPolicy { base: Duration::from_millis(2), ..RetryPolicy::default() };
    let price = Some(Price { input: 1.0, cached_input: 1.0, output: 100.0 });
    let key = Some(Key::new("K", Some(SECRET.into())).unwrap());
    ServerConfig { retry, price, key, ..ServerConfig::new(&peer.address, Profile::new(Wire::OpenaiChat, "m")) }
}

#[tokio::test]
async fn a_reply_comes_after_failures_that_pass_and_says_so() {
    let failures = [
        Does::Answers(429, "retry-after-ms: 5\r\n", "{}".into()),
        Does::Breaks,
        Does::Answers(500, "", format!("{{\"error\": {{\"message\": \"at {SECRET}\"}}}}")),
    ];
    let mut peer = peer([failures.to_vec(), vec![right()]].concat()).await;
    let mut config = config(&peer);
    config.retry.attempts = 4;
    let reply = Server::new(config).unwrap().chat(&request("x")).await.unwrap();
    assert_eq!(
        (reply.text.as_str(), reply.model.as_str(), reply.backend.as_str()),
        ("{\"count\": 2}", "m-1", "openai-chat")
    );
    assert!((reply.cost_usd.unwrap() - 0.002).abs() < 1e-12);
    let told = format!("{reply:?}");
    assert!(reply.notes.len() == 3 && told.contains("again after 5 ms") && told.contains("broke off"), "{told}");
    assert!(told.contains("at ***") && !told.contains(SECRET), "{told}");
    assert!(peer.headers.recv().await.unwrap().contains(&format!("authorization: Bearer {SECRET}")));
}

#[tokio::test]
async fn what_fails_for_good_is_asked_once_and_told_without_the_key() {
    for (does, part) in [
        (
            Does::Answers(401, "", format!("{{\"error\": {{\"message\": \"Incorrect key {SECRET}\"}}}}")),
            "Incorrect key ***",
        ),
        (Does::Answers(404, "", "{\"error\": \"model 'm' not found\"}".into()), "model 'm' not found"),
        (
            Does::Answers(429, "", "{\"error\": {\"code\": \"insufficient_quota\", \"message\": \"pay\"}}".into()),
            "quota",
        ),
        (Does::Answers(302, "location: http://127.0.0.1:1/\r\n", String::new()), "status 302"),
        (Does::Answers(200, "", "<html>a page</html>".into()), "no JSON"),
        (Does::Answers(503, "x-should-retry: false\r\n", String::new()), "overloaded"),
        (Does::Answers(503, "retry-after: 3600\r\n", String::new()), "overloaded"),
        (Does::Floods(10 << 20), "more than 8388608 bytes"),
    ] {
        let mut peer = peer(vec![does]).await;
        let server = Server::new(config(&peer)).unwrap();
        let error = server.chat(&request("x")).await.unwrap_err();
        assert!(error.to_string().contains(part), "{part}: {error}");
        assert!(!format!("{error:?}").contains(SECRET));
        peer.seen.recv().await.unwrap();
        assert!(peer.seen.try_recv().is_err(), "asked again: {part}");
    }
}

#[tokio::test]
async fn a_refused_parameter_is_left_out_from_then_on() {
    let mut peer = peer(vec![refuses("temperature"), refuses("response_format"), right()]).await;
    let mut config = config(&peer);
    config.profile.sampling.temperature = Some(0.5);
    config.profile.sampling.top_p = Some(0.5);
    let server = Server::new(config).unwrap();
    let reply = server.chat(&request("x")).await.unwrap();
    assert!(
        reply.notes[0].contains("`temperature` is refused") && reply.notes[1].contains("in the prompt"),
        "{:?}",
        reply.notes
    );
    assert_eq!(reply.notes[2], "sent with top_p 0.5");
    let mut bodies = Vec::new();
    for _ in 0..3 {
        bodies.push(peer.seen.recv().await.unwrap().0);
    }
    assert!(bodies[0].get("temperature").is_some() && bodies[1].get("temperature").is_none());
    assert!(bodies[2].get("response_format").is_none() && bodies[2].to_string().contains("JSON Schema"));
    // The next call begins with what was learned.
    server.chat(&request("y")).await.unwrap();
    let (body, _) = peer.seen.recv().await.unwrap();
    assert!(body.get("temperature").is_none() && body.get("response_format").is_none());
}

#[tokio::test]
async fn a_server_that_refuses_the_same_for_ever_is_not_asked_for_ever() {
    let mut peer = peer(vec![refuses("temperature")]).await;
    let mut config = config(&peer);
    config.profile.sampling.temperature = Some(0.5);
    let error = Server::new(config).unwrap().chat(&request("x")).await.unwrap_err();
    assert!(matches!(error, CallError::BadRequest { .. }), "{error}");
    peer.seen.recv().await.unwrap();
    peer.seen.recv().await.unwrap();
    assert!(peer.seen.try_recv().is_err());
}

#[tokio::test]
async fn silence_ends_a_call_and_so_does_its_limit() {
    let hanging = peer(vec![Does::Hangs]).await;
    let mut limited = config(&hanging);
    limited.limits.call = Duration::from_millis(50);
    let server = Server::new(limited).unwrap();
    assert_eq!(server.chat(&request("x")).await, Err(CallError::Timeout { limit_ms: 50 }));
    // A streamed reply is to begin soon, and the call is made again where it does not.
    let mut seen = hanging.seen;
    assert!(seen.recv().await.unwrap().1, "the connection stays open after the call");
    let hanging = peer(vec![Does::Hangs, right()]).await;
    let mut streamed = config(&hanging);
    (streamed.limits.idle, streamed.profile.stream) = (Duration::from_millis(30), true);
    let error = Server::new(streamed).unwrap().chat(&request("x")).await.unwrap_err();
    // The answer is no stream: asked again, it broke off.
    assert!(matches!(error, CallError::BrokenOff { .. }), "{error}");
}

#[tokio::test]
async fn a_call_that_is_dropped_hangs_up() {
    let mut hanging = peer(vec![Does::Hangs]).await;
    let server = Arc::new(Server::new(config(&hanging)).unwrap());
    let asked = request("x");
    tokio::select! {
        _ = server.chat(&asked) => panic!("nobody answers"),
        _ = hanging.headers.recv() => {}
    }
    assert!(hanging.seen.recv().await.unwrap().1, "the server still waits");
}

#[tokio::test]
async fn a_server_that_fails_is_left_alone_for_a_while() {
    let mut failing = peer(vec![Does::Answers(500, "", String::new())]).await;
    let mut config = config(&failing);
    config.retry.attempts = 1;
    let server = Server::new(config).unwrap();
    for _ in 0..3 {
        assert!(matches!(server.chat(&request("x")).await, Err(CallError::Server { status: 500, .. })));
        failing.seen.recv().await.unwrap();
    }
    assert!(matches!(server.chat(&request("x")).await, Err(CallError::Resting { failures: 3, .. })));
    assert!(failing.seen.try_recv().is_err());
}

#[tokio::test]
async fn nobody_at_the_address_is_said() {
    let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let address = format!("http://{}", listener.local_addr().unwrap());
    drop(listener);
    let config = ServerConfig {
        retry: RetryPolicy { attempts: 2, base: Duration::from_millis(1), ..RetryPolicy::default() },
        ..ServerConfig::new(address, Profile::new(Wire::Ollama, "m"))
    };
    let error = Server::new(config).unwrap().chat(&request("x")).await.unwrap_err();
    assert!(matches!(&error, CallError::Unreachable { reason } if reason.contains("refused")), "{error}");
}

#[test]
fn addresses_with_keys_in_them_are_refused_and_not_told() {
    for address in
        ["127.0.0.1:80", "ftp://a.b", "https://me:pw-secret@a.b/v1", "https://a.b/v1?key=pw-secret", "", "http://"]
    {
        let error = Server::new(ServerConfig::new(address, Profile::new(Wire::Gemini, "m"))).err().unwrap();
        assert!(error.contains("base_url") && !error.contains("pw-secret"), "{address}: {error}");
    }
}
