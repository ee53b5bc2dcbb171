//! Programs carried out over tiles of bodies.
//!
//! A tile is some groups of lanes, in which each number is a slice with one element a group. Instructions are the outer
//! loop and groups the inner one, so that the cost of finding out what to do is shared by all bodies of the tile. A tile of
//! one scalar is the reference.

use std::cell::Cell;

use super::functions;
use super::program::{Instruction, Kind, Program};
use crate::lanes::{LaneScalar, LaneTask};
use crate::real::{Outlined, Real};

/// What a program works on for one size of tile: its inputs, its constants and its slots, one after another.
#[derive(Clone)]
pub struct Scratch<R: Real> {
    groups: usize,
    inputs: usize,
    numbers: Vec<R>,
    truths: Vec<R::Mask>,
}

impl<R: Real> std::fmt::Debug for Scratch<R> {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter
            .debug_struct("Scratch")
            .field("groups", &self.groups)
            .field("numbers", &self.numbers)
            .finish_non_exhaustive()
    }
}

impl<R: Real> Scratch<R> {
    /// Memory for tiles of `groups` groups of lanes, for this program only.
    #[inline(always)]
    pub fn new(program: &Program, groups: usize) -> Self {
        let zero = R::splat(0.0);
        let inputs = program.inputs.len();
        let mut numbers = vec![zero; (inputs + program.constants.len() + program.slots) * groups];
        for (index, constant) in program.constants.iter().enumerate() {
            for number in &mut numbers[(inputs + index) * groups..][..groups] {
                *number = R::splat(*constant);
            }
        }
        Self { groups, inputs, numbers, truths: vec![zero.less_than(zero); program.truths * groups] }
    }

    /// Groups of lanes in a tile.
    #[inline(always)]
    pub fn groups(&self) -> usize {
        self.groups
    }

    /// Where input `index` of [`Program::inputs`] is, one number a group. What is written stays for later evaluations, so
    /// that parameters are loaded once for all stages of a step.
    ///
    /// # Panics
    ///
    /// If there is no such input.
    #[inline(always)]
    pub fn input(&mut self, index: usize) -> &mut [R] {
        assert!(index < self.inputs, "one of the inputs");
        &mut self.numbers[index * self.groups..][..self.groups]
    }
}

impl Program {
    /// Forms the results for all bodies of a tile from what [`Scratch::input`] holds, and stores them: result k of group g
    /// at `k * groups + g`.
    ///
    /// # Panics
    ///
    /// If the scratch memory is that of another program, or the length of `outputs` does not fit it.
    #[inline(always)]
    pub fn run<R: Real>(&self, scratch: &mut Scratch<R>, outputs: &mut [R]) {
        R::outlined(Evaluation { program: self, scratch, outputs, add: false });
    }

    /// As [`Program::run`], but adds the results to what `outputs` holds.
    ///
    /// # Panics
    ///
    /// As [`Program::run`].
    #[inline(always)]
    pub fn accumulate<R: Real>(&self, scratch: &mut Scratch<R>, outputs: &mut [R]) {
        R::outlined(Evaluation { program: self, scratch, outputs, add: true });
    }

    /// As [`Program::run`] with all inputs given: `inputs[i]` holds what [`Program::inputs`] names at i.
    ///
    /// # Panics
    ///
    /// As [`Program::run`], and if the number or the lengths of inputs do not fit.
    #[inline(always)]
    pub fn evaluate<R: Real>(&self, scratch: &mut Scratch<R>, inputs: &[&[R]], outputs: &mut [R]) {
        assert_eq!(inputs.len(), self.inputs.len(), "a slice an input");
        for (index, input) in inputs.iter().enumerate() {
            scratch.input(index).copy_from_slice(input);
        }
        self.run(scratch, outputs);
    }

    /// The results of one body by scalar arithmetic: `f64` is the reference, `f32` the shader's twin.
    ///
    /// # Panics
    ///
    /// If the number of inputs is not that of [`Program::inputs`].
    pub fn evaluate_one<T: crate::real::Scalar>(&self, inputs: &[T]) -> Vec<T> {
        let slices: Vec<&[T]> = inputs.iter().map(std::slice::from_ref).collect();
        let mut outputs = vec![T::default(); self.outputs.len()];
        self.evaluate::<T>(&mut Scratch::new(self, 1), &slices, &mut outputs);
        outputs
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

/// Groups of lanes in a tile of [`Program::evaluate_columns`].
const GROUPS: usize = 4;

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
        let zero = R::splat(0.0);
        let mut scratch = Scratch::<R>::new(program, GROUPS);
        let mut loaded = vec![zero; columns.len() * GROUPS];
        let mut results = vec![zero; outputs.len() * GROUPS];
        let mut lanes = vec![T::default(); R::LANES];
        for first in (0..bodies).step_by(GROUPS * R::LANES) {
            for (column, tile) in columns.iter().zip(loaded.chunks_exact_mut(GROUPS)) {
                for (group, number) in tile.iter_mut().enumerate() {
                    // Lanes behind the last body repeat it.
                    let start = first + group * R::LANES;
                    for (lane, value) in lanes.iter_mut().enumerate() {
                        *value = column[(start + lane).min(bodies - 1)];
                    }
                    *number = R::load(&lanes);
                }
            }
            let inputs: Vec<&[R]> = loaded.chunks_exact(GROUPS).collect();
            program.evaluate(&mut scratch, &inputs, &mut results);
            for (output, tile) in outputs.iter_mut().zip(results.chunks_exact(GROUPS)) {
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

/// Groups that an instruction is carried out for at once, where there are as many.
const LARGE: usize = 8;
/// The same where there are fewer.
const SMALL: usize = 4;

struct Evaluation<'a, R: Real> {
    program: &'a Program,
    scratch: &'a mut Scratch<R>,
    outputs: &'a mut [R],
    add: bool,
}

/// `N` groups of a tile from `at` on, during an evaluation. Their number is known to the compiler, as a loop over few groups
/// costs more by its branches than by its operations. Cells, because a result may take the place of an operand that is not
/// needed again.
#[derive(Clone, Copy)]
struct Block<'a, R: Real, const N: usize> {
    numbers: &'a [Cell<R>],
    truths: &'a [Cell<R::Mask>],
    groups: usize,
    at: usize,
}

impl<'a, R: Real, const N: usize> Block<'a, R, N> {
    #[inline(always)]
    fn number(self, operand: u16) -> &'a [Cell<R>] {
        &self.numbers[usize::from(operand) * self.groups + self.at..][..N]
    }

    #[inline(always)]
    fn truth(self, operand: u16) -> &'a [Cell<R::Mask>] {
        &self.truths[usize::from(operand) * self.groups + self.at..][..N]
    }
}

/// Carries out an operation for all groups of a block. It is a macro because a closure cannot be made to be inlined.
macro_rules! for_each_group {
    ($to:expr, $a:expr, |$x:ident| $result:expr) => {{
        let (to, a) = ($to, $a);
        for k in 0..N {
            let $x = a[k].get();
            to[k].set($result);
        }
    }};
    ($to:expr, $a:expr, $b:expr, |$x:ident, $y:ident| $result:expr) => {{
        let (to, a, b) = ($to, $a, $b);
        for k in 0..N {
            let ($x, $y) = (a[k].get(), b[k].get());
            to[k].set($result);
        }
    }};
    ($to:expr, $a:expr, $b:expr, $c:expr, |$x:ident, $y:ident, $z:ident| $result:expr) => {{
        let (to, a, b, c) = ($to, $a, $b, $c);
        for k in 0..N {
            let ($x, $y, $z) = (a[k].get(), b[k].get(), c[k].get());
            to[k].set($result);
        }
    }};
}

/// What needs much code is a function of its own.
struct FunctionOfTile<'a, R: Real, const N: usize> {
    tile: Block<'a, R, N>,
    instruction: Instruction,
}

impl<R: Real, const N: usize> Outlined for FunctionOfTile<'_, R, N> {
    type Output = ();
    #[inline(always)]
    fn run(self) {
        let Self { tile, instruction: Instruction { kind, to, a, b, c } } = self;
        match kind {
            Kind::SinCos => {
                for ((sin, cos), a) in tile.number(to).iter().zip(tile.number(c)).zip(tile.number(a)) {
                    let (sin_a, cos_a) = crate::real::sin_cos(a.get());
                    sin.set(sin_a);
                    cos.set(cos_a);
                }
            }
            Kind::Kepler => {
                let results = tile.number(to).iter().zip(tile.number(c));
                for ((sin, cos), (a, b)) in results.zip(tile.number(a).iter().zip(tile.number(b))) {
                    let (sin_e, cos_e) = functions::kepler(a.get(), b.get());
                    sin.set(sin_e);
                    cos.set(cos_e);
                }
            }
            Kind::One(function) => {
                for_each_group!(tile.number(to), tile.number(a), |x| functions::of_one(function, x));
            }
            Kind::Two(function) => {
                let (a, b) = (tile.number(a), tile.number(b));
                for_each_group!(tile.number(to), a, b, |x, y| functions::of_two(function, x, y));
            }
            _ => {}
        }
    }
}

impl<R: Real, const N: usize> Block<'_, R, N> {
    /// Carries out all instructions.
    #[inline(always)]
    fn carry_out(self, program: &Program) {
        let tile = self;
        // One jump for a run of instructions of one kind: where a processor does not foresee it, it costs more than the work.
        let mut rest = program.instructions.as_slice();
        for &(kind, count) in &program.runs {
            let (run, later) = rest.split_at(usize::from(count));
            rest = later;
            macro_rules! each {
                (|$to:ident, $a:ident, $b:ident, $c:ident| $work:expr) => {
                    for &Instruction { to: $to, a: $a, b: $b, c: $c, .. } in run {
                        $work
                    }
                };
            }
            match kind {
                Kind::Add => each!(|to, a, b, _c| {
                    for_each_group!(tile.number(to), tile.number(a), tile.number(b), |x, y| x + y);
                }),
                Kind::Sub => each!(|to, a, b, _c| {
                    for_each_group!(tile.number(to), tile.number(a), tile.number(b), |x, y| x - y);
                }),
                Kind::Mul => each!(|to, a, b, _c| {
                    for_each_group!(tile.number(to), tile.number(a), tile.number(b), |x, y| x * y);
                }),
                Kind::NegMul => each!(|to, a, b, _c| {
                    for_each_group!(tile.number(to), tile.number(a), tile.number(b), |x, y| -(x * y));
                }),
                Kind::Div => each!(|to, a, b, _c| {
                    for_each_group!(tile.number(to), tile.number(a), tile.number(b), |x, y| x / y);
                }),
                Kind::Min => each!(|to, a, b, _c| {
                    for_each_group!(tile.number(to), tile.number(a), tile.number(b), |x, y| x.min(y));
                }),
                Kind::Max => each!(|to, a, b, _c| {
                    for_each_group!(tile.number(to), tile.number(a), tile.number(b), |x, y| x.max(y));
                }),
                Kind::MulAdd => each!(|to, a, b, c| {
                    let (a, b, c) = (tile.number(a), tile.number(b), tile.number(c));
                    for_each_group!(tile.number(to), a, b, c, |x, y, z| x.mul_add(y, z));
                }),
                Kind::MulSub => each!(|to, a, b, c| {
                    let (a, b, c) = (tile.number(a), tile.number(b), tile.number(c));
                    for_each_group!(tile.number(to), a, b, c, |x, y, z| x.mul_add(y, -z));
                }),
                Kind::NegMulAdd => each!(|to, a, b, c| {
                    let (a, b, c) = (tile.number(a), tile.number(b), tile.number(c));
                    for_each_group!(tile.number(to), a, b, c, |x, y, z| (-x).mul_add(y, z));
                }),
                Kind::NegMulSub => each!(|to, a, b, c| {
                    let (a, b, c) = (tile.number(a), tile.number(b), tile.number(c));
                    for_each_group!(tile.number(to), a, b, c, |x, y, z| (-x).mul_add(y, -z));
                }),
                Kind::Neg => each!(|to, a, _b, _c| for_each_group!(tile.number(to), tile.number(a), |x| -x)),
                Kind::Sqrt => each!(|to, a, _b, _c| for_each_group!(tile.number(to), tile.number(a), |x| x.sqrt())),
                Kind::Abs => each!(|to, a, _b, _c| for_each_group!(tile.number(to), tile.number(a), |x| x.abs())),
                Kind::Round => each!(|to, a, _b, _c| for_each_group!(tile.number(to), tile.number(a), |x| x.round())),
                Kind::Less => each!(|to, a, b, _c| {
                    for_each_group!(tile.truth(to), tile.number(a), tile.number(b), |x, y| x.less_than(y));
                }),
                Kind::And => each!(|to, a, b, _c| {
                    for_each_group!(tile.truth(to), tile.truth(a), tile.truth(b), |x, y| x & y);
                }),
                Kind::Or => each!(|to, a, b, _c| {
                    for_each_group!(tile.truth(to), tile.truth(a), tile.truth(b), |x, y| x | y);
                }),
                Kind::Not => each!(|to, a, _b, _c| for_each_group!(tile.truth(to), tile.truth(a), |x| !x)),
                Kind::Select => each!(|to, a, b, c| {
                    let (a, b, c) = (tile.truth(a), tile.number(b), tile.number(c));
                    for_each_group!(tile.number(to), a, b, c, |x, y, z| R::select(x, y, z));
                }),
                Kind::SinCos | Kind::Kepler | Kind::One(_) | Kind::Two(_) => {
                    for &instruction in run {
                        R::outlined(FunctionOfTile { tile, instruction });
                    }
                }
            }
        }
    }
}

impl<R: Real> Outlined for Evaluation<'_, R> {
    type Output = ();
    #[inline(always)]
    fn run(self) {
        let Self { program, scratch, outputs, add } = self;
        let groups = scratch.groups;
        let count = (program.inputs.len() + program.constants.len() + program.slots) * groups;
        assert_eq!(scratch.numbers.len(), count, "its own memory");
        assert_eq!(outputs.len(), program.outputs.len() * groups, "room for all results");
        let numbers = Cell::from_mut(scratch.numbers.as_mut_slice()).as_slice_of_cells();
        let truths = Cell::from_mut(scratch.truths.as_mut_slice()).as_slice_of_cells();
        let mut at = 0;
        while at + LARGE <= groups {
            Block::<R, LARGE> { numbers, truths, groups, at }.carry_out(program);
            at += LARGE;
        }
        while at + SMALL <= groups {
            Block::<R, SMALL> { numbers, truths, groups, at }.carry_out(program);
            at += SMALL;
        }
        while at < groups {
            Block::<R, 1> { numbers, truths, groups, at }.carry_out(program);
            at += 1;
        }
        for (output, results) in program.outputs.iter().zip(outputs.chunks_exact_mut(groups)) {
            let from = &numbers[usize::from(*output) * groups..][..groups];
            for (result, number) in results.iter_mut().zip(from) {
                *result = if add { *result + number.get() } else { number.get() };
            }
        }
    }
}
