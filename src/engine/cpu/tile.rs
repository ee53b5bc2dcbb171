//! Driven bodies in tiles: a method goes stage by stage over a few lane groups whose slopes stay in the first-level cache, and the torques
//! add their parts for all of them at once ([`crate::torque::tile`]).
//!
//! What a step makes of its slopes is the text of the method's own file.

use std::marker::PhantomData;

use super::Block;
use super::adaptive::{Block as AdaptiveBlock, load_controller, store_controller};
use crate::batch::{load_body, load_state, store_state};
use crate::lanes::{LaneScalar, LaneTask};
use crate::method::cf4::{self, Turn};
use crate::method::rk8::{STAGES, Slopes, TIMES};
use crate::method::rk8_adaptive::{LEAST_STEP, Limits, Trial};
use crate::method::slope::Slope;
use crate::method::{rk4, rk8};
use crate::quaternion::Quaternion;
use crate::real::{Outlined, Real, Scalar};
use crate::rigid_body::{Body, Correction, State, orientation_rate};
use crate::torque::formula::{Formula, FormulaTask, Role};
use crate::torque::sum::Source;
use crate::torque::tile::{Each, GROUPS, TileTime, TileTorques};
use crate::vector::{TwoWords, Vector};

/// A method with equal steps, on tiles.
pub(super) trait TileStep {
    /// Advances the bodies of a tile by the interval's step with this number.
    fn step<R: Real>(tile: &mut Tile<'_, R>, index: u64);
}

/// Some lane groups of bodies, and what acts on them.
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
    /// Where the bodies stand at a stage.
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
            body: [body; GROUPS],
            h: [TwoWords { value: zero, residue: zero }; GROUPS],
            state: [state; GROUPS],
            correction: [body.correction(&state); GROUPS],
            groups: [0, 1, 2, 3],
            active: 0,
            q: [q; GROUPS],
            m: [Vector::zero(); GROUPS],
            slopes: [[Slope { q, m: Vector::zero() }; GROUPS]; STAGES],
        }
    }

    /// Takes the bodies of `groups` lane groups from body `first` on; `interval` is a step or a span, s.
    #[inline(always)]
    fn load(
        &mut self,
        source: &Source<'a, R::Scalar>,
        first: usize,
        groups: usize,
        interval: TwoWords<R::Scalar>,
        state: impl Fn(usize, usize) -> R,
    ) -> Each<R> {
        let mut rates = [R::splat(0.0); GROUPS];
        for (group, rate_of_group) in rates.iter_mut().enumerate().take(groups) {
            let columns = source.group::<R>(first + group * R::LANES, &[]);
            let (body, rate) = load_body(|column| columns.column(column));
            self.body[group] = body;
            self.h[group] = TwoWords {
                value: R::splat(interval.value.to_f64()) * rate,
                residue: R::splat(interval.residue.to_f64()) * rate,
            };
            self.state[group] = load_state(|column| state(column, group));
            *rate_of_group = rate;
        }
        self.groups = [0, 1, 2, 3];
        self.active = groups.min(GROUPS);
        self.torques.load(first, self.active);
        rates
    }

    /// The lane groups that are advanced, by number.
    #[inline(always)]
    fn active(&self) -> impl Iterator<Item = usize> + use<R> {
        let (groups, active) = (self.groups, self.active);
        (0..active.min(GROUPS)).map(move |place| groups[place % GROUPS] % GROUPS)
    }

    /// Forms what holds for a whole step.
    #[inline(always)]
    fn start(&mut self, time: TileTime<'_, R>) {
        if R::Scalar::WORDS == 2 {
            for group in self.active() {
                self.correction[group] = self.body[group].correction(&self.state[group]);
            }
        }
        self.torques.start(time, &self.groups[..self.active.min(GROUPS)]);
    }

    /// What follows from the time, at a fraction of an equal step.
    #[inline(always)]
    fn at(&mut self, fraction: f64) {
        let elapsed = [R::splat(fraction * self.seconds); GROUPS];
        self.torques.at(&elapsed, &self.groups[..self.active.min(GROUPS)]);
    }

    /// Forms the slopes of a stage of a Runge-Kutta method on (q, m); the first stage is 0.
    #[inline(always)]
    fn stage<P: Stages>(&mut self, stage: usize) {
        R::outlined(Place::<R, P> { tile: self, stage, method: PhantomData });
        let is_difference = P::DIFFERENCES && stage > 0;
        match self.torques.only() {
            Some(kind) => kind.with(SlopesUnderOne { tile: self, stage, is_difference }),
            None => R::outlined(FormSlopes { tile: self, stage, is_difference }),
        }
    }

    /// Stores the slope of a lane group at the place where it stands.
    #[inline(always)]
    fn store_slope(&mut self, group: usize, stage: usize, is_difference: bool, omega: Vector<R>, m_rate: Vector<R>) {
        let slope = Slope { q: orientation_rate(self.q[group], omega), m: m_rate };
        self.slopes[stage][group] = if is_difference {
            let first = &self.slopes[0][group];
            Slope { q: slope.q - first.q, m: slope.m - first.m }
        } else {
            slope
        };
    }
}

/// What leads to the stages of a Runge-Kutta method.
trait Stages {
    /// Whether the slopes of the later stages are kept less the first.
    const DIFFERENCES: bool;
    /// The change of (q, m) that leads to a stage from the second, numbered 1, on.
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

/// Where the bodies of a tile stand at a stage.
struct Place<'s, 'a, R: Real, P> {
    tile: &'s mut Tile<'a, R>,
    stage: usize,
    method: PhantomData<P>,
}

impl<R: Real, P: Stages> Outlined for Place<'_, '_, R, P> {
    type Output = ();
    #[inline(always)]
    fn run(self) {
        let Self { tile, stage, .. } = self;
        for group in tile.active() {
            let (q, m) = (tile.state[group].orientation.value, tile.state[group].angular_momentum_principal.value);
            (tile.q[group], tile.m[group]) = if stage == 0 {
                (q, m)
            } else {
                let slopes = TileSlopes { slopes: &tile.slopes, group };
                let (slope, h) = P::change(&slopes, stage, tile.h[group].value);
                (slope.q.axpy(h, q), slope.m.axpy(h, m))
            };
        }
    }
}

/// The slopes there, whatever acts.
struct FormSlopes<'s, 'a, R: Real> {
    tile: &'s mut Tile<'a, R>,
    stage: usize,
    is_difference: bool,
}

impl<R: Real> Outlined for FormSlopes<'_, '_, R> {
    type Output = ();
    #[inline(always)]
    fn run(self) {
        let Self { tile, stage, is_difference } = self;
        for group in tile.active() {
            let (omega, m_rate) = tile.rates(group, tile.q[group], tile.m[group]);
            tile.store_slope(group, stage, is_difference, omega, m_rate);
        }
    }
}

/// The slopes there, where one torque acts on rigid bodies: a function for each kind, with nothing in it of the others.
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
            R::outlined(FormSlopesUnder::<R, F> { task: self, formula: PhantomData });
        }
    }
}

struct FormSlopesUnder<'s, 'a, R: Real, F> {
    task: SlopesUnderOne<'s, 'a, R>,
    formula: PhantomData<F>,
}

impl<R: Real, F: Formula> Outlined for FormSlopesUnder<'_, '_, R, F> {
    type Output = ();
    #[inline(always)]
    fn run(self) {
        let SlopesUnderOne { tile, stage, is_difference } = self.task;
        for group in tile.active() {
            let (q, m, body) = (tile.q[group], tile.m[group], &tile.body[group]);
            let none = Correction::none();
            let correction = if R::Scalar::WORDS == 1 { &none } else { &tile.correction[group] };
            let omega = body.angular_velocity(m, correction);
            let gyroscopic_term = body.gyroscopic_term(m, correction);
            let m_rate = gyroscopic_term + tile.torques.only_torque::<F>(group, q, omega);
            tile.store_slope(group, stage, is_difference, omega, m_rate);
        }
    }
}

impl<R: Real> Tile<'_, R> {
    /// ω and dm/dt of a lane group.
    #[inline(always)]
    fn rates(&self, group: usize, q: Quaternion<R>, m: Vector<R>) -> (Vector<R>, Vector<R>) {
        let body = &self.body[group];
        let motion = if R::Scalar::WORDS == 1 {
            self.torques.motion(group, body, &Correction::none(), m)
        } else {
            self.torques.motion(group, body, &self.correction[group], m)
        };
        let sum = self.torques.sum(group, q, motion.angular_velocity);
        (motion.angular_velocity, motion.gyroscopic_term + sum)
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

/// [`crate::method::rk8`].
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

/// [`crate::method::rk4`].
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

/// [`crate::method::cf4`].
pub(super) struct Cf4;

impl TileStep for Cf4 {
    #[inline(always)]
    fn step<R: Real>(tile: &mut Tile<'_, R>, index: u64) {
        tile.start(TileTime::Equal(index));
        let turn = Turn { omega: Vector::zero(), m: Vector::zero() };
        let (mut turns, mut second) = ([[turn; 4]; GROUPS], [tile.state[0].orientation.value; GROUPS]);
        for (stage, fraction) in [0.0, 0.5, 0.5, 1.0].into_iter().enumerate() {
            if stage != 2 {
                tile.at(fraction);
            }
            R::outlined(FormTurns { tile, stage, turns: &mut turns, second: &mut second });
        }
        for group in tile.active() {
            tile.state[group] = cf4::advanced(turns[group], tile.h[group], tile.state[group]);
        }
    }
}

/// The rates of a stage of `cf4`.
struct FormTurns<'s, 'a, R: Real> {
    tile: &'s mut Tile<'a, R>,
    stage: usize,
    turns: &'s mut Each<[Turn<R>; 4]>,
    /// The attitude at the second stage.
    second: &'s mut Each<Quaternion<R>>,
}

impl<R: Real> Outlined for FormTurns<'_, '_, R> {
    type Output = ();
    #[inline(always)]
    fn run(self) {
        let Self { tile, stage, turns, second } = self;
        for group in tile.active() {
            let (q, m) = (tile.state[group].orientation.value, tile.state[group].angular_momentum_principal.value);
            let (dt, k) = (tile.h[group].value, &turns[group]);
            let half = dt * R::splat(0.5);
            let (q, m) = match stage {
                0 => (q, m),
                1 => (cf4::rotated(q, k[0].omega * half), k[0].m.axpy(half, m)),
                2 => (cf4::rotated(q, k[1].omega * half), k[1].m.axpy(half, m)),
                _ => (cf4::rotated(second[group], k[2].omega * dt - k[0].omega * half), k[2].m.axpy(dt, m)),
            };
            if stage == 1 {
                second[group] = q;
            }
            let (omega, m) = tile.rates(group, q, m);
            turns[group][stage % 4] = Turn { omega, m };
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

/// Attempts of a block; says whether any body is still under way.
pub(super) fn attempts_in_tiles<T: LaneScalar>(block: AdaptiveBlock<'_, '_, T>) -> bool {
    T::dispatch(Attempts(block))
}

struct Attempts<'a, 'b, T>(AdaptiveBlock<'a, 'b, T>);

impl<T: Scalar> LaneTask<T> for Attempts<'_, '_, T> {
    type Output = bool;
    const IN_LANES_ONLY: bool = true;

    #[inline(always)]
    fn run<R: Real<Scalar = T>>(self) -> bool {
        let Self(block) = self;
        let mut tile = Tile::<R>::new(block.source);
        let mut any_under_way = false;
        for offset in (0..block.bodies).step_by(GROUPS * R::LANES) {
            let groups = (block.bodies - offset).div_ceil(R::LANES).min(GROUPS);
            // Rows that are no bodies have the rate 0, so that nothing is left to do in them.
            let rates = tile.load(&block.source, block.first + offset, groups, block.span, |column, group| {
                R::load(&block.state[column][offset + group * R::LANES..])
            });
            let spans = tile.h;
            let mut controllers = [Default::default(); GROUPS];
            for group in tile.active() {
                let offset = offset + group * R::LANES;
                let controller = load_controller(|column| R::load(&block.controllers[column][offset..]));
                controllers[group] = if block.starts { controller.over(spans[group]) } else { controller };
            }
            let mut limits =
                [Limits { tolerance: R::splat(block.steps.tolerance), least_step: R::splat(LEAST_STEP) }; GROUPS];
            if let Some(seconds) = block.steps.least_step {
                for group in tile.active() {
                    limits[group].least_step = R::splat(seconds) * rates[group];
                }
            }
            for _ in 0..super::adaptive::SLICE {
                tile.active = 0;
                for (group, controller) in controllers.iter().enumerate().take(groups) {
                    if R::any(controller.under_way(&tile.state[group])) {
                        tile.groups[tile.active % GROUPS] = group;
                        tile.active += 1;
                    }
                }
                if tile.active == 0 {
                    break;
                }
                let mut gone = spans;
                let mut trials = [None; GROUPS];
                for group in tile.active() {
                    let (body, state) = (&tile.body[group], &tile.state[group]);
                    let trial = Trial::new(body, spans[group], &limits[group], &controllers[group], state);
                    (tile.h[group], gone[group]) = (trial.h, trial.gone);
                    trials[group] = Some(trial);
                }
                tile.start(TileTime::Own(&gone));
                for (stage, &fraction) in TIMES.iter().enumerate() {
                    // Closures that the standard library calls are not compiled for the lanes.
                    let mut elapsed = [R::splat(0.0); GROUPS];
                    for group in tile.active() {
                        elapsed[group] = tile.h[group].value * R::splat(fraction);
                    }
                    tile.torques.at(&elapsed, &tile.groups[..tile.active.min(GROUPS)]);
                    tile.stage::<Rk8>(stage);
                }
                for group in tile.active() {
                    let slopes = TileSlopes { slopes: &tile.slopes, group };
                    if let Some(trial) = &trials[group] {
                        (tile.state[group], controllers[group]) =
                            trial.concluded(&slopes, &limits[group], controllers[group], tile.state[group]);
                    }
                }
            }
            for (group, controller) in controllers.iter().enumerate().take(groups) {
                any_under_way |= R::any(controller.under_way(&tile.state[group]));
                let offset = offset + group * R::LANES;
                store_state(&tile.state[group], |column, number: R| number.store(&mut block.state[column][offset..]));
                store_controller(controller, |column, number: R| {
                    number.store(&mut block.controllers[column][offset..]);
                });
            }
        }
        any_under_way
    }
}
