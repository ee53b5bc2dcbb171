//! `rk8`: Dormand and Prince's Runge-Kutta method of order 8 on (q, m), with the quaternion's norm restored.
//!
//! Order 8, twelve evaluations per step, explicit. It conserves nothing exactly; the drift of energy and angular momentum is of order dt⁹
//! per step. Stable on a steady rotation for ω dt < 6; accurate for ω dt up to about 1. For equal numbers of evaluations its error is 10³
//! to 10⁶ times smaller than that of `rk4`.
//!
//! Source: E. Hairer, S. P. Nørsett, G. Wanner, *Solving Ordinary Differential Equations I*, 2nd ed. (1993), section
//! II.5 and the program DOP853 in its appendix, after J. R. Dormand, P. J. Prince, J. Comput. Appl. Math. 6 (1980) 19.
//! `tests/truth/tableau.rs` checks all 200 order conditions up to order 8 on these coefficients.
//!
//! Differences from the source: all sums are of differences from the first slope, kⱼ − k₁, so that Σⱼ aᵢⱼ = cᵢ and Σ bⱼ = 1
//! hold exactly for the rounded coefficients, and nothing cancels: weights up to 43 multiply only small differences. With
//! weights of k itself rounded to `f32`, time would stretch by up to 5e-7. Increments are added to a state carried in
//! two words, and the quaternion's norm is restored as in `rk4`.

use crate::kernel::method::PlainStep;
use crate::kernel::method::slope::{Slope, rates};
use crate::kernel::rigid_body::{Body, Correction, State};
use crate::kernel::torque_kernel::TorqueKernel;
use crate::math::quaternion::norm_correction_of_step;
use crate::math::real::Real;
use crate::math::vector::TwoWords;

/// Stages.
#[doc(hidden)]
pub const STAGES: usize = 12;

/// Times of the stages as fractions of the step.
#[doc(hidden)]
pub const TIMES: [f64; STAGES] = [
    0.0,
    5.26001519587677318785587544488e-2,
    7.89002279381515978178381316732e-2,
    1.1835034190722739672675719751e-1,
    2.8164965809277260327324280249e-1,
    1.0 / 3.0,
    0.25,
    4.0 / 13.0,
    127.0 / 195.0,
    0.6,
    6.0 / 7.0,
    1.0,
];

/// aᵢⱼ, row i from the second stage on; the first column is not used in the sums (see the module's differences).
#[doc(hidden)]
pub const STAGE_WEIGHTS: [[f64; STAGES - 1]; STAGES - 1] = [
    row([5.26001519587677318785587544488e-2]),
    row([1.97250569845378994544595329183e-2, 5.91751709536136983633785987549e-2]),
    row([2.95875854768068491816892993775e-2, 0.0, 8.87627564304205475450678981324e-2]),
    row([
        2.41365134159266685502369798665e-1,
        0.0,
        -8.84549479328286085344864962717e-1,
        9.24834003261792003115737966543e-1,
    ]),
    row([
        3.7037037037037037037037037037e-2,
        0.0,
        0.0,
        1.70828608729473871279604482173e-1,
        1.25467687566822425016691814123e-1,
    ]),
    row([
        3.7109375e-2,
        0.0,
        0.0,
        1.70252211019544039314978060272e-1,
        6.02165389804559606850219397283e-2,
        -1.7578125e-2,
    ]),
    row([
        3.70920001185047927108779319836e-2,
        0.0,
        0.0,
        1.70383925712239993810214054705e-1,
        1.07262030446373284651809199168e-1,
        -1.53194377486244017527936158236e-2,
        8.27378916381402288758473766002e-3,
    ]),
    row([
        6.24110958716075717114429577812e-1,
        0.0,
        0.0,
        -3.36089262944694129406857109825,
        -8.68219346841726006818189891453e-1,
        2.75920996994467083049415600797e1,
        2.01540675504778934086186788979e1,
        -4.34898841810699588477366255144e1,
    ]),
    row([
        4.77662536438264365890433908527e-1,
        0.0,
        0.0,
        -2.48811461997166764192642586468,
        -5.90290826836842996371446475743e-1,
        2.12300514481811942347288949897e1,
        1.52792336328824235832596922938e1,
        -3.32882109689848629194453265587e1,
        -2.03312017085086261358222928593e-2,
    ]),
    row([
        -9.3714243008598732571704021658e-1,
        0.0,
        0.0,
        5.18637242884406370830023853209,
        1.09143734899672957818500254654,
        -8.14978701074692612513997267357,
        -1.85200656599969598641566180701e1,
        2.27394870993505042818970056734e1,
        2.49360555267965238987089396762,
        -3.0467644718982195003823669022,
    ]),
    row([
        2.27331014751653820792359768449,
        0.0,
        0.0,
        -1.05344954667372501984066689879e1,
        -2.00087205822486249909675718444,
        -1.79589318631187989172765950534e1,
        2.79488845294199600508499808837e1,
        -2.85899827713502369474065508674,
        -8.87285693353062954433549289258,
        1.23605671757943030647266201528e1,
        6.43392746015763530355970484046e-1,
    ]),
];

/// A row, with zeros behind.
const fn row<const COUNT: usize>(weights: [f64; COUNT]) -> [f64; STAGES - 1] {
    let mut row = [0.0; STAGES - 1];
    row.split_at_mut(COUNT).0.copy_from_slice(&weights);
    row
}

/// bⱼ, the weights of order 8; the first is not used in the sum.
#[doc(hidden)]
pub const WEIGHTS: [f64; STAGES] = [
    5.42937341165687622380535766363e-2,
    0.0,
    0.0,
    0.0,
    0.0,
    4.45031289275240888144113950566,
    1.89151789931450038304281599044,
    -5.8012039600105847814672114227,
    3.1116436695781989440891606237e-1,
    -1.52160949662516078556178806805e-1,
    2.01365400804030348374776537501e-1,
    4.47106157277725905176885569043e-2,
];

/// bⱼ less the weights of the embedded formula of order 5.
#[doc(hidden)]
pub const ERROR_WEIGHTS_5: [f64; STAGES] = [
    1.312004499419488073250102996e-2,
    0.0,
    0.0,
    0.0,
    0.0,
    -1.225156446376204440720569753,
    -4.957589496572501915214079952e-1,
    1.664377182454986536961530415,
    -3.503288487499736816886487290e-1,
    3.341791187130174790297318841e-1,
    8.192320648511571246570742613e-2,
    -2.235530786388629525884427845e-2,
];

/// The weights of the embedded formula of order 3, of the slopes 1, 9 and 12.
#[doc(hidden)]
pub const WEIGHTS_3: [f64; 3] =
    [2.44094488188976377952755905512e-1, 7.33846688281611857341361741547e-1, 2.20588235294117647058823529412e-2];

/// The method as a type.
#[doc(hidden)]
pub struct Rk8;

impl PlainStep for Rk8 {
    #[inline(always)]
    fn step<R: Real, E: TorqueKernel<R>>(
        body: &Body<R>,
        torques: &E,
        step_index: u64,
        dt: TwoWords<R>,
        state: State<R>,
    ) -> State<R> {
        let start = torques.start(step_index);
        let slopes = slopes(
            body,
            #[inline(always)]
            |fraction| torques.epoch(&start, fraction),
            torques,
            dt.value,
            &state,
        );
        advanced(&slopes, dt, state)
    }
}

/// The slopes of a step: the one at its start, and the differences of the others from it.
///
/// The implementation decides where they are kept: in registers or in a tile's memory.
pub(crate) trait Slopes<R: Real> {
    /// k₁.
    fn first(&self) -> Slope<R>;
    /// kⱼ₊₂ − k₁, j = `index` from 0.
    fn difference(&self, index: usize) -> Slope<R>;
}

/// first · first_weight + Σ weights · differences; a weight of 0 costs nothing.
#[inline(always)]
pub(crate) fn weighted<R: Real>(slopes: &impl Slopes<R>, first_weight: f64, weights: &[f64]) -> Slope<R> {
    let (first, first_weight) = (slopes.first(), R::splat(first_weight));
    let mut sum = Slope { q: first.q * first_weight, m: first.m * first_weight };
    for (index, &weight) in weights.iter().enumerate() {
        if weight != 0.0 {
            let (weight, difference) = (R::splat(weight), slopes.difference(index));
            sum = Slope { q: difference.q.axpy(weight, sum.q), m: difference.m.axpy(weight, sum.m) };
        }
    }
    sum
}

/// The sum of slopes that leads to a stage; the second stage has number 1.
///
/// Each stage has straight-line code: loops over its weights would cost as much as its sums.
#[inline(always)]
pub(crate) fn stage_sum<R: Real>(slopes: &impl Slopes<R>, stage: usize) -> Slope<R> {
    match stage {
        1 => sum_of::<R, 1>(slopes),
        2 => sum_of::<R, 2>(slopes),
        3 => sum_of::<R, 3>(slopes),
        4 => sum_of::<R, 4>(slopes),
        5 => sum_of::<R, 5>(slopes),
        6 => sum_of::<R, 6>(slopes),
        7 => sum_of::<R, 7>(slopes),
        8 => sum_of::<R, 8>(slopes),
        9 => sum_of::<R, 9>(slopes),
        10 => sum_of::<R, 10>(slopes),
        _ => sum_of::<R, 11>(slopes),
    }
}

#[inline(always)]
fn sum_of<R: Real, const STAGE: usize>(slopes: &impl Slopes<R>) -> Slope<R> {
    let (first, first_weight) = (slopes.first(), R::splat(TIMES[STAGE]));
    let mut sum = Slope { q: first.q * first_weight, m: first.m * first_weight };
    for index in 0..STAGE - 1 {
        let weight = STAGE_WEIGHTS[STAGE - 1][1 + index];
        if weight != 0.0 {
            let (weight, difference) = (R::splat(weight), slopes.difference(index));
            sum = Slope { q: difference.q.axpy(weight, sum.q), m: difference.m.axpy(weight, sum.m) };
        }
    }
    sum
}

/// The slopes of all stages, in registers.
#[derive(Clone, Copy, Debug)]
pub(crate) struct StageSlopes<R> {
    first: Slope<R>,
    differences: [Slope<R>; STAGES - 1],
}

impl<R: Real> Slopes<R> for StageSlopes<R> {
    #[inline(always)]
    fn first(&self) -> Slope<R> {
        self.first
    }

    #[inline(always)]
    fn difference(&self, index: usize) -> Slope<R> {
        self.differences[index]
    }
}

/// The slopes of all stages of a step of `h`; `epoch_at` says what depends on time alone, at a fraction of the step, and must be forced inline
/// ([`crate::math::real::outlined`]).
#[inline(always)]
pub(crate) fn slopes<R: Real, E: TorqueKernel<R>>(
    body: &Body<R>,
    epoch_at: impl Fn(f64) -> E::Epoch,
    torques: &E,
    h: R,
    state: &State<R>,
) -> StageSlopes<R> {
    let q = state.orientation.value;
    let m = state.angular_momentum_principal.value;
    let correction: Correction<R> = body.correction(state);
    let first = rates(body, torques, &epoch_at(0.0), &correction, q, m);
    let mut slopes = StageSlopes { first, differences: [first; STAGES - 1] };
    for stage in 1..STAGES {
        let sum = weighted(&slopes, TIMES[stage], &STAGE_WEIGHTS[stage - 1][1..stage]);
        let epoch = epoch_at(TIMES[stage]);
        let slope = rates(body, torques, &epoch, &correction, sum.q.axpy(h, q), sum.m.axpy(h, m));
        slopes.differences[stage - 1] = Slope { q: slope.q - first.q, m: slope.m - first.m };
    }
    slopes
}

/// The state after a step of dt with these slopes.
#[inline(always)]
pub(crate) fn advanced<R: Real>(slopes: &impl Slopes<R>, dt: TwoWords<R>, state: State<R>) -> State<R> {
    let sum = weighted(slopes, 1.0, &WEIGHTS[1..]);
    let q = state.orientation.value;
    let restoring = norm_correction_of_step(q, sum.q.axpy(dt.value, q));
    let q_increment = sum.q.axpy(dt.value, sum.q.axpy(dt.residue, restoring));
    let m_increment = sum.m.axpy(dt.value, sum.m * dt.residue);
    state.advanced(q_increment, m_increment)
}
