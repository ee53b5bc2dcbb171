//! Compares every torque's recorded formula with the formula itself.

use super::wgsl::{Argument, Signature};
use super::*;
use crate::engine::gpu::shader::Source;
use crate::math::Precision;
use crate::math::lanes::{Each, LaneScalar, LaneTask};
use crate::math::quaternion::Quaternion;
use crate::math::real::{Function, Real, Scalar};
use crate::math::vector::Vector;
use crate::torque::orbiting_dipole::DipoleField;
use Shape::{Number, Quaternion as Rotation, Vector as Triple};

/// A formula over any number type, its arguments one after another.
trait Kernel {
    const NAME: &'static str;
    const ARGUMENTS: &'static [(&'static str, Shape)];
    /// Whether the formula itself depends on the precision, so that only its `f64` form is recorded.
    const KNOWS_PRECISION: bool = false;
    fn call<R: Real>(x: &[R]) -> Vector<R>;
}

fn v<R: Real>(x: &[R], at: usize) -> Vector<R> {
    Vector::new(x[at], x[at + 1], x[at + 2])
}

fn q<R: Real>(x: &[R], at: usize) -> Quaternion<R> {
    Quaternion::new(x[at], x[at + 1], x[at + 2], x[at + 3])
}

macro_rules! kernels {
    ($($name:ident ($($argument:ident: $shape:ident),*) $(precision $knows:literal)? = |$x:ident| $call:expr;)*) => {
        $(
            #[expect(non_camel_case_types, reason = "named as the functions")]
            struct $name;
            impl Kernel for $name {
                const NAME: &'static str = stringify!($name);
                const ARGUMENTS: &'static [(&'static str, Shape)] = &[$((stringify!($argument), $shape)),*];
                $(const KNOWS_PRECISION: bool = $knows;)?
                #[inline(always)]
                fn call<R: Real>($x: &[R]) -> Vector<R> {
                    use crate::torque::$name::$name;
                    $call
                }
            }
        )*
        /// Calls a generic function for every kernel.
        macro_rules! for_each_kernel {
            ($function:ident) => { $($function::<$name>();)* };
        }
    };
}

kernels! {
    constant_body(torque: Triple) = |x| constant_body(v(x, 0));
    constant_world(torque_world: Triple, orientation: Rotation) = |x| constant_world(v(x, 0), q(x, 3));
    eddy_current(coefficient: Number, direction_world: Triple, orientation: Rotation, angular_velocity: Triple) =
        |x| eddy_current(x[0], v(x, 1), q(x, 4), v(x, 8));
    gravity_gradient(coefficients: Triple, x_world: Triple, y_world: Triple, phase: Number, orientation: Rotation) =
        |x| gravity_gradient(v(x, 0), v(x, 3), v(x, 6), x[9], q(x, 10));
    gravity_gradient_kepler(coefficients: Triple, x_world: Triple, y_world: Triple, eccentricity: Number, start: Number,
        phase: Number, orientation: Rotation) =
        |x| gravity_gradient_kepler(v(x, 0), v(x, 3), v(x, 6), x[9], x[10], x[11], q(x, 12));
    heavy_top(moment: Triple, direction_world: Triple, orientation: Rotation) =
        |x| heavy_top(v(x, 0), v(x, 3), q(x, 6));
    internal_dissipation(coefficient: Number, m: Triple, angular_velocity: Triple) =
        |x| internal_dissipation(x[0], v(x, 1), v(x, 4));
    linear_drag(coefficient: Number, angular_velocity: Triple) = |x| linear_drag(x[0], v(x, 1));
    log_spring(stiffness: Number, spring_target: Rotation, orientation: Rotation) precision true =
        |x| log_spring(x[0], q(x, 1), q(x, 5));
    magnetic_dipole(moment: Triple, direction_world: Triple, orientation: Rotation) =
        |x| magnetic_dipole(v(x, 0), v(x, 3), q(x, 6));
    matrix_drag(diagonal: Triple, off_diagonal: Triple, angular_velocity: Triple) =
        |x| matrix_drag(v(x, 0), v(x, 3), v(x, 6));
    orbiting_dipole(eccentricity: Number, moment: Triple, x_world: Triple, y_world: Triple, start: Number, sin_tilt: Number,
        cos_tilt: Number, azimuth: Number, orbit_phase: Number, rotation_phase: Number, orientation: Rotation) = |x| {
        let field = DipoleField {
            x_world: v(x, 4),
            y_world: v(x, 7),
            eccentricity: x[0],
            start: x[10],
            sin_tilt: x[11],
            cos_tilt: x[12],
            azimuth: x[13],
        };
        orbiting_dipole(v(x, 1), &field, x[14], x[15], q(x, 16))
    };
    quadratic_drag(coefficient: Number, angular_velocity: Triple) = |x| quadratic_drag(x[0], v(x, 1));
    sine_spring(stiffness: Number, spring_target: Rotation, orientation: Rotation) =
        |x| sine_spring(x[0], q(x, 1), q(x, 5));
    sinusoidal(sine: Triple, cosine: Triple, phase: Number) = |x| sinusoidal(v(x, 0), v(x, 3), x[6]);
}

fn width<K: Kernel>() -> usize {
    K::ARGUMENTS.iter().map(|(_, shape)| shape.width()).sum()
}

fn recorded<K: Kernel>() -> Expression {
    let (graph, outputs) = Graph::record::<Fault>(|recorder| {
        let input = |index| recorder.input(Input::new(InputKind::Parameter, index as u16));
        let inputs: Vec<Symbol> = (0..width::<K>()).map(input).collect();
        Ok(K::call(&inputs).into_symbols())
    })
    .unwrap_or_else(|fault| panic!("{}: {fault}", K::NAME));
    Expression::new(&graph, &outputs, Triple)
}

/// Numbers in [−1, 1]; the eccentricity, if there is one, in [0, 0.9].
fn arguments<K: Kernel>(row: u64) -> Vec<f64> {
    let mut bits = row.wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    let mut uniform = || {
        bits ^= bits << 13;
        bits ^= bits >> 7;
        bits ^= bits << 17;
        (bits >> 11) as f64 / 2f64.powi(53)
    };
    let mut numbers = vec![];
    for (name, shape) in K::ARGUMENTS {
        for _ in 0..shape.width() {
            numbers.push(if *name == "eccentricity" { 0.9 * uniform() } else { 2.0 * uniform() - 1.0 });
        }
    }
    numbers
}

/// The bits of a number, with both zeros alike.
fn bits<T: Scalar>(x: T) -> u64 {
    (x.to_f64() + 0.0).to_bits()
}

/// Number of rows of arguments, one for each lane of a program; odd.
const ROWS: usize = 203;

struct InLanes<'a, T: Scalar, K> {
    program: &'a Program,
    columns: &'a [Vec<T>],
    kernel: std::marker::PhantomData<K>,
}

impl<T: LaneScalar, K: Kernel> LaneTask<T> for InLanes<'_, T, K> {
    type Output = ();
    #[inline(always)]
    fn run<R: Real<Scalar = T>>(self) {
        const GROUPS: usize = 6;
        let groups = |column: &Vec<T>| std::array::from_fn(|group| R::load(&column[group * R::LANES..]));
        let numbers: Vec<Each<R, GROUPS>> = self.columns.iter().map(|column| Each(groups(column))).collect();
        let mut outputs = vec![Each([R::splat(0.0); GROUPS]); 3];
        let mut scratch = Scratch::new(self.program);
        for (index, input) in self.program.inputs().iter().enumerate() {
            *scratch.input(index) = numbers[usize::from(input.index)];
        }
        self.program.run(&mut scratch, &mut outputs);
        for group in 0..GROUPS {
            let row: Vec<R> = numbers.iter().map(|number| number[group]).collect();
            let direct = K::call(&row);
            for (component, direct) in [direct.x, direct.y, direct.z].into_iter().enumerate() {
                let (mut found, mut expected) = (vec![T::default(); R::LANES], vec![T::default(); R::LANES]);
                outputs[component][group].store(&mut found);
                direct.store(&mut expected);
                for (found, expected) in found.into_iter().zip(expected) {
                    assert_eq!(bits(found), bits(expected), "{} in lanes: {found:?}, {expected:?}", K::NAME);
                }
            }
        }
    }
}

fn agree<T: LaneScalar, K: Kernel>() {
    if T::WORDS == 2 && K::KNOWS_PRECISION {
        return;
    }
    let program = recorded::<K>().program();
    let rows: Vec<Vec<T>> =
        (0..ROWS as u64).map(|row| arguments::<K>(row).into_iter().map(T::from_f64).collect()).collect();
    for row in &rows {
        let inputs: Vec<T> = program.inputs().iter().map(|input| row[usize::from(input.index)]).collect();
        let found = program.evaluate_one(&inputs);
        let direct = K::call(row);
        for (found, expected) in found.into_iter().zip([direct.x, direct.y, direct.z]) {
            assert_eq!(bits(found), bits(expected), "{}: {found:?}, {expected:?}", K::NAME);
        }
    }
    let columns: Vec<Vec<T>> = (0..width::<K>()).map(|column| rows.iter().map(|row| row[column]).collect()).collect();
    T::dispatch(InLanes::<T, K> { program: &program, columns: &columns, kernel: std::marker::PhantomData });
}

#[test]
fn a_recorded_torque_has_the_bits_of_its_formula() {
    fn check<K: Kernel>() {
        agree::<f64, K>();
        agree::<f32, K>();
    }
    for_each_kernel!(check);
}

#[test]
fn columns_in_lanes_are_the_bodies_one_by_one() {
    fn check<K: Kernel>() {
        let program = recorded::<K>().program();
        let rows: Vec<Vec<f64>> = (0..ROWS as u64).map(arguments::<K>).collect();
        let columns: Vec<Vec<f64>> = program
            .inputs()
            .iter()
            .map(|input| rows.iter().map(|row| row[usize::from(input.index)]).collect())
            .collect();
        let columns: Vec<&[f64]> = columns.iter().map(Vec::as_slice).collect();
        let together = program.evaluate_columns(&columns, ROWS);
        for body in [0, 1, 31, ROWS - 1] {
            let alone: Vec<&[f64]> = columns.iter().map(|column| &column[body..=body]).collect();
            for (together, alone) in together.iter().zip(program.evaluate_columns(&alone, 1)) {
                assert_eq!(bits(together[body]), bits(alone[0]), "{}", K::NAME);
            }
        }
    }
    for_each_kernel!(check);
}

/// The text of a kernel.
fn text<K: Kernel>() -> String {
    let formula = recorded::<K>();
    let mut first = 0;
    let mut signature = Signature { name: K::NAME.to_owned(), ..Signature::default() };
    signature.comment.push(format!("{}, recorded.", K::NAME));
    for (name, shape) in K::ARGUMENTS {
        let inputs = (first..).map(|index| Input::new(InputKind::Parameter, index)).take(shape.width());
        signature.parameters.push(Argument::new(*name, *shape, inputs));
        first += shape.width() as u16;
    }
    wgsl::function(formula.graph(), formula.outputs(), &signature).unwrap_or_else(|error| panic!("{error}"))
}

#[test]
fn the_text_of_a_drag_reads_as_one_writes_it() {
    assert_eq!(
        text::<quadratic_drag>(),
        "// quadratic_drag, recorded.
fn quadratic_drag(coefficient: real, angular_velocity: vector) -> vector {
    let t1 = mul_add(angular_velocity.z, angular_velocity.z, mul_add(angular_velocity.y, angular_velocity.y, \
         angular_velocity.x * angular_velocity.x));
    let t2 = coefficient * sqrt(t1);
    return vector(-(angular_velocity.x * t2), -(angular_velocity.y * t2), -(angular_velocity.z * t2));
}
"
    );
}

/// The texts of all kernels.
fn texts() -> String {
    let mut all = String::new();
    macro_rules! each {
        ($($name:ty)*) => { $(all += &text::<$name>();)* };
    }
    each!(constant_body constant_world eddy_current gravity_gradient gravity_gradient_kepler heavy_top internal_dissipation
        linear_drag log_spring magnetic_dipole matrix_drag orbiting_dipole quadratic_drag sine_spring sinusoidal);
    all
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
    assert_eq!(texts().matches("fn ").count(), 15);
    assert_eq!(refusal(&texts()), None);
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
