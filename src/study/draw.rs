//! Draws that are functions of (seed, body, column) only.
//!
//! Every number comes from one block of Philox4x32-10 (J. K. Salmon, M. A. Moraes, R. O. Dror, D. E. Shaw, *Parallel
//! random numbers: as easy as 1, 2, 3*, SC11, 2011), whose key is the seed and whose 128-bit counter is made of body,
//! column and block. No state passes from one draw to the next, so a body's values depend neither on how many bodies
//! there are, nor on their order, nor on the thread that draws them.
//!
//! Draws have the same bits on every platform: integers are exact, additions, products and square roots are rounded
//! as IEEE 754 prescribes, and the logarithm, exponential, sine and cosine are those of the crate `libm`, which is
//! compiled from the same Rust source everywhere, rather than those of the system.

use glam::{DQuat, DVec3};

/// What is drawn. The column's number enters the counter, so it must never change.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Column {
    /// Inertia tensor, or principal moments.
    Inertia,
    /// Orientation.
    Orientation,
    /// Angular velocity.
    AngularVelocity,
    /// Mass.
    Mass,
    /// Position of the centre of mass.
    Position,
    /// Velocity of the centre of mass.
    Velocity,
    /// A rate of rotation, for callers that draw it apart from its direction; studies draw both as one angular velocity.
    SpinRate,
    /// A parameter of a torque.
    Torque {
        /// Index of the torque in its study.
        torque: u16,
        /// Index of the parameter in its model, below 4,096.
        parameter: u16,
    },
    /// A parameter of a force.
    Force {
        /// Index of the force in its study.
        force: u16,
        /// Index of the parameter in its model, below 4,096.
        parameter: u16,
    },
    /// A value of one part of a body that is composed of parts.
    Part {
        /// Index of the part.
        part: u16,
        /// Which value.
        of: PartColumn,
    },
    /// An element of the orbit that a study states once.
    Orbit {
        /// Index of the element, below 4,096.
        parameter: u16,
    },
    /// A point of a design.
    Design {
        /// Index of the axis.
        axis: u16,
    },
    /// The row of a table that a body takes; the block is the hash of the table's name.
    Rows,
    /// Variables that are drawn together; the block is the hash of the variable's name.
    Correlated,
}

/// What is drawn for a part; the number enters the counter, so it must never change.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum PartColumn {
    /// Lengths of its shape.
    Size = 0,
    /// Mass or density.
    Matter = 1,
    /// Position in the body.
    Position = 2,
    /// Orientation in the body.
    Orientation = 3,
}

impl Column {
    /// The column's number in the counter.
    fn number(self) -> u32 {
        match self {
            Column::Inertia => 1,
            Column::Orientation => 2,
            Column::AngularVelocity => 3,
            Column::Mass => 4,
            Column::Position => 5,
            Column::Velocity => 6,
            Column::SpinRate => 7,
            Column::Rows => 8,
            Column::Correlated => 9,
            Column::Design { axis } => 0x400_0000 | u32::from(axis),
            Column::Orbit { parameter } => 0x500_0000 | u32::from(parameter),
            Column::Part { part, of } => 0x200_0000 | u32::from(part) << 2 | of as u32,
            Column::Force { force, parameter } => 0x300_0000 | Self::around(force, parameter),
            Column::Torque { torque, parameter } => 0x100_0000 | Self::around(torque, parameter),
        }
    }

    /// The bits of a torque or force and of its parameter: the parameter's higher bits stand above the owner's number.
    fn around(owner: u16, parameter: u16) -> u32 {
        assert!(parameter < 1 << 12, "four bits stand above");
        let (low, high) = (u32::from(parameter & 0xff), u32::from(parameter >> 8));
        high << 28 | u32::from(owner) << 8 | low
    }
}

/// The source of all draws of one seed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Draw {
    seed: u64,
    /// The offset added to the index of a body.
    first_body: u64,
    /// Number of consecutive bodies with the same draws.
    together: usize,
}

impl Draw {
    /// The draws of `seed`.
    pub fn new(seed: u64) -> Self {
        Self { seed, first_body: 0, together: 1 }
    }

    /// The same draws for a part of the bodies, whose first body has index `first_body` in the whole and 0 in the part.
    #[must_use]
    pub(crate) fn counted_from(self, first_body: usize) -> Self {
        Self { first_body: first_body as u64, ..self }
    }

    /// The cell, out of `cells`, that contains a body.
    pub(super) fn cell(self, body: usize, cells: usize) -> usize {
        (self.first_body as usize + body) % cells
    }

    /// The same draws, but each shared by `together` consecutive bodies.
    pub(super) fn common_to(self, together: usize) -> Self {
        Self { together: together.max(1), ..self }
    }

    /// The 128 bits of one block; a vector's component c comes from block c.
    pub(super) fn bits(self, body: usize, column: Column, block: u32) -> [u32; 4] {
        let (seed, body) = (self.seed, (self.first_body + body as u64) / self.together as u64);
        rand_philox::philox4x32_10(
            [body as u32, (body >> 32) as u32, column.number(), block],
            [seed as u32, (seed >> 32) as u32],
        )
    }

    /// Two numbers, uniform on the open interval (0, 1): the 2⁵² midpoints (n + ½) 2⁻⁵².
    pub(super) fn pair(self, body: usize, column: Column, block: u32) -> (f64, f64) {
        let [a, b, c, d] = self.bits(body, column, block);
        (open_unit(a, b), open_unit(c, d))
    }

    /// A number uniform on (0, 1).
    pub fn uniform(self, body: usize, column: Column, component: u32) -> f64 {
        self.pair(body, column, component).0
    }

    /// A standard normal number, |x| ≤ 8.6 (G. E. P. Box, M. E. Muller, *A note on the generation of random normal
    /// deviates*, 1958, equation 1; the second number of the pair is not used, so that each component has its own
    /// block).
    pub fn normal(self, body: usize, column: Column, component: u32) -> f64 {
        let (u, v) = self.pair(body, column, component);
        (-2.0 * libm::log(u)).sqrt() * libm::cos(std::f64::consts::TAU * v)
    }

    /// A vector with standard normal components.
    pub fn normal_vector(self, body: usize, column: Column) -> DVec3 {
        DVec3::new(self.normal(body, column, 0), self.normal(body, column, 1), self.normal(body, column, 2))
    }

    /// A unit vector, uniform on the sphere: its z is uniform (Archimedes' theorem of the hat-box), its azimuth too.
    pub fn direction(self, body: usize, column: Column) -> DVec3 {
        let (u, v) = self.pair(body, column, 0);
        let z = 2.0 * u - 1.0;
        // 1 - z² as 4u(1 - u), without cancellation at the poles.
        let radius = (4.0 * u * (1.0 - u)).sqrt();
        let (sin, cos) = libm::sincos(std::f64::consts::TAU * v);
        DVec3::new(radius * cos, radius * sin, z)
    }

    /// A rotation, uniform on SO(3) (K. Shoemake, *Uniform random rotations*, Graphics Gems III, 1992, p. 129).
    pub fn rotation(self, body: usize, column: Column) -> DQuat {
        let (u, v) = self.pair(body, column, 0);
        let (w, _) = self.pair(body, column, 1);
        let (sin_v, cos_v) = libm::sincos(std::f64::consts::TAU * v);
        let (sin_w, cos_w) = libm::sincos(std::f64::consts::TAU * w);
        let (near, far) = ((1.0 - u).sqrt(), u.sqrt());
        DQuat::from_xyzw(near * sin_v, near * cos_v, far * sin_w, far * cos_w)
    }
}

/// (n + ½) 2⁻⁵² with the upper 52 of 64 bits as n; exact.
pub(super) fn open_unit(high: u32, low: u32) -> f64 {
    let bits = (u64::from(high) << 32) | u64::from(low);
    ((bits >> 12) as f64 + 0.5) * (1.0 / (1_u64 << 52) as f64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn no_two_parameters_share_their_draws() {
        let mut numbers = BTreeSet::new();
        for torque in [0, 1, 255, u16::MAX] {
            for parameter in 0..1100 {
                assert!(numbers.insert(Column::Torque { torque, parameter }.number()), "{torque}, {parameter}");
                assert!(numbers.insert(Column::Force { force: torque, parameter }.number()), "{torque}, {parameter}");
            }
        }
        // The bits of earlier draws must not change.
        assert_eq!(Column::Torque { torque: 2, parameter: 7 }.number(), 0x100_0207);
    }

    /// The bits of four draws, so that neither a platform nor a release changes a study's bodies unnoticed.
    const PINNED: [&str; 4] = ["3fe45270b4ee7881", "bfc7a494c0e01f7d", "3feb8af1ac614af7", "3fdcb7191c53e8c4"];

    #[test]
    fn draws_have_pinned_bits() {
        let draw = Draw::new(42);
        let found = [
            draw.uniform(7, Column::Mass, 0),
            draw.normal(7, Column::AngularVelocity, 2),
            draw.direction(7, Column::AngularVelocity).x,
            draw.rotation(7, Column::Orientation).w,
        ]
        .map(|x| format!("{:016x}", x.to_bits()));
        assert_eq!(found, PINNED);
    }

    #[test]
    fn the_unit_interval_is_open() {
        assert!(open_unit(0, 0) > 0.0);
        assert!(open_unit(u32::MAX, u32::MAX) < 1.0);
    }

    #[test]
    fn normal_draws_have_the_moments_of_a_normal_distribution() {
        // 40,000 draws: five standard errors of mean (1/√n), variance (√(2/n)) and fourth moment (√(96/n)).
        let count = 40_000;
        let draw = Draw::new(1);
        let moment = |power: i32| {
            (0..count).map(|body| draw.normal(body, Column::AngularVelocity, 0).powi(power)).sum::<f64>() / count as f64
        };
        let root = (count as f64).sqrt();
        let (mean, variance, fourth) = (moment(1), moment(2), moment(4));
        assert!(mean.abs() < 5.0 / root, "mean {mean}");
        assert!((variance - 1.0).abs() < 5.0 * 2.0_f64.sqrt() / root, "variance {variance}");
        assert!((fourth - 3.0).abs() < 5.0 * 96.0_f64.sqrt() / root, "fourth moment {fourth}");
    }

    #[test]
    fn rotations_are_unit_and_spread_evenly() {
        let count = 40_000;
        let draw = Draw::new(1);
        let mut sum = [0.0; 4];
        for body in 0..count {
            let q = draw.rotation(body, Column::Orientation);
            assert!((q.length() - 1.0).abs() < 4.0 * f64::EPSILON, "body {body}: {q:?}");
            for (sum, x) in sum.iter_mut().zip(q.to_array()) {
                *sum += x * x;
            }
        }
        // E x² = 1/4, Var x² = 1/16 on the three-sphere; five standard errors.
        for (component, sum) in sum.into_iter().enumerate() {
            let mean = sum / count as f64;
            assert!((mean - 0.25).abs() < 5.0 * 0.25 / (count as f64).sqrt(), "component {component}: {mean}");
        }
    }
}
