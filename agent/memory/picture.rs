//! The scene graph as a picture that a person can read: things where they are seen from above, relations as arrows.

use acm_store::{Id, State, relation::Edge};
use std::fmt::Write;

const SIZE: f64 = 900.0;
const MARGIN: f64 = 80.0;
/// Most things that are drawn: more could not be told apart.
const MOST: usize = 300;

/// The picture. It asks for nothing from outside, and words are escaped.
pub fn svg(state: &State) -> String {
    let places: Vec<(Id, [f32; 3])> = state.ids().take(MOST).filter_map(|id| Some((id, state.position(id)?))).collect();
    let (mut low, mut high) = ([f64::MAX; 2], [f64::MIN; 2]);
    for (_, position) in &places {
        for axis in 0..2 {
            low[axis] = low[axis].min(f64::from(position[axis]));
            high[axis] = high[axis].max(f64::from(position[axis]));
        }
    }
    let span = (0..2).map(|axis| high[axis] - low[axis]).fold(1e-3, f64::max);
    let scale = (SIZE - 2.0 * MARGIN) / span;
    let at = |position: [f32; 3]| {
        let x = MARGIN + (f64::from(position[0]) - low[0]) * scale;
        (x, SIZE - MARGIN - (f64::from(position[1]) - low[1]) * scale)
    };
    let mut out = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{SIZE}\" height=\"{SIZE}\" font-family=\"sans-serif\" font-size=\"12\">\n\
         <defs><marker id=\"a\" viewBox=\"0 0 8 8\" refX=\"8\" refY=\"4\" markerWidth=\"7\" markerHeight=\"7\" orient=\"auto\">\
         <path d=\"M0 0L8 4L0 8z\" fill=\"#888\"/></marker></defs>\n<rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n"
    );
    let mut add = |text: std::fmt::Arguments<'_>| out.write_fmt(text).unwrap_or_default();
    for (id, position) in &places {
        let (x, y) = at(*position);
        for edge in state.relations.of(*id).filter(Edge::holds) {
            let Some(other) = state.position(edge.object) else { continue };
            let (to_x, to_y) = at(other);
            let word = escaped(state.symbols.word(edge.relation));
            add(format_args!(
                "<path d=\"M{x:.1} {y:.1}L{to_x:.1} {to_y:.1}\" stroke=\"#888\" marker-end=\"url(#a)\"/>"
            ));
            add(format_args!(
                "<text x=\"{:.1}\" y=\"{:.1}\" fill=\"#666\">{word}</text>\n",
                (x + to_x) / 2.0,
                (y + to_y) / 2.0 - 3.0
            ));
        }
    }
    for (id, position) in &places {
        let (x, y) = at(*position);
        let Some(object) = state.object(*id) else { continue };
        let shade = (230.0 - 150.0 * f64::from(object.confidence)).clamp(0.0, 255.0) as u8;
        let words: Vec<String> =
            object.states.iter().map(|state_word| escaped(state.symbols.word(*state_word))).collect();
        let category = escaped(state.symbols.word(object.category));
        add(format_args!(
            "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"7\" fill=\"rgb({shade},{shade},255)\" stroke=\"#224\"/>"
        ));
        add(format_args!("<text x=\"{:.1}\" y=\"{:.1}\">O{id} {category}</text>", x + 10.0, y + 4.0));
        add(format_args!(
            "<text x=\"{:.1}\" y=\"{:.1}\" fill=\"#777\">{}</text>\n",
            x + 10.0,
            y + 18.0,
            words.join(", ")
        ));
    }
    let left_out = state.table.live.saturating_sub(MOST);
    let rest = if left_out > 0 { format!("; {left_out} more are not drawn") } else { String::new() };
    add(format_args!("<text x=\"12\" y=\"20\">seen from above, {span:.2} m across{rest}</text>\n"));
    out + "</svg>\n"
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}
