//! Letters in pictures.

use font8x8::{BASIC_FONTS, UnicodeFonts};
use image::{Rgb, RgbImage};

/// Distance between letters, pixels.
pub const ADVANCE: u32 = 8;
/// Distance between lines, pixels.
pub const LINE: u32 = 12;

/// Writes a text with its upper left corner at a pixel; what lies outside of the picture is left out, and signs that
/// the font does not have are blanks.
pub fn write(image: &mut RgbImage, left: i64, top: i64, text: &str, color: Rgb<u8>) {
    for (place, sign) in (0i64..).zip(text.chars()) {
        let rows = BASIC_FONTS.get(sign).unwrap_or_default();
        for (row, bits) in (0i64..).zip(rows) {
            for column in (0..8).filter(|column| bits & (1 << column) != 0) {
                dot(image, left + place * i64::from(ADVANCE) + column, top + row, color);
            }
        }
    }
}

/// Sets one pixel, if there is such a one.
pub fn dot(image: &mut RgbImage, column: i64, row: i64, color: Rgb<u8>) {
    let (Ok(column), Ok(row)) = (u32::try_from(column), u32::try_from(row)) else { return };
    if let Some(pixel) = image.get_pixel_mut_checked(column, row) {
        *pixel = color;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn letters_are_drawn_where_they_belong_and_nowhere_else() {
        let mut image = RgbImage::new(40, 10);
        write(&mut image, 8, 1, "I", Rgb([255; 3]));
        let lit: Vec<(u32, u32)> =
            image.enumerate_pixels().filter(|(.., p)| p.0[0] > 0).map(|(x, y, _)| (x, y)).collect();
        assert!(lit.len() > 8 && lit.iter().all(|(x, y)| (8..16).contains(x) && (1..9).contains(y)), "{lit:?}");
        write(&mut image, -20, -20, "outside", Rgb([255; 3]));
    }
}
