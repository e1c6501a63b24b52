//! Appearance: mean colour and spread in CIELAB (D65), where Euclidean distance is roughly perceptual.

use serde::{Deserialize, Serialize};

/// A colour in CIELAB under D65: lightness 0-100, a (green to red), b (blue to yellow).
///
/// ```
/// # use acm_concept::color::Lab;
/// let red = Lab::from_srgb([255, 0, 0]);
/// assert!((red.l - 53.2).abs() < 0.1 && (red.a - 80.1).abs() < 0.1 && (red.b - 67.2).abs() < 0.1);
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Lab {
    /// Lightness, 0-100.
    pub l: f64,
    /// Green (negative) to red (positive).
    pub a: f64,
    /// Blue (negative) to yellow (positive).
    pub b: f64,
}

impl Lab {
    /// From 8-bit sRGB (IEC 61966-2-1 transfer curve, D65 white).
    pub fn from_srgb(rgb: [u8; 3]) -> Lab {
        let [r, g, b] = rgb.map(|channel| {
            let c = f64::from(channel) / 255.0;
            if c <= 0.04045 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) }
        });
        let x = (0.4124564 * r + 0.3575761 * g + 0.1804375 * b) / 0.95047;
        let y = 0.2126729 * r + 0.7151522 * g + 0.0721750 * b;
        let z = (0.0193339 * r + 0.1191920 * g + 0.9503041 * b) / 1.08883;
        let f = |t: f64| if t > 216.0 / 24389.0 { t.cbrt() } else { (24389.0 / 27.0 * t + 16.0) / 116.0 };
        let (fx, fy, fz) = (f(x), f(y), f(z));
        Lab { l: 116.0 * fy - 16.0, a: 500.0 * (fx - fy), b: 200.0 * (fy - fz) }
    }
    /// Distance from grey.
    pub fn chroma(&self) -> f64 {
        self.a.hypot(self.b)
    }
    /// Hue angle in radians, (-pi, pi].
    pub fn hue(&self) -> f64 {
        self.b.atan2(self.a)
    }
    /// Euclidean distance (CIE76 delta E).
    pub fn distance(&self, other: &Lab) -> f64 {
        ((self.l - other.l).powi(2) + (self.a - other.a).powi(2) + (self.b - other.b).powi(2)).sqrt()
    }
    /// Distance in the a-b plane, which shading changes less than lightness.
    pub fn chroma_distance(&self, other: &Lab) -> f64 {
        (self.a - other.a).hypot(self.b - other.b)
    }
}

/// Hues that a palette tells apart, from 0 radians on in equal steps, and greys, from dark to light.
const HUES: usize = 8;
const GREYS: [f64; 3] = [18.0, 52.0, 86.0];
/// Chroma below which a colour is a grey, and from which on it has a hue; between the two it is some of either.
const GREY_CHROMA: f64 = 9.0;
const HUE_CHROMA: f64 = 19.0;

/// Which share of a surface has which colour: eight hues, then dark, middle and light grey. A colour between two of them
/// counts for either, so that what is seen in another light changes a little and never jumps. Sums to 1, or to 0 where
/// nothing is known.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Palette([f64; HUES + GREYS.len()]);

impl Palette {
    /// Adds one colour with a weight.
    pub fn add(&mut self, color: &Lab, weight: f64) {
        let vivid = ((color.chroma() - GREY_CHROMA) / (HUE_CHROMA - GREY_CHROMA)).clamp(0.0, 1.0);
        let turn = color.hue().rem_euclid(std::f64::consts::TAU) / std::f64::consts::TAU * HUES as f64;
        let (hue, between) = (turn.floor() as usize % HUES, turn.fract());
        let mut give = |slot: usize, share: f64| self.0[slot] += weight * share;
        give(hue, vivid * (1.0 - between));
        give((hue + 1) % HUES, vivid * between);
        let lightness = color.l.clamp(GREYS[0], GREYS[2]);
        let low = usize::from(lightness >= GREYS[1]);
        let between = (lightness - GREYS[low]) / (GREYS[low + 1] - GREYS[low]);
        give(HUES + low, (1.0 - vivid) * (1.0 - between));
        give(HUES + low + 1, (1.0 - vivid) * between);
    }
    /// The same shares with the sum 1.
    pub fn normalised(self) -> Palette {
        let sum: f64 = self.0.iter().sum();
        if sum > 0.0 { Palette(self.0.map(|share| share / sum)) } else { self }
    }
    /// Between this palette and another one: `share` of the way.
    pub fn towards(&self, other: &Palette, share: f64) -> Palette {
        if self.is_unknown() {
            return *other;
        }
        let mut mixed = self.0;
        mixed.iter_mut().zip(other.0).for_each(|(own, other)| *own += share * (other - *own));
        Palette(mixed)
    }
    /// Whether nothing is known.
    pub fn is_unknown(&self) -> bool {
        self.0.iter().all(|share| *share == 0.0)
    }
    /// How unlike two palettes are, 0 for equal ones to 1 for ones without a common colour: the symmetric chi-square
    /// distance, in which a small share of a colour that the other lacks counts more than the same difference of a large one.
    pub fn distance(&self, other: &Palette) -> f64 {
        let terms = self.0.iter().zip(other.0).filter(|(a, b)| *a + b > 0.0);
        0.5 * terms.map(|(a, b)| (a - b).powi(2) / (a + b)).sum::<f64>()
    }
}

/// What a segment looks like: mean colour, the standard deviation around it, and the colours in it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Appearance {
    /// Mean colour.
    pub mean: Lab,
    /// Root mean square distance of the pixels from the mean, in delta E.
    pub spread: f64,
    /// The shares of colours; of one where nothing is said of it.
    #[serde(default, skip_serializing_if = "Palette::is_unknown")]
    pub palette: Palette,
}

impl Appearance {
    /// Of a surface that has one colour, but for a spread.
    pub fn plain(mean: Lab, spread: f64) -> Appearance {
        let mut palette = Palette::default();
        palette.add(&mean, 1.0);
        Appearance { mean, spread, palette }
    }
}
