//! Cost against the number of objects, both on logarithmic axes, as SVG.

use super::BenchResult;
use anyhow::Context;
use std::{collections::BTreeMap, fmt::Write, path::Path};

const COLORS: [&str; 6] = ["#1b6ca8", "#c8553d", "#588157", "#8d6a9f", "#b08900", "#444444"];
const WIDTH: f64 = 720.0;
const HEIGHT: f64 = 440.0;
const LEFT: f64 = 70.0;
const BOTTOM: f64 = 50.0;

/// Writes the picture: a line for each kind of question that was measured at more than one size.
pub fn write(result: &BenchResult, path: &Path) -> anyhow::Result<()> {
    std::fs::write(path, svg(result)).with_context(|| format!("the picture {} cannot be written", path.display()))
}

fn svg(result: &BenchResult) -> String {
    let mut lines: BTreeMap<&str, Vec<(f64, f64)>> = BTreeMap::new();
    for row in &result.rows {
        if let (Some(objects), Some(us)) = (row.values.get("objects"), row.values.get("p50_us")) {
            lines.entry(&row.name).or_default().push((objects.log10(), us.max(0.01).log10()));
        }
    }
    lines.retain(|_, points| points.len() > 1);
    let all = || lines.values().flatten();
    let (low, high) = all().fold((f64::MAX, f64::MIN), |(low, high), (_, y)| (low.min(y.floor()), high.max(y.ceil())));
    let (first, last) = all().fold((f64::MAX, f64::MIN), |(first, last), (x, _)| (first.min(*x), last.max(*x)));
    let x = |value: f64| LEFT + (value - first) / (last - first).max(1e-9) * (WIDTH - LEFT - 180.0);
    let y = |value: f64| HEIGHT - BOTTOM - (value - low) / (high - low).max(1e-9) * (HEIGHT - BOTTOM - 30.0);
    let mut out = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{WIDTH}\" height=\"{HEIGHT}\" font-family=\"sans-serif\" \
         font-size=\"12\"><rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n"
    );
    let mut add = |text: std::fmt::Arguments<'_>| {
        // Writing into a string cannot fail.
        out.write_fmt(text).unwrap_or_default();
    };
    for power in (low as i32)..=(high as i32) {
        let at = y(f64::from(power));
        let right = x(last);
        add(format_args!("<path d=\"M{LEFT} {at}H{right}\" stroke=\"#ddd\"/>"));
        add(format_args!(
            "<text x=\"{}\" y=\"{}\" text-anchor=\"end\">{} us</text>\n",
            LEFT - 6.0,
            at + 4.0,
            10f64.powi(power)
        ));
    }
    for power in (first.round() as i32)..=(last.round() as i32) {
        let at = x(f64::from(power));
        add(format_args!(
            "<text x=\"{at}\" y=\"{}\" text-anchor=\"middle\">1e{power}</text>\n",
            HEIGHT - BOTTOM + 18.0
        ));
    }
    add(format_args!(
        "<text x=\"{LEFT}\" y=\"{}\">objects; median processor time of one question</text>\n",
        HEIGHT - 12.0
    ));
    for ((name, points), color) in lines.iter().zip(COLORS.iter().cycle()) {
        let path: Vec<String> = points.iter().map(|(px, py)| format!("{:.1},{:.1}", x(*px), y(*py))).collect();
        add(format_args!(
            "<polyline points=\"{}\" fill=\"none\" stroke=\"{color}\" stroke-width=\"2\"/>",
            path.join(" ")
        ));
        if let Some((px, py)) = points.last() {
            add(format_args!(
                "<text x=\"{:.1}\" y=\"{:.1}\" fill=\"{color}\">{name}</text>\n",
                x(*px) + 6.0,
                y(*py) + 4.0
            ));
        }
    }
    out + "</svg>\n"
}
