//! White noise, which is constant over a step.

use super::Columns;
use crate::math::clock::MOST_LANES;
use crate::math::real::{Real, Scalar, outlined};
use crate::math::vector::Vector;
use crate::torque::Kind;
use crate::torque::white_noise::{NoiseKey, minus_log, noise_words, normal_vector, uniform_parts, uniform_turns};

impl<R: Real> Columns<'_, R> {
    /// The torque of all instances of white noise over equal step `step` of the interval.
    #[inline(always)]
    pub(crate) fn noise(&self, step: u64) -> Vector<R> {
        let instances = self.source.table.instances(Kind::WhiteNoise);
        if instances.count == 0 {
            return Vector::zero();
        }
        outlined!(R, sum_of_draws(self, instances.first, instances.count, step))
    }

    /// One draw for each lane.
    #[inline(always)]
    fn normal_vector(&self, first: usize, draw: u64) -> Vector<R> {
        let word = |lane: usize, word: usize| {
            let digit = |column: usize| {
                self.source.parameters[(first + 2 + 2 * word + column) * self.source.stride + self.first + lane]
                    .to_f64() as u32
            };
            digit(0) | (digit(1) << 16)
        };
        let mut words = [[0_u32; 4]; MOST_LANES];
        for (lane, words) in words[..R::LANES].iter_mut().enumerate() {
            let key = NoiseKey { body: [word(lane, 0), word(lane, 1)], seed: [word(lane, 2), word(lane, 3)] };
            *words = noise_words(key, draw);
        }
        let logarithm = |index: usize| {
            minus_log(
                R::from_lanes(|lane| uniform_parts(words[lane][index]).0),
                R::from_lanes(|lane| uniform_parts(words[lane][index]).1),
            )
        };
        let angle = |index: usize| R::from_lanes(|lane| uniform_turns(words[lane][index]));
        normal_vector([logarithm(0), logarithm(2)], [angle(1), angle(3)])
    }
}

/// [`Columns::noise`] of the instances with columns from `first` on.
#[inline(always)]
fn sum_of_draws<R: Real>(columns: &Columns<'_, R>, first: usize, count: usize, step: u64) -> Vector<R> {
    let step = columns.source.clock.step().wrapping_add(step);
    let mut sum = Vector::zero();
    let inverse_root = R::splat(1.0 / columns.source.dt.sqrt());
    for first in (0..count).map(|index| first + index * Kind::WhiteNoise.columns()) {
        let draws = columns.source.parameters[(first + 1) * columns.source.stride + columns.first].to_f64() as u64;
        let mut draw_sum = Vector::zero();
        for draw in 0..draws {
            draw_sum = draw_sum + columns.normal_vector(first, step.wrapping_mul(draws).wrapping_add(draw));
        }
        sum = draw_sum.axpy(columns.column(first) * inverse_root, sum);
    }
    sum
}
