//! The WGSL text of a formula has the formula's own names, whatever these are, and nothing else follows from them.

use std::collections::BTreeSet;

use glam::{DQuat, DVec3};
use polhode::Ensemble;
use polhode::bodies::inertia::InertiaTensor;
use polhode::engine::batch::prepare_with;
use polhode::engine::gpu::shader::Source;
use polhode::expression::wgsl::{self, Argument, Signature};
use polhode::expression::{Expression, Fault, Input, InputKind, Shape, Symbols};
use polhode::kernel::method::Method;
use polhode::math::Precision;
use polhode::torque::{Parameters, Torque};
use proptest::prelude::*;
use proptest::test_runner::Config;
use wgpu::naga;

/// The text of a formula of x, y and z, a number, over three parameters of these names.
fn text_of(formula: &str) -> String {
    let symbols = ["x", "y", "z"]
        .into_iter()
        .try_fold(Symbols::parameters_only(), |symbols, name| symbols.parameter(name, Shape::Number))
        .expect("free names");
    let formula = Expression::parse(formula, &symbols, Shape::Number).unwrap_or_else(|error| panic!("{error}"));
    let argument = |(name, index)| Argument::new(name, Shape::Number, [Input::new(InputKind::Parameter, index)]);
    let parameters = [("x", 0), ("y", 1), ("z", 2)].map(argument).to_vec();
    let signature = Signature { name: "f".to_owned(), parameters, ..Signature::default() };
    wgsl::function(formula.graph(), formula.outputs(), &signature).unwrap_or_else(|error| panic!("{error}"))
}

/// Two bodies, whose axes are the principal ones or not.
fn bodies(turned: bool) -> Ensemble {
    Ensemble::from_fn(2, |body| {
        let turn = DQuat::from_rotation_x(if turned { 0.3 + body as f64 } else { 0.0 });
        let tensor = InertiaTensor::from(DVec3::new(1.0, 2.0, 2.5)).rotated(turn);
        (tensor, DQuat::from_rotation_y(0.2), DVec3::new(0.1, 0.2, 0.3))
    })
    .expect("valid bodies")
}

/// The kernel of bodies under torques.
fn kernel(torques: &[Torque], turned: bool) -> Source {
    let (_, batch) = prepare_with(&bodies(turned), torques, 100.0, Precision::F32).expect("enough memory");
    Source::advance_under(Precision::F32, Method::Rk4, batch.torques())
}

/// All kernels of bodies under torques.
fn kernels(torques: &[Torque]) -> Vec<Source> {
    let of_precision = |precision| {
        let (_, batch) = prepare_with(&bodies(true), torques, 100.0, precision).expect("enough memory");
        let table = batch.torques();
        let equal = Method::ALL.map(|method| Source::advance_with_forces(precision, method, table, Some(7)).tapped());
        let still = [Source::adaptive(precision, table), Source::advance_under(precision, Method::Rk8, table)];
        equal.into_iter().chain(still).collect::<Vec<_>>()
    };
    Precision::ALL.into_iter().flat_map(of_precision).collect()
}

/// The text that a kernel has of its formulas.
fn formulas(kernel: &Source) -> &str {
    let chunk = kernel.chunks().iter().find(|chunk| chunk.file == "torque/custom.wgsl").expect("a formula");
    &chunk.text
}

fn custom(text: &str, parameters: Parameters) -> Torque {
    Torque::custom(text, parameters).unwrap_or_else(|error| panic!("{error}"))
}

/// Names that a text gives values and arguments.
fn names_in(text: &str) -> Vec<&str> {
    let lets = text.lines().filter_map(|line| line.trim().strip_prefix("let ")?.split(' ').next());
    let arguments = text.split(['(', ',']).filter_map(|part| part.trim().split_once(": ").map(|(name, _)| name));
    lets.chain(arguments.filter(|name| !name.contains(' '))).collect()
}

#[test]
fn a_text_has_the_names_of_its_formula() {
    assert_eq!(
        text_of(
            "let lever = x * y; let far = lever > z; let s = sin(lever);
            select(far, s, cos(lever) * (z - y) * (z - y))"
        ),
        "fn f(x: real, y: real, z: real) -> real {
    let lever = x * y;
    let far = (z < lever);
    let angle1 = sin_cos(lever);
    let s = angle1.sin;
    let t2 = z - y;
    return select(t2 * (t2 * angle1.cos), s, far);
}
"
    );
}

#[test]
fn a_shader_has_the_names_of_its_torque_and_its_moments() {
    let parameters = || Parameters::new().number("k", 0.3).and_then(|p| p.vector("b", DVec3::Y)).expect("valid");
    let text = "let u = to_body(vec(0, 0, 1));
        let q = conjugate(attitude);
        let drag = norm(angular_velocity);
        -k * cross(u, b) * q.w * q.x - drag * angular_velocity";
    let recorded = Torque::recorded(parameters(), |s| s.vector("b") * s.number("k")).expect("a formula");
    let moments = "let phase = w * time; let growth = a * sin(phase); 1 + growth * growth";
    let numbers = Parameters::new().number("w", 0.3).and_then(|p| p.number("a", 0.5)).expect("valid");
    let change = Torque::custom_inertia_factor(moments, numbers).expect("a formula");
    let kernel = kernel(&[custom(text, parameters()), recorded, change], true);
    let found = names_in(formulas(&kernel));
    let wanted =
        ["u_x", "u_y", "u_z", "q_x", "drag", "k", "b_x", "b_y", "b_z", "a", "growth", "reference_rate", "torque_unit"];
    let of_body = ["to_body_xx", "to_principal_w", "attitude_x", "angular_velocity_x"];
    for name in wanted.into_iter().chain(of_body) {
        assert!(found.contains(&name), "{name} is not in {}", formulas(&kernel));
    }
    // A function of the shaders has the name.
    assert!(found.contains(&"phase_") && !found.contains(&"phase"), "{}", formulas(&kernel));
    kernel.validate().unwrap_or_else(|error| panic!("{error}\n{}", formulas(&kernel)));
}

/// The names of the `let`s of a text over x, y and z.
fn lets(formula: &str) -> Vec<String> {
    let text = text_of(formula);
    text.lines().filter_map(|line| Some(line.strip_prefix("    let ")?.split_once(' ')?.0.to_owned())).collect()
}

#[test]
fn of_equal_values_the_first_name_stands() {
    assert_eq!(lets("let a = x * y; let b = y * x; let c = b; a + b * c + z"), ["a"]);
    // Neither inputs nor constants need a value of their own.
    assert_eq!(lets("let a = x; let c = 2; let d = -a; max(d, c * y)"), ["d"]);
}

#[test]
fn names_that_are_not_free_get_something_behind_them() {
    let found = |formula: &str| lets(formula).into_iter().collect::<BTreeSet<_>>();
    let set = |names: &[&str]| names.iter().map(ToString::to_string).collect::<BTreeSet<_>>();
    // A component and a number.
    assert_eq!(found("let u = vec(x * y, 0, 1); let u_x = x * z; u.x + u_x"), set(&["u_x", "u_x_2"]));
    // Names like numbered ones, which make way.
    let numbered = "let t1 = x + y; let angle2 = x + z; let is3 = t1 < angle2;
        select(is3, t1, angle2) + sin(y + z) * (y - z) * (y - z)";
    assert_eq!(found(numbered), set(&["t1", "angle2", "is3", "t2", "angle3"]));
    // Case counts.
    assert_eq!(found("let v3 = x + y; let V3 = x + z; v3 * V3"), set(&["v3", "V3"]));
    // Underscores.
    let underscores =
        "let _ = x + y; let __ = x + z; let __a = y + z; let a__b = x - y; let a_b = x - z; let _a_ = y - z;
        _ * __ * __a * a__b * a_b * _a_";
    assert_eq!(found(underscores), set(&["_2", "_3", "_a", "a_b", "a_b_2", "_a_"]));
    // Words of WGSL, types and functions, those that the text calls, arguments and the function itself.
    let words = "let fn = x + y; let f32 = x + z; let real = y + z; let mul_add = x - y; let f = x - z; let x_ = x * y;
        fn * f32 + real * mul_add * f + x_";
    assert_eq!(found(words), set(&["fn_", "f32_", "real_", "mul_add_", "f_2", "x_"]));
}

/// Formulas that differ by their names are equal, and look equal to what tells studies from others.
#[test]
fn names_are_no_part_of_a_formula() {
    let symbols = Symbols::rotation().parameter("k", Shape::Number).expect("a free name");
    let other = Symbols::rotation().parameter("stiffness", Shape::Number).expect("a free name");
    let parse = |text: &str, symbols: &Symbols| Expression::parse(text, symbols, Shape::Vector).expect("a formula");
    let plain = parse("-k * cross(to_body(vec(0, 0, 1)), vec(1, 0, 0))", &symbols);
    let named =
        parse("let u = to_body(vec(0, 0, 1)); let e = vec(1, 0, 0); let m = cross(u, e); -stiffness * m", &other);
    assert_eq!(plain, named);
    assert_eq!(format!("{plain:?}"), format!("{named:?}"));
    assert_eq!(plain.program(), named.program());
}

#[test]
fn parameters_that_bodies_have_of_their_own_make_no_other_shader() {
    let of = |k: Parameters| custom("let u = to_body(vec(0, 0, 1)); -k * cross(u, vec(1, 0, 0))", k);
    let key = |values: Parameters| kernel(&[of(values)], false).key();
    let shared = key(Parameters::new().number("k", 0.3).expect("valid"));
    assert_eq!(shared, key(Parameters::new().number("k", vec![0.1, 0.2]).expect("valid")));
    assert_eq!(shared, key(Parameters::new().number("k", vec![0.7, -0.2]).expect("valid")));
}

/// What a shader declares, and the names of its formulas' arguments and values.
fn module(kernel: &Source) -> (BTreeSet<String>, Vec<String>) {
    kernel.validate().unwrap_or_else(|error| panic!("{error}\n{}", formulas(kernel)));
    let module = naga::front::wgsl::parse_str(&kernel.text()).expect("a shader");
    let mut declared = BTreeSet::new();
    declared.extend(module.functions.iter().filter_map(|(_, function)| function.name.clone()));
    declared.extend(module.entry_points.iter().map(|point| point.name.clone()));
    declared.extend(module.global_variables.iter().filter_map(|(_, variable)| variable.name.clone()));
    declared.extend(module.constants.iter().filter_map(|(_, constant)| constant.name.clone()));
    declared.extend(module.overrides.iter().filter_map(|(_, constant)| constant.name.clone()));
    declared.extend(module.types.iter().filter_map(|(_, kind)| kind.name.clone()));
    let is_custom = |name: &str| name.starts_with("custom_");
    let mut own = Vec::new();
    for (_, function) in module.functions.iter().filter(|(_, f)| f.name.as_deref().is_some_and(is_custom)) {
        own.extend(function.arguments.iter().filter_map(|argument| argument.name.clone()));
        own.extend(function.named_expressions.values().cloned());
    }
    (declared, own)
}

/// Words of WGSL, and what the shaders declare.
fn hostile() -> BTreeSet<String> {
    let plain = custom("angular_velocity", Parameters::new());
    let declared: BTreeSet<String> = kernels(&[plain]).iter().flat_map(|kernel| module(kernel).0).collect();
    let words = naga::keywords::wgsl::RESERVED.iter().chain(naga::keywords::wgsl::BUILTIN_IDENTIFIERS);
    let further =
        ["t1", "c0", "phase_0", "orientation", "angular_velocity_principal", "moment_ratio", "_", "__", "___a"];
    let all = words.chain(&further).map(ToString::to_string).chain(declared);
    // What the language itself keeps is refused.
    all.filter(|name| Symbols::rotation().parameter(name, Shape::Number).is_ok()).collect()
}

/// A torque with so many definitions, each of a value of its own.
fn defining<'a>(names: impl Iterator<Item = &'a String> + Clone) -> Torque {
    let definition =
        |(number, name): (usize, &String)| format!("let {name} = angular_velocity.x * {number}.5 + attitude.y;\n");
    let definitions: String = names.clone().enumerate().map(definition).collect();
    let sum: Vec<&str> = names.map(String::as_str).collect();
    custom(&format!("{definitions}vec({}, 0, 0)", sum.join(" + ")), Parameters::new())
}

/// A torque with so many parameters.
fn reading<'a>(names: impl Iterator<Item = &'a String> + Clone) -> Torque {
    let add = |parameters: Parameters, name: &String| parameters.number(name, 0.5);
    let parameters = names.clone().try_fold(Parameters::new(), add).expect("free names");
    let sum: Vec<String> = names.map(|name| format!("{name} * angular_velocity.x")).collect();
    custom(&format!("vec({}, 0, 0)", sum.join(" + ")), parameters)
}

/// Each of the formulas' names is legal, and nobody else's.
fn are_free(kernel: &Source) {
    let (declared, own) = module(kernel);
    for name in own {
        assert!(!declared.contains(&name) && !name.contains("__"), "{name}");
    }
}

#[test]
fn every_word_of_wgsl_and_of_the_shaders_may_be_a_name() {
    let names: Vec<String> = hostile().into_iter().collect();
    assert!(names.len() > 700, "{}", names.len());
    kernels(&[defining(names.iter())]).iter().for_each(are_free);
    for names in names.chunks(100) {
        are_free(&kernel(&[reading(names.iter())], true));
    }
}

proptest! {
    #![proptest_config(Config { failure_persistence: None, ..Config::with_cases(60) })]

    #[test]
    fn any_names_make_a_shader(names in prop::collection::btree_set("[a-cA-C_tu][a-cA-C_0-2x]{0,4}", 1..40)) {
        let is_free = |name: &&String| Symbols::rotation().parameter(name, Shape::Number).is_ok();
        let names: Vec<&String> = names.iter().filter(is_free).collect();
        if !names.is_empty() {
            are_free(&kernel(&[defining(names.iter().copied()), reading(names.iter().copied())], true));
        }
    }
}

#[test]
fn a_name_stands_once_in_a_text() {
    let symbols = Symbols::parameters_only().parameter("x", Shape::Number).expect("a free name");
    for text in ["let a = x * 2; let a = x * 3; a", "let x = 2; x"] {
        let refused = Expression::parse(text, &symbols, Shape::Number).expect_err("a name twice").fault;
        assert!(matches!(refused, Fault::DuplicateName { .. }), "{refused}");
    }
}
