//! In which evaluation of a step a fault shows first, and in what of it.

use glam::{DMat3, DVec3};
use polhode::engine::Engine;
use polhode::math::Precision;
use polhode::scene::AdaptiveSteps;
use polhode::verify::{Culprit, NoStage, Onset, Options, Parting, Shown, Stage, Term, verify};
use polhode::{Method, Scene, Torque};

use super::onset::HALF_ANGLE;
use super::{DT, adaptive, faulty, scene, steps};

/// Linear drag, and a torque that turns with the time: at t = 0 its cosine is 1 and its sine 0.
fn torques() -> [Torque; 2] {
    [Torque::linear_drag(0.3), Torque::sinusoidal(DVec3::X, DVec3::Y, 3.0)]
}

/// A torque that reads the attitude.
fn top() -> Torque {
    Torque::heavy_top(0.4, DVec3::new(0.1, 0.0, 0.2), -9.8 * DVec3::Z)
}

type Fault = (&'static str, &'static str, &'static str);

fn parting_of(engine: &Engine, scene: &Scene, options: &Options, what: &str) -> Parting {
    let report = verify(engine, scene, options).expect("both sides run");
    let parting = report.parting().unwrap_or_else(|| panic!("{what} went unnoticed"));
    println!("{what}: {}", parting.stage.map_or_else(|none| none.in_words().to_owned(), Stage::in_words));
    parting.clone()
}

/// The culprit of a fault in a shader, and the stage.
fn planted(fault: Fault, torques: &[Torque], method: Method, precision: Precision) -> (Culprit, Found) {
    let scene = scene(torques).pinned(method, DT, Some(precision)).skipping(false);
    let what = format!("{fault:?} under {method} in {precision}");
    let parting = parting_of(&faulty(&[fault]), &scene, &steps(1), &what);
    (parting.culprit, parting.stage)
}

type Found = Result<Stage, NoStage>;

fn stage(number: usize, of: usize, term: Term) -> Found {
    Ok(Stage { number, of, is_stage: true, term, shown: Shown::Evaluations })
}

fn evaluation(number: usize, of: usize, term: Term) -> Found {
    Ok(Stage { number, of, is_stage: false, term, shown: Shown::Evaluations })
}

/// Of an engine that shows none of its evaluations.
fn in_short_steps(number: usize, of: usize, term: Term) -> Found {
    Ok(Stage { number, of, is_stage: true, term, shown: Shown::ShortSteps })
}

#[test]
fn a_fault_in_rk4_is_named_by_stage_and_term() {
    let file = "method/rk4.wgsl";
    let of_the_method: [(Fault, Found); 6] = [
        (
            (
                file,
                "axpy_quaternion(k2.q, half, q), axpy_vector(k2.m, half, m)",
                "axpy_quaternion(k2.q, half, q), axpy_vector(k2.m, dt.value, m)",
            ),
            stage(3, 4, Term::AngularMomentum),
        ),
        (
            (file, "axpy_quaternion(k2.q, half, q)", "axpy_quaternion(k2.q, dt.value, q)"),
            stage(3, 4, Term::Orientation),
        ),
        (HALF_ANGLE, stage(1, 4, Term::OrientationRate)),
        (
            ("rigid_body.wgsl", "fma(body.gyroscopic.value,", "fma(1.001 * body.gyroscopic.value,"),
            stage(1, 4, Term::GyroscopicTerm),
        ),
        (
            (
                "rigid_body.wgsl",
                "fma(body.inverse_moments.value, m, correction",
                "fma(1.001 * body.inverse_moments.value, m, correction",
            ),
            stage(1, 4, Term::Turning),
        ),
        ((file, "axpy_vector(k2.m + k3.m, 2.0,", "axpy_vector(k2.m + k3.m, 2.01,"), stage(4, 4, Term::Increment)),
    ];
    for precision in Precision::ALL {
        for (fault, expected) in of_the_method {
            assert_eq!(planted(fault, &torques(), Method::Rk4, precision), (Culprit::Method, expected), "{fault:?}");
            // Without torques as well.
            assert_eq!(planted(fault, &[], Method::Rk4, precision), (Culprit::Method, expected), "{fault:?}");
        }
    }
}

#[test]
fn a_fault_in_a_torque_is_named_by_the_stage_at_which_it_shows() {
    let formula = ("torque/sinusoidal.wgsl", "    return ", "    return 1.001 * ");
    let sine = [Torque::linear_drag(0.3), Torque::sinusoidal(DVec3::X, DVec3::ZERO, 3.0)];
    let terms = "return torque_terms(epoch, orientation, angular_velocity_principal)";
    let late = "let later = settings.dt_value * 0.75 < epoch.instant.elapsed;
    return torque_terms(epoch, orientation, angular_velocity_principal) * select(real(1.0), real(1.001), later)";
    let middle = ("method/rk4.wgsl", "let middle = epoch(step_index, 0.5);", "let middle = epoch(step_index, 0.25);");
    for precision in Precision::ALL {
        let named = |fault, torques: &[Torque]| planted(fault, torques, Method::Rk4, precision);
        assert_eq!(named(formula, &torques()), (Culprit::Torques(vec![1]), stage(1, 4, Term::Torque)));
        // Nothing at the start of the first step, where the sine is 0.
        assert_eq!(named(formula, &sine), (Culprit::Torques(vec![1]), stage(2, 4, Term::Torque)));
        assert_eq!(named(middle, &torques()), (Culprit::Torques(vec![1]), stage(2, 4, Term::Time)));
        let (culprit, found) = named(("torque/sum.wgsl", terms, late), &torques());
        assert!(matches!(culprit, Culprit::Torques(_)), "{culprit:?}");
        assert_eq!(found, stage(4, 4, Term::Torque));
    }
}

#[test]
fn faults_in_stages_of_other_methods_are_named() {
    let rk8 = |from, to| planted(("method/rk8.wgsl", from, to), &torques(), Method::Rk8, Precision::F64);
    let (culprit, found) = rk8("sum = more(sum, -1.7578125e-2, d6)", "sum = more(sum, -1.7e-2, d6)");
    assert_eq!(culprit, Culprit::Method);
    assert!(found == stage(7, 12, Term::AngularMomentum) || found == stage(7, 12, Term::Orientation), "{found:?}");
    assert_eq!(
        rk8("        1.89151789931450038304281599044", "        1.8915"),
        (Culprit::Method, stage(12, 12, Term::Increment))
    );
    for precision in Precision::ALL {
        let cf4 = |from, to| planted(("method/cf4.wgsl", from, to), &torques(), Method::Cf4, precision);
        let found = cf4("axpy_vector(k2.m, half, m)", "axpy_vector(k2.m, dt.value, m)");
        assert_eq!(found, (Culprit::Method, stage(3, 4, Term::AngularMomentum)));
        // Torques alone read the orientation of a stage.
        let fault = ("method/cf4.wgsl", "k3.omega * dt.value - k1", "k3.omega * half - k1");
        let found = planted(fault, &[top()], Method::Cf4, precision);
        assert_eq!(found, (Culprit::Torques(vec![0]), stage(4, 4, Term::Orientation)));
    }
}

/// Kicks between free flows, and an implicit method, ask their torques alone.
#[test]
fn faults_between_evaluations_of_a_torque_are_named() {
    for precision in Precision::ALL {
        let flow = (
            "method/midpoint.wgsl",
            "let v = axpy_vector(angular_velocity, half,",
            "let v = axpy_vector(angular_velocity, half * 1.01,",
        );
        let found = planted(flow, &torques(), Method::Splitting2, precision);
        assert_eq!(found, (Culprit::Method, evaluation(2, 2, Term::Orientation)));
        // A torque of a kind whose flow is integrated in four evaluations a kick.
        let drag = [Torque::matrix_drag(DMat3::from_diagonal(DVec3::new(0.3, 0.2, 0.1)))];
        let kick = ("method/kick.wgsl", "axpy_vector(k2, half, m)", "axpy_vector(k2, h.value, m)");
        let found = planted(kick, &drag, Method::Splitting2, precision);
        assert_eq!(found, (Culprit::Torques(vec![0]), evaluation(3, 8, Term::AngularVelocity)));
        let halfway = ("method/implicit_midpoint.wgsl", "let scalar = norm + 1.0", "let scalar = norm + 1.01");
        let found = planted(halfway, &[top()], Method::ImplicitMidpoint, precision);
        assert_eq!(found, (Culprit::Torques(vec![0]), evaluation(1, 2, Term::Orientation)));
    }
}

#[test]
fn a_fault_in_an_attempt_is_named_by_stage_and_term() {
    let planted = |fault: Fault, precision: Precision| {
        let tolerance = if precision == Precision::F32 { 1e-4 } else { 1e-10 };
        let scene = adaptive(&torques(), tolerance, precision);
        let parting = parting_of(&faulty(&[fault]), &scene, &steps(4), &format!("{fault:?} in {precision}"));
        (parting.culprit, parting.stage)
    };
    let time = ("method/rk8.wgsl", "epoch_at(place, 0.6)", "epoch_at(place, 0.5)");
    let formula = ("torque/sinusoidal.wgsl", "    return ", "    return 1.001 * ");
    let weights = ("method/rk8.wgsl", "sum = more(sum, -1.7578125e-2, d6)", "sum = more(sum, -1.7e-2, d6)");
    let estimate =
        ("method/rk8_adaptive.wgsl", "1.664377182454986536961530415", "1.664377182454986536961530415 * 1.01");
    for precision in Precision::ALL {
        assert_eq!(planted(time, precision), (Culprit::Torques(vec![1]), stage(10, 12, Term::Time)), "{precision}");
        assert_eq!(planted(formula, precision), (Culprit::Torques(vec![1]), stage(1, 12, Term::Torque)));
        assert_eq!(planted(HALF_ANGLE, precision), (Culprit::Method, stage(1, 12, Term::OrientationRate)));
        // The states agree.
        assert_eq!(planted(estimate, precision), (Culprit::Method, Err(NoStage::StatesAgree)));
    }
    let (culprit, found) = planted(weights, Precision::F64);
    assert_eq!(culprit, Culprit::Method);
    assert!(found == stage(7, 12, Term::AngularMomentum) || found == stage(7, 12, Term::Orientation), "{found:?}");
}

/// The twin's sinusoid is a thousandth stronger in its cosine, which is 1 at the start of the first step, or in its sine, which is 0 there.
fn stronger_twins() -> [Options; 2] {
    let twins = |[sine, cosine]: [f64; 2]| {
        vec![torques()[0].clone(), Torque::sinusoidal(sine * DVec3::X, cosine * DVec3::Y, 3.0)]
    };
    [[1.0, 1.001], [1.001, 1.0]].map(|strengths| Options { twin_torques: Some(twins(strengths)), ..steps(1) })
}

/// Lanes show none of their evaluations: short steps from the states and times of the twin's say which slope it is.
#[test]
fn a_fault_in_lanes_is_named_by_the_first_slope_that_differs() {
    let [cosine, sine] = stronger_twins();
    for (method, count) in [(Method::Rk4, 4), (Method::Rk8, 12), (Method::Cf4, 4)] {
        let stepped = |precision| scene(&torques()).pinned(method, DT, Some(precision)).skipping(false);
        for precision in Precision::ALL {
            let parting = parting_of(&Engine::cpu(), &stepped(precision), &cosine, &format!("{method} in {precision}"));
            assert_eq!(parting.culprit, Culprit::Torques(vec![1]));
            assert_eq!(parting.stage, in_short_steps(1, count, Term::Torque), "{method} in {precision}");
        }
        let parting = parting_of(&Engine::cpu(), &stepped(Precision::F64), &sine, method.name());
        assert_eq!(parting.stage, in_short_steps(2, count, Term::Torque), "{method}");
    }
    let attempts = adaptive(&torques(), 1e-10, Precision::F64);
    let found = |options| parting_of(&Engine::cpu(), &attempts, options, "attempts").stage;
    assert_eq!(found(&cosine), in_short_steps(1, 12, Term::Torque));
    assert_eq!(found(&sine), in_short_steps(2, 12, Term::Torque));
    // Kicks ask for the torque alone.
    let kicked = scene(&torques()).pinned(Method::Splitting2, DT, Some(Precision::F64)).skipping(false);
    let parting = parting_of(&Engine::cpu(), &kicked, &cosine, "kicks");
    let expected = Stage { number: 1, of: 2, is_stage: false, term: Term::Torque, shown: Shown::ShortSteps };
    assert_eq!(parting.stage, Ok(expected));
}

/// Of a series the power with which the difference falls is that of the first coefficient that differs.
#[test]
fn a_fault_in_a_series_is_named_by_its_first_coefficient() {
    let series = scene(&torques()).taylor(AdaptiveSteps { tolerance: 1e-12, least_step: None }).skipping(false);
    for (options, number) in stronger_twins().into_iter().zip([1, 2]) {
        let stage = parting_of(&Engine::cpu(), &series, &options, "series").stage.expect("a coefficient");
        assert_eq!((stage.number, stage.term, stage.shown), (number, Term::Torque, Shown::Series));
        let words =
            format!("the coefficient of order {number} of its series of order {} is the first to differ", stage.of);
        assert!(stage.in_words().starts_with(&words), "{}", stage.in_words());
    }
}

/// A projection is behind all evaluations, and a free flow makes none.
#[test]
fn where_nothing_is_evaluated_no_stage_is_named_and_why_is_said() {
    let free = scene(&[]).projected(Method::Rk4, DT);
    let root = ("method/projection.wgsl", "let size = sqrt(", "let size = 1.001 * sqrt(");
    let report = verify(&faulty(&[root]), &free, &steps(1)).expect("both sides run");
    assert_eq!(report.parting().expect("a fault is planted").stage, Err(NoStage::NoEvaluations));
    assert!(report.to_string().contains(NoStage::NoEvaluations.in_words()), "{report}");
    let parting = parting_of(&faulty(&[HALF_ANGLE]), &free, &steps(1), "half an angle");
    assert_eq!(parting.stage, stage(1, 4, Term::OrientationRate));
}

#[test]
fn the_report_names_stage_and_term() {
    let fault = ("method/rk4.wgsl", "axpy_vector(k2.m, half, m)", "axpy_vector(k2.m, dt.value, m)");
    let scene = scene(&torques()).pinned(Method::Rk4, DT, Some(Precision::F64)).skipping(false);
    let report = verify(&faulty(&[fault]), &scene, &steps(1)).expect("both sides run");
    let words = "stage 3 of 4 is the first to differ: the angular momentum at which it takes place; it is the weights of the slopes \
                 before it";
    assert!(report.to_string().contains(words), "{report}");
    let json: serde_json::Value = serde_json::from_str(&report.to_json()).expect("JSON");
    let parting = &json["groups"][0]["comparisons"][0]["parting"];
    assert_eq!((&parting["stage"]["number"], &parting["stage"]["of"]), (&3.into(), &4.into()));
    assert_eq!((&parting["stage"]["term"], &parting["stage"]["words"]), (&"angular momentum".into(), &words.into()));
    let onset = report.parting().expect("a fault is planted").onset;
    assert!(matches!(onset, Onset::Stage(_, 2..)), "{onset:?}");
}

/// Beside a fault behind all evaluations they agree to their bounds, whatever the method asks, under torques that depend on the attitude, the
/// angular velocity and the time.
#[test]
fn evaluations_agree_under_every_method_where_the_fault_is_behind_them() {
    let drag = Torque::matrix_drag(DMat3::from_diagonal(DVec3::new(0.3, 0.2, 0.1)));
    let moving_top = [drag, top(), Torque::sinusoidal(DVec3::X, DVec3::Y, 3.0)];
    let behind = (
        "advance.wgsl",
        "    store_state(state, i);",
        "    if (!FREE) {
        state.angular_momentum_principal.value = state.angular_momentum_principal.value * 1.001;
    }
    store_state(state, i);",
    );
    let behind_attempt = [
        ("adaptive.wgsl", "let attempted = advance(", "var attempted = advance("),
        (
            "adaptive.wgsl",
            "    store_state(attempted.state, i);",
            "    if (!FREE) {
        let m = attempted.state.angular_momentum_principal.value;
        attempted.state.angular_momentum_principal.value = m * 1.001;
    }
    store_state(attempted.state, i);",
        ),
    ];
    let agree = |engine: &Engine, scene: &Scene, what: &str| {
        let parting = parting_of(engine, scene, &steps(1), what);
        assert_eq!(parting.culprit, Culprit::Torques(vec![0, 1, 2]), "{what}");
        let stage = parting.stage.unwrap_or_else(|none| panic!("{what}: {}", none.in_words()));
        assert_eq!((stage.term, stage.number), (Term::Increment, stage.of), "{what}: {stage:?}");
    };
    let (equal, own) = (faulty(&[behind]), faulty(&behind_attempt));
    // In turn, as each costs the pipelines of every torque alone.
    for (method, precision) in Method::ALL.into_iter().zip(Precision::ALL.into_iter().cycle()) {
        let scene = scene(&moving_top).pinned(method, DT, Some(precision)).skipping(false);
        agree(&equal, &scene, &format!("{method} in {precision}"));
    }
    agree(&own, &adaptive(&moving_top, 1e-4, Precision::F32), "attempts in f32");
}
