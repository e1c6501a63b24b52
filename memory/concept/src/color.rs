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

/// What a segment looks like: mean colour and the standard deviation around it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Appearance {
    /// Mean colour.
    pub mean: Lab,
    /// Root mean square distance of the pixels from the mean, in delta E.
    pub spread: f64,
}
