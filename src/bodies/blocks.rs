//! The blocks of bodies into which an ensemble is cut, whatever engine computes them and in how many parts.

use std::ops::Range;

/// The most blocks of an ensemble, as long as blocks hold fewer than [`LARGEST`] bodies.
const MOST: usize = 1 << 9;

/// The most bodies of a block.
const LARGEST: usize = 1 << 16;

/// Consecutive bodies in blocks of one size, a power of two that depends only on the number of all bodies.
///
/// Statistics are formed block by block and merged in the order of the blocks, and parts of an ensemble end where blocks do, so that
/// results do not depend on the number of parts.
///
/// ```
/// use polhode::bodies::Blocks;
///
/// assert_eq!((Blocks::of(500).size(), Blocks::of(100_000).size()), (1, 256));
/// // The blocks of a part, in its own indices.
/// let blocks = Blocks::of(100_000);
/// assert_eq!(blocks.bodies_of_part(0, 7), 0..14080);
/// assert_eq!(blocks.bodies_of_part(6, 7), 85760..100_000);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Blocks {
    body_count: usize,
    size: usize,
}

impl Blocks {
    /// The blocks of an ensemble of `body_count` bodies.
    pub fn of(body_count: usize) -> Self {
        let size = body_count.div_ceil(MOST).next_power_of_two().min(LARGEST);
        Self { body_count, size }
    }

    /// Number of bodies in a block; the last block may have fewer.
    pub fn size(&self) -> usize {
        self.size
    }

    /// Number of blocks.
    pub fn count(&self) -> usize {
        self.body_count.div_ceil(self.size)
    }

    /// The bodies of one of `count` parts, numbered from 0; parts have as nearly equal numbers of blocks as possible.
    ///
    /// # Panics
    ///
    /// If `count` is 0.
    pub fn bodies_of_part(&self, part: usize, count: usize) -> Range<usize> {
        let start = |part: usize| {
            let blocks = (part as u128 * self.count() as u128 / count as u128) as usize;
            (blocks * self.size).min(self.body_count)
        };
        start(part)..start(part + 1)
    }

    /// The intersections of the blocks with a range of bodies.
    pub(crate) fn within(&self, bodies: &Range<usize>) -> impl Iterator<Item = Range<usize>> + Clone + use<> {
        let (size, bodies) = (self.size, bodies.clone());
        let blocks = if bodies.is_empty() { 0..0 } else { bodies.start / size..bodies.end.div_ceil(size) };
        blocks.map(move |block| (block * size).max(bodies.start)..((block + 1) * size).min(bodies.end))
    }
}

/// Cuts rows into ranges of at most `most`; each ends at one of `ends`, ascending, if one lies within reach.
pub(crate) fn cut(rows: usize, most: usize, ends: &[usize]) -> Vec<Range<usize>> {
    let (mut ranges, mut start) = (Vec::new(), 0);
    while start < rows {
        let reach = start.saturating_add(most.max(1)).min(rows);
        let last = ends[..ends.partition_point(|&end| end <= reach)].last().copied().filter(|&end| end > start);
        let end = if reach == rows { rows } else { last.unwrap_or(reach) };
        ranges.push(start..end);
        start = end;
    }
    ranges
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_cover_all_bodies_once_and_end_where_blocks_do() {
        for body_count in [0, 1, 5, 1023, 1024, 1025, 4096, 100_001, 1 << 26, (1 << 26) + 1, 100_000_000] {
            let blocks = Blocks::of(body_count);
            assert!(blocks.size().is_power_of_two() && blocks.size() <= LARGEST);
            assert!(blocks.count() <= MOST || blocks.size() == LARGEST, "{body_count}");
            for count in [1, 2, 7, 64] {
                let mut end = 0;
                for part in 0..count {
                    let bodies = blocks.bodies_of_part(part, count);
                    assert_eq!(bodies.start, end);
                    assert!(bodies.start.is_multiple_of(blocks.size()) || bodies.is_empty());
                    let within: usize = blocks.within(&bodies).map(|block| block.len()).sum();
                    assert_eq!(within, bodies.len());
                    end = bodies.end;
                }
                assert_eq!(end, body_count);
            }
        }
        assert_eq!(cut(10, 4, &[]), [0..4, 4..8, 8..10]);
        assert_eq!(cut(10, 4, &[3, 3, 9]), [0..3, 3..7, 7..10]);
        assert_eq!(cut(10, 10, &[3]), std::iter::once(0..10).collect::<Vec<_>>());
        assert!(cut(0, 4, &[0]).is_empty());
        assert_eq!(Blocks::of(5000).within(&(3..33)).collect::<Vec<_>>(), [3..16, 16..32, 32..33]);
    }
}
