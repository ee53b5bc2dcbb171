//! Time-dependent values that are the same for all bodies, kept from the first tile of a block for the following ones.

use crate::math::real::{Real, Scalar};

/// The most numbers kept for one torque: 128 KiB in `f64`, which fit into the second-level cache.
const MOST_NUMBERS: usize = 16_384;

/// Numbers for each time that a tile evaluates, in the order of its equal steps and their stages, which is the same for all tiles.
#[derive(Clone, Debug)]
pub(super) struct Kept<T> {
    /// The parameters with which the numbers were computed.
    parameters: Vec<T>,
    /// How many numbers belong to one time.
    width: usize,
    numbers: Vec<T>,
}

impl<T: Scalar> Kept<T> {
    /// An empty store, for `width` numbers at each time.
    pub fn new(width: usize) -> Self {
        Self { parameters: Vec::new(), width, numbers: Vec::new() }
    }

    /// Begins a tile whose bodies share these parameters. Numbers kept for other parameters are discarded.
    pub fn begin(&mut self, parameters: impl Iterator<Item = T> + Clone) {
        let bits = |number: T| number.to_f64().to_bits();
        if !self.parameters.iter().copied().map(bits).eq(parameters.clone().map(bits)) {
            self.parameters.clear();
            self.parameters.extend(parameters);
            self.numbers.clear();
        }
    }

    /// The numbers at a time, if they are known.
    #[inline(always)]
    pub fn at(&self, time: usize) -> Option<&[T]> {
        self.numbers.get(time * self.width..(time + 1) * self.width)
    }

    /// Keeps the first lane of the numbers at a time; those of earlier times are known, or there is no room for them.
    #[inline(always)]
    pub fn keep<R: Real<Scalar = T>>(&mut self, time: usize, numbers: impl Iterator<Item = R>) {
        if self.numbers.len() != time * self.width || self.numbers.len() + self.width > MOST_NUMBERS {
            return;
        }
        let mut lanes = [T::default(); crate::math::clock::MOST_LANES];
        for number in numbers {
            number.store(&mut lanes);
            self.numbers.push(lanes[0]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_kept_in_the_order_of_their_times_until_parameters_change() {
        let mut kept = Kept::<f64>::new(2);
        kept.begin([1.0, 2.0].into_iter());
        assert!(kept.at(0).is_none());
        kept.keep(0, [3.0, 4.0].into_iter());
        kept.keep(2, [9.0, 9.0].into_iter());
        kept.keep(1, [5.0, 6.0].into_iter());
        assert_eq!([kept.at(0), kept.at(1), kept.at(2)], [Some(&[3.0, 4.0][..]), Some(&[5.0, 6.0][..]), None]);
        kept.begin([1.0, 2.0].into_iter());
        assert_eq!(kept.at(1), Some(&[5.0, 6.0][..]), "another tile of the same bodies");
        kept.begin([1.0, 2.5].into_iter());
        assert!(kept.at(0).is_none(), "bodies of other parameters");
    }

    #[test]
    fn no_more_is_kept_than_there_is_room_for() {
        let mut kept = Kept::<f64>::new(4);
        for time in 0..MOST_NUMBERS {
            kept.keep(time, [time as f64; 4].into_iter());
        }
        assert_eq!(kept.numbers.len(), MOST_NUMBERS);
        let last = MOST_NUMBERS / 4 - 1;
        assert_eq!((kept.at(last), kept.at(last + 1)), (Some(&[last as f64; 4][..]), None));
    }
}
