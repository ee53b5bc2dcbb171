//! Quantiles of many numbers from counts in narrow intervals, which merge exactly.

/// The greatest relative distance of a quantile of a [`Sketch`] of more than 2,048 numbers from the number of its rank: half an interval.
pub const QUANTILE_ERROR: f64 = 1.0 / 4096.0;

/// The low bits of a number that an interval ignores: 11 of the fraction's 52 are kept.
const OPEN_BITS: u32 = 52 - 11;

/// Number of intervals in a page, which is an octave.
const PAGE: u64 = 1 << 11;

/// The most pages: one for each sign and exponent.
const PAGES: usize = 1 << 12;

/// The most numbers that are kept one by one, before pages take their place: as many as take the space of two.
pub const FEW: usize = 1 << 11;

/// Stands for a page that has not been looked up.
const NOWHERE: u16 = u16::MAX;

/// Counts of numbers in intervals; the numbers of an interval have the same sign, exponent and first eleven bits of the fraction.
///
/// Counts are integers, so that the sketch of all numbers is the sum of those of any parts, in any order. (Intervals of constant
/// relative width are those of C. Masson, J. E. Rim, H. K. Lee, *DDSketch*, PVLDB 12 (2019) 2195, with the logarithm of base 2 replaced by
/// the piecewise linear one that a floating-point number holds.)
///
/// Up to 2,048 numbers are kept one by one, so that their quantiles are exact, and many sketches of few numbers take little memory.
#[derive(Clone, Debug, Default)]
pub struct Sketch {
    /// All numbers ([`ordered`]), if there are few.
    few: Vec<u64>,
    /// Ascending by number; empty as long as there are few numbers.
    pages: Vec<Page>,
    count: u64,
}

impl PartialEq for Sketch {
    fn eq(&self, other: &Self) -> bool {
        self.sorted() == other.sorted() && self.pages == other.pages && self.count == other.count
    }
}

/// The intervals of an octave of one sign.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Page {
    number: u64,
    counts: Vec<u32>,
}

/// What a sketch is written as: its numbers, if there are few, and runs of counts: the number of the first interval, and the counts from
/// there on.
#[cfg(feature = "study")]
type Written = (Vec<u64>, Vec<(u64, Vec<u32>)>);

#[cfg(feature = "study")]
impl serde::Serialize for Sketch {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut runs: Vec<(u64, Vec<u32>)> = Vec::new();
        self.for_each(|interval, count| {
            match runs.last_mut() {
                Some((first, counts)) if *first + counts.len() as u64 == interval => counts.push(count),
                _ => runs.push((interval, vec![count])),
            }
            true
        });
        let written: Written = (self.sorted(), runs);
        written.serialize(serializer)
    }
}

#[cfg(feature = "study")]
impl<'de> serde::Deserialize<'de> for Sketch {
    fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let (few, runs) = Written::deserialize(deserializer)?;
        if few.len() > FEW || !few.is_empty() && !runs.is_empty() {
            return Err(serde::de::Error::custom("more than few numbers one by one"));
        }
        let mut sketch = Self { count: few.len() as u64, few, pages: Vec::new() };
        for (first, counts) in runs {
            if first.saturating_add(counts.len() as u64) > 1 << (u64::BITS - OPEN_BITS) {
                return Err(serde::de::Error::custom("an interval of no number"));
            }
            for (interval, count) in (first..).zip(counts) {
                sketch.add(interval, count);
            }
        }
        Ok(sketch)
    }
}

/// The bits of a number, mapped so that they sort as the numbers do.
fn ordered(x: f64) -> u64 {
    let bits = x.to_bits();
    if bits >> 63 == 1 { !bits } else { bits | 1 << 63 }
}

fn from_ordered(ordered: u64) -> f64 {
    f64::from_bits(if ordered >> 63 == 1 { ordered ^ 1 << 63 } else { !ordered })
}

impl Sketch {
    /// Counts numbers; those that are not finite are left out.
    pub fn extend(&mut self, numbers: impl IntoIterator<Item = f64>) {
        // Zeros of both signs count as one.
        let finite = numbers.into_iter().filter(|x| x.is_finite());
        let mut numbers = finite.map(|x| ordered(x + 0.0));
        while self.is_few() && self.few.len() < FEW {
            let Some(number) = numbers.next() else { return };
            self.few.push(number);
            self.count += 1;
        }
        let mut keys = numbers.map(|number| number >> OPEN_BITS).peekable();
        if keys.peek().is_none() {
            return;
        }
        self.spread();
        // The index of each page met so far; inserting a page invalidates them all.
        let mut places = [NOWHERE; PAGES];
        for key in keys {
            let (number, interval) = (key / PAGE, (key % PAGE) as usize);
            let mut place = usize::from(places[number as usize]);
            if place == usize::from(NOWHERE) {
                let before = self.pages.len();
                place = self.page(number);
                if self.pages.len() > before {
                    places.fill(NOWHERE);
                }
                places[number as usize] = place as u16;
            }
            self.pages[place].counts[interval] += 1;
            self.count += 1;
        }
    }

    /// Adds the counts of another sketch.
    pub fn merge(&mut self, other: &Self) {
        if other.is_few() {
            let room = if self.is_few() { FEW - self.few.len() } else { 0 };
            let (kept, counted) = other.few.split_at(room.min(other.few.len()));
            self.few.extend(kept);
            self.count += kept.len() as u64;
            counted.iter().for_each(|&number| self.add(number >> OPEN_BITS, 1));
            return;
        }
        self.spread();
        for Page { number, counts } in &other.pages {
            let page = self.page(*number);
            self.pages[page].counts.iter_mut().zip(counts).for_each(|(own, count)| *own += count);
        }
        self.count += other.count;
    }

    /// Whether the numbers are kept one by one.
    fn is_few(&self) -> bool {
        self.pages.is_empty()
    }

    /// Few numbers, ascending.
    fn sorted(&self) -> Vec<u64> {
        let mut sorted = self.few.clone();
        sorted.sort_unstable();
        sorted
    }

    /// Counts so many numbers of an interval.
    fn add(&mut self, interval: u64, count: u32) {
        self.spread();
        let page = self.page(interval / PAGE);
        let place = &mut self.pages[page].counts[(interval % PAGE) as usize];
        *place = place.saturating_add(count);
        self.count += u64::from(count);
    }

    /// Moves few numbers to pages.
    fn spread(&mut self) {
        for number in std::mem::take(&mut self.few) {
            let interval = number >> OPEN_BITS;
            let page = self.page(interval / PAGE);
            self.pages[page].counts[(interval % PAGE) as usize] += 1;
        }
    }

    /// Passes the intervals of pages that have numbers, ascending, with their counts, as long as `take` returns true.
    fn for_each(&self, mut take: impl FnMut(u64, u32) -> bool) {
        let of_page = |page: &Page| {
            let first = page.number * PAGE;
            let counts = page.counts.iter().enumerate().filter(|(_, count)| **count > 0);
            counts.map(|(place, &count)| (first + place as u64, count)).collect::<Vec<_>>()
        };
        for (interval, count) in self.pages.iter().flat_map(of_page) {
            if !take(interval, count) {
                return;
            }
        }
    }

    /// The index of a page, which is created if necessary.
    fn page(&mut self, number: u64) -> usize {
        match self.pages.binary_search_by_key(&number, |page| page.number) {
            Ok(place) => place,
            Err(place) => {
                self.pages.insert(place, Page { number, counts: vec![0; PAGE as usize] });
                place
            }
        }
    }

    /// Number of numbers counted.
    pub fn count(&self) -> u64 {
        self.count
    }

    /// The number of rank ⌈`percent` n/100⌉ of n, from 1 (the nearest-rank quantile), to a relative [`QUANTILE_ERROR`] if they are more than
    /// 2,048; NaN for an empty sketch.
    pub fn quantile(&self, percent: f64) -> f64 {
        let rank = nearest_rank(percent, self.count);
        if self.few.len() >= rank as usize {
            return from_ordered(*self.few.clone().select_nth_unstable(rank as usize - 1).1);
        }
        let (mut below, mut found) = (0, f64::NAN);
        self.for_each(|interval, count| {
            below += u64::from(count);
            if below >= rank {
                let (low, high) = (interval << OPEN_BITS, ((interval + 1) << OPEN_BITS) - 1);
                // The interval at zero also holds what is below the least normal number.
                let (low, high) = (from_ordered(low), from_ordered(high));
                found = if low <= 0.0 && high >= 0.0 { 0.0 } else { 0.5 * low + 0.5 * high };
            }
            below < rank
        });
        found
    }
}

/// The rank ⌈`percent` n/100⌉ of n numbers, from 1. Rounding puts no product that is whole above itself.
pub(super) fn nearest_rank(percent: f64, count: u64) -> u64 {
    const ROUNDING: f64 = 4.0 * f64::EPSILON;
    ((percent * count as f64 / 100.0 * (1.0 - ROUNDING)).ceil() as u64).clamp(1, count.max(1))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Numbers over many octaves, of both signs.
    fn numbers(count: u32) -> Vec<f64> {
        let spread = |k: u32| f64::from(k.wrapping_mul(2_654_435_761) % 10_007) / 10_007.0 - 0.4;
        (0..count).map(|k| spread(k) * 10.0_f64.powi((k % 13) as i32 - 6)).collect()
    }

    #[test]
    fn ranks_are_those_of_whole_percentages() {
        for count in [100, 200, 1000, 10_000] {
            for percent in 1..=100 {
                assert_eq!(
                    nearest_rank(f64::from(percent), count),
                    u64::from(percent as u32) * count / 100,
                    "{percent} %"
                );
            }
        }
        for (percent, count, rank) in
            [(0.0, 5, 1), (7.0, 99, 7), (7.1, 100, 8), (2.5, 1000, 25), (0.1, 3000, 3), (50.0, 0, 1)]
        {
            assert_eq!(nearest_rank(percent, count), rank, "{percent} % of {count}");
        }
    }

    #[test]
    fn quantiles_are_those_of_sorted_numbers() {
        let mut sorted = numbers(5_000);
        let mut sketch = Sketch::default();
        sketch.extend(sorted.iter().copied());
        sorted.sort_by(f64::total_cmp);
        for percent in [0.0, 0.01, 1.0, 25.0, 50.0, 77.7, 99.0, 99.99, 100.0] {
            let rank = nearest_rank(percent, sorted.len() as u64) as usize;
            let (expected, found) = (sorted[rank - 1], sketch.quantile(percent));
            assert!(
                (found - expected).abs() <= QUANTILE_ERROR * expected.abs(),
                "{percent} %: {found:e}, {expected:e}"
            );
        }
    }

    #[test]
    fn parts_in_any_order_make_the_whole() {
        let all = numbers(5_000);
        let mut whole = Sketch::default();
        whole.extend(all.iter().copied());
        let mut merged = Sketch::default();
        for part in all.chunks(777).rev() {
            let mut sketch = Sketch::default();
            sketch.extend(part.iter().rev().copied());
            merged.merge(&sketch);
        }
        assert_eq!(whole, merged);
        assert_eq!(whole.count(), 5_000);
    }

    #[test]
    fn few_numbers_are_as_many() {
        for count in [1, 100, FEW as u32 - 1, FEW as u32, FEW as u32 + 1, 3 * FEW as u32] {
            let all = numbers(count);
            let (mut at_once, mut one_by_one) = (Sketch::default(), Sketch::default());
            at_once.extend(all.iter().copied());
            all.iter().rev().for_each(|&x| one_by_one.extend([x]));
            let mut in_pages = at_once.clone();
            in_pages.spread();
            assert_eq!(at_once, one_by_one, "{count}");
            let mut sorted = all.clone();
            sorted.sort_by(f64::total_cmp);
            assert_eq!(at_once.is_few(), count as usize <= FEW, "{count}");
            assert_eq!(at_once.count(), u64::from(count));
            for percent in [0.0, 3.0, 50.0, 99.0, 100.0] {
                let exact = sorted[nearest_rank(percent, u64::from(count)) as usize - 1];
                assert!(
                    (in_pages.quantile(percent) - exact).abs() <= QUANTILE_ERROR * exact.abs(),
                    "{percent} % of {count}"
                );
                if at_once.is_few() {
                    assert_eq!(at_once.quantile(percent), exact, "{percent} % of {count}");
                }
            }
            let mut of_parts = Sketch::default();
            for part in all.chunks(777) {
                let mut sketch = Sketch::default();
                sketch.extend(part.iter().copied());
                of_parts.merge(&sketch);
            }
            assert_eq!(of_parts, at_once, "{count}");
        }
    }

    #[test]
    fn zeros_and_what_is_no_number() {
        let mut sketch = Sketch::default();
        assert!(sketch.quantile(50.0).is_nan());
        sketch.extend([0.0, -0.0, f64::NAN, f64::INFINITY, 1.0]);
        assert_eq!((sketch.count(), sketch.quantile(50.0)), (3, 0.0));
        assert!((sketch.quantile(100.0) - 1.0).abs() <= QUANTILE_ERROR);
    }
}
