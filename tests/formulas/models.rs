//! What the declarations of torque models promise, and what follows from them for all models alike.
#![cfg(feature = "study")]

use std::path::Path;

use glam::{DMat3, DQuat, DVec3};
use polhode::engine::Engine;
use polhode::study::{Study, describe_models, models_table};
use polhode::torque::flat_plates::{Facet, Surface};
use polhode::torque::reaction_wheels::Wheels;
use polhode::torque::variable_inertia::{InertiaChange, Law};
use polhode::torque::{
    Declaration, Orbit, Parameter, ParameterDeclaration, Preset, Sampling, Shape, Torque, Validity, Value, declarations,
};
use polhode::{Ensemble, Error, Method, Plan, Scene};

const BODIES: &str =
    "seed = 5\n[bodies]\ncount = 3\ninertia = [1.0, 2.0, 2.5]\nangular_velocity = [0.1, 0.2, 0.3]\n[time]\nend = 1.0\n";

/// The longest line of `polhode run --help`.
const HELP_WIDTH: usize = 100;

/// Which of the keys that exclude each other stand in a study: the last declared, or the first.
#[derive(Clone, Copy, PartialEq)]
enum Chosen {
    First,
    Last,
}

/// The parameters of a model that one study can hold: those of a choice that are not chosen are left out.
fn chosen(model: &Declaration, which: Chosen) -> Vec<&ParameterDeclaration> {
    let top = |parameter: &ParameterDeclaration| parameter.name.split('.').next().unwrap_or_default().to_owned();
    let is_chosen = |parameter: &&ParameterDeclaration| {
        let mut rivals =
            model.parameters.iter().filter(|rival| rival.choice.is_some() && rival.choice == parameter.choice);
        let rival = if which == Chosen::First { rivals.next() } else { rivals.next_back() };
        rival.is_none_or(|rival| top(rival) == top(parameter))
    };
    model.parameters.iter().filter(is_chosen).collect()
}

/// A value that is valid, as it stands in a study.
fn valid_text(parameter: &ParameterDeclaration) -> String {
    match parameter.shape {
        Shape::Number if matches!(parameter.valid, Validity::Range(..)) => "0.25",
        // Within every orbit that the other values make.
        Shape::Number if parameter.name == "orbit.equatorial_radius" => "0.125",
        Shape::Number => "1.5",
        Shape::Vector => "[1.0, 2.0, 3.0]",
        Shape::Rotation => "[0.5, 0.5, 0.5, 0.5]",
        Shape::Matrix => "[[2.0, 0.5, 0.0], [0.5, 2.0, 0.0], [0.0, 0.0, 2.0]]",
        Shape::Tensor => "[1.5, 2.5, 3.0]",
        Shape::Whole => "3",
        Shape::List => return format!("[{{ {} }}]", row_text(&parameter.elements)),
        _ => panic!("{parameter:?}: a shape that this test does not know"),
    }
    .to_owned()
}

/// The keys of a table of a list, of each choice the first.
fn row_text(elements: &[ParameterDeclaration]) -> String {
    let is_chosen = |element: &&ParameterDeclaration| {
        let mut rivals = elements.iter().filter(|rival| rival.choice.is_some() && rival.choice == element.choice);
        rivals.next().is_none_or(|rival| rival.alternative() == element.alternative())
    };
    let keys = elements.iter().filter(is_chosen).map(|element| format!("{} = {}", element.name, valid_text(element)));
    keys.collect::<Vec<_>>().join(", ")
}

/// `[[torque]]` of a model with some parameters, each with its text.
fn torque_text(model: &str, parameters: &[(&ParameterDeclaration, String)]) -> String {
    let mut lines = vec!["[[torque]]".to_owned(), format!("model = \"{model}\"")];
    lines.extend(parameters.iter().map(|(parameter, text)| format!("{} = {text}", parameter.name)));
    lines.join("\n") + "\n"
}

/// All chosen parameters with valid values, one of them with another text.
fn with_text<'a>(
    model: &'a Declaration,
    parameter: &'a ParameterDeclaration,
    text: &str,
) -> Vec<(&'a ParameterDeclaration, String)> {
    let holds = |which| chosen(model, which).contains(&parameter);
    let which = if holds(Chosen::First) { Chosen::First } else { Chosen::Last };
    let value = |member: &&'a ParameterDeclaration| {
        (*member, if *member == parameter { text.to_owned() } else { valid_text(member) })
    };
    chosen(model, which).iter().map(value).collect()
}

fn study(torque: &str) -> polhode::Result<Study> {
    Study::parse(Path::new("study.toml"), &format!("{BODIES}{torque}"))
}

/// The torque that a study makes.
fn torque_of(text: &str) -> Torque {
    let scene = study(text).and_then(|study| study.scene()).unwrap_or_else(|error| panic!("{text}{error}"));
    scene.torques()[0].clone()
}

/// Why a study, or a plan of its scene, is refused.
fn refusal(text: &str) -> String {
    let study = match study(text) {
        Ok(study) => study,
        Err(error) => return error.to_string(),
    };
    let scene = match study.scene() {
        Ok(scene) => scene,
        Err(error) => return error.to_string(),
    };
    match Plan::new(&scene, &Engine::cpu()) {
        Ok(_) => panic!("{text}is taken for valid"),
        Err(error) => study.located(error).to_string(),
    }
}

#[test]
fn every_declaration_is_complete() {
    let mut names: Vec<&str> = declarations().flat_map(Declaration::names).collect();
    let count = names.len();
    names.sort_unstable();
    names.dedup();
    assert_eq!(names.len(), count, "names are not unique: {names:?}");
    for name in names {
        let is_kebab = name.split('-').all(|word| !word.is_empty() && word.chars().all(|c| c.is_ascii_lowercase()));
        assert!(is_kebab, "{name}");
    }
    for model in declarations() {
        let name = &model.name;
        assert!(model.summary.contains('=') && !model.summary.contains('\n'), "{name}: {}", model.summary);
        let has_year = model.source.as_bytes().windows(4).any(|word| word.iter().all(u8::is_ascii_digit));
        assert!(has_year || model.source == "by definition", "{name}: {}", model.source);
        assert!(!model.parameters.is_empty(), "{name}");
        for (place, parameter) in model.parameters.iter().enumerate() {
            let of = format!("{name}.{}", parameter.name);
            assert_eq!(model.position(&parameter.name), Some(place), "{of} is there twice");
            let is_key = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_' || c == '.';
            assert!(parameter.name.chars().all(is_key) && parameter.name != "model", "{of}");
            assert!(!parameter.unit.is_empty() && !parameter.about.is_empty(), "{of}");
            assert!(!parameter.about.contains('\n') && !parameter.about.ends_with('.'), "{of}: {}", parameter.about);
            assert_eq!(parameter.frame.is_some(), needs_frame(parameter.shape), "{of}: {:?}", parameter.frame);
            let default_of_whole = matches!(parameter.default, Some(Preset::Whole(_) | Preset::Seed));
            assert!(parameter.default.is_none() || default_of_whole == (parameter.shape == Shape::Whole), "{of}");
        }
        // Draws of one torque are told apart by their numbers; only parameters that exclude each other may share one.
        for which in [Chosen::First, Chosen::Last] {
            let mut draws: Vec<u16> = chosen(model, which).iter().map(|parameter| parameter.draw).collect();
            draws.sort_unstable();
            let all = draws.len();
            draws.dedup();
            assert_eq!(draws.len(), all, "{name}: {draws:?}");
        }
    }
}

/// Whether axes have to be named.
fn needs_frame(shape: Shape) -> bool {
    matches!(shape, Shape::Vector | Shape::Matrix | Shape::Tensor)
}

/// Numbers of draws enter the random numbers of studies: they must never change.
#[test]
fn numbers_of_draws_are_pinned() {
    let mut found = Vec::new();
    for model in declarations() {
        let draws: Vec<String> = model.parameters.iter().map(|parameter| parameter.draw.to_string()).collect();
        found.push(format!("{} {}", model.name, draws.join(" ")));
    }
    let pinned = [
        "constant-body 0",
        "constant-world 0",
        "linear-drag 0",
        "matrix-drag 0",
        "quadratic-drag 0",
        "sinusoidal 0 1 2",
        "gravity-gradient 0 1 2 3 4 5 6 12 13",
        "heavy-top 0 1 2",
        "magnetic-dipole 0 1",
        "orbiting-dipole 0 1 2 3 4 5 6 7 8 9 10 11 12 13",
        "eddy-current 0 1",
        "orbiting-eddy-current 0 1 2 3 4 5 6 7 8 9 10 11 12 13",
        "flat-plates 0 1 2",
        "sine-spring 0 1",
        "log-spring 0 1",
        "internal-dissipation 0",
        "pd-attitude 0 1 2 3 4 5",
        "pd-direction 0 1 2 3 4 5 6",
        "reaction-wheels 0 1 2 3 4 5 6 7",
        "magnetorquers 0 1 2 3 4 5 6 7 8 9 10 11 14 15 16 12 13",
        "white-noise 0 1 2",
        "variable-inertia 0 0 1 2 3",
    ];
    assert_eq!(found, pinned, "add the line of a new model; no other may change");
}

#[test]
fn every_model_has_a_constructor_with_the_declared_shapes() {
    let (v, q, m) = (DVec3::new(1.0, 2.0, 3.0), DQuat::from_xyzw(0.5, 0.5, 0.5, 0.5), DMat3::IDENTITY);
    let orbit = || Orbit::circular(1.0, 2.0);
    let surface = Surface::Solar { specular: 0.25, diffuse: 0.5 };
    let facet = Facet { area: 1.0, normal_body: v, centre_body: v, surface };
    let wheels = Wheels { torque_limit: 0.1.into(), momentum_limit: 4.0.into(), momentum: v.into() };
    let sampling = Sampling::every(0.5).delayed(0.1);
    let built = [
        Torque::constant_body(v),
        Torque::constant_world(v),
        Torque::linear_drag(1.0),
        Torque::matrix_drag(m),
        Torque::quadratic_drag(1.0),
        Torque::sinusoidal(v, v, 1.0),
        Torque::gravity_gradient(orbit()),
        Torque::heavy_top(1.0, v, v),
        Torque::magnetic_dipole(v, v),
        Torque::orbiting_dipole(v, orbit(), 1.0, 0.1, 0.2, 0.3),
        Torque::eddy_current(1.0, v),
        Torque::orbiting_eddy_current(1.0, orbit(), 1.0, 0.1, 0.2, 0.3),
        Torque::flat_plates(1.0, v, &[facet]).expect("a valid facet"),
        Torque::sine_spring(1.0, q),
        Torque::log_spring(1.0, q),
        Torque::internal_dissipation(1.0),
        Torque::pd_attitude(1.0, 2.0, q, 0.5, sampling),
        Torque::pd_direction(1.0, 2.0, v, v, 0.5, sampling),
        Torque::reaction_wheels(1.0, 2.0, q, wheels, sampling),
        Torque::magnetorquers(1.0, 0.2, orbit(), [1.0, 0.1, 0.2, 0.3].map(Into::into), sampling),
        Torque::white_noise(1.0, 2),
        Torque::variable_inertia(InertiaChange::factor(2.0), Law::ramp(1.0, 2.0)),
    ];
    let names: Vec<&str> = built.iter().map(Torque::name).collect();
    let declared: Vec<&str> = declarations().map(|model| &*model.name).collect();
    assert_eq!(names, declared, "add the constructor of a new model, in the order of the registry");
    for torque in &built {
        for parameter in &torque.declaration().parameters {
            let shape = match torque.parameter(&parameter.name) {
                Some(Value::Number(_)) => Shape::Number,
                Some(Value::Vector(_)) => Shape::Vector,
                Some(Value::Rotation(_)) => Shape::Rotation,
                Some(Value::Matrix(_)) => Shape::Matrix,
                Some(Value::Tensor(_)) => Shape::Tensor,
                Some(Value::Whole(_)) => Shape::Whole,
                Some(Value::List(_)) => Shape::List,
                None if parameter.choice.is_some() => continue,
                other => panic!("{}.{}: {other:?}", torque.name(), parameter.name),
            };
            assert_eq!(shape, parameter.shape, "{}.{}", torque.name(), parameter.name);
        }
        assert_eq!(torque.parameter("no_such"), None);
    }
}

/// Models that are composed of formulas record these in their constructors, which give no errors.
#[test]
fn controllers_with_values_that_are_not_valid_are_refused_with_the_scene() {
    let bodies = Ensemble::from_fn(2, |_| (DVec3::new(1.0, 2.0, 2.5), DQuat::IDENTITY, DVec3::X)).expect("valid");
    let (v, q) = (DVec3::new(1.0, 2.0, 3.0), DQuat::IDENTITY);
    let orbit = || Orbit::circular(1.0, 2.0);
    let field = || [1.0, 0.1, 0.2, 0.3].map(Into::into);
    let wheels = |momentum: Parameter<DVec3>| Wheels { torque_limit: 0.1.into(), momentum_limit: 4.0.into(), momentum };
    let each = Sampling::every(0.5);
    let (none, three) = (Vec::<f64>::new(), vec![v; 3]);
    let refused = [
        Torque::pd_attitude(f64::NAN, 2.0, q, 0.5, each),
        Torque::pd_attitude(1.0, 2.0, DQuat::from_xyzw(0.0, 0.0, 0.0, 0.0), 0.5, each),
        Torque::pd_attitude(1.0, 2.0, q, 0.5, Sampling::every(f64::NAN)),
        Torque::pd_attitude(1.0, 2.0, q, 0.5, Sampling::every(0.0)),
        Torque::pd_attitude(1.0, 2.0, q, none.clone(), each),
        Torque::pd_direction(1.0, 2.0, DVec3::ZERO, v, 0.5, each),
        Torque::pd_direction(1.0, 2.0, v, three.clone(), 0.5, each),
        Torque::reaction_wheels(1.0, 2.0, q, wheels(three.into()), each),
        Torque::reaction_wheels(1.0, 2.0, q, wheels(DVec3::NAN.into()), each.delayed(-1.0)),
        Torque::magnetorquers(none, 0.2, orbit(), field(), each),
        Torque::magnetorquers(1.0, 0.2, Orbit::circular(f64::NAN, -2.0), field(), each),
        Torque::magnetorquers(1.0, 0.2, orbit(), field(), Sampling::every(f64::INFINITY)),
    ];
    for (index, torque) in refused.into_iter().enumerate() {
        let scene = Scene::new(bodies.clone()).torque(torque).until(1.0).pinned(Method::Rk4, 0.1, None);
        assert!(Plan::new(&scene, &Engine::cpu()).is_err(), "{index}");
    }
}

#[test]
fn every_model_is_read_with_its_defaults_and_with_all_keys() {
    for model in declarations() {
        for which in [Chosen::First, Chosen::Last] {
            let parameters = chosen(model, which);
            let all: Vec<_> = parameters.iter().map(|parameter| (*parameter, valid_text(parameter))).collect();
            let needed: Vec<_> = all.iter().filter(|(parameter, _)| parameter.default.is_none()).cloned().collect();
            for name in model.names() {
                let full = torque_of(&torque_text(name, &all));
                let short = torque_of(&torque_text(name, &needed));
                assert_eq!((full.name(), short.name()), (&*model.name, &*model.name));
                for parameter in &parameters {
                    assert!(full.parameter(&parameter.name).is_some(), "{name}.{}", parameter.name);
                    let expected = match parameter.default {
                        None => continue,
                        Some(Preset::Number(x)) if parameter.shape == Shape::Vector => {
                            Value::Vector(DVec3::splat(x).into())
                        }
                        Some(Preset::Number(x)) => Value::Number(x.into()),
                        Some(Preset::Whole(number)) => Value::Whole(number),
                        // That of the study.
                        Some(Preset::Seed) => Value::Whole(5),
                        other => panic!("{other:?}"),
                    };
                    assert_eq!(short.parameter(&parameter.name), Some(&expected), "{name}.{}", parameter.name);
                }
            }
            for (parameter, _) in &needed {
                let without: Vec<_> = needed.iter().filter(|(other, _)| other != parameter).cloned().collect();
                let message = refusal(&torque_text(&model.name, &without));
                // Where nothing of its table is left, the table is missing.
                let table = parameter.name.split('.').next().unwrap_or_default();
                assert!(message.contains("torque[1]") && message.contains(table), "{message}");
            }
        }
    }
}

#[test]
fn unknown_keys_are_refused_with_the_nearest() {
    for model in declarations() {
        for parameter in chosen(model, Chosen::First) {
            let table = with_text(model, parameter, &valid_text(parameter));
            // The last letter is doubled.
            let last = parameter.name.chars().last().unwrap_or('x');
            let text = torque_text(&model.name, &table) + &format!("{}{last} = 1\n", parameter.name);
            let message = refusal(&text);
            let key = parameter.name.split('.').next_back().unwrap_or_default();
            let expected = format!("torque[1].{}{last} is not known: did you mean {key}?", parameter.name);
            assert!(message.contains(&expected), "{message}\n{expected}");
            assert!(message.starts_with("study.toml:"), "{message}");
        }
    }
}

#[test]
fn parameters_of_each_body_are_drawn_or_read_from_columns() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("study.toml");
    // A column that nothing reads is refused, so the table holds as many as the parameter takes.
    let write = |count: usize| {
        let row = |row: &[&str], own: &[&str]| [row, &own[..count]].concat().join(",") + "\n";
        let rows = row(&["wx", "wy", "wz"], &["a", "b", "c", "d"])
            + &row(&["0.1", "0", "0"], &["0.25", "0.5", "0.75", "1"])
            + &row(&["0", "0.2", "0"], &["0.5", "0.75", "1", "0.25"]);
        std::fs::write(folder.path().join("bodies.csv"), rows).expect("written");
    };
    for model in declarations() {
        for parameter in model.parameters.iter().filter(|parameter| parameter.per_body) {
            let of = format!("{}.{}", model.name, parameter.name);
            let (drawn, columns) = match parameter.shape {
                Shape::Number => ("{ distribution = \"uniform\", low = 0.25, high = 0.75 }", "{ column = \"a\" }"),
                Shape::Vector => {
                    ("{ distribution = \"uniform\", low = 0.25, high = 0.75 }", "{ columns = [\"a\", \"b\", \"c\"] }")
                }
                Shape::Rotation => ("{ distribution = \"uniform\" }", "{ columns = [\"a\", \"b\", \"c\", \"d\"] }"),
                Shape::Tensor => (
                    "{ moments = { distribution = \"uniform\", low = 0.25, high = 0.75 } }",
                    "{ columns = [\"a\", \"b\", \"c\"] }",
                ),
                other => panic!("{of}: {other:?}"),
            };
            let value = |torque: &Torque| torque.parameter(&parameter.name).cloned().expect("given");
            let text = |values: &str| torque_text(&model.name, &with_text(model, parameter, values));
            assert!(!value(&torque_of(&text(drawn))).is_shared(), "{of} is drawn");

            write(match parameter.shape {
                Shape::Number => 1,
                Shape::Rotation => 4,
                _ => 3,
            });
            let head = "[bodies]\nfile = \"bodies.csv\"\ninertia = [1.0, 2.0, 2.5]\n[time]\nend = 1.0\n";
            let study = Study::parse(&file, &format!("{head}{}", text(columns)));
            let scene = study.and_then(|study| study.scene()).unwrap_or_else(|error| panic!("{of}: {error}"));
            let is_second_row = match value(&scene.torques()[0]) {
                Value::Number(number) => number.at(1) == 0.5,
                Value::Vector(vector) => vector.at(1) == DVec3::new(0.5, 0.75, 1.0),
                Value::Rotation(rotation) => rotation.at(1) == DQuat::from_xyzw(0.5, 0.75, 1.0, 0.25),
                Value::Tensor(tensor) => tensor.at(1) == DVec3::new(0.5, 0.75, 1.0).into(),
                other => panic!("{of}: {other:?}"),
            };
            assert!(is_second_row, "{of}");
        }
    }
}

#[test]
fn values_that_are_not_valid_are_refused_by_their_key() {
    for model in declarations() {
        for parameter in &model.parameters {
            let bad: &[&str] = match (parameter.shape, parameter.valid) {
                (Shape::Number, Validity::Finite) => &["true", "nan"],
                (Shape::Number, Validity::NotNegative) => &["-0.5", "inf"],
                (Shape::Number, Validity::Positive) => &["0.0", "-1.0"],
                (Shape::Number, Validity::Range(0.0, 0.99)) => &["-0.1", "1.0"],
                (Shape::Number, Validity::Range(-0.5, 0.5)) => &["-0.6", "0.75"],
                (Shape::Vector, Validity::NotZero) => &["[0, 0, 0]", "[1e-200, 0, 0]", "[1, 2, inf]", "3"],
                (Shape::Vector, _) => &["[1, 2]", "[1, 2, nan]", "3"],
                (Shape::List, _) => &["[]", "[1]", "[{ }]", "{ }", "3"],
                (Shape::Rotation, _) => &["[0, 0, 0, 0]", "[1, 2, 3]"],
                (Shape::Matrix, Validity::PositiveSemidefinite) => {
                    &["[[1, 0, 0], [0, -1, 0], [0, 0, 1]]", "[[1, 0, 0], [0.5, 1, 0], [0, 0, 1]]", "[[1, 0], [0, 1]]"]
                }
                (Shape::Tensor, _) => &["[1, 1, 3]", "[1, 2]", "7"],
                (Shape::Whole, Validity::Range(..)) => &["0", "65536", "1.5"],
                (Shape::Whole, _) => &["-1", "1.5", "\"a\""],
                other => panic!("{}.{}: {other:?}", model.name, parameter.name),
            };
            for text in bad {
                let table = torque_text(&model.name, &with_text(model, parameter, text));
                let message = refusal(&table);
                let line = BODIES.lines().count()
                    + 1
                    + table.lines().position(|line| line.starts_with(&format!("{} =", parameter.name))).unwrap_or(0);
                let expected = format!("study.toml:{line}: torque[1].{}", parameter.name);
                assert!(message.starts_with(&expected), "{message}\n{expected} = {text}");
                assert_eq!(message.lines().count(), 1, "{message}");
            }
            // From Rust too, without a study: the message names the torque and the key, with its unit.
            let is_bad = |number: f64| match parameter.valid {
                Validity::NotNegative => number < 0.0,
                Validity::Positive => number <= 0.0,
                _ => false,
            };
            if parameter.shape == Shape::Number && is_bad(-1.0) {
                let table = torque_text(&model.name, &with_text(model, parameter, "-1.0"));
                let scene = study(&table).and_then(|study| study.scene()).expect("drawn");
                let error = Plan::new(&scene, &Engine::cpu()).map(|_| ()).expect_err("not valid");
                let Error::Torque { field, expected, .. } = &error else { panic!("{error:?}") };
                assert_eq!(field, &parameter.name);
                assert!(parameter.unit == "1" || expected.ends_with(&format!("({})", parameter.unit)), "{expected}");
            }
        }
    }
}

#[test]
fn help_and_documentation_list_every_model() {
    let help = describe_models();
    for model in declarations() {
        assert!(help.contains(&*model.summary), "{}", model.name);
        for parameter in model.parameters.iter().flat_map(|of| std::iter::once(of).chain(&of.elements)) {
            assert!(help.contains(&*parameter.name), "{}.{}", model.name, parameter.name);
        }
    }
    // A key is followed by a blank or stands alone, however long it is.
    let keys =
        declarations().flat_map(|model| &model.parameters).flat_map(|of| std::iter::once(of).chain(&of.elements));
    for key in keys.map(|parameter| &*parameter.name) {
        let stands = |line: &str| {
            let rest = line.trim_start().trim_start_matches("- ").strip_prefix(key);
            rest.is_some_and(|rest| rest.is_empty() || rest.starts_with(' '))
        };
        assert!(help.lines().any(stands), "{key} runs into its description");
    }
    for line in help.lines() {
        assert!(line.chars().count() <= HELP_WIDTH, "{} characters: {line}", line.chars().count());
    }
    let documented: Vec<&str> =
        include_str!("../../src/torque/mod.rs").lines().filter_map(|line| line.strip_prefix("//! |")).collect();
    let table = models_table();
    let expected: Vec<&str> = table.lines().filter_map(|line| line.strip_prefix('|')).collect();
    if documented != expected {
        table.lines().for_each(|line| println!("//! {line}"));
    }
    assert!(documented == expected, "src/torque/mod.rs has another table: paste the lines above");
}
