//! How a frame lies in a chunk of shared memory. The one file of the runtime with unsafe code: bytes are copied into
//! memory that was not initialised, so that a frame is written once and never cleared beforehand.
#![allow(unsafe_code, reason = "a loan is filled in place; every block below says why it is sound")]

use super::{
    super::{ByteFrame, MAX_PLANES},
    Service,
};
use bytes::Bytes;
use iceoryx2::{prelude::ZeroCopySend, sample_mut::SampleMut, sample_mut_uninit::SampleMutUninit};
use std::{mem::MaybeUninit, ptr};

/// Header and planes begin at multiples of this many bytes.
const ALIGNMENT: usize = 64;

/// A piece of the payload.
#[repr(C)]
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, ZeroCopySend)]
pub struct Extent {
    /// Where it begins, bytes from the start of the payload.
    pub offset: u64,
    /// How long it is, bytes.
    pub bytes: u64,
}

/// What goes along with each payload, in the same form in every process.
#[repr(C)]
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, ZeroCopySend)]
#[type_name("acm/FrameTag/1")]
pub struct FrameTag {
    /// The frame's number.
    pub number: u64,
    /// Width, pixels.
    pub width: u32,
    /// Height, pixels.
    pub height: u32,
    /// How many of the planes are used.
    pub planes: u64,
    /// Where the header lies.
    pub header: Extent,
    /// Where the planes lie.
    pub plane: [Extent; MAX_PLANES],
}

/// Payload bytes that are enough for a frame wherever its chunk begins.
pub fn payload_bytes(frame_bytes: usize) -> usize {
    frame_bytes + ALIGNMENT * (MAX_PLANES + 1)
}

/// Writes a frame into a loan of at least [`payload_bytes`], which must have at most [`MAX_PLANES`] planes.
pub fn fill(
    mut loan: SampleMutUninit<Service, [MaybeUninit<u8>], FrameTag>,
    number: u64,
    frame: &ByteFrame,
) -> SampleMut<Service, [u8], FrameTag> {
    let mut tag = FrameTag { number, width: frame.size[0], height: frame.size[1], ..FrameTag::default() };
    let mut rest = loan.payload_mut();
    let base = rest.as_ptr().addr();
    for (index, part) in std::iter::once(&frame.header).chain(&frame.planes).enumerate() {
        let gap = rest.as_ptr().addr().next_multiple_of(ALIGNMENT) - rest.as_ptr().addr();
        let (padding, from_here) = rest.split_at_mut(gap);
        let (target, behind) = from_here.split_at_mut(part.len());
        let extent = Extent { offset: (target.as_ptr().addr() - base) as u64, bytes: part.len() as u64 };
        match index.checked_sub(1) {
            None => tag.header = extent,
            Some(plane) => (tag.plane[plane], tag.planes) = (extent, index as u64),
        }
        clear(padding);
        // SAFETY: `target` was split off with exactly `part.len()` bytes and is borrowed exclusively, so it overlaps no
        // source; `MaybeUninit<u8>` has the layout of `u8`.
        unsafe { ptr::copy_nonoverlapping(part.as_ptr(), target.as_mut_ptr().cast::<u8>(), part.len()) };
        rest = behind;
    }
    clear(rest);
    *loan.user_header_mut() = tag;
    // SAFETY: the loop cut the payload into paddings, targets and the last rest, without leaving anything out, and wrote
    // all of them.
    unsafe { loan.assume_init() }
}

fn clear(bytes: &mut [MaybeUninit<u8>]) {
    for byte in bytes {
        byte.write(0);
    }
}

/// Cuts a payload into a frame as its tag says. The tag comes from another process and is believed in nothing.
pub fn cut(tag: &FrameTag, payload: &Bytes) -> Result<ByteFrame, String> {
    let planes = usize::try_from(tag.planes).ok().and_then(|count| tag.plane.get(..count));
    let planes = planes.ok_or_else(|| format!("it names {} planes, at most {MAX_PLANES} are possible", tag.planes))?;
    let cut = |extent: &Extent| {
        let end = extent.offset.checked_add(extent.bytes).filter(|end| *end <= payload.len() as u64);
        let end = end.ok_or_else(|| format!("{extent:?} reaches beyond its {} bytes", payload.len()))?;
        Ok::<Bytes, String>(payload.slice(extent.offset as usize..end as usize))
    };
    Ok(ByteFrame {
        size: [tag.width, tag.height],
        header: cut(&tag.header)?,
        planes: planes.iter().map(cut).collect::<Result<_, _>>()?,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tag_that_reaches_beyond_its_payload_is_refused() {
        let payload = Bytes::from_static(b"headerPLANE");
        let header = Extent { offset: 0, bytes: 6 };
        let tag = |plane, planes| FrameTag { header, planes, plane: [plane; MAX_PLANES], ..FrameTag::default() };
        let good = cut(&tag(Extent { offset: 6, bytes: 5 }, 1), &payload).unwrap();
        assert_eq!((&good.header[..], &good.planes[0][..]), (&b"header"[..], &b"PLANE"[..]));
        for (offset, bytes, planes) in [(6, 6, 1), (u64::MAX, 1, 1), (12, 0, 1), (6, 5, 5), (6, 5, u64::MAX)] {
            assert!(cut(&tag(Extent { offset, bytes }, planes), &payload).is_err(), "{offset} {bytes} {planes}");
        }
    }
}
