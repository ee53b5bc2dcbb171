//! Compares every torque's recorded formula with the formula itself.

use super::wgsl::{Argument, Signature};
use super::*;
use crate::engine::gpu::shader::Source;
use crate::math::Precision;
use crate::math::lanes::{Each, LaneScalar, LaneTask};
use crate::math::quaternion::Quaternion;
use crate::math::real::{Function, Real, Scalar};
use crate::math::vector::Vector;
use crate::torque::formula::{Column, Epoch, Formula, FormulaTask, MOST_PHASES, Role, Row};
use crate::torque::internal_dissipation::internal_dissipation;
use crate::torque::{Kind, shader};
use Shape::{Number, Vector as Triple};

/// One number for each input of a formula: columns, phases, orientation, angular velocity.
struct Numbers<'a, R>(&'a [R]);

impl<R: Real> Row<R> for Numbers<'_, R> {
    #[inline(always)]
    fn number(&self, column: usize) -> R {
        self.0[column]
    }
}

/// The formula itself.
#[inline(always)]
fn direct<F: Formula, R: Real>(numbers: &[R]) -> Vector<R> {
    let (row, rest) = (Numbers(numbers), &numbers[F::PARAMETERS..]);
    let mut phases = [R::splat(0.0); MOST_PHASES];
    phases[..F::PHASES.len()].copy_from_slice(&rest[..F::PHASES.len()]);
    let state = Numbers(&rest[F::PHASES.len()..]);
    F::torque(&row, &F::epoch(&row, phases), state.quaternion(0), state.vector(4))
}

/// Where an input stands among the numbers.
fn place<F: Formula>(input: &Input) -> usize {
    let first = match input.kind {
        InputKind::Parameter => 0,
        InputKind::Phase => F::PARAMETERS,
        InputKind::Orientation => F::PARAMETERS + F::PHASES.len(),
        InputKind::AngularVelocity => F::PARAMETERS + F::PHASES.len() + 4,
        kind => panic!("{} reads {kind:?}", F::STEM),
    };
    first + usize::from(input.index)
}

fn recorded<F: Formula>() -> Program {
    let (graph, outputs, _) = shader::recording::<F>().unwrap_or_else(|| panic!("{} is not recorded", F::STEM));
    Program::new(&graph, &outputs)
}

/// [`internal_dissipation`], which is no torque but adds to the rate at which the body's axes turn.
struct Slip;

impl Formula for Slip {
    const STEM: &'static str = "internal_dissipation";
    const COLUMNS: &'static [Column] = &[Column::number("coefficient"), Column::vector("m")];
    #[inline(always)]
    fn torque<R: Real>(row: &impl Row<R>, _: &Epoch<R>, _: Quaternion<R>, omega: Vector<R>) -> Vector<R> {
        internal_dissipation(row.number(0), row.vector(1), omega)
    }
}

fn for_each_formula(task: impl FormulaTask<Output = ()> + Copy) {
    Kind::ALL.iter().filter(|kind| kind.role() == Role::Torque).for_each(|kind| kind.with(task));
    task.run::<Slip>();
}

/// Numbers in [−1, 1]; the eccentricity, if there is one, in [0, 0.9].
fn numbers<F: Formula>(row: u64) -> Vec<f64> {
    let mut bits = row.wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    let mut uniform = || {
        bits ^= bits << 13;
        bits ^= bits >> 7;
        bits ^= bits << 17;
        (bits >> 11) as f64 / 2f64.powi(53)
    };
    let columns = F::COLUMNS.iter().flat_map(|column| std::iter::repeat_n(column.name, column.numbers));
    let names = columns.chain(F::PHASES.iter().copied()).chain(["state"; 7]);
    names.map(|name| if name == "eccentricity" { 0.9 * uniform() } else { 2.0 * uniform() - 1.0 }).collect()
}

/// The bits of a number, with both zeros alike.
fn bits<T: Scalar>(x: T) -> u64 {
    (x.to_f64() + 0.0).to_bits()
}

/// Number of rows of arguments, one for each lane of a program; odd.
const ROWS: usize = 203;

struct InLanes<'a, T: Scalar, F> {
    program: &'a Program,
    columns: &'a [Vec<T>],
    formula: std::marker::PhantomData<F>,
}

impl<T: LaneScalar, F: Formula> LaneTask<T> for InLanes<'_, T, F> {
    type Output = ();
    #[inline(always)]
    fn run<R: Real<Scalar = T>>(self) {
        const GROUPS: usize = 6;
        let groups = |column: &Vec<T>| std::array::from_fn(|group| R::load(&column[group * R::LANES..]));
        let numbers: Vec<Each<R, GROUPS>> = self.columns.iter().map(|column| Each(groups(column))).collect();
        let mut outputs = vec![Each([R::splat(0.0); GROUPS]); 3];
        let mut scratch = Scratch::new(self.program);
        for (index, input) in self.program.inputs().iter().enumerate() {
            *scratch.input(index) = numbers[place::<F>(input)];
        }
        self.program.run(&mut scratch, &mut outputs);
        for group in 0..GROUPS {
            let row: Vec<R> = numbers.iter().map(|number| number[group]).collect();
            let direct = direct::<F, R>(&row);
            for (component, direct) in [direct.x, direct.y, direct.z].into_iter().enumerate() {
                let (mut found, mut expected) = (vec![T::default(); R::LANES], vec![T::default(); R::LANES]);
                outputs[component][group].store(&mut found);
                direct.store(&mut expected);
                for (found, expected) in found.into_iter().zip(expected) {
                    assert_eq!(bits(found), bits(expected), "{} in lanes: {found:?}, {expected:?}", F::STEM);
                }
            }
        }
    }
}

fn agree<T: LaneScalar, F: Formula>() {
    let program = recorded::<F>();
    let rows: Vec<Vec<T>> =
        (0..ROWS as u64).map(|row| numbers::<F>(row).into_iter().map(T::from_f64).collect()).collect();
    for row in &rows {
        let inputs: Vec<T> = program.inputs().iter().map(|input| row[place::<F>(input)]).collect();
        let found = program.evaluate_one(&inputs);
        let direct = direct::<F, T>(row);
        for (found, expected) in found.into_iter().zip([direct.x, direct.y, direct.z]) {
            assert_eq!(bits(found), bits(expected), "{}: {found:?}, {expected:?}", F::STEM);
        }
    }
    let columns: Vec<Vec<T>> = (0..rows[0].len()).map(|column| rows.iter().map(|row| row[column]).collect()).collect();
    T::dispatch(InLanes::<T, F> { program: &program, columns: &columns, formula: std::marker::PhantomData });
}

#[test]
fn a_recorded_torque_has_the_bits_of_its_formula() {
    #[derive(Clone, Copy)]
    struct Agree;
    impl FormulaTask for Agree {
        type Output = ();
        fn run<F: Formula>(self) {
            agree::<f64, F>();
            agree::<f32, F>();
        }
    }
    for_each_formula(Agree);
}

#[test]
fn columns_in_lanes_are_the_bodies_one_by_one() {
    #[derive(Clone, Copy)]
    struct Columns;
    impl FormulaTask for Columns {
        type Output = ();
        fn run<F: Formula>(self) {
            let program = recorded::<F>();
            let rows: Vec<Vec<f64>> = (0..ROWS as u64).map(numbers::<F>).collect();
            let column = |input: &Input| rows.iter().map(|row| row[place::<F>(input)]).collect();
            let columns: Vec<Vec<f64>> = program.inputs().iter().map(column).collect();
            let columns: Vec<&[f64]> = columns.iter().map(Vec::as_slice).collect();
            let together = program.evaluate_columns(&columns, ROWS);
            for body in [0, 1, 31, ROWS - 1] {
                let alone: Vec<&[f64]> = columns.iter().map(|column| &column[body..=body]).collect();
                for (together, alone) in together.iter().zip(program.evaluate_columns(&alone, 1)) {
                    assert_eq!(bits(together[body]), bits(alone[0]), "{}", F::STEM);
                }
            }
        }
    }
    for_each_formula(Columns);
}

/// The texts of kinds of torque, one after another.
fn texts(wanted: impl Fn(Kind) -> bool) -> String {
    shader::functions(wanted).into_iter().map(|(_, text)| text).collect()
}

#[test]
fn the_text_of_a_drag_reads_as_one_writes_it() {
    assert_eq!(
        texts(|kind| kind == Kind::QuadraticDrag),
        "// quadratic_drag, in principal axes and the body's own units; recorded from src/torque/quadratic_drag.rs.
fn quadratic_drag(coefficient: real, angular_velocity_principal: vector) -> vector {
    let t1 = mul_add(angular_velocity_principal.y, angular_velocity_principal.y, angular_velocity_principal.x * angular_velocity_principal.x);
    let t2 = coefficient * sqrt(mul_add(angular_velocity_principal.z, angular_velocity_principal.z, t1));
    return vector(
        -(angular_velocity_principal.x * t2),
        -(angular_velocity_principal.y * t2),
        -(angular_velocity_principal.z * t2),
    );
}
"
    );
}

/// What is wrong with a text in either precision, if anything.
fn refusal(text: &str) -> Option<String> {
    use wgpu::naga;
    Precision::ALL.into_iter().find_map(|precision| {
        let chunks = [Source::functions(precision), Source::elementary_functions(precision)].concat();
        let shared: String = chunks.iter().map(|chunk| chunk.text.as_ref()).collect();
        let settings = "struct Settings { zero: u32 }\n@group(0) @binding(0) var<uniform> settings: Settings;\n";
        let whole = [settings, &shared, include_str!("../../shaders/kepler.wgsl"), text].concat();
        let module = match naga::front::wgsl::parse_str(&whole) {
            Ok(module) => module,
            Err(error) => return Some(error.emit_to_string(&whole)),
        };
        let (flags, all) = (naga::valid::ValidationFlags::all(), naga::valid::Capabilities::all());
        naga::valid::Validator::new(flags, all).validate(&module).err().map(|error| error.emit_to_string(&whole))
    })
}

#[test]
fn every_text_is_a_shader_in_both_precisions() {
    let torques = Kind::ALL.iter().filter(|kind| kind.role() == Role::Torque).count();
    assert_eq!(texts(|_| true).matches("fn ").count(), torques);
    assert_eq!(refusal(&texts(|_| true)), None);
    assert!(refusal("fn planted() -> real { return vector(0.0); }").is_some());
}

#[test]
fn constants_are_printed_for_both_precisions() {
    let of = |work: &dyn Fn(Symbol) -> Symbol| {
        let symbols = Symbols::parameters_only().parameter("x", Number).unwrap();
        let formula = Expression::record(&symbols, |s| work(s.number("x"))).unwrap();
        let parameters = vec![Argument::new("x", Number, [Input::new(InputKind::Parameter, 0)])];
        let signature = Signature { name: "f".to_owned(), parameters, ..Signature::default() };
        wgsl::function(formula.graph(), formula.outputs(), &signature)
    };
    let c = Symbol::splat;
    for constant in [-0.0, 5e-324, -1e-310, 1e-40, 3.4e38, -1.25, 0.1, 16_777_217.0, 1e22] {
        let text = of(&|x| (c(constant) - x).max(c(constant) * x) - c(constant) / x).unwrap();
        assert_eq!(refusal(&text), None, "{text}");
        let select =
            |x: Symbol| Symbol::select(x.less_than(c(constant)), c(constant), c(2.0)) + (x - c(constant)).abs();
        assert_eq!(refusal(&of(&select).unwrap()), None);
        assert_eq!(refusal(&of(&|_| c(constant)).unwrap()), None);
    }
    assert_eq!(of(&|x| x + c(1e39)), Err(wgsl::WgslError::ConstantOutOfRange(1e39)));
}

#[test]
fn truth_values_have_a_text() {
    let symbols = Symbols::parameters_only().parameter("x", Triple).unwrap();
    let formula = Expression::record(&symbols, |s| {
        let Vector { x, y, z } = s.vector("x");
        let (first, second) = (x.less_than(y), y.less_than(z));
        let both = (first & second) | !(z.less_than(x) & first);
        Symbol::select(both, x, y) + Symbol::select(!second, z, x) + Symbol::select(both & second, y, z)
    })
    .unwrap();
    let inputs = (0..3).map(|index| Input::new(InputKind::Parameter, index));
    let parameters = vec![Argument::new("x", Triple, inputs)];
    let signature = Signature { name: "f".to_owned(), parameters, ..Signature::default() };
    let text = wgsl::function(formula.graph(), formula.outputs(), &signature).unwrap();
    assert_eq!(refusal(&text), None, "{text}");
    for x in [[1.0, 2.0, 3.0], [2.0, 1.0, 3.0], [3.0, 2.0, 1.0], [1.0, 3.0, 2.0]] {
        let [a, b, c]: [f64; 3] = x;
        #[expect(clippy::nonminimal_bool, reason = "as the formula says it")]
        let both = (a < b && b < c) || !(c < a && a < b);
        let expected = if both { a } else { b } + if b < c { a } else { c } + if both && b < c { b } else { c };
        assert_eq!(formula.program().evaluate_one(&x), [expected]);
    }
}

#[test]
fn kepler_is_one_instruction() {
    let symbols = Symbols::parameters_only().parameter("m", Number).unwrap().parameter("e", Number).unwrap();
    let formula = Expression::record(&symbols, |s| {
        let (m, e) = (s.number("m"), s.number("e"));
        m.function_with(Function::KeplerSin, e) + m.function_with(Function::KeplerCos, e)
    })
    .unwrap();
    assert_eq!(formula.program().instructions.len(), 2);
    let (_, sin, cos) = crate::math::kepler::eccentric_anomaly(0.7, 0.3);
    assert_eq!(formula.program().evaluate_one(&[0.7, 0.3]), [sin + cos]);
}
