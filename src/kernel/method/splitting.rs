//! `splitting2`, `splitting4`, `splitting6`: kicks by the torque between free flows.
//!
//! | method | attitude- or time-dependent torque | with drag | kicks | free flows |
//! | --- | --- | --- | --- | --- |
//! | `splitting2` | Strang | Strang | 2 | 1 |
//! | `splitting4` | SRKN6b | BM4 | 7 | 6 |
//! | `splitting6` | SRKN11b | BM6 | 12 or 11 | 11 or 10 |
//!
//! The free flow is the preprocessed discrete Moser-Veselov step of order 6 (`moser_veselov.rs`); the kick is the exact or
//! sufficiently accurate flow of the torque at a frozen attitude and time (`kick.rs`); time advances with the free flow. A
//! torque-free body is stepped by one free flow, of order 6 for all three methods.
//!
//! Each is symmetric, and explicit except for the small equation of the free flow. Without torque, energy and the angular
//! momentum in the world are kept to rounding; with a torque that has a potential the energy error is bounded and of
//! order dt² (dt⁴, dt⁶); |q| is kept.
//!
//! Compositions of order above 2 need negative substeps: they are useful while the damping per step is small (c dt/I ≲ 1), but nothing is
//! refused beyond that. The free flow needs |ω dt| times the longest substep (1 for order 2, 0.61 for SRKN6b, 0.36 for BM4 and SRKN11b,
//! 0.54 for BM6) below 1; otherwise the body is flagged.
//!
//! Sources. Strang: G. Strang, SIAM J. Numer. Anal. 5 (1968) 506. BM4 and BM6: S. Blanes, P. C. Moan, J. Comput. Appl.
//! Math. 142 (2002) 313, table 2, S6 of order 4 and S10 of order 6. SRKN6b and SRKN11b: the same, table 3; they rest on
//! the free flow's generator being quadratic in m and the kick depending on the attitude and time only. **Under drag that does
//! not hold and SRKN11b drops to order 4**, which is why BM4 and BM6 take over there; `tests/truth/convergence.rs` shows both.
//!
//! Differences from the sources: substep ends are rounded, not substeps, so that in `f32` the substeps (in two words)
//! add up to dt exactly.

use crate::kernel::method::Step;
use crate::kernel::method::kick::kick;
use crate::kernel::method::moser_veselov::{Modification, drift};
use crate::kernel::rigid_body::{Body, Invariants, State};
use crate::kernel::torque_kernel::{TorqueKernel, VelocityDependence};
use crate::math::real::{Real, Scalar};
use crate::math::vector::{TwoWords, two_difference};

/// A palindromic sequence of kicks and free flows, given by the ends of its substeps as fractions of the step.
#[derive(Clone, Copy, Debug)]
#[doc(hidden)]
pub struct Composition {
    /// The end of each kick, starting from 0; a kick comes first.
    pub kick_ends: &'static [f64],
    /// The end of each free flow, starting from 0; one fewer than kicks, each between two of them.
    pub drift_ends: &'static [f64],
}

/// Running sums of the first half of a palindrome (including its middle element if the length is odd) and its mirror image; the last sum is
/// 1.
const fn ends<const HALF: usize, const ALL: usize>(half: [f64; HALF]) -> [f64; ALL] {
    let mut sums = [0.0; ALL];
    let mut sum = 0.0;
    let mut i = 0;
    while i < ALL {
        sum += if i < HALF { half[i] } else { half[ALL - 1 - i] };
        sums[i] = sum;
        i += 1;
    }
    sums[ALL - 1] = 1.0;
    sums
}

/// Strang's composition, order 2.
pub(crate) const STRANG: Composition = Composition { kick_ends: &[0.5, 1.0], drift_ends: &[1.0] };

const SRKN6B_KICKS: [f64; 4] = [
    0.0829844064174052,
    0.396309801498368,
    -0.0390563049223486,
    1.0 - 2.0 * (0.0829844064174052 + 0.396309801498368 - 0.0390563049223486),
];
const SRKN6B_DRIFTS: [f64; 3] = [0.245298957184271, 0.604872665711080, 0.5 - (0.245298957184271 + 0.604872665711080)];

/// SRKN6b of Blanes and Moan, order 4 for kicks that do not depend on ω.
pub(crate) const SRKN6B: Composition =
    Composition { kick_ends: &ends::<4, 7>(SRKN6B_KICKS), drift_ends: &ends::<3, 6>(SRKN6B_DRIFTS) };

const SRKN11B_KICKS: [f64; 6] = [
    0.0414649985182624,
    0.198128671918067,
    -0.0400061921041533,
    0.0752539843015807,
    -0.0115113874206879,
    0.5 - (0.0414649985182624 + 0.198128671918067 - 0.0400061921041533 + 0.0752539843015807 - 0.0115113874206879),
];
const SRKN11B_DRIFTS: [f64; 6] = [
    0.123229775946271,
    0.290553797799558,
    -0.127049212625417,
    -0.246331761062075,
    0.357208872795928,
    1.0 - 2.0 * (0.123229775946271 + 0.290553797799558 - 0.127049212625417 - 0.246331761062075 + 0.357208872795928),
];

/// SRKN11b of Blanes and Moan, order 6 for kicks that do not depend on ω, 4 for others.
#[doc(hidden)]
pub const SRKN11B: Composition =
    Composition { kick_ends: &ends::<6, 12>(SRKN11B_KICKS), drift_ends: &ends::<6, 11>(SRKN11B_DRIFTS) };

const BM4_KICKS: [f64; 4] = [
    0.0792036964311957,
    0.353172906049774,
    -0.0420650803577195,
    1.0 - 2.0 * (0.0792036964311957 + 0.353172906049774 - 0.0420650803577195),
];
const BM4_DRIFTS: [f64; 3] = [0.209515106613362, -0.143851773179818, 0.5 - (0.209515106613362 - 0.143851773179818)];

/// S6 of Blanes and Moan, order 4 for any kick.
pub(crate) const BM4: Composition =
    Composition { kick_ends: &ends::<4, 7>(BM4_KICKS), drift_ends: &ends::<3, 6>(BM4_DRIFTS) };

const BM6_KICKS: [f64; 6] = [
    0.0502627644003922,
    0.413514300428344,
    0.0450798897943977,
    -0.188054853819569,
    0.541960678450780,
    1.0 - 2.0 * (0.0502627644003922 + 0.413514300428344 + 0.0450798897943977 - 0.188054853819569 + 0.541960678450780),
];
const BM6_DRIFTS: [f64; 5] = [
    0.148816447901042,
    -0.132385865767784,
    0.067307604692185,
    0.432666402578175,
    0.5 - (0.148816447901042 - 0.132385865767784 + 0.067307604692185 + 0.432666402578175),
];

/// S10 of Blanes and Moan, order 6 for any kick.
#[doc(hidden)]
pub const BM6: Composition =
    Composition { kick_ends: &ends::<6, 11>(BM6_KICKS), drift_ends: &ends::<5, 10>(BM6_DRIFTS) };

/// The composition of order `ORDER` for torques of that kind.
#[doc(hidden)]
pub const fn composition<const ORDER: u32>(dependence: VelocityDependence) -> Composition {
    match (ORDER, dependence) {
        (2, _) => STRANG,
        (4, VelocityDependence::None) => SRKN6B,
        (4, _) => BM4,
        (_, VelocityDependence::None) => SRKN11B,
        (_, _) => BM6,
    }
}

/// The methods as a type; `ORDER` is 2, 4 or 6.
#[doc(hidden)]
pub struct Splitting<const ORDER: u32>;

/// What is the same for all steps.
#[derive(Clone, Copy, Debug)]
#[doc(hidden)]
pub struct Prepared<R> {
    /// How the moments change with the step size and the invariants.
    pub modification: Modification<R>,
    /// The body with its moments changed for one whole step at the initial invariants; used for a torque-free body.
    pub free: Body<R>,
}

impl<const ORDER: u32> Step for Splitting<ORDER> {
    type Prepared<R: Real> = Prepared<R>;

    const INVARIANTS: bool = true;

    #[inline(always)]
    fn prepare<R: Real, E: TorqueKernel<R>>(
        body: &Body<R>,
        invariants: &Invariants<R>,
        dt: TwoWords<R>,
    ) -> Prepared<R> {
        let modification = Modification::new(body);
        Prepared { modification, free: modification.modified(body, dt.value, invariants) }
    }

    #[inline(always)]
    fn step<R: Real, E: TorqueKernel<R>>(
        body: &Body<R>,
        prepared: &Prepared<R>,
        torques: &E,
        step_index: u64,
        dt: TwoWords<R>,
        state: State<R>,
    ) -> State<R> {
        if E::FREE {
            return drift(&prepared.free, dt, state);
        }
        let composition = composition::<ORDER>(torques.velocity_dependence());
        composed::<R, E, ORDER>(&composition, body, prepared, torques, step_index, dt, state)
    }
}

/// One step of a composition.
#[inline(always)]
#[doc(hidden)]
pub fn composed<R: Real, E: TorqueKernel<R>, const ORDER: u32>(
    composition: &Composition,
    body: &Body<R>,
    prepared: &Prepared<R>,
    torques: &E,
    step_index: u64,
    dt: TwoWords<R>,
    state: State<R>,
) -> State<R> {
    let mut state = state;
    let step = torques.start(step_index);
    let (mut kicked, mut drifted) = (0.0, 0.0);
    for (i, &kick_end) in composition.kick_ends.iter().enumerate() {
        let epoch = torques.epoch(&step, drifted);
        state = kick::<R, E, ORDER>(body, torques, &epoch, part_of(dt, kicked, kick_end), state);
        kicked = kick_end;
        if let Some(&drift_end) = composition.drift_ends.get(i) {
            let h = part_of(dt, drifted, drift_end);
            let modified = prepared.modification.modified_at(body, h.value, &state);
            state = drift(&modified, h, state);
            drifted = drift_end;
        }
    }
    state
}

/// The part of dt between two fractions of it. In `f32` the fractions are rounded first, so that parts with common ends
/// add up to the whole exactly.
#[inline(always)]
fn part_of<R: Real>(dt: TwoWords<R>, start: f64, end: f64) -> TwoWords<R> {
    if R::Scalar::WORDS == 1 {
        return TwoWords { value: dt.value * R::splat(end - start), residue: R::splat(0.0) };
    }
    let (value, residue) = two_difference(dt.value * R::splat(end), dt.value * R::splat(start));
    TwoWords { value, residue: dt.residue.mul_add(R::splat(end - start), residue) }
}
