//! Round things on a face: lamps, and dials with a needle.

use super::{face::Face, ink, shape::Shape};
use crate::scan::Scan;
use acm_concept::{
    color::Lab,
    reading::{Content, Hue, Upright},
};
use glam::DVec2;

/// Fewest pixels across a lamp and a dial.
const LEAST_LAMP_PX: f64 = 6.0;
const LEAST_DIAL_PX: f64 = 24.0;
/// Less coloured than this, a round spot is a dot of paint.
const LEAST_CHROMA: f64 = 14.0;
/// Logarithm of a lamp's strongest channel over the light's at which it is as likely lit as not, and how fast that
/// changes. A matt surface in full light reaches 0 in its strongest channel.
const LIT: f64 = -0.9;
const LIT_SLOPE: f64 = 7.0;
/// Luminance of the light's white, if nothing bright is in view: a camera's exposure does not leave it darker.
const LEAST_WHITE: f64 = 0.5;
/// A dial is looked at from and to these shares of its radius: the hub and the scale are left out.
const FROM: f64 = 0.3;
const TO: f64 = 0.9;
/// Contrast of a needle, CIELAB: a thin one mixes with its dial.
const LEAST_CONTRAST: f32 = 9.0;
/// A needle reaches so far at least, and another so much less.
const LEAST_REACH: f64 = 0.46;
const RIVAL: f64 = 0.88;
/// Directions that are tried.
const DIRECTIONS: usize = 180;
/// A needle is no wider, as an angle at half the radius, degrees.
const WIDEST_DEG: f64 = 50.0;

/// The lamp that a round spot with what it surrounds is, with a confidence. `white` is the lightness of the brightest
/// matt surfaces of the frame.
pub(super) fn lamp(scan: &Scan, face: &Face, solid: &[usize], shape: &Shape, white: f64) -> Option<(Content, f64)> {
    let diameter_px = shape.size().min_element() * shape.px_per_m;
    let tolerance = if diameter_px < 12.0 { 0.26 } else { 0.19 };
    if diameter_px < LEAST_LAMP_PX || !shape.is_round(tolerance) {
        return None;
    }
    let radius = 0.25 * shape.size().element_sum();
    let inner: Vec<usize> =
        solid.iter().copied().filter(|&at| face.place_of(at).distance(shape.middle()) < 0.65 * radius).collect();
    let appearance = scan.appearance(&inner.iter().map(|&at| face.window.pixel(at, scan.grid)).collect::<Vec<_>>());
    let color = appearance.mean;
    let mean = [color.l, color.a, color.b].map(|value| value as f32);
    let odd = |at: &&usize| ink::distance(scan.lab[face.window.pixel(**at, scan.grid)], mean) > 20.0;
    let marked = inner.iter().filter(odd).count() * 40 > inner.len();
    if inner.is_empty() || marked || appearance.spread > 12.0 || color.chroma() < LEAST_CHROMA {
        return None;
    }
    let strength = (strongest_channel(&color) / luminance(white).max(LEAST_WHITE)).max(1e-4).ln();
    let odds = LIT_SLOPE * (strength - LIT);
    let lit = odds > 0.0;
    let sure = 1.0 / (1.0 + (-odds.abs()).exp());
    let sized = 1.0 - 0.5 * (-(diameter_px - LEAST_LAMP_PX) / 2.0).exp();
    Some((Content::Lamp { hue: Hue::of(&color), color, lit }, sure * (0.9 + 0.09 * sized)))
}

/// Where the needle of a round dial points, with a confidence; `None` for what is no dial or has none.
pub(super) fn needle(scan: &Scan, face: &Face, shape: &Shape) -> Option<(Content, f64)> {
    let diameter_px = shape.size().min_element() * shape.px_per_m;
    if diameter_px < LEAST_DIAL_PX || !shape.is_round(0.13) {
        return None;
    }
    let grid = face.window.grid;
    let (centre, radius) = (shape.middle(), 0.25 * shape.size().element_sum());
    let lab = |at: usize| scan.lab[face.window.pixel(at, scan.grid)];
    // A needle that ends at a mark of the scale is not surrounded by its dial.
    let inner: Vec<usize> = (0..grid.len()).filter(|&at| face.place_of(at).distance(centre) < 0.85 * radius).collect();
    let (ground, sigma) = ink::ground(&inner, lab)?;
    // Not the hub nor the scale, which may be of other colours.
    let between = |at: &usize| (FROM * radius..0.75 * radius).contains(&face.place_of(*at).distance(centre));
    let mut ranked: Vec<usize> = inner.iter().copied().filter(between).collect();
    ranked.sort_by(|&a, &b| ink::distance(lab(b), ground).total_cmp(&ink::distance(lab(a), ground)));
    ranked.truncate((inner.len() / 50).max(4));
    let color = ink::mean(ranked.into_iter(), lab)?;
    let contrast = ink::distance(color, ground);
    if contrast < (4.0 * sigma).max(LEAST_CONTRAST) {
        return None;
    }
    // The share of ink anywhere on the dial, whatever its colour.
    let ink_at = |place: DVec2| {
        let at = face.project(place)?;
        let (x, y) = (at.x.floor(), at.y.floor());
        let value = |x: f64, y: f64| {
            let inside = x >= 0.0 && y >= 0.0 && (x as usize) < grid.width && (y as usize) < grid.height;
            if inside { ink::distance(lab(grid.index(x as usize, y as usize)), ground) / contrast } else { 0.0 }
        };
        let (fx, fy) = ((at.x - x) as f32, (at.y - y) as f32);
        let line = |y: f64| value(x, y) * (1.0 - fx) + value(x + 1.0, y) * fx;
        Some((line(y) * (1.0 - fy) + line(y + 1.0) * fy).min(1.0))
    };
    let step = 0.6 / (radius * shape.px_per_m);
    let reach = |direction: usize| {
        let along = DVec2::from_angle(direction as f64 / DIRECTIONS as f64 * std::f64::consts::TAU);
        let (mut share, mut sum) = (FROM, 0.0);
        while share < TO {
            match ink_at(centre + along * radius * share) {
                Some(value) if value > 0.35 => sum += f64::from(value) * step,
                _ => break,
            }
            share += step;
        }
        (share, sum)
    };
    let reaches: Vec<(f64, f64)> = (0..DIRECTIONS).map(reach).collect();
    let best = (0..DIRECTIONS).max_by(|&a, &b| reaches[a].1.total_cmp(&reaches[b].1))?;
    let far = reaches[best].0;
    let away = |a: usize| {
        let steps = (a + DIRECTIONS - best) % DIRECTIONS;
        steps.min(DIRECTIONS - steps) as f64 * 360.0 / DIRECTIONS as f64
    };
    let rival = (0..DIRECTIONS).filter(|&a| away(a) > 30.0).map(|a| reaches[a].0).fold(FROM, f64::max);
    let halfway = FROM + 0.5 * (far - FROM);
    let width_deg = reaches.iter().filter(|(share, _)| *share > halfway).count() as f64 * 360.0 / DIRECTIONS as f64;
    if far < LEAST_REACH || rival - FROM > RIVAL * (far - FROM) || width_deg > 2.0 * WIDEST_DEG {
        return None;
    }
    // The middle of its outer half, weighed by ink.
    let along = DVec2::from_angle(best as f64 / DIRECTIONS as f64 * std::f64::consts::TAU);
    let mut sum = DVec2::ZERO;
    for &at in &inner {
        let offset = (face.place_of(at) - centre) / radius;
        let share = offset.length();
        if share > FROM && share < far.min(0.85) && along.dot(offset) > 0.85 * share {
            let value = f64::from((ink::distance(lab(at), ground) / contrast).min(1.0));
            sum += offset / share * if value > 0.3 { value * share } else { 0.0 };
        }
    }
    let direction = sum.try_normalize()?;
    let angle_deg = direction.x.atan2(direction.y).to_degrees().rem_euclid(360.0);
    let unique = ((far - rival) / (far - FROM)).clamp(0.0, 1.0);
    let long = ((far - LEAST_REACH) / 0.2).clamp(0.0, 1.0);
    let confidence = 0.7 + 0.17 * unique + 0.12 * long;
    let upright = Upright { up: face.up, assumed: face.level };
    Some((Content::Needle { angle_deg, upright }, confidence))
}

/// Luminance, 0-1, of a lightness.
fn luminance(l: f64) -> f64 {
    let f = (l + 16.0) / 116.0;
    if l > 8.0 { f.powi(3) } else { l / 903.3 }
}

/// The strongest of a colour's linear sRGB channels, 0-1.
fn strongest_channel(color: &Lab) -> f64 {
    let fy = (color.l + 16.0) / 116.0;
    let cube = |f: f64| if f.powi(3) > 216.0 / 24389.0 { f.powi(3) } else { (116.0 * f - 16.0) * 27.0 / 24389.0 };
    let (x, y, z) = (0.95047 * cube(fy + color.a / 500.0), cube(fy), 1.08883 * cube(fy - color.b / 200.0));
    let red = 3.2404542 * x - 1.5371385 * y - 0.4985314 * z;
    let green = -0.969266 * x + 1.8760108 * y + 0.041556 * z;
    let blue = 0.0556434 * x - 0.2040259 * y + 1.0572252 * z;
    red.max(green).max(blue)
}
