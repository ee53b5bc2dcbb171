//! Driven bodies in tiles: a method goes stage by stage over a few lane groups whose slopes stay in the first-level cache, and the torques
//! add their parts for all of them at once ([`crate::torque::tile`]).
//!
//! The method's own file forms a step from the slopes.

mod attempts;
mod cf4;

pub(super) use attempts::attempts_in_tiles;
pub(super) use cf4::Cf4;

use std::marker::PhantomData;

use super::Block;
use crate::engine::batch::{load_body, load_state, store_state};
use crate::kernel::method::rk8::{STAGES, Slopes, TIMES};
use crate::kernel::method::slope::Slope;
use crate::kernel::method::{rk4, rk8};
use crate::kernel::rigid_body::{Body, Correction, State, orientation_rate};
use crate::math::lanes::{Each, GROUPS, LaneScalar, LaneTask};
use crate::math::quaternion::Quaternion;
use crate::math::real::{Real, Scalar, outlined};
use crate::math::vector::{TwoWords, Vector};
use crate::torque::formula::{Formula, FormulaTask, Role};
use crate::torque::sum::Source;
use crate::torque::tile::{TileTime, TileTorques};

/// A method with equal steps, on tiles.
pub(super) trait TileStep {
    /// Advances the bodies of a tile by step `index` of the interval.
    fn step<R: Real>(tile: &mut Tile<'_, R>, index: u64);
}

/// Some lane groups of bodies, and their torques.
pub(super) struct Tile<'a, R: Real> {
    torques: TileTorques<'a, R>,
    /// An equal step, s.
    seconds: f64,
    body: Each<Body<R>>,
    /// Steps, in units of each body's own scale.
    h: Each<TwoWords<R>>,
    state: Each<State<R>>,
    correction: Each<Correction<R>>,
    /// Lane groups that are advanced.
    groups: [usize; GROUPS],
    active: usize,
    /// The bodies' orientations and angular momenta at a stage.
    q: Each<Quaternion<R>>,
    m: Each<Vector<R>>,
    slopes: [Each<Slope<R>>; STAGES],
}

impl<'a, R: Real> Tile<'a, R> {
    /// A tile without bodies.
    #[inline(always)]
    fn new(source: Source<'a, R::Scalar>) -> Self {
        let zero = R::splat(0.0);
        let words = |value| TwoWords { value, residue: Vector::zero() };
        let (q, ones) = (Quaternion::new(zero, zero, zero, zero), R::splat(1.0));
        let body = Body::new(words(Vector::new(ones, ones, ones)));
        let state = State {
            orientation: TwoWords { value: q, residue: q },
            angular_momentum_principal: words(Vector::zero()),
            status: zero,
        };
        Self {
            torques: TileTorques::new(source),
            seconds: source.dt,
            body: Each([body; GROUPS]),
            h: Each([TwoWords { value: zero, residue: zero }; GROUPS]),
            state: Each([state; GROUPS]),
            correction: Each([body.correction(&state); GROUPS]),
            groups: [0, 1, 2, 3],
            active: 0,
            q: Each([q; GROUPS]),
            m: Each([Vector::zero(); GROUPS]),
            slopes: [Each([Slope { q, m: Vector::zero() }; GROUPS]); STAGES],
        }
    }

    /// Loads the bodies of `groups` lane groups from body `first` on, for steps of `interval`, s.
    #[inline(always)]
    fn load(
        &mut self,
        source: &Source<'a, R::Scalar>,
        first: usize,
        groups: usize,
        interval: TwoWords<R::Scalar>,
        state: impl Fn(usize, usize) -> R,
    ) {
        for group in 0..groups.min(GROUPS) {
            let columns = source.columns::<R>(first + group * R::LANES);
            let (body, rate) = load_body(|column| columns.column(column));
            self.body[group] = body;
            self.h[group] = interval.times(rate);
            self.state[group] = load_state(|column| state(column, group));
        }
        self.groups = [0, 1, 2, 3];
        self.active = groups.min(GROUPS);
        self.torques.load(first, self.active);
    }

    /// The lane groups that are advanced, by number.
    #[inline(always)]
    fn active(&self) -> impl Iterator<Item = usize> + use<R> {
        let (groups, active) = (self.groups, self.active);
        (0..active.min(GROUPS)).map(move |place| groups[place % GROUPS] % GROUPS)
    }

    /// Forms the quantities that hold for a whole step.
    #[inline(always)]
    fn start(&mut self, time: TileTime<'_, R>) {
        if R::Scalar::WORDS == 2 {
            for group in self.active() {
                self.correction[group] = self.body[group].correction(&self.state[group]);
            }
        }
        self.torques.start(time, &self.groups[..self.active.min(GROUPS)]);
    }

    /// Forms the quantities that follow from the time, at a fraction of an equal step.
    #[inline(always)]
    fn at(&mut self, fraction: f64) {
        let elapsed = Each([R::splat(fraction * self.seconds); GROUPS]);
        self.torques.at(&elapsed, &self.groups[..self.active.min(GROUPS)]);
    }

    /// Forms the slopes of a stage of a Runge-Kutta method on (q, m); the first stage is 0.
    #[inline(always)]
    fn stage<P: Stages>(&mut self, stage: usize) {
        match self.torques.only() {
            Some(kind) => {
                outlined!(R, place::<R, P>(self, stage));
                kind.with(SlopesUnderOne { tile: self, stage, is_difference: P::DIFFERENCES && stage > 0 });
            }
            None if self.torques.has_expressions_only() => {
                outlined!(R, form_rigid_slopes::<R, P>(self, stage));
                outlined!(R, add_expressions::<R, P>(self, stage));
            }
            None if self.torques.has_expressions() => {
                outlined!(R, place::<R, P>(self, stage));
                self.form_expressions();
                outlined!(R, form_slopes::<R, P>(self, stage, true));
            }
            None => outlined!(R, form_slopes::<R, P>(self, stage, false)),
        }
    }

    /// Forms the torques that are expressions, at the placed bodies.
    #[inline(always)]
    fn form_expressions(&mut self) {
        outlined!(R, {
            for group in self.active() {
                let omega = self.angular_velocity(group, self.m[group]);
                self.torques.place(group, self.q[group], omega);
            }
            self.torques.form_expressions();
        });
    }

    /// The orientation and angular momentum of a lane group at a stage.
    #[inline(always)]
    fn placed<P: Stages>(&self, group: usize, stage: usize) -> (Quaternion<R>, Vector<R>) {
        let (q, m) = (self.state[group].orientation.value, self.state[group].angular_momentum_principal.value);
        if stage == 0 {
            return (q, m);
        }
        let slopes = TileSlopes { slopes: &self.slopes, group };
        let (slope, h) = P::change(&slopes, stage, self.h[group].value);
        (slope.q.axpy(h, q), slope.m.axpy(h, m))
    }

    /// Stores the slope of a lane group.
    #[inline(always)]
    fn store_slope(&mut self, group: usize, stage: usize, is_difference: bool, slope: Slope<R>) {
        self.slopes[stage][group] = if is_difference {
            let first = &self.slopes[0][group];
            Slope { q: slope.q - first.q, m: slope.m - first.m }
        } else {
            slope
        };
    }
}

/// The stages of a Runge-Kutta method.
trait Stages {
    /// Whether the slopes of later stages are stored as differences from the first.
    const DIFFERENCES: bool;
    /// The change of (q, m) that leads to a stage, for stages from the second, numbered 1, on: a slope and a step.
    fn change<R: Real>(slopes: &TileSlopes<'_, R>, stage: usize, h: R) -> (Slope<R>, R);
}

impl Stages for Rk8 {
    const DIFFERENCES: bool = true;
    #[inline(always)]
    fn change<R: Real>(slopes: &TileSlopes<'_, R>, stage: usize, h: R) -> (Slope<R>, R) {
        (rk8::stage_sum(slopes, stage), h)
    }
}

impl Stages for Rk4 {
    const DIFFERENCES: bool = false;
    #[inline(always)]
    fn change<R: Real>(slopes: &TileSlopes<'_, R>, stage: usize, h: R) -> (Slope<R>, R) {
        (slopes.slopes[stage - 1][slopes.group], if stage == 3 { h } else { h * R::splat(0.5) })
    }
}

/// Places the bodies of a tile at a stage.
#[inline(always)]
fn place<R: Real, P: Stages>(tile: &mut Tile<'_, R>, stage: usize) {
    for group in tile.active() {
        (tile.q[group], tile.m[group]) = tile.placed::<P>(group, stage);
    }
}

/// Forms the slopes there, for any torques.
#[inline(always)]
fn form_slopes<R: Real, P: Stages>(tile: &mut Tile<'_, R>, stage: usize, is_placed: bool) {
    for group in tile.active() {
        let (q, m) = if is_placed { (tile.q[group], tile.m[group]) } else { tile.placed::<P>(group, stage) };
        let (omega, m_rate) = tile.rates(group, q, m);
        let slope = Slope { q: orientation_rate(q, omega), m: m_rate };
        tile.store_slope(group, stage, P::DIFFERENCES && stage > 0, slope);
    }
}

/// Forms the slopes there without torques, and places the bodies for them.
#[inline(always)]
fn form_rigid_slopes<R: Real, P: Stages>(tile: &mut Tile<'_, R>, stage: usize) {
    for group in tile.active() {
        let (q, m) = tile.placed::<P>(group, stage);
        let body = &tile.body[group];
        let none = Correction::none();
        let correction = if R::Scalar::WORDS == 1 { &none } else { &tile.correction[group] };
        let omega = body.angular_velocity(m, correction);
        let gyroscopic_term = body.gyroscopic_term(m, correction);
        tile.slopes[stage][group] = Slope { q: orientation_rate(q, omega), m: gyroscopic_term };
        tile.torques.place(group, q, omega);
    }
    tile.torques.form_expressions();
}

/// Adds the torques to the slopes.
#[inline(always)]
fn add_expressions<R: Real, P: Stages>(tile: &mut Tile<'_, R>, stage: usize) {
    for group in tile.active() {
        let Slope { q, m } = tile.slopes[stage][group];
        let slope = Slope { q, m: m + tile.torques.sum_of_expressions(group) };
        tile.store_slope(group, stage, P::DIFFERENCES && stage > 0, slope);
    }
}

/// Forms the slopes there if only one torque acts on rigid bodies: a function for each kind, without code for the
/// others.
struct SlopesUnderOne<'s, 'a, R: Real> {
    tile: &'s mut Tile<'a, R>,
    stage: usize,
    is_difference: bool,
}

impl<R: Real> FormulaTask for SlopesUnderOne<'_, '_, R> {
    type Output = ();
    #[inline(always)]
    fn run<F: Formula>(self) {
        if matches!(F::ROLE, Role::Torque) {
            outlined!(R, form_slopes_under::<R, F>(self));
        }
    }
}

#[inline(always)]
fn form_slopes_under<R: Real, F: Formula>(SlopesUnderOne { tile, stage, is_difference }: SlopesUnderOne<'_, '_, R>) {
    for group in tile.active() {
        let (q, m, body) = (tile.q[group], tile.m[group], &tile.body[group]);
        let none = Correction::none();
        let correction = if R::Scalar::WORDS == 1 { &none } else { &tile.correction[group] };
        let omega = body.angular_velocity(m, correction);
        let gyroscopic_term = body.gyroscopic_term(m, correction);
        let m_rate = gyroscopic_term + tile.torques.only_torque::<F>(group, q, omega);
        let slope = Slope { q: orientation_rate(q, omega), m: m_rate };
        tile.store_slope(group, stage, is_difference, slope);
    }
}

impl<R: Real> Tile<'_, R> {
    /// ω = I⁻¹ m of a lane group.
    #[inline(always)]
    fn angular_velocity(&self, group: usize, m: Vector<R>) -> Vector<R> {
        let (body, none) = (&self.body[group], Correction::none());
        let correction = if R::Scalar::WORDS == 1 { &none } else { &self.correction[group] };
        self.torques.motion(group, body, correction, m).angular_velocity
    }

    /// The rate at which the axes of a lane group turn, and dm/dt.
    #[inline(always)]
    fn rates(&self, group: usize, q: Quaternion<R>, m: Vector<R>) -> (Vector<R>, Vector<R>) {
        let body = &self.body[group];
        let motion = if R::Scalar::WORDS == 1 {
            self.torques.motion(group, body, &Correction::none(), m)
        } else {
            self.torques.motion(group, body, &self.correction[group], m)
        };
        let sum = self.torques.sum(group, q, motion.angular_velocity);
        (motion.axes_rate, motion.gyroscopic_term + sum)
    }
}

/// The slopes of `rk8` of one lane group of a tile.
struct TileSlopes<'s, R> {
    slopes: &'s [Each<Slope<R>>; STAGES],
    group: usize,
}

impl<R: Real> Slopes<R> for TileSlopes<'_, R> {
    #[inline(always)]
    fn first(&self) -> Slope<R> {
        self.slopes[0][self.group]
    }

    #[inline(always)]
    fn difference(&self, index: usize) -> Slope<R> {
        self.slopes[index + 1][self.group]
    }
}

/// [`crate::kernel::method::rk8`].
pub(super) struct Rk8;

impl TileStep for Rk8 {
    #[inline(always)]
    fn step<R: Real>(tile: &mut Tile<'_, R>, index: u64) {
        tile.start(TileTime::Equal(index));
        for (stage, &fraction) in TIMES.iter().enumerate() {
            tile.at(fraction);
            tile.stage::<Rk8>(stage);
        }
        for group in tile.active() {
            let slopes = TileSlopes { slopes: &tile.slopes, group };
            tile.state[group] = rk8::advanced(&slopes, tile.h[group], tile.state[group]);
        }
    }
}

/// [`crate::kernel::method::rk4`].
pub(super) struct Rk4;

impl TileStep for Rk4 {
    #[inline(always)]
    fn step<R: Real>(tile: &mut Tile<'_, R>, index: u64) {
        tile.start(TileTime::Equal(index));
        for (stage, fraction) in [0.0, 0.5, 0.5, 1.0].into_iter().enumerate() {
            // The third stage has the time of the second.
            if stage != 2 {
                tile.at(fraction);
            }
            tile.stage::<Rk4>(stage);
        }
        for group in tile.active() {
            let [k1, k2, k3, k4, ..] = &tile.slopes;
            let slopes = [k1[group], k2[group], k3[group], k4[group]];
            tile.state[group] = rk4::advanced(slopes, tile.h[group], tile.state[group]);
        }
    }
}

/// Equal steps of a block.
pub(super) fn in_tiles<T: LaneScalar, M: TileStep>(block: Block<'_, '_, T>) {
    T::dispatch(Advance::<T, M>(block, PhantomData));
}

struct Advance<'a, 'b, T, M>(Block<'a, 'b, T>, PhantomData<M>);

impl<T: Scalar, M: TileStep> LaneTask<T> for Advance<'_, '_, T, M> {
    type Output = ();
    const IN_LANES_ONLY: bool = true;

    #[inline(always)]
    fn run<R: Real<Scalar = T>>(self) {
        let Self(block, _) = self;
        let mut tile = Tile::<R>::new(block.source);
        for offset in (0..block.bodies).step_by(GROUPS * R::LANES) {
            let groups = (block.bodies - offset).div_ceil(R::LANES);
            tile.load(&block.source, block.first + offset, groups, block.dt_words, |column, group| {
                R::load(&block.state[column][offset + group * R::LANES..])
            });
            for step in 0..block.steps {
                M::step(&mut tile, block.first_step + step);
            }
            for group in tile.active() {
                let offset = offset + group * R::LANES;
                store_state(&tile.state[group], |column, number: R| number.store(&mut block.state[column][offset..]));
            }
        }
    }
}
