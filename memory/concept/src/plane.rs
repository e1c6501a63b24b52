//! One plane of an image, shared and read-only.

use std::{fmt, ops::Deref, sync::Arc};

/// The values of one image plane, row by row. Cloning copies no value: clones share one owner.
///
/// The owner is whatever holds the values: a vector, or a piece of memory that another process filled. It is dropped
/// with the last clone. Each use of the plane asks the owner for its slice, so a loop over pixels should take the slice
/// once.
///
/// ```
/// # use acm_concept::plane::Plane;
/// let depth: Plane<f32> = vec![0.5, 0.75].into();
/// let shared = depth.clone();
/// assert_eq!(shared.as_ptr(), depth.as_ptr());
/// assert_eq!(shared[1], 0.75);
/// ```
pub struct Plane<T>(Arc<dyn AsRef<[T]> + Send + Sync>);

impl<T> Plane<T> {
    /// A plane whose values stay where `owner` has them. The owner must give the same slice each time.
    pub fn of(owner: impl AsRef<[T]> + Send + Sync + 'static) -> Plane<T> {
        Plane(Arc::new(owner))
    }
}

impl<T> Deref for Plane<T> {
    type Target = [T];
    fn deref(&self) -> &[T] {
        (*self.0).as_ref()
    }
}

impl<T> Clone for Plane<T> {
    fn clone(&self) -> Self {
        Plane(Arc::clone(&self.0))
    }
}

impl<T: Send + Sync + 'static> From<Vec<T>> for Plane<T> {
    fn from(values: Vec<T>) -> Self {
        Plane::of(values)
    }
}

impl<T: Send + Sync + 'static> From<Arc<[T]>> for Plane<T> {
    fn from(values: Arc<[T]>) -> Self {
        Plane::of(values)
    }
}

/// The number of values: a whole image would drown any message.
impl<T> fmt::Debug for Plane<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Plane({} values)", self.len())
    }
}

impl<T: PartialEq> PartialEq for Plane<T> {
    fn eq(&self, other: &Self) -> bool {
        **self == **other
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_plane_is_a_view_into_its_owner() {
        let owner: Arc<[u8]> = Arc::from([1, 2, 3]);
        let plane = Plane::from(Arc::clone(&owner));
        let clone = plane.clone();
        drop(plane);
        assert_eq!(clone.as_ptr(), owner.as_ptr());
        assert_eq!(Arc::strong_count(&owner), 2);
        drop(clone);
        assert_eq!(Arc::strong_count(&owner), 1);
    }

    #[test]
    fn planes_are_equal_when_their_values_are() {
        let plane: Plane<u8> = vec![1, 2].into();
        assert_eq!(plane, Plane::from(Arc::<[u8]>::from([1, 2])));
        assert_ne!(plane, vec![1, 3].into());
        assert_eq!(format!("{plane:?}"), "Plane(2 values)");
    }
}
