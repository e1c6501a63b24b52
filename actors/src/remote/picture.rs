//! Frames as bytes and back: colour as 8-bit RGB, then depth as 32-bit floats.

use acm_concept::{
    camera::{FrameHeader, RgbdFrame},
    plane::Plane,
};
use acm_runtime::frame_bus::{ByteFrame, Bytes};

/// Raw bytes of a frame with this many pixels.
pub fn raw_bytes(pixels: usize) -> usize {
    7 * pixels
}

/// A frame's planes as bytes, in the order in which they are sent. Nothing is copied where floats are little endian.
pub fn planes(frame: &RgbdFrame) -> [Bytes; 2] {
    let depth = if cfg!(target_endian = "little") {
        Bytes::from_owner(DepthBytes(frame.depth.clone()))
    } else {
        frame.depth.iter().flat_map(|depth| depth.to_le_bytes()).collect()
    };
    [Bytes::from_owner(frame.color.clone()), depth]
}

/// A frame for a bus. Its header stays with the message that names it.
pub fn byte_frame(frame: &RgbdFrame) -> ByteFrame {
    let intrinsics = frame.header.intrinsics;
    ByteFrame { size: [intrinsics.width, intrinsics.height], header: Bytes::new(), planes: planes(frame).into() }
}

/// The frame whose colour and depth these are. The planes stay where they are, unless floats cannot be read from there.
pub fn frame(header: FrameHeader, color: Bytes, depth: Bytes) -> Result<RgbdFrame, String> {
    if !depth.len().is_multiple_of(4) {
        return Err(format!("a depth plane of {} bytes holds no whole number of floats", depth.len()));
    }
    let readable = cfg!(target_endian = "little") && bytemuck::try_cast_slice::<u8, f32>(&depth).is_ok();
    let depth = match readable {
        true => Plane::of(Floats(depth)),
        false => Plane::from(depth.chunks_exact(4).map(float).collect::<Vec<f32>>()),
    };
    RgbdFrame::new(header, Plane::of(color), depth).map_err(|e| e.to_string())
}

fn float(bytes: &[u8]) -> f32 {
    f32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]])
}

/// Floats seen as bytes.
struct DepthBytes(Plane<f32>);

impl AsRef<[u8]> for DepthBytes {
    fn as_ref(&self) -> &[u8] {
        bytemuck::cast_slice(&self.0)
    }
}

/// Bytes seen as floats; made only of bytes that can be.
struct Floats(Bytes);

impl AsRef<[f32]> for Floats {
    fn as_ref(&self) -> &[f32] {
        bytemuck::cast_slice(&self.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use acm_concept::{camera::Intrinsics, ids::FrameId, pose::Pose, time::Time};

    fn example() -> RgbdFrame {
        let header = FrameHeader {
            id: FrameId(3),
            camera: "head".into(),
            time: Time(5),
            intrinsics: Intrinsics::from_vertical_fov(3, 2, 1.0),
            camera_pose: Pose::IDENTITY,
        };
        let depth: Vec<f32> = (0..6).map(|i| i as f32 * 0.1).collect();
        RgbdFrame::new(header, (0..18).collect::<Vec<u8>>().into(), depth.into()).unwrap()
    }

    #[test]
    fn a_frame_survives_and_its_planes_stay_where_they_are() {
        let original = example();
        let [color, depth] = planes(&original);
        assert_eq!(color.len() + depth.len(), raw_bytes(6));
        let back = frame(original.header.clone(), color, depth).unwrap();
        assert_eq!(back, original);
        assert_eq!((back.color.as_ptr(), back.depth.as_ptr()), (original.color.as_ptr(), original.depth.as_ptr()));
    }

    #[test]
    fn floats_that_begin_anywhere_are_read() {
        let original = example();
        let [color, depth] = planes(&original);
        for shift in 0..4 {
            let shifted = [vec![0; shift], depth.to_vec()].concat();
            let shifted = Bytes::from(shifted).slice(shift..);
            assert_eq!(frame(original.header.clone(), color.clone(), shifted).unwrap(), original);
        }
    }

    #[test]
    fn planes_of_another_size_are_refused() {
        let original = example();
        let [color, depth] = planes(&original);
        assert!(frame(original.header.clone(), color.slice(1..), depth.clone()).is_err());
        assert!(frame(original.header.clone(), color.clone(), depth.slice(4..)).is_err());
        assert!(frame(original.header, color, depth.slice(..23)).is_err());
    }
}
