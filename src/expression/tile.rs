//! Executes programs over tiles of bodies.
//!
//! A tile is some groups of lanes; each number is a slice with one element for each group. Instructions are the outer loop and groups the
//! inner one, so that the cost of decoding is shared by all bodies of the tile. A tile of one scalar is the reference.

use super::functions;
use super::graph::Input;
use super::program::{Instruction, Kind, Program};
use crate::math::lanes::{Each, GROUPS, LaneScalar, LaneTask};
use crate::math::quaternion::Quaternion;
use crate::math::real::{Real, outlined};
use crate::math::vector::Vector;

/// The memory that a program works on, for tiles of `GROUPS` lane groups: its inputs, its constants and its slots, one after another.
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

    /// The location of input `index` of [`Program::inputs`]. Its value is kept for later evaluations, so that parameters are loaded once
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
    /// Computes the results for all bodies of a tile from the inputs set by [`Scratch::input`], and stores them.
    ///
    /// # Panics
    ///
    /// If the scratch memory belongs to another program, or the length of `outputs` does not fit it.
    #[inline(always)]
    pub(crate) fn run<R: Real, const GROUPS: usize>(
        &self,
        scratch: &mut Scratch<R, GROUPS>,
        outputs: &mut [Each<R, GROUPS>],
    ) {
        outlined!(R, evaluate(self, scratch, outputs, false));
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
        outlined!(R, evaluate(self, scratch, outputs, true));
    }

    /// The results of one body by scalar arithmetic: `f64` is the reference, `f32` the shader's twin.
    ///
    /// # Panics
    ///
    /// If the number of inputs is not that of [`Program::inputs`].
    pub fn evaluate_one<T: crate::math::real::Scalar>(&self, inputs: &[T]) -> Vec<T> {
        assert_eq!(inputs.len(), self.inputs.len(), "a number an input");
        let found = self.evaluate_each(|index, _| [inputs[index]]);
        found.into_iter().map(|[output]| output).collect()
    }

    /// The results for a few bodies, or a few states of one, by the same arithmetic: `inputs` gives a number of each for an input and its place.
    pub(crate) fn evaluate_each<T: crate::math::real::Scalar, const N: usize>(
        &self,
        inputs: impl Fn(usize, Input) -> [T; N],
    ) -> Vec<[T; N]> {
        let mut scratch = Scratch::<T, N>::new(self);
        for (index, &input) in self.inputs.iter().enumerate() {
            *scratch.input(index) = Each(inputs(index, input));
        }
        let mut outputs = vec![Each([T::default(); N]); self.outputs.len()];
        self.run(&mut scratch, &mut outputs);
        outputs.into_iter().map(|Each(output)| output).collect()
    }

    /// The results for many bodies in the widest lanes of this processor: `columns[i]` holds input i of all bodies, and the result holds
    /// one column for each result.
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
                    let start = first + group * R::LANES;
                    if start + R::LANES <= bodies {
                        *number = R::load(&column[start..]);
                        continue;
                    }
                    // Lanes after the last body repeat it.
                    for (lane, value) in lanes.iter_mut().enumerate() {
                        *value = column[(start + lane).min(bodies - 1)];
                    }
                    *number = R::load(&lanes);
                }
            }
            program.run(&mut scratch, &mut results);
            for (output, tile) in outputs.iter_mut().zip(&results) {
                for (group, number) in tile.iter().enumerate() {
                    let start = (first + group * R::LANES).min(bodies);
                    let end = (start + R::LANES).min(bodies);
                    if start + R::LANES == end {
                        number.store(&mut output[start..end]);
                        continue;
                    }
                    number.store(&mut lanes);
                    output[start..end].copy_from_slice(&lanes[..end - start]);
                }
            }
        }
    }
}

/// Executes an operation for all groups. It is a macro because each closure would have to be marked `#[inline(always)]`. A result may
/// overwrite an operand that is not needed again.
macro_rules! for_each_group {
    ($to:expr, $([$operand:ident of $from:expr]),+ => $result:expr) => {
        for k in 0..GROUPS {
            $(let $operand = $from[k];)+
            $to[k] = $result;
        }
    };
}

/// x, or −x.
#[inline(always)]
fn signed<R: Real>(is_negative: bool, x: R) -> R {
    if is_negative { -x } else { x }
}

/// Rotates a vector.
#[inline(always)]
#[expect(clippy::needless_range_loop, reason = "results go to other numbers than those that are read")]
fn rotate<R: Real, const GROUPS: usize>(numbers: &mut [Each<R, GROUPS>], instruction: &Instruction, is_inverse: bool) {
    let [x, y, z, w, a, b, c] = instruction.operands.map(usize::from);
    let [to_a, to_b, to_c] = instruction.results.map(usize::from);
    for k in 0..GROUPS {
        let q = Quaternion::new(numbers[x][k], numbers[y][k], numbers[z][k], numbers[w][k]);
        let v = Vector::new(numbers[a][k], numbers[b][k], numbers[c][k]);
        let turned = if is_inverse { q.rotate_inverse(v) } else { q.rotate(v) };
        (numbers[to_a][k], numbers[to_b][k], numbers[to_c][k]) = (turned.x, turned.y, turned.z);
    }
}

/// Functions with much code, which are compiled separately.
#[inline(always)]
fn apply_function<R: Real, const GROUPS: usize>(numbers: &mut [Each<R, GROUPS>], instruction: Instruction) {
    let [to, second, _] = instruction.results.map(usize::from);
    let [a, b, ..] = instruction.operands.map(usize::from);
    match instruction.kind {
        Kind::SinCos => {
            let a = numbers[a];
            for (k, &x) in a.iter().enumerate() {
                (numbers[to][k], numbers[second][k]) = crate::math::real::sin_cos(x);
            }
        }
        Kind::Kepler => {
            let (a, b) = (numbers[a], numbers[b]);
            for (k, (&x, &y)) in a.iter().zip(b.iter()).enumerate() {
                (numbers[to][k], numbers[second][k]) = functions::kepler(x, y);
            }
        }
        Kind::One(function) => {
            for_each_group!(numbers[to], [x of numbers[a]] => functions::of_one(function, x));
        }
        Kind::Two(function) => {
            for_each_group!(numbers[to], [x of numbers[a]], [y of numbers[b]] => functions::of_two(function, x, y));
        }
        _ => {}
    }
}

impl<R: Real, const GROUPS: usize> Scratch<R, GROUPS> {
    /// Executes all instructions.
    #[inline(always)]
    fn carry_out(&mut self, program: &Program) {
        let (numbers, truths) = (self.numbers.as_mut_slice(), self.truths.as_mut_slice());
        // One jump for a run of instructions of one kind: a mispredicted jump costs more than the work.
        let mut rest = program.instructions.as_slice();
        for &(kind, count) in &program.runs {
            let (run, later) = rest.split_at(usize::from(count));
            rest = later;
            macro_rules! each {
                ($into:ident, [$($operand:ident of $from:ident),+] => $result:expr) => {
                    for instruction in run {
                        let to = usize::from(instruction.results[0]);
                        let [$($operand,)+ ..] = instruction.operands.map(usize::from);
                        for_each_group!($into[to], $([$operand of $from[$operand]]),+ => $result);
                    }
                };
            }
            // An arm for each choice of signs, so that they are constants in it.
            macro_rules! by_signs {
                ([] => $work:expr) => { $work };
                ([$sign:ident of $is_negative:expr $(, $rest:ident of $other:expr)*] => $work:expr) => {
                    if $is_negative {
                        const $sign: bool = true;
                        by_signs!([$($rest of $other),*] => $work)
                    } else {
                        const $sign: bool = false;
                        by_signs!([$($rest of $other),*] => $work)
                    }
                };
            }
            match kind {
                Kind::Add => each!(numbers, [x of numbers, y of numbers] => x + y),
                Kind::Sub => each!(numbers, [x of numbers, y of numbers] => x - y),
                Kind::Mul => each!(numbers, [x of numbers, y of numbers] => x * y),
                Kind::NegMul => each!(numbers, [x of numbers, y of numbers] => -(x * y)),
                Kind::MulMul => each!(numbers, [x of numbers, y of numbers, z of numbers] => x * y * z),
                Kind::Div => each!(numbers, [x of numbers, y of numbers] => x / y),
                Kind::Min => each!(numbers, [x of numbers, y of numbers] => x.min(y)),
                Kind::Max => each!(numbers, [x of numbers, y of numbers] => x.max(y)),
                Kind::MulThenAdd => each!(numbers, [x of numbers, y of numbers, z of numbers] => x * y + z),
                Kind::MulThenSub => each!(numbers, [x of numbers, y of numbers, z of numbers] => x * y - z),
                Kind::SubMul => each!(numbers, [x of numbers, y of numbers, z of numbers] => z - x * y),
                Kind::AddProducts => {
                    each!(numbers, [x of numbers, y of numbers, z of numbers, w of numbers] => x * y + z * w);
                }
                Kind::SubProducts => {
                    each!(numbers, [x of numbers, y of numbers, z of numbers, w of numbers] => x * y - z * w);
                }
                Kind::MulAdd([p, q]) => by_signs!([P of p, Q of q] => {
                    each!(numbers, [x of numbers, y of numbers, z of numbers] => signed(P, x).mul_add(y, signed(Q, z)));
                }),
                Kind::Products2([p, q]) => by_signs!([P of p, Q of q] => {
                    each!(numbers, [x of numbers, y of numbers, z of numbers, w of numbers] => {
                        signed(P, x).mul_add(y, signed(Q, z * w))
                    });
                }),
                Kind::Products3([p, q, s]) => by_signs!([P of p, Q of q, S of s] => {
                    each!(numbers, [x of numbers, y of numbers, z of numbers, w of numbers, u of numbers, v of numbers] => {
                        signed(P, x).mul_add(y, signed(Q, z).mul_add(w, signed(S, u * v)))
                    });
                }),
                Kind::MulAdd2([p, q, s]) => by_signs!([P of p, Q of q, S of s] => {
                    each!(numbers, [x of numbers, y of numbers, z of numbers, w of numbers, u of numbers] => {
                        signed(P, x).mul_add(y, signed(Q, z).mul_add(w, signed(S, u)))
                    });
                }),
                Kind::Rotate(is_inverse) => {
                    for instruction in run {
                        rotate(numbers, instruction, is_inverse);
                    }
                }
                Kind::Neg => each!(numbers, [x of numbers] => -x),
                Kind::Sqrt => each!(numbers, [x of numbers] => x.sqrt()),
                Kind::Abs => each!(numbers, [x of numbers] => x.abs()),
                Kind::Round => each!(numbers, [x of numbers] => x.round()),
                Kind::Less => each!(truths, [x of numbers, y of numbers] => x.less_than(y)),
                Kind::And => each!(truths, [x of truths, y of truths] => x & y),
                Kind::Or => each!(truths, [x of truths, y of truths] => x | y),
                Kind::Not => each!(truths, [x of truths] => !x),
                Kind::Select => each!(numbers, [x of truths, y of numbers, z of numbers] => R::select(x, y, z)),
                Kind::SinCos | Kind::Kepler | Kind::One(_) | Kind::Two(_) => {
                    for &instruction in run {
                        outlined!(R, apply_function(numbers, instruction));
                    }
                }
            }
        }
    }
}

/// [`Program::run`], or, if `add` is set, [`Program::accumulate`].
#[inline(always)]
fn evaluate<R: Real, const GROUPS: usize>(
    program: &Program,
    scratch: &mut Scratch<R, GROUPS>,
    outputs: &mut [Each<R, GROUPS>],
    add: bool,
) {
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
