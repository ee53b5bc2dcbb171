//! Programs carried out over tiles of bodies.
//!
//! A tile is some groups of lanes, in which each number is a slice with one element a group. Instructions are the outer
//! loop and groups the inner one, so that the cost of finding out what to do is shared by all bodies of the tile. A tile of
//! one scalar is the reference.

use super::functions;
use super::program::{Instruction, Kind, Program};
use crate::math::lanes::{Each, GROUPS, LaneScalar, LaneTask};
use crate::math::real::{Outlined, Real};

/// What a program works on, for tiles of `GROUPS` lane groups: its inputs, its constants and its slots, one after another.
#[derive(Clone)]
pub(crate) struct Scratch<R: Real, const GROUPS: usize> {
    inputs: usize,
    numbers: Vec<Each<R, GROUPS>>,
    truths: Vec<Each<R::Mask, GROUPS>>,
}

impl<R: Real, const GROUPS: usize> std::fmt::Debug for Scratch<R, GROUPS> {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter.debug_struct("Scratch").field("numbers", &self.numbers).finish_non_exhaustive()
    }
}

impl<R: Real, const GROUPS: usize> Scratch<R, GROUPS> {
    /// Memory for this program only.
    #[inline(always)]
    pub fn new(program: &Program) -> Self {
        let zero = R::splat(0.0);
        let inputs = program.inputs.len();
        let mut numbers = vec![Each([zero; GROUPS]); inputs + program.constants.len() + program.slots];
        for (index, constant) in program.constants.iter().enumerate() {
            numbers[inputs + index] = Each([R::splat(*constant); GROUPS]);
        }
        Self { inputs, numbers, truths: vec![Each([zero.less_than(zero); GROUPS]); program.truths] }
    }

    /// Where input `index` of [`Program::inputs`] is. What is written stays for later evaluations, so that parameters are loaded once
    /// for all stages of a step.
    ///
    /// # Panics
    ///
    /// If there is no such input.
    #[inline(always)]
    pub fn input(&mut self, index: usize) -> &mut Each<R, GROUPS> {
        assert!(index < self.inputs, "one of the inputs");
        &mut self.numbers[index]
    }
}

impl Program {
    /// Forms the results for all bodies of a tile from what [`Scratch::input`] holds, and stores them.
    ///
    /// # Panics
    ///
    /// If the scratch memory is that of another program, or the length of `outputs` does not fit it.
    #[inline(always)]
    pub(crate) fn run<R: Real, const GROUPS: usize>(
        &self,
        scratch: &mut Scratch<R, GROUPS>,
        outputs: &mut [Each<R, GROUPS>],
    ) {
        R::outlined(Evaluation { program: self, scratch, outputs, add: false });
    }

    /// As [`Program::run`], but adds the results to what `outputs` holds.
    ///
    /// # Panics
    ///
    /// As [`Program::run`].
    #[inline(always)]
    pub(crate) fn accumulate<R: Real, const GROUPS: usize>(
        &self,
        scratch: &mut Scratch<R, GROUPS>,
        outputs: &mut [Each<R, GROUPS>],
    ) {
        R::outlined(Evaluation { program: self, scratch, outputs, add: true });
    }

    /// The results of one body by scalar arithmetic: `f64` is the reference, `f32` the shader's twin.
    ///
    /// # Panics
    ///
    /// If the number of inputs is not that of [`Program::inputs`].
    pub fn evaluate_one<T: crate::math::real::Scalar>(&self, inputs: &[T]) -> Vec<T> {
        assert_eq!(inputs.len(), self.inputs.len(), "a number an input");
        let mut scratch = Scratch::<T, 1>::new(self);
        for (index, &input) in inputs.iter().enumerate() {
            *scratch.input(index) = Each([input]);
        }
        let mut outputs = vec![Each([T::default()]); self.outputs.len()];
        self.run(&mut scratch, &mut outputs);
        outputs.into_iter().map(|Each([output])| output).collect()
    }

    /// The results of many bodies by the widest lanes of this processor: `columns[i]` holds input i of all bodies, and
    /// the result holds as many columns as there are results.
    ///
    /// # Panics
    ///
    /// If the number of columns is not that of [`Program::inputs`], or a column is shorter than `bodies`.
    pub fn evaluate_columns<T: LaneScalar>(&self, columns: &[&[T]], bodies: usize) -> Vec<Vec<T>> {
        assert_eq!(columns.len(), self.inputs.len(), "a column an input");
        let mut outputs = vec![vec![T::default(); bodies]; self.outputs.len()];
        T::dispatch(Columns { program: self, columns, bodies, outputs: &mut outputs });
        outputs
    }
}

struct Columns<'a, T> {
    program: &'a Program,
    columns: &'a [&'a [T]],
    bodies: usize,
    outputs: &'a mut [Vec<T>],
}

impl<T: LaneScalar> LaneTask<T> for Columns<'_, T> {
    type Output = ();
    #[inline(always)]
    fn run<R: Real<Scalar = T>>(self) {
        let Self { program, columns, bodies, outputs } = self;
        let mut scratch = Scratch::<R, GROUPS>::new(program);
        let mut results = vec![Each([R::splat(0.0); GROUPS]); outputs.len()];
        let mut lanes = vec![T::default(); R::LANES];
        for first in (0..bodies).step_by(GROUPS * R::LANES) {
            for (index, column) in columns.iter().enumerate() {
                for (group, number) in scratch.input(index).iter_mut().enumerate() {
                    // Lanes behind the last body repeat it.
                    let start = first + group * R::LANES;
                    for (lane, value) in lanes.iter_mut().enumerate() {
                        *value = column[(start + lane).min(bodies - 1)];
                    }
                    *number = R::load(&lanes);
                }
            }
            program.run(&mut scratch, &mut results);
            for (output, tile) in outputs.iter_mut().zip(&results) {
                for (group, number) in tile.iter().enumerate() {
                    number.store(&mut lanes);
                    let start = (first + group * R::LANES).min(bodies);
                    let end = (start + R::LANES).min(bodies);
                    output[start..end].copy_from_slice(&lanes[..end - start]);
                }
            }
        }
    }
}

struct Evaluation<'a, R: Real, const GROUPS: usize> {
    program: &'a Program,
    scratch: &'a mut Scratch<R, GROUPS>,
    outputs: &'a mut [Each<R, GROUPS>],
    add: bool,
}

/// Carries out an operation for all groups. It is a macro because a closure cannot be made to be inlined. A result may take the place
/// of an operand that is not needed again.
macro_rules! for_each_group {
    ($to:expr, $a:expr, |$x:ident| $result:expr) => {
        for k in 0..GROUPS {
            let $x = $a[k];
            $to[k] = $result;
        }
    };
    ($to:expr, $a:expr, $b:expr, |$x:ident, $y:ident| $result:expr) => {
        for k in 0..GROUPS {
            let ($x, $y) = ($a[k], $b[k]);
            $to[k] = $result;
        }
    };
    ($to:expr, $a:expr, $b:expr, $c:expr, |$x:ident, $y:ident, $z:ident| $result:expr) => {
        for k in 0..GROUPS {
            let ($x, $y, $z) = ($a[k], $b[k], $c[k]);
            $to[k] = $result;
        }
    };
}

/// What needs much code is a function of its own.
struct FunctionOfTile<'a, R: Real, const GROUPS: usize> {
    numbers: &'a mut [Each<R, GROUPS>],
    instruction: Instruction,
}

impl<R: Real, const GROUPS: usize> Outlined for FunctionOfTile<'_, R, GROUPS> {
    type Output = ();
    #[inline(always)]
    fn run(self) {
        let Self { numbers, instruction } = self;
        let [to, a, b, c] = instruction.places();
        match instruction.kind {
            Kind::SinCos => {
                let a = numbers[a];
                for (k, &x) in a.iter().enumerate() {
                    (numbers[to][k], numbers[c][k]) = crate::math::real::sin_cos(x);
                }
            }
            Kind::Kepler => {
                let (a, b) = (numbers[a], numbers[b]);
                for (k, (&x, &y)) in a.iter().zip(b.iter()).enumerate() {
                    (numbers[to][k], numbers[c][k]) = functions::kepler(x, y);
                }
            }
            Kind::One(function) => {
                for_each_group!(numbers[to], numbers[a], |x| functions::of_one(function, x));
            }
            Kind::Two(function) => {
                for_each_group!(numbers[to], numbers[a], numbers[b], |x, y| functions::of_two(function, x, y));
            }
            _ => {}
        }
    }
}

impl<R: Real, const GROUPS: usize> Scratch<R, GROUPS> {
    /// Carries out all instructions.
    #[inline(always)]
    fn carry_out(&mut self, program: &Program) {
        let (numbers, truths) = (self.numbers.as_mut_slice(), self.truths.as_mut_slice());
        // One jump for a run of instructions of one kind: where a processor does not foresee it, it costs more than the work.
        let mut rest = program.instructions.as_slice();
        for &(kind, count) in &program.runs {
            let (run, later) = rest.split_at(usize::from(count));
            rest = later;
            macro_rules! each {
                (|$to:ident, $a:ident, $b:ident, $c:ident| $work:expr) => {
                    for instruction in run {
                        let [$to, $a, $b, $c] = instruction.places();
                        $work
                    }
                };
            }
            match kind {
                Kind::Add => each!(|to, a, b, _c| {
                    for_each_group!(numbers[to], numbers[a], numbers[b], |x, y| x + y);
                }),
                Kind::Sub => each!(|to, a, b, _c| {
                    for_each_group!(numbers[to], numbers[a], numbers[b], |x, y| x - y);
                }),
                Kind::Mul => each!(|to, a, b, _c| {
                    for_each_group!(numbers[to], numbers[a], numbers[b], |x, y| x * y);
                }),
                Kind::NegMul => each!(|to, a, b, _c| {
                    for_each_group!(numbers[to], numbers[a], numbers[b], |x, y| -(x * y));
                }),
                Kind::Div => each!(|to, a, b, _c| {
                    for_each_group!(numbers[to], numbers[a], numbers[b], |x, y| x / y);
                }),
                Kind::Min => each!(|to, a, b, _c| {
                    for_each_group!(numbers[to], numbers[a], numbers[b], |x, y| x.min(y));
                }),
                Kind::Max => each!(|to, a, b, _c| {
                    for_each_group!(numbers[to], numbers[a], numbers[b], |x, y| x.max(y));
                }),
                Kind::MulAdd => each!(|to, a, b, c| {
                    for_each_group!(numbers[to], numbers[a], numbers[b], numbers[c], |x, y, z| x.mul_add(y, z));
                }),
                Kind::MulSub => each!(|to, a, b, c| {
                    for_each_group!(numbers[to], numbers[a], numbers[b], numbers[c], |x, y, z| x.mul_add(y, -z));
                }),
                Kind::NegMulAdd => each!(|to, a, b, c| {
                    for_each_group!(numbers[to], numbers[a], numbers[b], numbers[c], |x, y, z| (-x).mul_add(y, z));
                }),
                Kind::NegMulSub => each!(|to, a, b, c| {
                    for_each_group!(numbers[to], numbers[a], numbers[b], numbers[c], |x, y, z| (-x).mul_add(y, -z));
                }),
                Kind::Neg => each!(|to, a, _b, _c| for_each_group!(numbers[to], numbers[a], |x| -x)),
                Kind::Sqrt => each!(|to, a, _b, _c| for_each_group!(numbers[to], numbers[a], |x| x.sqrt())),
                Kind::Abs => each!(|to, a, _b, _c| for_each_group!(numbers[to], numbers[a], |x| x.abs())),
                Kind::Round => each!(|to, a, _b, _c| for_each_group!(numbers[to], numbers[a], |x| x.round())),
                Kind::Less => each!(|to, a, b, _c| {
                    for_each_group!(truths[to], numbers[a], numbers[b], |x, y| x.less_than(y));
                }),
                Kind::And => each!(|to, a, b, _c| {
                    for_each_group!(truths[to], truths[a], truths[b], |x, y| x & y);
                }),
                Kind::Or => each!(|to, a, b, _c| {
                    for_each_group!(truths[to], truths[a], truths[b], |x, y| x | y);
                }),
                Kind::Not => each!(|to, a, _b, _c| for_each_group!(truths[to], truths[a], |x| !x)),
                Kind::Select => each!(|to, a, b, c| {
                    for_each_group!(numbers[to], truths[a], numbers[b], numbers[c], |x, y, z| R::select(x, y, z));
                }),
                Kind::SinCos | Kind::Kepler | Kind::One(_) | Kind::Two(_) => {
                    for &instruction in run {
                        R::outlined(FunctionOfTile { numbers: &mut *numbers, instruction });
                    }
                }
            }
        }
    }
}

impl<R: Real, const GROUPS: usize> Outlined for Evaluation<'_, R, GROUPS> {
    type Output = ();
    #[inline(always)]
    fn run(self) {
        let Self { program, scratch, outputs, add } = self;
        let count = program.inputs.len() + program.constants.len() + program.slots;
        assert_eq!(scratch.numbers.len(), count, "its own memory");
        assert_eq!(outputs.len(), program.outputs.len(), "room for all results");
        scratch.carry_out(program);
        for (output, from) in outputs.iter_mut().zip(&program.outputs) {
            let from = &scratch.numbers[usize::from(*from)];
            for group in 0..GROUPS {
                output[group] = if add { output[group] + from[group] } else { from[group] };
            }
        }
    }
}
