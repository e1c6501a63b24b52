//! One HTML page: tables, plots with intervals, short films. It asks for nothing from outside.

use super::{
    plan::{Block, Plan, jittered},
    tally::{Averages, Rate, Tally},
};
use crate::{bench::BenchResult, embed};
use anyhow::Context;
use image::{RgbImage, codecs::jpeg::JpegEncoder, imageops};
use serde::Deserialize;
use std::{fmt::Write, path::Path};

/// Pictures of a film, and its JPEG quality, 0-100.
const PICTURES: usize = 24;
const QUALITY: u8 = 70;
/// Seconds that a picture stays.
const PICTURE_S: f64 = 0.6;
const STYLE: &str = include_str!("page.css");
/// What others have published, and what stays unfair in a comparison with it.
const PUBLISHED: &str = include_str!("published.toml");

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Published {
    tasks: Vec<String>,
    unfair: Vec<String>,
    method: Vec<Method>,
}

/// A published row: success in per cent by task, and means over nine and over the paper's seven where they are told.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Method {
    name: String,
    scores: Vec<toml::Value>,
    nine: Option<f64>,
    seven: Option<f64>,
}

/// A film with the scenario that it is of.
pub type Film = (String, Vec<u8>);

/// Writes a film: its pictures one above the other in one JPEG.
///
/// # Errors
/// The file cannot be written.
pub fn write_film(out: &Path, scenario: &str, pictures: &[RgbImage]) -> anyhow::Result<()> {
    let Some(first) = pictures.first() else { return Ok(()) };
    let count = pictures.len().min(PICTURES);
    let mut strip = RgbImage::new(first.width(), first.height() * count as u32);
    for row in 0..count {
        let index = if count < 2 { 0 } else { row * (pictures.len() - 1) / (count - 1) };
        let Some(picture) = pictures.get(index) else { continue };
        imageops::replace(&mut strip, picture, 0, i64::from(first.height()) * row as i64);
    }
    let mut bytes = Vec::new();
    JpegEncoder::new_with_quality(&mut bytes, QUALITY).encode_image(&strip)?;
    let folder = out.join("films");
    let path = folder.join(format!("{scenario}.jpg"));
    std::fs::create_dir_all(&folder)
        .and_then(|()| std::fs::write(&path, bytes))
        .with_context(|| path.display().to_string())
}

/// The films that there are of the tasks.
pub fn films(out: &Path, plan: &Plan) -> Vec<Film> {
    let names = plan.tasks.iter().flat_map(|task| [task.clone(), jittered(task)]);
    // A film that was not made, or was taken away, is not shown.
    names
        .filter_map(|name| Some((name.clone(), std::fs::read(out.join("films").join(format!("{name}.jpg"))).ok()?)))
        .collect()
}

/// The page.
///
/// # Errors
/// A film's bytes are no picture.
pub fn html(plan: &Plan, tallies: &[Tally], result: &BenchResult, films: &[Film]) -> anyhow::Result<String> {
    let published: Published = toml::from_str(PUBLISHED)?;
    let mut page = format!(
        "<!doctype html><html lang=\"en\"><meta charset=\"utf-8\"><title>RMBench tasks</title><style>{STYLE}</style><h1>Memories on the tasks of RMBench</h1>"
    );
    writeln!(
        page,
        "<p>Sensor {}, robot {}, {} seeds a block, commit {}, {} build. Success is the strict predicate and the agent's own \
         claim; intervals are Wilson's at 95 %. What crashed or was not run counts as a failure.</p>",
        escape(&plan.sensor),
        escape(plan.robot_name()),
        plan.seeds,
        escape(&result.commit),
        result.build
    )?;
    list(&mut page, result.errors.iter(), "wrong")?;
    if plan.blocks.len() > 1 {
        side_by_side(&mut page, plan, tallies)?;
    }
    for (block, first) in &plan.blocks {
        for jitter in plan.layouts() {
            let layout = if *jitter { "jittered layouts" } else { "published layouts" };
            let last = first + plan.seeds - 1;
            writeln!(page, "<h2>{} seeds {first} to {last}, {layout}</h2>", capital(block.word()))?;
            averages(&mut page, plan, tallies, *block, *jitter)?;
            for task in &plan.tasks {
                let scenario = if *jitter { jittered(task) } else { task.clone() };
                let of_it: Vec<&Tally> =
                    tallies.iter().filter(|tally| tally.scenario == scenario && tally.block == *block).collect();
                writeln!(page, "<h3>{}</h3><div class=\"task\">{}</div>", escape(&scenario), plot(&of_it))?;
                if let Some((_, film)) = films.iter().find(|(name, _)| *name == scenario) {
                    page.push_str(&moving(film)?);
                }
                table(&mut page, &of_it)?;
            }
        }
    }
    writeln!(
        page,
        "<h2>Published scores, from another simulator</h2><p>Learned from 50 demonstrations, colour images only, as each paper gives them, in per cent. They are not compared with ours.</p>"
    )?;
    page.push_str("<table><tr><th>method</th>");
    for task in published.tasks.iter().map(String::as_str).chain(["nine", "paper's seven"]) {
        write!(page, "<th>{}</th>", escape(task))?;
    }
    for method in &published.method {
        write!(page, "</tr><tr><td>{}</td>", escape(&method.name))?;
        for score in &method.scores {
            write!(page, "<td>{}</td>", score.as_integer().map_or_else(|| "–".into(), |score| score.to_string()))?;
        }
        for mean in [method.nine, method.seven] {
            write!(page, "<td>{}</td>", mean.map_or_else(|| "–".into(), |mean| format!("{mean:.1}")))?;
        }
    }
    page.push_str("</tr></table><h2>What stays unfair</h2>");
    list(&mut page, published.unfair.iter(), "")?;
    list(&mut page, result.notes.iter(), "note")?;
    page.push_str("</html>\n");
    Ok(page)
}

fn list<'a>(page: &mut String, lines: impl Iterator<Item = &'a String>, class: &str) -> std::fmt::Result {
    write!(page, "<ul class=\"{class}\">")?;
    for line in lines {
        write!(page, "<li>{}</li>", escape(line))?;
    }
    writeln!(page, "</ul>")
}

fn averages(page: &mut String, plan: &Plan, tallies: &[Tally], block: Block, jitter: bool) -> std::fmt::Result {
    let heads = [
        "memory",
        "tasks",
        "strict",
        "faithful",
        "strict, seven",
        "faithful, seven",
        "decided",
        "false claims",
        "gave up",
        "worst lower bound",
        "frames",
        "wall s",
    ];
    write!(page, "<table><tr>{}</tr>", heads.map(|head| format!("<th>{head}</th>")).concat())?;
    for contender in &plan.contenders {
        let a = Averages::of(tallies, contender, block, jitter);
        let shares = [a.strict, a.faithful, a.strict7, a.faithful7, a.decided, a.false_success, a.gave_up, a.worst_low];
        let cells = shares.map(|share| format!("<td>{}</td>", percent(share))).concat();
        let name = escape(&contender.to_string());
        writeln!(
            page,
            "<tr><td>{name}</td><td>{}</td>{cells}<td>{:.1}</td><td>{:.1}</td></tr>",
            a.tasks, a.frames, a.wall_s
        )?;
    }
    writeln!(page, "</table>")
}

/// Strict success over all tasks of each memory, block by block.
fn side_by_side(page: &mut String, plan: &Plan, tallies: &[Tally]) -> std::fmt::Result {
    page.push_str("<h2>Blocks side by side: strict, mean over tasks</h2><table><tr><th>memory</th>");
    let columns =
        || plan.layouts().iter().flat_map(|jitter| plan.blocks.iter().map(move |(block, _)| (*block, *jitter)));
    for (block, jitter) in columns() {
        write!(page, "<th>{}{}</th>", block.word(), if jitter { ", jittered" } else { "" })?;
    }
    for contender in &plan.contenders {
        write!(page, "</tr><tr><td>{}</td>", escape(&contender.to_string()))?;
        for (block, jitter) in columns() {
            write!(page, "<td>{}</td>", percent(Averages::of(tallies, contender, block, jitter).strict))?;
        }
    }
    writeln!(page, "</tr></table>")
}

fn table(page: &mut String, tallies: &[&Tally]) -> std::fmt::Result {
    let heads = [
        "memory",
        "asked",
        "strict",
        "faithful",
        "exploit",
        "decided",
        "false claims",
        "gave up",
        "skills",
        "in vain",
        "simulated s",
        "wall s",
        "frames",
        "inspected",
        "known again",
        "memory kB",
        "worlds",
    ];
    write!(page, "<table><tr>{}</tr>", heads.map(|head| format!("<th>{head}</th>")).concat())?;
    for tally in tallies {
        let judged = tally.is_faithful_judged();
        let faithful = |text: String| if judged { text } else { "–".into() };
        let cells = [
            escape(&tally.name()),
            tally.asked.to_string(),
            interval(tally.rate(|e| e.solved)),
            faithful(interval(tally.rate(|e| e.faithful == Some(true)))),
            faithful(percent(tally.rate(|e| e.faithful == Some(true) && !e.strict).share)),
            percent(tally.rate(|e| e.decided).share),
            percent(tally.rate(|e| e.false_success).share),
            percent(tally.rate(|e| e.gave_up).share),
            format!("{:.1}", tally.mean(|e| f64::from(e.steps))),
            format!("{:.1}", tally.mean(|e| f64::from(e.in_vain))),
            format!("{:.0}", tally.mean(|e| e.simulated_s)),
            format!("{:.1}", tally.mean(|e| e.wall_s)),
            format!("{:.1}", tally.mean(|e| f64::from(e.frames))),
            format!("{:.1}", tally.mean(|e| f64::from(e.inspected))),
            tally.known_again().map_or_else(|| "–".into(), percent),
            format!("{:.0}", tally.mean(|e| e.memory_bytes as f64) / 1e3),
            tally.worlds().to_string(),
        ];
        writeln!(page, "<tr>{}</tr>", cells.map(|cell| format!("<td>{cell}</td>")).concat())?;
    }
    writeln!(page, "</table>")
}

/// Strict success of each memory with its interval, filled, and by the published checker, open.
fn plot(tallies: &[&Tally]) -> String {
    const ROW: usize = 16;
    let x = |share: f64| 190.0 + 300.0 * share;
    let height = ROW * tallies.len() + 20;
    let mut svg = format!("<svg viewBox=\"0 0 510 {height}\" width=\"510\" height=\"{height}\" role=\"img\">");
    for tenth in [0.0, 0.25, 0.5, 0.75, 1.0] {
        let (at, label) = (x(tenth), format!("{:.0}", 100.0 * tenth));
        svg += &format!(
            "<line class=\"grid\" x1=\"{at}\" y1=\"0\" x2=\"{at}\" y2=\"{}\"/><text x=\"{at}\" y=\"{}\" text-anchor=\"middle\">{label}</text>",
            height - 16,
            height - 4
        );
    }
    for (row, tally) in tallies.iter().enumerate() {
        let y = (ROW * row + ROW / 2) as f64;
        let strict = tally.rate(|e| e.solved);
        svg += &format!("<text x=\"184\" y=\"{}\" text-anchor=\"end\">{}</text>", y + 4.0, escape(&tally.name()));
        svg += &format!(
            "<line class=\"interval\" x1=\"{:.1}\" y1=\"{y}\" x2=\"{:.1}\" y2=\"{y}\"/>",
            x(strict.low),
            x(strict.high)
        );
        svg += &format!("<circle class=\"strict\" cx=\"{:.1}\" cy=\"{y}\" r=\"4\"/>", x(strict.share));
        if tally.is_faithful_judged() {
            let faithful = tally.rate(|e| e.faithful == Some(true));
            svg += &format!("<circle class=\"faithful\" cx=\"{:.1}\" cy=\"{y}\" r=\"6\"/>", x(faithful.share));
        }
    }
    svg + "</svg>"
}

/// A film as an element that moves by itself.
fn moving(film: &[u8]) -> anyhow::Result<String> {
    let picture = image::load_from_memory(film)?;
    let height = picture.width() * 3 / 4;
    let count = (picture.height() / height.max(1)).max(1);
    let (total, seconds) = (height * count, PICTURE_S * f64::from(count));
    let uri = embed::data_uri("image/jpeg", film);
    Ok(format!(
        "<div class=\"film\" style=\"width:{}px;height:{height}px;--end:-{total}px;background-image:url({uri});animation:film {seconds}s steps({count}) infinite\"></div>",
        picture.width()
    ))
}

fn percent(share: f64) -> String {
    if share.is_finite() { format!("{:.0} %", 100.0 * share) } else { "–".into() }
}

fn interval(rate: Rate) -> String {
    format!("{} <small>{:.0}–{:.0}</small>", percent(rate.share), 100.0 * rate.low, 100.0 * rate.high)
}

fn capital(word: &str) -> String {
    let mut letters = word.chars();
    letters.next().map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect())
}

fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}
