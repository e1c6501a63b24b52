//! Letters that are printed on things: middle lines of our own drawn with a broad nib, dots, and seven segments.
//!
//! They share nothing with what the reader compares with: its marks are drawn with a round pen along other lines.

use font8x8::{BASIC_FONTS, UnicodeFonts};
use glam::DVec2;
use rand::Rng;
use rand_chacha::ChaCha8Rng;

/// A convex polygon, corners in order.
pub type Polygon = Vec<DVec2>;

/// How letters are drawn.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Style {
    /// A nib with two half axes, the first turned by an angle from the right, letters so many times wider and slanted.
    Nib {
        /// Half axes, heights of a letter.
        half: DVec2,
        /// Angle, radians.
        angle: f64,
        /// Times the width that the middle lines have.
        width: f64,
        /// Shift to the right over the height.
        slant: f64,
        /// Whether strokes that end at the foot or the head have feet.
        serifs: bool,
    },
    /// Squares of a coarse raster.
    Dots,
    /// Seven segments.
    Segments {
        /// Half their thickness, the gap between them, heights of a digit.
        half: f64,
        /// See `half`.
        gap: f64,
        /// Shift to the right over the height.
        slant: f64,
    },
}

/// A mark, one high with its foot at y = 0, and how wide it is.
#[derive(Debug, Clone, Default)]
pub struct Letter {
    /// What is inked.
    pub ink: Vec<Polygon>,
    /// Segments that are dark.
    pub ghosts: Vec<Polygon>,
    /// Its width.
    pub width: f64,
}

impl Style {
    /// A style of print from a generator.
    pub fn print(rng: &mut ChaCha8Rng) -> Style {
        let slant = if rng.random_bool(0.25) { rng.random_range(0.08..0.2) } else { 0.0 };
        let width = rng.random_range(0.8..1.2);
        match rng.random_range(0..6) {
            0 => Style::Dots,
            // Thick down strokes and feet.
            1 => {
                let half = DVec2::new(rng.random_range(0.06..0.09), rng.random_range(0.02..0.04));
                Style::Nib { half, angle: 0.0, width, slant, serifs: true }
            }
            2 => {
                let half = DVec2::new(rng.random_range(0.07..0.1), rng.random_range(0.02..0.05));
                Style::Nib { half, angle: 0.5, width, slant, serifs: false }
            }
            3 => {
                Style::Nib { half: DVec2::splat(rng.random_range(0.09..0.12)), angle: 0.0, width, slant, serifs: false }
            }
            _ => {
                let half = rng.random_range(0.04..0.08);
                Style::Nib { half: DVec2::splat(half), angle: rng.random_range(0.0..0.8), width, slant, serifs: false }
            }
        }
    }

    /// A style of segments from a generator.
    pub fn segments(rng: &mut ChaCha8Rng) -> Style {
        let slant = if rng.random_bool(0.5) { rng.random_range(0.05..0.15) } else { 0.0 };
        Style::Segments { half: rng.random_range(0.045..0.085), gap: rng.random_range(0.005..0.02), slant }
    }

    /// A mark in this style; `None` if it has none.
    pub fn letter(self, mark: char) -> Option<Letter> {
        match self {
            Style::Nib { half, angle, width, slant, serifs } => nib(mark, half, angle, width, slant, serifs),
            Style::Dots => dots(mark),
            Style::Segments { half, gap, slant } => segments(mark, half, gap, slant),
        }
    }
}

/// Marks that every style of print has.
pub const MARKS: &str = "+-\u{2190}\u{2191}\u{2192}\u{2193}AEFHKLTPNX";

/// Middle lines as in SVG paths: M moves, L draws a line, C a cubic curve. One high, y up.
const LINES: &[(char, &str)] = &[
    ('0', "M .3 1 C .02 1 .02 0 .3 0 C .58 0 .58 1 .3 1"),
    ('1', "M .08 .75 L .32 1 L .32 0"),
    ('2', "M .05 .75 C .08 1.07 .55 1.1 .55 .72 C .55 .45 .2 .3 .04 0 L .58 0"),
    (
        '3',
        "M .05 .85 C .2 1.06 .52 1.02 .52 .76 C .52 .58 .36 .52 .22 .52 C .4 .52 .57 .46 .57 .25 C .57 -.05 .15 -.08 .03 .15",
    ),
    ('4', "M .43 0 L .43 1 L .02 .28 L .6 .28"),
    ('5', "M .53 1 L .12 1 L .08 .55 C .25 .68 .57 .62 .57 .32 C .57 -.04 .15 -.08 .03 .12"),
    ('6', "M .52 .93 C .2 1.05 .03 .6 .04 .33 C .05 -.11 .57 -.11 .57 .3 C .57 .67 .15 .72 .05 .35"),
    ('7', "M .03 1 L .57 1 C .4 .7 .25 .4 .22 0"),
    ('8', "M .3 .53 C .0 .6 .0 1 .3 1 C .6 1 .6 .6 .3 .53 C -.05 .45 -.05 0 .3 0 C .65 0 .65 .45 .3 .53"),
    ('9', "M .55 .65 C .45 .28 .03 .33 .03 .7 C .03 1.11 .55 1.11 .56 .67 C .57 .4 .4 -.05 .08 .07"),
    ('+', "M .3 .2 L .3 .8 M 0 .5 L .6 .5"),
    ('-', "M .05 .5 L .55 .5"),
    ('\u{2191}', "M .3 0 L .3 1 M .02 .62 L .3 1 L .58 .62"),
    ('\u{2193}', "M .3 1 L .3 0 M .02 .38 L .3 0 L .58 .38"),
    ('\u{2192}', "M 0 .5 L .9 .5 M .55 .82 L .9 .5 L .55 .18"),
    ('\u{2190}', "M .9 .5 L 0 .5 M .35 .82 L 0 .5 L .35 .18"),
    ('A', "M 0 0 L .32 1 L .64 0 M .11 .34 L .53 .34"),
    ('E', "M .52 1 L .04 1 L .04 0 L .54 0 M .04 .53 L .46 .53"),
    ('F', "M .54 1 L .04 1 L .04 0 M .04 .52 L .47 .52"),
    ('H', "M .03 0 L .03 1 M .6 0 L .6 1 M .03 .52 L .6 .52"),
    ('K', "M .03 0 L .03 1 M .56 1 L .05 .42 M .22 .6 L .6 0"),
    ('L', "M .04 1 L .04 0 L .52 0"),
    ('T', "M .31 0 L .31 1 M 0 1 L .62 1"),
    ('P', "M .04 0 L .04 1 C .7 1.05 .7 .45 .04 .46"),
    ('N', "M .03 0 L .03 1 L .6 0 L .6 1"),
    ('X', "M 0 0 L .58 1 M .02 1 L .6 0"),
];

fn nib(mark: char, half: DVec2, angle: f64, width: f64, slant: f64, serifs: bool) -> Option<Letter> {
    let path = LINES.iter().find(|(known, _)| *known == mark)?.1;
    let place = |p: DVec2| DVec2::new(p.x * width + slant * p.y, p.y);
    let (a, b) = (DVec2::from_angle(angle) * half.x, DVec2::from_angle(angle).perp() * half.y);
    let pen = [a + b, a - b, -a - b, -a + b];
    let mut ink = Vec::new();
    for line in strokes(path) {
        let line: Vec<DVec2> = line.into_iter().map(place).collect();
        for ends in line.windows(2) {
            ink.push(hull(pen.iter().flat_map(|corner| [ends[0] + *corner, ends[1] + *corner]).collect()));
        }
        let (Some(first), Some(last)) = (line.first(), line.last()) else { continue };
        let closed = first.distance(*last) < 1e-6;
        for end in [first, last] {
            if serifs && !closed && (end.y.abs() < 1e-6 || (end.y - 1.0).abs() < 1e-6) {
                let foot = DVec2::new(0.15 * width, 0.0);
                ink.push(hull([-foot, foot].iter().flat_map(|f| [*end + *f + b, *end + *f - b]).collect()));
            }
        }
    }
    let low = ink.iter().flatten().fold(f64::INFINITY, |low, p| low.min(p.x));
    let high = ink.iter().flatten().fold(f64::NEG_INFINITY, |high, p| high.max(p.x));
    for polygon in &mut ink {
        polygon.iter_mut().for_each(|p| p.x -= low);
    }
    Some(Letter { ink, ghosts: Vec::new(), width: high - low })
}

/// The lines of a path, curves as twelve pieces.
fn strokes(path: &str) -> Vec<Vec<DVec2>> {
    let mut lines: Vec<Vec<DVec2>> = Vec::new();
    let mut words = path.split_whitespace();
    while let Some(command) = words.next() {
        let mut point = || {
            let mut number = || words.next().and_then(|word| word.parse().ok()).unwrap_or(0.0);
            DVec2::new(number(), number())
        };
        match (command, lines.last_mut()) {
            ("L", Some(line)) => line.push(point()),
            ("C", Some(line)) => {
                let from = line.last().copied().unwrap_or_default();
                let (one, two, to) = (point(), point(), point());
                for step in 1..=12 {
                    let (t, s) = (f64::from(step) / 12.0, 1.0 - f64::from(step) / 12.0);
                    line.push(from * s.powi(3) + one * 3.0 * s * s * t + two * 3.0 * s * t * t + to * t.powi(3));
                }
            }
            _ => lines.push(vec![point()]),
        }
    }
    lines
}

fn dots(mark: char) -> Option<Letter> {
    let rows = BASIC_FONTS.get(mark)?;
    let used = |column: u32| rows.iter().any(|row| row & (1 << column) != 0);
    let first = (0..8).find(|column| used(*column))?;
    let last = (0..8).rev().find(|column| used(*column))?;
    // Its capitals are seven dots high, the foot free.
    let dot = 1.0 / 7.0;
    let mut ink = Vec::new();
    for (row, bits) in rows.iter().enumerate() {
        for column in (first..=last).filter(|column| bits & (1 << column) != 0) {
            let (x, y) = (f64::from(column - first) * dot, (6.0 - row as f64) * dot);
            ink.push([(x, y), (x + dot, y), (x + dot, y + dot), (x, y + dot)].map(DVec2::from).to_vec());
        }
    }
    Some(Letter { ink, ghosts: Vec::new(), width: f64::from(last + 1 - first) * dot })
}

/// Which segments a digit lights: from the top clockwise, the middle one last.
const LIT: [u8; 10] =
    [0b0111111, 0b0000110, 0b1011011, 0b1001111, 0b1100110, 0b1101101, 0b1111101, 0b0000111, 0b1111111, 0b1101111];

fn segments(mark: char, half: f64, gap: f64, slant: f64) -> Option<Letter> {
    let lit = *LIT.get(mark.to_digit(10)? as usize)?;
    let width = 0.52;
    let (left, right, foot, middle, head) = (half, width - half, half, 0.5, 1.0 - half);
    let ends = [
        [(left, head), (right, head)],
        [(right, head), (right, middle)],
        [(right, middle), (right, foot)],
        [(right, foot), (left, foot)],
        [(left, foot), (left, middle)],
        [(left, middle), (left, head)],
        [(left, middle), (right, middle)],
    ];
    let mut letter = Letter { width: width + slant, ..Letter::default() };
    for (at, [from, to]) in ends.into_iter().enumerate() {
        let (from, to) = (DVec2::from(from), DVec2::from(to));
        let along = (to - from).normalize();
        let (a, b) = (from + along * gap, to - along * gap);
        let (side, tip) = (along.perp() * half, along * half);
        let bar = [a, a + tip + side, b - tip + side, b, b - tip - side, a + tip - side];
        let bar = bar.map(|p| DVec2::new(p.x + slant * p.y, p.y)).to_vec();
        if lit & (1 << at) != 0 { letter.ink.push(bar) } else { letter.ghosts.push(bar) }
    }
    Some(letter)
}

/// The convex hull, counter-clockwise (Andrew's monotone chain).
fn hull(mut points: Vec<DVec2>) -> Polygon {
    points.sort_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)));
    let mut hull: Polygon = Vec::new();
    let mut chain = |points: &mut dyn Iterator<Item = DVec2>| {
        let start = hull.len();
        for point in points {
            while hull.len() >= start + 2 {
                let (a, b) = (hull[hull.len() - 2], hull[hull.len() - 1]);
                if (b - a).perp_dot(point - a) > 1e-12 {
                    break;
                }
                hull.pop();
            }
            hull.push(point);
        }
        hull.pop();
    };
    chain(&mut points.iter().copied());
    chain(&mut points.iter().rev().copied());
    hull
}
