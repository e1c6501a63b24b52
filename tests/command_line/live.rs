//! `acm run --live`, in a pipe and on a terminal.

use crate::acm;
use rustix::{
    pty::{OpenptFlags, grantpt, ioctl_tiocgptpeer, openpt, unlockpt},
    termios::{Winsize, tcsetwinsize},
};
use std::{
    fs::File,
    io::{Read, Write},
    process::{Command, ExitStatus},
};

/// Rows and columns of the terminal: all that one run tells fits on it.
const SIZE: (u16, u16) = (60, 90);

const RUN: [&str; 5] = ["run", "put-back-block", "--seed", "3", "--live"];

fn controls(bytes: &[u8]) -> usize {
    bytes.iter().filter(|byte| byte.is_ascii_control() && **byte != b'\n').count()
}

#[test]
fn in_a_pipe_progress_is_plain_lines_and_the_result_comes_last() {
    let output = acm().args(RUN).output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    assert_eq!((controls(&output.stdout), output.stderr.len()), (0, 0));
    let text = String::from_utf8(output.stdout).unwrap();
    let place = |part: &str| text.find(part).unwrap_or_else(|| panic!("no `{part}` in {text}"));
    let order = [
        "put-back-block seed 3: ",
        " parse ",
        " decided ",
        " skill-ended ",
        " verdict ",
        " ended ",
        "judge     strict",
    ];
    assert!(order.map(place).is_sorted(), "{text}");
    // The ticks of a skill and what the actors ask each other are not worth telling.
    assert!([" command ", " moved ", " decide ", " kept "].iter().all(|kind| !text.contains(kind)), "{text}");
    assert!(!text.contains("at work"), "{text}");
}

#[test]
fn of_a_range_it_says_which_and_json_stays_json() {
    let output = acm().args(["run", "put-back-block", "--seed", "3..4", "--live", "--json"]).output().unwrap();
    assert_eq!(output.status.code(), Some(0));
    let result: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(result["solved"], 2);
    assert_eq!(controls(&output.stderr), 0);
    let told = String::from_utf8(output.stderr).unwrap();
    for part in ["put-back-block seed 3 (1 of 2), 0 solved\n", "put-back-block seed 4 (2 of 2), 1 solved\n"] {
        assert!(told.contains(part), "no `{part}` in {told}");
    }
    assert_eq!(told.lines().filter(|line| line.contains(" ended  ")).count(), 2, "{told}");
    assert_eq!(told.lines().filter(|line| line.starts_with("seed ")).count(), 2, "{told}");
}

/// What a terminal showed of a run.
struct Watched {
    /// Each picture with the block on it that differs from the one before.
    pictures: Vec<String>,
    screen: vt100::Screen,
    status: ExitStatus,
}

/// The rows of a screen. Its own text joins those that are full.
fn text(screen: &vt100::Screen) -> String {
    screen.rows(0, SIZE.1).map(|row| row.trim_end().to_owned() + "\n").collect()
}

/// Runs `acm` on a terminal of its own. With `interrupt`, Ctrl-C is pressed as soon as that is to be read there.
fn watch(arguments: &[&str], interrupt: Option<&str>) -> Watched {
    let flags = OpenptFlags::RDWR | OpenptFlags::NOCTTY;
    let ours = openpt(flags).unwrap();
    grantpt(&ours).unwrap();
    unlockpt(&ours).unwrap();
    let (ws_row, ws_col) = SIZE;
    tcsetwinsize(&ours, Winsize { ws_row, ws_col, ws_xpixel: 0, ws_ypixel: 0 }).unwrap();
    let theirs = || ioctl_tiocgptpeer(&ours, flags).unwrap();
    // A session of its own, so that its keys reach the program and nobody else.
    let mut child = Command::new("setsid")
        .arg("--ctty")
        .arg(assert_cmd::cargo::cargo_bin!("acm"))
        .args(arguments)
        .env("TERM", "xterm")
        .stdin(theirs())
        .stdout(theirs())
        .stderr(theirs())
        .spawn()
        .unwrap();
    let (mut terminal, mut ours) = (vt100::Parser::new(ws_row, ws_col, 0), File::from(ours));
    let (mut pictures, mut interrupt) = (Vec::<String>::new(), interrupt);
    let mut bytes = [0; 4096];
    // The end of a terminal whose other side is closed is an error.
    while let Ok(count @ 1..) = ours.read(&mut bytes) {
        terminal.process(&bytes[..count]);
        let picture = text(terminal.screen());
        if interrupt.is_some_and(|sight| picture.contains(sight)) {
            interrupt = None;
            ours.write_all(b"\x03").unwrap();
        }
        // What was read may end in the middle of a picture.
        let whole = ["  at work ", "  so far "].iter().all(|part| picture.contains(part));
        if whole && pictures.last() != Some(&picture) {
            pictures.push(picture);
        }
    }
    Watched { pictures, screen: terminal.screen().clone(), status: child.wait().unwrap() }
}

/// The terminal as one wants it back: no block, and the cursor where one types.
fn is_left_clean(watched: &Watched) {
    let end = text(&watched.screen);
    assert!(["at work", "so far"].iter().all(|part| !end.contains(part)), "{end}");
    assert!(!watched.screen.hide_cursor() && !watched.screen.alternate_screen());
    assert_eq!(watched.screen.cursor_position().1, 0, "{end}");
}

#[test]
fn on_a_terminal_a_block_is_drawn_anew_and_leaves_nothing() {
    let watched = watch(&RUN, None);
    assert_eq!(watched.status.code(), Some(0));
    assert!(watched.pictures.len() > 3, "{:#?}", watched.pictures);
    for picture in &watched.pictures {
        // Whatever has scrolled by, there is one block, and below it nothing.
        assert_eq!(picture.matches("  at work ").count(), 1, "{picture}");
        assert!(picture.trim_end().lines().last().unwrap().starts_with("  so far "), "{picture}");
    }
    let shown = |part: &str| watched.pictures.iter().any(|picture| picture.contains(part));
    for part in ["subtask   1 of ", "step      1: ", "s and ", "skills left", "objects known", "at work   perception"] {
        assert!(shown(part), "never `{part}`: {:#?}", watched.pictures);
    }
    let end = text(&watched.screen);
    assert!(end.contains("judge     strict: success") && end.contains(" verdict "), "{end}");
    is_left_clean(&watched);
}

#[test]
fn ctrl_c_leaves_the_terminal_clean() {
    let watched = watch(&RUN, Some("at work   perception"));
    let end = text(&watched.screen);
    assert_eq!(watched.status.code(), Some(130), "{end}");
    assert!(end.contains("interrupted"), "{end}");
    is_left_clean(&watched);
}
