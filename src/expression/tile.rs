//! Programs carried out over tiles of bodies.
//!
//! A tile is some groups of lanes, in which each number is a slice with one element a group. Instructions are the outer
//! loop and groups the inner one, so that the cost of finding out what to do is shared by all bodies of the tile. A tile of
//! one scalar is the reference.

use super::functions;
use super::program::{Kind, Program};
use crate::lanes::{LaneScalar, LaneTask};
use crate::real::{Outlined, Real};

/// Groups that are worked on at once, so that their numbers stay in registers within an instruction.
const BLOCK: usize = 4;

/// What a program needs of memory for one size of tile: its constants and its slots.
#[derive(Clone, Debug)]
pub struct Scratch<R: Real> {
    groups: usize,
    numbers: Vec<R>,
    truths: Vec<R::Mask>,
}

impl<R: Real> Scratch<R> {
    /// Memory for tiles of `groups` groups of lanes, for this program only.
    #[inline(always)]
    pub fn new(program: &Program, groups: usize) -> Self {
        let zero = R::splat(0.0);
        let mut numbers = vec![zero; (program.constants.len() + program.slots) * groups];
        for (index, constant) in program.constants.iter().enumerate() {
            for number in &mut numbers[index * groups..(index + 1) * groups] {
                *number = R::splat(*constant);
            }
        }
        Self { groups, numbers, truths: vec![zero.less_than(zero); program.truths * groups] }
    }
}

impl Program {
    /// Forms the results for all bodies of a tile and stores them: result k of group g at `k * groups + g`.
    ///
    /// `inputs[i]` holds what [`Program::inputs`] names at i, one number a group.
    ///
    /// # Panics
    ///
    /// If the scratch memory is that of another program, or the number or the lengths of inputs or outputs do not fit it.
    #[inline(always)]
    pub fn evaluate<R: Real>(&self, scratch: &mut Scratch<R>, inputs: &[&[R]], outputs: &mut [R]) {
        R::outlined(Evaluation::<R, false> { program: self, scratch, inputs, outputs });
    }

    /// As [`Program::evaluate`], but adds the results to what `outputs` holds.
    ///
    /// # Panics
    ///
    /// As [`Program::evaluate`].
    #[inline(always)]
    pub fn accumulate<R: Real>(&self, scratch: &mut Scratch<R>, inputs: &[&[R]], outputs: &mut [R]) {
        R::outlined(Evaluation::<R, true> { program: self, scratch, inputs, outputs });
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

struct Evaluation<'a, R: Real, const ADD: bool> {
    program: &'a Program,
    scratch: &'a mut Scratch<R>,
    inputs: &'a [&'a [R]],
    outputs: &'a mut [R],
}

/// A tile during an evaluation.
struct Tile<'a, R: Real> {
    inputs: &'a [&'a [R]],
    numbers: &'a mut [R],
    truths: &'a mut [R::Mask],
    groups: usize,
}

impl<R: Real> Tile<'_, R> {
    /// The block of an operand that begins at the group `at`.
    #[inline(always)]
    fn read<const N: usize>(&self, operand: u16, at: usize) -> [R; N] {
        let operand = usize::from(operand);
        let numbers = match self.inputs.get(operand) {
            Some(input) => &input[at..at + N],
            None => {
                let start = (operand - self.inputs.len()) * self.groups + at;
                &self.numbers[start..start + N]
            }
        };
        let mut block = [numbers[0]; N];
        block.copy_from_slice(numbers);
        block
    }

    #[inline(always)]
    fn write<const N: usize>(&mut self, to: u16, at: usize, block: [R; N]) {
        let start = (usize::from(to) - self.inputs.len()) * self.groups + at;
        self.numbers[start..start + N].copy_from_slice(&block);
    }

    #[inline(always)]
    fn read_truth<const N: usize>(&self, operand: u16, at: usize) -> [R::Mask; N] {
        let start = usize::from(operand) * self.groups + at;
        let truths = &self.truths[start..start + N];
        let mut block = [truths[0]; N];
        block.copy_from_slice(truths);
        block
    }

    #[inline(always)]
    fn write_truth<const N: usize>(&mut self, to: u16, at: usize, block: [R::Mask; N]) {
        let start = usize::from(to) * self.groups + at;
        self.truths[start..start + N].copy_from_slice(&block);
    }
}

/// Carries out an operation for all groups of a tile: blocks first, then what is left one by one. It is a macro because a
/// closure cannot be made to be inlined.
macro_rules! for_each_block {
    ($tile:ident, |$at:ident, $n:ident| $body:block) => {{
        let mut $at = 0;
        while $at + BLOCK <= $tile.groups {
            const $n: usize = BLOCK;
            $body
            $at += BLOCK;
        }
        while $at < $tile.groups {
            const $n: usize = 1;
            $body
            $at += 1;
        }
    }};
}

macro_rules! unary {
    ($tile:ident, $instruction:ident, |$a:ident| $result:expr) => {
        for_each_block!($tile, |at, N| {
            let mut block = $tile.read::<N>($instruction.a, at);
            for number in &mut block {
                let $a = *number;
                *number = $result;
            }
            $tile.write($instruction.to, at, block);
        })
    };
}

macro_rules! binary {
    ($tile:ident, $instruction:ident, |$a:ident, $b:ident| $result:expr) => {
        for_each_block!($tile, |at, N| {
            let mut block = $tile.read::<N>($instruction.a, at);
            let second = $tile.read::<N>($instruction.b, at);
            for k in 0..N {
                let ($a, $b) = (block[k], second[k]);
                block[k] = $result;
            }
            $tile.write($instruction.to, at, block);
        })
    };
}

macro_rules! ternary {
    ($tile:ident, $instruction:ident, |$a:ident, $b:ident, $c:ident| $result:expr) => {
        for_each_block!($tile, |at, N| {
            let mut block = $tile.read::<N>($instruction.a, at);
            let second = $tile.read::<N>($instruction.b, at);
            let third = $tile.read::<N>($instruction.c, at);
            for k in 0..N {
                let ($a, $b, $c) = (block[k], second[k], third[k]);
                block[k] = $result;
            }
            $tile.write($instruction.to, at, block);
        })
    };
}

/// What needs much code is a function of its own.
struct FunctionOfTile<'t, 'a, R: Real> {
    tile: &'t mut Tile<'a, R>,
    instruction: super::program::Instruction,
}

impl<R: Real> Outlined for FunctionOfTile<'_, '_, R> {
    type Output = ();
    #[inline(always)]
    fn run(self) {
        let Self { tile, instruction } = self;
        for at in 0..tile.groups {
            let [a] = tile.read::<1>(instruction.a, at);
            match instruction.kind {
                Kind::SinCos => {
                    let (sin, cos) = crate::real::sin_cos(a);
                    tile.write(instruction.to, at, [sin]);
                    tile.write(instruction.c, at, [cos]);
                }
                Kind::Kepler => {
                    let [b] = tile.read::<1>(instruction.b, at);
                    let (sin, cos) = functions::kepler(a, b);
                    tile.write(instruction.to, at, [sin]);
                    tile.write(instruction.c, at, [cos]);
                }
                Kind::One(function) => tile.write(instruction.to, at, [functions::of_one(function, a)]),
                Kind::Two(function) => {
                    let [b] = tile.read::<1>(instruction.b, at);
                    tile.write(instruction.to, at, [functions::of_two(function, a, b)]);
                }
                _ => {}
            }
        }
    }
}

impl<R: Real, const ADD: bool> Outlined for Evaluation<'_, R, ADD> {
    type Output = ();
    #[inline(always)]
    fn run(self) {
        let Self { program, scratch, inputs, outputs } = self;
        let groups = scratch.groups;
        assert_eq!(inputs.len(), program.inputs.len(), "a slice an input");
        assert_eq!(scratch.numbers.len(), (program.constants.len() + program.slots) * groups, "its own memory");
        assert_eq!(outputs.len(), program.outputs.len() * groups, "room for all results");
        let (numbers, truths) = (scratch.numbers.as_mut_slice(), scratch.truths.as_mut_slice());
        let mut tile = Tile { inputs, numbers, truths, groups };
        for &instruction in &program.instructions {
            match instruction.kind {
                Kind::Add => binary!(tile, instruction, |a, b| a + b),
                Kind::Sub => binary!(tile, instruction, |a, b| a - b),
                Kind::Mul => binary!(tile, instruction, |a, b| a * b),
                Kind::NegMul => binary!(tile, instruction, |a, b| -(a * b)),
                Kind::Div => binary!(tile, instruction, |a, b| a / b),
                Kind::MulAdd => ternary!(tile, instruction, |a, b, c| a.mul_add(b, c)),
                Kind::MulSub => ternary!(tile, instruction, |a, b, c| a.mul_add(b, -c)),
                Kind::NegMulAdd => ternary!(tile, instruction, |a, b, c| (-a).mul_add(b, c)),
                Kind::NegMulSub => ternary!(tile, instruction, |a, b, c| (-a).mul_add(b, -c)),
                Kind::Neg => unary!(tile, instruction, |a| -a),
                Kind::Sqrt => unary!(tile, instruction, |a| a.sqrt()),
                Kind::Abs => unary!(tile, instruction, |a| a.abs()),
                Kind::Round => unary!(tile, instruction, |a| a.round()),
                Kind::Min => binary!(tile, instruction, |a, b| a.min(b)),
                Kind::Max => binary!(tile, instruction, |a, b| a.max(b)),
                Kind::Less => for_each_block!(tile, |at, N| {
                    let (a, b) = (tile.read::<N>(instruction.a, at), tile.read::<N>(instruction.b, at));
                    for k in 0..N {
                        tile.write_truth(instruction.to, at + k, [a[k].less_than(b[k])]);
                    }
                }),
                Kind::And => for_each_block!(tile, |at, N| {
                    let mut block = tile.read_truth::<N>(instruction.a, at);
                    let second = tile.read_truth::<N>(instruction.b, at);
                    for k in 0..N {
                        block[k] = block[k] & second[k];
                    }
                    tile.write_truth(instruction.to, at, block);
                }),
                Kind::Or => for_each_block!(tile, |at, N| {
                    let mut block = tile.read_truth::<N>(instruction.a, at);
                    let second = tile.read_truth::<N>(instruction.b, at);
                    for k in 0..N {
                        block[k] = block[k] | second[k];
                    }
                    tile.write_truth(instruction.to, at, block);
                }),
                Kind::Not => for_each_block!(tile, |at, N| {
                    let mut block = tile.read_truth::<N>(instruction.a, at);
                    for truth in &mut block {
                        *truth = !*truth;
                    }
                    tile.write_truth(instruction.to, at, block);
                }),
                Kind::Select => for_each_block!(tile, |at, N| {
                    let condition = tile.read_truth::<N>(instruction.a, at);
                    let mut block = tile.read::<N>(instruction.b, at);
                    let other = tile.read::<N>(instruction.c, at);
                    for k in 0..N {
                        block[k] = R::select(condition[k], block[k], other[k]);
                    }
                    tile.write(instruction.to, at, block);
                }),
                Kind::SinCos | Kind::Kepler | Kind::One(_) | Kind::Two(_) => {
                    R::outlined(FunctionOfTile { tile: &mut tile, instruction });
                }
            }
        }
        for (index, output) in program.outputs.iter().enumerate() {
            for_each_block!(tile, |at, N| {
                let mut block = tile.read::<N>(*output, at);
                let to = &mut outputs[index * groups + at..][..N];
                if ADD {
                    for k in 0..N {
                        block[k] = to[k] + block[k];
                    }
                }
                to.copy_from_slice(&block);
            });
        }
    }
}
