//! What is written or shown on a thing: marks, lamps and needles, read from pixels.

use crate::color::Lab;
use glam::DVec3;
use serde::{Deserialize, Serialize};
use std::fmt;

/// One thing that was read, or that asks to be read and cannot be.
///
/// ```
/// # use acm_concept::reading::*;
/// let up = Upright { up: glam::DVec3::Z, assumed: false };
/// let content = Content::Text { text: "42".into(), upright: up, turned: None };
/// let reading = Reading { content, confidence: 0.97, bounds: [10, 20, 29, 34], height_px: 15.0, position: glam::DVec3::ZERO };
/// assert_eq!(reading.to_string(), "`42` 97 %");
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Reading {
    /// What it says.
    pub content: Content,
    /// Probability that `content` is right, 0-1; of what is unreadable, that there is something to read.
    pub confidence: f64,
    /// First column, first row, last column, last row, both included.
    pub bounds: [u32; 4],
    /// Height as the camera sees it, pixels: of a line's highest mark, of a lamp, of a dial.
    pub height_px: f64,
    /// Its middle, in the world, metres.
    pub position: DVec3,
}

/// What a [`Reading`] says.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case")]
pub enum Content {
    /// A line of digits, printed or of seven segments, and marks: `+`, `-`, arrows, capital letters that cannot be
    /// taken for digits.
    Text {
        /// The marks from left to right.
        text: String,
        /// Which way up it was read.
        upright: Upright,
        /// What it says the other way up, where that reads as well and nothing tells which is meant: `6` and `9`.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        turned: Option<String>,
    },
    /// A round spot of colour.
    Lamp {
        /// Its colour as it was seen.
        color: Lab,
        /// The name of that colour.
        hue: Hue,
        /// Whether it is as bright as a surface that the light falls on could hardly be in that colour.
        lit: bool,
    },
    /// The needle of a round dial.
    Needle {
        /// Where it points, degrees from the dial's top, clockwise as seen from the front, 0-360.
        angle_deg: f64,
        /// Which way is up on the dial.
        upright: Upright,
    },
    /// There is something to read, and it cannot be.
    Unreadable {
        /// Why.
        reason: Unreadable,
    },
}

/// Which way is up on the face that was read.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Upright {
    /// Unit direction in the world, within the face.
    pub up: DVec3,
    /// Whether it was assumed: a face that looks up has no up of its own. Of text the direction along the face's edges
    /// in which it reads best is taken, of a dial the one away from the viewer.
    pub assumed: bool,
}

/// Why something cannot be read.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Unreadable {
    /// Too few pixels: go nearer.
    TooSmall,
    /// The picture is saturated there: look from elsewhere.
    Glare,
    /// Something is in front of it, or it reaches beyond the face that is seen.
    Covered,
    /// It looks as much like one thing as like another.
    Ambiguous,
}

/// Names of colours, coarse enough to be told apart under any white light.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Hue {
    /// Hue angles from -20 to 52 degrees.
    Red,
    /// To 83 degrees: amber too.
    Orange,
    /// To 112 degrees.
    Yellow,
    /// To 178 degrees.
    Green,
    /// To 240 degrees.
    Cyan,
    /// To 308 degrees.
    Blue,
    /// To 340 degrees: magenta and pink too.
    Purple,
    /// Less than 10 from grey.
    White,
}

impl Hue {
    /// The name of a colour by its hue angle in CIELAB; white without chroma.
    ///
    /// ```
    /// # use acm_concept::{color::Lab, reading::Hue};
    /// assert_eq!(Hue::of(&Lab::from_srgb([230, 30, 20])), Hue::Red);
    /// assert_eq!(Hue::of(&Lab::from_srgb([20, 90, 30])), Hue::Green);
    /// assert_eq!(Hue::of(&Lab::from_srgb([250, 250, 250])), Hue::White);
    /// ```
    pub fn of(color: &Lab) -> Hue {
        if color.chroma() < 10.0 {
            return Hue::White;
        }
        // Between the hues of the screen's primaries and of amber (71), in degrees.
        match color.hue().to_degrees().rem_euclid(360.0) {
            h if !(52.0..340.0).contains(&h) => Hue::Red,
            h if h < 83.0 => Hue::Orange,
            h if h < 112.0 => Hue::Yellow,
            h if h < 178.0 => Hue::Green,
            h if h < 240.0 => Hue::Cyan,
            h if h < 308.0 => Hue::Blue,
            _ => Hue::Purple,
        }
    }
    /// Its name, small letters.
    pub fn name(self) -> &'static str {
        match self {
            Hue::Red => "red",
            Hue::Orange => "orange",
            Hue::Yellow => "yellow",
            Hue::Green => "green",
            Hue::Cyan => "cyan",
            Hue::Blue => "blue",
            Hue::Purple => "purple",
            Hue::White => "white",
        }
    }
}

impl Unreadable {
    /// The reason in words.
    pub fn words(self) -> &'static str {
        match self {
            Unreadable::TooSmall => "too small",
            Unreadable::Glare => "glare",
            Unreadable::Covered => "covered or cut off",
            Unreadable::Ambiguous => "ambiguous",
        }
    }
}

impl fmt::Display for Reading {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let percent = 100.0 * self.confidence;
        match &self.content {
            Content::Text { text, turned: None, .. } => write!(f, "`{text}` {percent:.0} %"),
            Content::Text { text, turned: Some(other), .. } => write!(f, "`{text}` or turned `{other}` {percent:.0} %"),
            Content::Lamp { hue, lit, .. } => {
                write!(f, "{} lamp {} {percent:.0} %", hue.name(), if *lit { "lit" } else { "dark" })
            }
            Content::Needle { angle_deg, .. } => write!(f, "needle at {angle_deg:.0} deg {percent:.0} %"),
            Content::Unreadable { reason } => write!(f, "unreadable: {}", reason.words()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hues_have_their_names_bright_and_dark() {
        let named = [
            ([255, 40, 30], [90, 15, 12], Hue::Red),
            ([255, 176, 32], [100, 66, 10], Hue::Orange),
            ([250, 240, 40], [100, 95, 10], Hue::Yellow),
            ([48, 208, 80], [15, 70, 25], Hue::Green),
            ([40, 80, 255], [10, 20, 90], Hue::Blue),
        ];
        for (bright, dark, hue) in named {
            assert_eq!([Hue::of(&Lab::from_srgb(bright)), Hue::of(&Lab::from_srgb(dark))], [hue, hue]);
        }
    }

    #[test]
    fn a_reading_is_written_with_its_kind_and_read_again() {
        let upright = Upright { up: DVec3::Y, assumed: true };
        let content = Content::Text { text: "6".into(), upright, turned: Some("9".into()) };
        let reading = Reading { content, confidence: 0.5, bounds: [1, 2, 3, 4], height_px: 12.0, position: DVec3::X };
        let text = serde_json::to_string(&reading).unwrap();
        assert!(text.contains(r#""kind":"text""#) && text.contains(r#""turned":"9""#), "{text}");
        assert_eq!(serde_json::from_str::<Reading>(&text).unwrap(), reading);
        assert_eq!(reading.to_string(), "`6` or turned `9` 50 %");
    }
}
