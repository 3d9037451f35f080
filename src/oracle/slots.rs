//! The samples of a pixel in the dense list. Twin of `glsl/include/slots.glsl`, exact.

use std::ops::Range;

/// First slots of the pixels in list order, and the end; and the same of what a fill added behind the list, empty without
/// one.
#[derive(Debug, Clone, Copy)]
pub struct Slots<'a> {
    /// One more than there are pixels.
    pub offsets: &'a [u32],
    /// As many, or none.
    pub extras: &'a [u32],
}

impl Slots<'_> {
    /// Slots of a pixel, in order.
    pub fn of(self, index: usize) -> std::iter::Chain<Range<usize>, Range<usize>> {
        let run = |list: &[u32]| list.get(index + 1).map_or(0..0, |end| list[index] as usize..*end as usize);
        run(self.offsets).chain(run(self.extras))
    }
}
