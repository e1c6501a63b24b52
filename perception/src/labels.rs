//! Label images: which pixel belongs to which object.

use acm_concept::object::Percepts;
use image::{ImageBuffer, Luma};

/// A 16-bit label image as it is written to a PNG file.
pub type LabelImage = ImageBuffer<Luma<u16>, Vec<u16>>;

/// Draws the pixels of every object in a value of its own: 0 is background, object i of `percepts` is i + 1.
///
/// Where two objects claim a pixel the one with fewer pixels keeps it, as it is the one in front or on top.
pub fn draw(percepts: &Percepts) -> LabelImage {
    let (width, height) = (percepts.frame.intrinsics.width, percepts.frame.intrinsics.height);
    let mut values = vec![0u16; width as usize * height as usize];
    let mut order: Vec<usize> = (0..percepts.objects.len().min(usize::from(u16::MAX))).collect();
    order.sort_by_key(|&i| std::cmp::Reverse(percepts.objects[i].support.count));
    for object in order {
        for pixel in percepts.objects[object].support.indices() {
            if let Some(value) = values.get_mut(pixel) {
                *value = object as u16 + 1;
            }
        }
    }
    ImageBuffer::from_raw(width, height, values).unwrap_or_else(|| ImageBuffer::new(width, height))
}
