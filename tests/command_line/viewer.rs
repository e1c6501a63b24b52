//! The viewer in a real browser: load, click, search, keys, links; and `acm trace view`, which serves it.

use crate::{
    chromium::{self, Browser},
    long, refuses,
    trace::{prints, trace},
};
use std::{
    io::{BufRead, BufReader, Read, Write},
    net::TcpStream,
    process::Stdio,
};

/// A browser, or a line that says why the test is skipped.
fn browser() -> Option<Browser> {
    let program = chromium::program();
    if program.is_none() {
        println!("skipped: there is no chromium on this machine; Debian's package `chromium` has it");
    }
    Some(Browser::start(&program?))
}

#[test]
fn a_run_is_looked_into_with_mouse_and_keys() {
    let Some(mut browser) = browser() else { return };
    let dir = tempfile::tempdir().unwrap();
    let page = dir.path().join("run.html");
    prints(&["trace", "export", trace().to_str().unwrap(), "--html", page.to_str().unwrap()]);
    let url = format!("file://{}", page.display());
    browser.looks(1500, 950, "light");
    browser.open(&url);
    assert!(browser.text("h1").contains("put-back-block"));
    assert!(browser.text("#step").starts_with("step 1 of "));
    assert_eq!(browser.ask("location.hash"), "", "nobody picked anything yet");
    // What was seen: a picture that is there, with a box and a name for each thing.
    assert_eq!(browser.ask("document.querySelector('#frame img').naturalWidth"), 160);
    assert_eq!(browser.ask("document.querySelectorAll('#frame rect').length"), 6);
    assert!(browser.text("#memory").contains("cube"));
    assert!(browser.text("#details").contains("The decision behind it: step 1"));
    browser.picture("light");

    // A click on a row, and the link to it.
    browser.click(".row.begins + .row .kind");
    assert_eq!(browser.text(".row.picked .kind"), "execute");
    let hash = browser.ask("location.hash").as_str().unwrap().to_owned();
    assert!(hash.starts_with("#seq="), "{hash}");
    assert!(browser.text("#details").contains("run pick"));
    // The chain of causes is followed by a click.
    browser.click("#details .rowline:nth-of-type(2) .go");
    assert_eq!(browser.text(".row.picked .kind"), "decided");
    browser.click("#tab-plan");
    let plan = browser.text("#details");
    for part in ["Preconditions", "hand-empty()", "Rejected", "it needs holding", "What went wrong"] {
        assert!(plan.contains(part), "no `{part}` in: {plan}");
    }
    browser.picture("plan");
    browser.click("#tab-message");
    assert!(browser.text("#details").contains("planner"));
    browser.click("#tab-changes");
    assert!(browser.text("#details").contains("What memory wrote in step 1"));

    // Keys: the next step, the next message, the cause, light and dark.
    browser.key("w");
    browser.key("ArrowRight");
    assert!(browser.text("#step").starts_with("step 2 of "), "{}", browser.text("#step"));
    assert_eq!(browser.ask("location.hash"), "#step=2");
    let seq = browser.text(".row.picked .seq");
    browser.key("ArrowDown");
    browser.key("c");
    assert_eq!(browser.text(".row.picked .seq"), seq);
    browser.key("?");
    assert_eq!(browser.ask("document.getElementById('keys').open"), true);
    browser.picture("keys");
    browser.key("Escape");
    assert_eq!(browser.ask("document.getElementById('keys').open"), false);

    // Search: by key, through all that was found.
    browser.key("/");
    for sign in "contradicted:".chars() {
        browser.key(&sign.to_string());
    }
    let found = |browser: &mut Browser| -> [usize; 2] {
        let text = browser.text("#found");
        let (place, count) = text.split_once(" of ").unwrap_or_else(|| panic!("{text}"));
        [place.parse().unwrap(), count.parse().unwrap()]
    };
    let [place, count] = found(&mut browser);
    assert_eq!(count, 2, "the verdict and what memory is told of it");
    assert!(browser.text(".row.picked mark").eq_ignore_ascii_case("contradicted:"));
    browser.key("Enter");
    assert_eq!(found(&mut browser), [place % count + 1, count]);
    browser.picture("search");
    browser.key("Escape");
    assert_eq!(browser.text("#found"), "");

    // Links.
    browser.ask("location.hash = 'seq=12&tab=message'");
    browser.settle();
    assert_eq!(browser.text(".row.picked .seq"), "12");
    assert_eq!(browser.ask("document.getElementById('tab-message').getAttribute('aria-selected')"), "true");
    browser.ask("location.hash = 'seq=99999'");
    browser.settle();
    assert!(browser.text("#notes").contains("There is no message 99999"));
    browser.open("about:blank#");
    browser.open(&format!("{url}#step=3"));
    assert!(browser.text("#step").starts_with("step 3 of "));

    // Dark where the system is, unless somebody switches.
    let background = "getComputedStyle(document.body).backgroundColor";
    let light = browser.ask(background);
    browser.looks(1500, 950, "dark");
    assert_ne!(browser.ask(background), light);
    browser.picture("dark");
    browser.click("#theme");
    assert_eq!(browser.ask(background), light);
    // A narrow window has all of it, one below the other.
    browser.looks(420, 900, "light");
    assert_eq!(browser.ask("document.documentElement.scrollWidth <= innerWidth"), true, "it is wider than the window");
    browser.picture("narrow");
    browser.ask("scrollTo(0, 900)");
    browser.picture("narrow-below");
    assert_eq!(browser.complaints, Vec::<String>::new());
}

#[test]
fn a_thousand_steps_of_hostile_names_stay_a_page() {
    let Some(mut browser) = browser() else { return };
    let dir = tempfile::tempdir().unwrap();
    let long = long::write(trace(), dir.path(), 170);
    let page = dir.path().join("long.html");
    prints(&["trace", "export", long.to_str().unwrap(), "--html", page.to_str().unwrap()]);
    browser.looks(1500, 950, "light");
    browser.open(&format!("file://{}#step=1000", page.display()));
    assert!(browser.text("#step").starts_with("step 1000 of "), "{}", browser.text("#step"));
    assert_eq!(browser.text(".row.picked .kind"), "decided");
    // Of many thousand rows only those in sight are there, wherever one is.
    for key in ["Home", "End"] {
        browser.key(key);
        assert!(browser.ask("document.querySelectorAll('.row').length").as_u64().unwrap() < 80);
        // The arrows lie where the rows lie.
        let same = "['top', 'height'].every(side => Math.abs(arrows.getBoundingClientRect()[side] - lanes.getBoundingClientRect()[side]) < 1)";
        assert_eq!(browser.ask(same), true);
    }
    assert!(browser.ask("rows.length").as_u64().unwrap() > 10_000);
    for _ in 0..20 {
        browser.key("ArrowLeft");
    }
    let rows = browser.ask("[...document.querySelectorAll('.row')].map(row => row.getBoundingClientRect().top)");
    let tops: Vec<f64> = serde_json::from_value(rows).unwrap();
    assert!(tops.windows(2).all(|pair| (pair[1] - pair[0] - 22.0).abs() < 0.01), "{tops:?}");
    browser.picture("long");
    // Names are texts, wherever they stand.
    assert!(browser.text("h1").contains(long::HOSTILE));
    assert!(browser.text("#heads").contains("onerror"));
    assert_ne!(browser.ask("document.title"), "owned");
    assert_eq!(browser.ask("document.querySelectorAll('img[src=x]').length"), 0);
    // What a model was asked stands beside the message.
    browser.ask("location.hash = `seq=${calls[0].replied}&tab=model`");
    browser.settle();
    let model = browser.text("#details");
    assert!(model.contains("Say </script> & <b>bold</b>") && model.contains("I say so."), "{model}");
    assert!(model.contains("<i>hm</i>") && model.contains("7 tokens in, 3 out"), "{model}");
    browser.picture("model");
    assert_eq!(browser.complaints, Vec::<String>::new());
}

fn ask(address: &str, path: &str, host: &str) -> String {
    let mut stream = TcpStream::connect(address).unwrap();
    write!(stream, "GET {path} HTTP/1.1\r\nHost: {host}\r\nConnection: close\r\n\r\n").unwrap();
    let mut answer = String::new();
    stream.read_to_string(&mut answer).unwrap();
    answer
}

#[cfg(unix)]
#[test]
fn the_viewer_is_served_on_this_machine_alone_until_it_is_ended() {
    let file = trace().to_str().unwrap();
    let mut server = std::process::Command::new(assert_cmd::cargo::cargo_bin!("acm"))
        .args(["trace", "view", file])
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let mut line = String::new();
    BufReader::new(server.stdout.take().unwrap()).read_line(&mut line).unwrap();
    let url = line.split_whitespace().next().unwrap().to_owned();
    let address = url.trim_start_matches("http://").trim_end_matches('/').to_owned();
    assert!(address.starts_with("127.0.0.1:"), "{line}");
    let page = ask(&address, "/", &address);
    assert!(
        page.starts_with("HTTP/1.1 200") && page.contains("default-src 'none'") && page.contains("acm.trace-page/1")
    );
    assert!(ask(&address, "/etc/passwd", &address).starts_with("HTTP/1.1 404"));
    assert!(ask(&address, "/", "somebody.example").starts_with("HTTP/1.1 403"));
    let port = address.rsplit(':').next().unwrap();
    refuses(&["trace", "view", file, "--port", port], &[&format!("127.0.0.1:{port} cannot be served"), "--port"]);
    if let Some(mut browser) = browser() {
        browser.open(&format!("{url}#step=2"));
        assert!(browser.text("#step").starts_with("step 2 of "));
        assert_eq!(browser.complaints, Vec::<String>::new());
    }
    assert!(interrupted(server.id()), "the server could not be told to end");
    assert_eq!(server.wait().unwrap().code(), Some(0));
}

/// Ctrl-C for a process.
fn interrupted(process: u32) -> bool {
    std::process::Command::new("kill")
        .args(["-INT", &process.to_string()])
        .status()
        .is_ok_and(|status| status.success())
}
