//! Classification of torque-free bodies in SIMD lanes. It settles those that are far from every simpler class.

use super::choice::{Classification, aligned};
use super::class::{Bound, FreeLanes, Shape, Verdict};
use super::driven::{ActingTorques, TorqueSet};
use crate::math::lanes::{LaneScalar, LaneTask};
use crate::math::real::Real;
use crate::math::vector::Vector;
use crate::scene::Scene;

/// Number of bodies that are classified together: a multiple of every lane count.
pub(super) const CLASSIFIED_TOGETHER: usize = 64;

/// Moments, angular momentum and span.
const COLUMNS: usize = 7;

/// Some bodies of a scene.
pub(super) struct LaneClassification {
    bodies: [[f64; CLASSIFIED_TOGETHER]; COLUMNS],
    /// Whether the body was classified and is far from every simpler class.
    is_general: [bool; CLASSIFIED_TOGETHER],
    set_up_error: [f64; CLASSIFIED_TOGETHER],
}

impl LaneClassification {
    /// Classifies up to [`CLASSIFIED_TOGETHER`] bodies, starting at `first`. Skips driven bodies, linear rotors and those whose principal
    /// axes do not lie along body axes.
    pub fn at((scene, acting): (&Scene, &ActingTorques<'_>), first: usize, tolerance: &Bound) -> Self {
        let mut lanes = Self {
            bodies: [[1.0; CLASSIFIED_TOGETHER]; COLUMNS],
            is_general: [false; CLASSIFIED_TOGETHER],
            set_up_error: [f64::INFINITY; CLASSIFIED_TOGETHER],
        };
        if !scene.may_skip() {
            return lanes;
        }
        let count = CLASSIFIED_TOGETHER.min(scene.ensemble().len() - first);
        for (offset, is_seen) in lanes.is_general[..count].iter_mut().enumerate() {
            if !acting.on(first + offset).is_empty() {
                continue;
            }
            if let Some(body) = aligned(scene, first + offset) {
                let (i, m) = (body.moments, body.angular_momentum_principal);
                for (column, number) in [i.x, i.y, i.z, m.x, m.y, m.z, body.span].into_iter().enumerate() {
                    lanes.bodies[column][offset] = number;
                }
                *is_seen = true;
            }
        }
        if lanes.is_general.contains(&true) {
            f64::dispatch(InLanes(&mut lanes, tolerance));
        }
        lanes
    }

    /// The classification of the body at an offset, or `None` where it needs the scalar one.
    pub fn classification(&self, offset: usize) -> Option<Classification> {
        let verdict = Verdict { shape: Shape::Asymmetric, axis: 0, bound: Bound::default() };
        let set_up = Bound::of_set_up(self.set_up_error[offset]);
        self.is_general[offset].then_some(Classification { torques: TorqueSet::default(), verdict, set_up, rate: 0.0 })
    }
}

struct InLanes<'a>(&'a mut LaneClassification, &'a Bound);

impl LaneTask<f64> for InLanes<'_> {
    type Output = ();

    #[inline(always)]
    fn run<R: Real<Scalar = f64>>(self) {
        let Self(lanes, tolerance) = self;
        let mut is_far = [0.0; CLASSIFIED_TOGETHER];
        for offset in (0..CLASSIFIED_TOGETHER).step_by(R::LANES) {
            let [i1, i2, i3, m1, m2, m3, span] = lanes.bodies.each_ref().map(|column| R::load(&column[offset..]));
            let (moments, m) = (Vector::new(i1, i2, i3), Vector::new(m1, m2, m3));
            let bodies = FreeLanes { moments, angular_momentum_principal: m, span };
            let [a, b, c, d] = bodies.least_attitudes().map(|least| tolerance.is_far(least));
            R::select(a & b & c & d, R::splat(1.0), R::splat(0.0)).store(&mut is_far[offset..]);
            bodies.set_up_error(true).store(&mut lanes.set_up_error[offset..]);
        }
        for (is_general, is_far) in lanes.is_general.iter_mut().zip(is_far) {
            *is_general &= is_far == 1.0;
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::{DQuat, DVec3};

    use super::super::choice::classify;
    use super::*;
    use crate::bodies::Ensemble;
    use crate::bodies::inertia::InertiaTensor;
    use crate::torque::Torque;

    /// Bodies of all classes; one in seven has tilted principal axes and one in eleven is driven.
    fn scene() -> Scene {
        const BODIES: usize = 1000;
        let number = |body: usize, column: usize| 0.5 + 0.5 * ((12.9898 * body as f64 + 78.233 * column as f64).sin());
        let inertia = |body: usize| {
            let near = [1.0, 1.0, 1e-3, 1e-7, 0.0][body % 5];
            let moments =
                DVec3::new(1.0 + near * number(body, 0), 1.0 + near * number(body, 1), 1.0 + 0.5 * number(body, 2));
            let tensor = InertiaTensor::from_principal_moments(moments * 10.0_f64.powi(body as i32 % 30 - 15));
            if body.is_multiple_of(7) { tensor.rotated(DQuat::from_rotation_y(0.3)) } else { tensor }
        };
        let omega = |body: usize| {
            let across = [1.0, 1.0, 1e-4, 1e-9, 0.0][body / 5 % 5];
            let rate = [1.0, 1.0, 1.0, 1e-9, 0.0][body / 25 % 5];
            DVec3::new(across * number(body, 3), number(body, 4), across * number(body, 5)) * rate
        };
        let columns = (0..BODIES).map(|body| (inertia(body), omega(body))).collect::<Vec<_>>();
        let (inertia, omega): (Vec<_>, Vec<_>) = columns.into_iter().unzip();
        let ensemble = Ensemble::from_columns(&inertia, &[DQuat::IDENTITY; BODIES], &omega).unwrap();
        let drag = (0..BODIES).map(|body| if body.is_multiple_of(11) { 0.1 } else { 0.0 }).collect::<Vec<_>>();
        Scene::new(ensemble).until(10.0).torque(Torque::linear_drag(drag))
    }

    #[test]
    fn lanes_agree_with_the_scalar_classification() {
        let scene = scene();
        let acting = ActingTorques::of(scene.torques());
        for attitude in [1e-2, 1e-5, 1e-9, 1e-12] {
            let tolerance = Bound { attitude, ..Bound::NONE };
            let (mut enough, mut closer) = (0, 0);
            for first in (0..scene.ensemble().len()).step_by(CLASSIFIED_TOGETHER) {
                let lanes = LaneClassification::at((&scene, &acting), first, &tolerance);
                for body in first..(first + CLASSIFIED_TOGETHER).min(scene.ensemble().len()) {
                    match lanes.classification(body - first) {
                        Some(classification) => {
                            assert_eq!(
                                classification,
                                classify((&scene, &acting), body, &tolerance),
                                "body {body}, {attitude:e} rad"
                            );
                            enough += 1;
                        }
                        None => closer += 1,
                    }
                }
            }
            assert!(enough > 50 && closer > 100, "{enough}, {closer}");
        }
    }

    #[test]
    fn nothing_is_classified_in_lanes_without_skipping() {
        let scene = scene().skipping(false);
        let acting = ActingTorques::of(scene.torques());
        let lanes = LaneClassification::at((&scene, &acting), 0, &Bound { attitude: 1e-9, ..Bound::NONE });
        assert!((0..CLASSIFIED_TOGETHER).all(|offset| lanes.classification(offset).is_none()));
    }
}
