//! Torques that ask where the body is, under forces that leave that no closed form: the centre of mass is integrated with the rotation.
//!
//! Truth is the classical Runge-Kutta method of order 4, written here, on (q, L, x, v) as the equations stand: with the momentum L in the world,
//! in other variables than the library's, and in such short steps that twice as many change nothing beyond [`OWN_ERROR`]; and what coupled
//! motions conserve.

use glam::{DMat3, DQuat, DVec3};
use polhode::bodies::ensemble::Translation;
use polhode::bodies::inertia::InertiaTensor;
use polhode::record::EventTime;
use polhode::run::{How, StateError, alone, replay};
use polhode::scene::{AdaptiveSteps, Condition, Event, Outputs, Quantity};
use polhode::torque::{Parameters, Torque};
use polhode::verify::{Options, verify};
use polhode::{Engine, Ensemble, Force, Plan, Precision, Record, Scene};

use crate::common::random::Random;

/// Not a multiple of any number of lanes.
const BODIES: usize = 21;
/// s.
const END: f64 = 8.0;
/// Steps of the truth.
const STEPS: usize = 1 << 14;
/// What is left of its error, rad, m and m/s.
const OWN_ERROR: f64 = 1e-11;

/// A body with axes of its own.
fn tensor(body: usize) -> InertiaTensor {
    let mut random = Random::new(31 + body as u64);
    let axes = DMat3::from_quat(DQuat::from_array([(); 4].map(|()| random.normal())).normalize());
    let moments = DVec3::new(1.0, 1.4, 2.0) * random.between(0.8, 1.2);
    let matrix = axes * DMat3::from_diagonal(moments) * axes.transpose();
    let [x, y, z] = [matrix.x_axis, matrix.y_axis, matrix.z_axis];
    InertiaTensor { xx: x.x, yy: y.y, zz: z.z, xy: x.y, xz: x.z, yz: y.z }
}

fn mass(body: usize) -> f64 {
    0.6 + 0.05 * body as f64
}

/// A body as the truth moves it: body to world, world axes.
#[derive(Clone, Copy, Debug)]
struct Moving {
    orientation: DQuat,
    angular_momentum: DVec3,
    position: DVec3,
    velocity: DVec3,
}

fn start(body: usize) -> Moving {
    let mut random = Random::new(7 + body as u64);
    let orientation = DQuat::from_array([(); 4].map(|()| random.normal())).normalize();
    let mut vector = |size: f64| DVec3::from_array([(); 3].map(|()| random.between(-size, size)));
    let (omega, position, velocity) = (vector(1.0), vector(2.0), vector(1.0));
    Moving { orientation, angular_momentum: orientation * (tensor(body).to_matrix() * omega), position, velocity }
}

impl Moving {
    fn omega(&self, body: usize) -> DVec3 {
        let q = self.orientation.normalize();
        tensor(body).to_matrix().inverse() * (q.conjugate() * self.angular_momentum)
    }

    fn plus(&self, rate: &Self, h: f64) -> Self {
        Self {
            orientation: self.orientation + rate.orientation * h,
            angular_momentum: self.angular_momentum + rate.angular_momentum * h,
            position: self.position + rate.position * h,
            velocity: self.velocity + rate.velocity * h,
        }
    }
}

/// What acts on a body: the torque, N m, in body axes, and the force, N, in the world's, of the time (s), the motion, and ω (body axes).
type Law = fn(usize, f64, &Moving, DVec3) -> (DVec3, DVec3);

fn rate(body: usize, time: f64, at: &Moving, law: Law) -> Moving {
    let omega = at.omega(body);
    let (torque, force) = law(body, time, at, omega);
    let spin = DQuat::from_xyzw(omega.x, omega.y, omega.z, 0.0);
    Moving {
        orientation: at.orientation.mul_quat(spin) * 0.5,
        angular_momentum: at.orientation.normalize() * torque,
        position: at.velocity,
        velocity: force / mass(body),
    }
}

/// Steps of order 4 from the start.
fn stepped(body: usize, law: Law, end: f64, steps: usize) -> Moving {
    let h = end / steps as f64;
    let mut at = start(body);
    for step in 0..steps {
        let time = step as f64 * h;
        let k1 = rate(body, time, &at, law);
        let k2 = rate(body, time + 0.5 * h, &at.plus(&k1, 0.5 * h), law);
        let k3 = rate(body, time + 0.5 * h, &at.plus(&k2, 0.5 * h), law);
        let k4 = rate(body, time + h, &at.plus(&k3, h), law);
        at = at.plus(&k1, h / 6.0).plus(&k2, h / 3.0).plus(&k3, h / 3.0).plus(&k4, h / 6.0);
    }
    at
}

/// How far two motions are apart: attitude, rad, and position, m, and velocity, m/s.
fn apart(a: &Moving, b: &Moving) -> f64 {
    let turned = a.orientation.normalize().conjugate() * b.orientation.normalize();
    let angle = 2.0 * DVec3::new(turned.x, turned.y, turned.z).length();
    angle.max(a.position.distance(b.position)).max(a.velocity.distance(b.velocity))
}

fn bodies_from(moving: &[Moving]) -> Ensemble {
    let row = |body: usize| (tensor(body), moving[body].orientation, moving[body].omega(body));
    let translation = Translation {
        mass: (0..moving.len()).map(mass).collect(),
        position: moving.iter().map(|at| at.position).collect(),
        velocity: moving.iter().map(|at| at.velocity).collect(),
    };
    Ensemble::from_fn(moving.len(), row).and_then(|bodies| bodies.with_translation(translation)).expect("valid bodies")
}

fn bodies() -> Ensemble {
    bodies_from(&(0..BODIES).map(start).collect::<Vec<_>>())
}

fn run(scene: &Scene) -> Record {
    let engine = Engine::cpu();
    engine.run(&Plan::new(scene, &engine).expect("a plan")).expect("runs")
}

/// The end of a run.
fn ended(scene: &Scene) -> Vec<Moving> {
    let record = run(scene);
    let end = record.final_state();
    let of = |body: usize| {
        let (orientation, omega) = (end.orientation(body), end.angular_velocity_body(body));
        let angular_momentum = orientation * (tensor(body).to_matrix() * omega);
        Moving { orientation, angular_momentum, position: end.positions()[body], velocity: end.velocities()[body] }
    };
    (0..end.positions().len()).map(of).collect()
}

fn steps(tolerance: f64) -> AdaptiveSteps {
    AdaptiveSteps { tolerance, least_step: None }
}

/// The largest distance of a run's ends from the truth, which says how far it may be off itself.
fn error(scene: &Scene, law: Law) -> f64 {
    let ends = ended(scene);
    let of = |body: usize| {
        let truth = stepped(body, law, scene.end(), 2 * STEPS);
        let own = apart(&truth, &stepped(body, law, scene.end(), STEPS));
        assert!(own < OWN_ERROR, "body {body}: {own:e}");
        apart(&ends[body], &truth)
    };
    (0..ends.len()).map(of).fold(0.0, f64::max)
}

/// A spring from the origin to a point of the body, N/m and m.
const STIFFNESS: f64 = 3.0;
const ARM: DVec3 = DVec3::new(0.3, -0.1, 0.2);

fn tether(_: usize, _: f64, at: &Moving, _: DVec3) -> (DVec3, DVec3) {
    let q = at.orientation.normalize();
    let force = -STIFFNESS * (at.position + q * ARM);
    (ARM.cross(q.conjugate() * force), force)
}

fn tethered(ensemble: Ensemble) -> Scene {
    let parameters = || Parameters::new().number("k", STIFFNESS).and_then(|all| all.vector("c", ARM)).expect("names");
    let force = Force::custom("-k * (position + to_world(c))", parameters()).expect("a force");
    let torque = Torque::custom("cross(c, to_body(-k * (position + to_world(c))))", parameters()).expect("a torque");
    Scene::new(ensemble).until(END).force(force).torque(torque)
}

/// N s/m; none on the first body, which alone has the terms of all the same.
fn linear_drag(body: usize) -> f64 {
    if body == 0 { 0.0 } else { 0.1 + 0.01 * body as f64 }
}

/// Forces of every kind, of which the built-in ones come in between those of the user's own.
fn everything(body: usize, time: f64, at: &Moving, omega: DVec3) -> (DVec3, DVec3) {
    let q = at.orientation.normalize();
    let speed = at.velocity.length();
    let force = mass(body) * DVec3::new(0.1, 0.0, -0.5) - linear_drag(body) * at.velocity - 0.05 * speed * at.velocity
        + q * DVec3::new(0.2, 0.1, -0.3)
        + DVec3::new((1.3 * time).sin() - 0.2 * mass(body) * at.position.x, 0.0, 0.02 * at.position.x * at.position.y)
        + q * omega * 0.1;
    let seen = q.conjugate() * at.position;
    let air = q.conjugate() * at.velocity;
    let torque = -0.02 * seen.cross(DVec3::Z) + 0.1 * air * air.x - 0.02 * omega + DVec3::Y * 0.1 * (0.7 * time).cos();
    (torque, force)
}

fn under_everything() -> Scene {
    let own = "vec(sin(1.3 * time) - k * mass * position.x, 0, 0.02 * position.x * position.y)";
    let parameters = Parameters::new().number("k", 0.2).expect("a name");
    let drag: Vec<f64> = (0..BODIES).map(linear_drag).collect();
    let torque = "let air = to_body(velocity);
        -0.02 * cross(to_body(position), vec(0, 0, 1)) + 0.1 * air.x * air - 0.02 * angular_velocity + vec(0, 0.1 * cos(0.7 * time), 0)";
    Scene::new(bodies())
        .until(END)
        .force(Force::gravity(DVec3::new(0.1, 0.0, -0.5)))
        .force(Force::custom(own, parameters).expect("a force"))
        .force(Force::linear_drag(drag))
        .force(Force::quadratic_drag(0.05))
        .torque(Torque::custom(torque, Parameters::new()).expect("a torque"))
        .force(Force::thrust(DVec3::new(0.2, 0.1, -0.3)))
        .force(Force::custom("0.1 * to_world(angular_velocity)", Parameters::new()).expect("a force"))
}

#[test]
fn a_tethered_body_moves_as_its_coupled_equations_say() {
    let found = error(&tethered(bodies()).taylor(steps(1e-14)), tether);
    assert!(found < 1e-10, "{found:e}");
}

#[test]
fn all_forces_act_on_a_centre_of_mass_that_torques_ask_for() {
    let found = error(&under_everything().taylor(steps(1e-14)), everything);
    assert!(found < 1e-10, "{found:e}");
    // What a fault would make: a hundredth of the thrust is left out.
    let other = |body: usize, time: f64, at: &Moving, omega: DVec3| {
        let (torque, force) = everything(body, time, at, omega);
        (torque, force - at.orientation.normalize() * DVec3::new(2e-3, 1e-3, -3e-3))
    };
    let found = error(&under_everything().taylor(steps(1e-14)), other);
    assert!(found > 1e-3, "{found:e}");
}

/// Errors go as the tolerance does, whatever the order: from 1e-5 to 1e-11 by six decades, within one.
#[test]
fn errors_go_as_the_tolerance() {
    let truth: Vec<Moving> = (0..BODIES).map(|body| stepped(body, everything, END, 2 * STEPS)).collect();
    let largest = |tolerance: f64| {
        let ends = ended(&under_everything().taylor(steps(tolerance)));
        ends.iter().zip(&truth).map(|(end, truth)| apart(end, truth)).fold(0.0, f64::max)
    };
    let errors: Vec<f64> = [1e-5, 1e-7, 1e-9, 1e-11].map(largest).to_vec();
    for pair in errors.windows(2) {
        let decades = (pair[0] / pair[1]).log10();
        assert!((1.0..3.0).contains(&decades), "{errors:?}");
    }
}

/// Kinetic energy of both motions and that of the spring; the angular momentum about the origin.
fn kept(body: usize, at: &Moving) -> (f64, DVec3) {
    let omega = at.omega(body);
    let stretched = at.position + at.orientation.normalize() * ARM;
    let energy = 0.5 * omega.dot(tensor(body).to_matrix() * omega)
        + 0.5 * mass(body) * at.velocity.length_squared()
        + 0.5 * STIFFNESS * stretched.length_squared();
    (energy, at.angular_momentum + mass(body) * at.position.cross(at.velocity))
}

#[test]
fn a_tethered_body_keeps_its_energy_and_its_angular_momentum_about_the_origin() {
    let ends = ended(&tethered(bodies()).until(200.0).taylor(steps(1e-13)));
    let mut exchanged = 0.0_f64;
    for (body, end) in ends.iter().enumerate() {
        let (before, after) = (kept(body, &start(body)), kept(body, end));
        let (energy, momentum) = ((after.0 / before.0 - 1.0).abs(), before.1.distance(after.1) / before.1.length());
        assert!(energy < 1e-10 && momentum < 1e-10, "body {body}: {energy:e}, {momentum:e}");
        exchanged = exchanged.max(start(body).angular_momentum.distance(end.angular_momentum));
    }
    assert!(exchanged > 0.1, "nothing passed between rotation and translation: {exchanged}");
}

#[test]
fn a_tethered_body_goes_back_where_it_came_from() {
    let scene = |moving: &[Moving]| tethered(bodies_from(moving)).taylor(steps(1e-14));
    let begun: Vec<Moving> = (0..BODIES).map(start).collect();
    let turned_back = |at: Moving| Moving { angular_momentum: -at.angular_momentum, velocity: -at.velocity, ..at };
    let ends: Vec<Moving> = ended(&scene(&begun)).into_iter().map(turned_back).collect();
    let back: Vec<Moving> = ended(&scene(&ends)).into_iter().map(turned_back).collect();
    for (body, (begun, back)) in begun.iter().zip(&back).enumerate() {
        assert!(apart(begun, back) < 1e-10, "body {body}: {:e}", apart(begun, back));
    }
}

/// Gravity and linear drag as the library has them leave a closed form; as formulas of the user's own they do not, and mean the same.
#[test]
fn what_has_a_closed_form_comes_out_the_same_without_it() {
    let torque = || {
        let text = "0.1 * cross(to_body(velocity), vec(0, 0, 1)) + 0.02 * to_body(position)";
        Torque::custom(text, Parameters::new()).expect("a torque")
    };
    let scene = || Scene::new(bodies()).until(END).torque(torque()).taylor(steps(1e-14));
    let built_in = scene().force(Force::gravity(DVec3::new(0.3, -0.1, -0.98))).force(Force::linear_drag(0.4));
    let custom = Force::custom("mass * vec(0.3, -0.1, -0.98) - 0.4 * velocity", Parameters::new()).expect("a force");
    let custom = scene().force(custom);
    assert!(!built_in.torques()[0].needs().position && custom.torques()[0].needs().position);
    for (body, (a, b)) in ended(&built_in).iter().zip(&ended(&custom)).enumerate() {
        assert!(apart(a, b) < 1e-11, "body {body}: {:e}", apart(a, b));
    }
}

/// A body that starts at rest in the origin has no scale yet: forces of several powers of time take it away. A position 1e7 m from the origin
/// keeps what is added to it.
#[test]
fn a_centre_of_mass_may_start_at_rest_in_the_origin_or_far_from_it() {
    for (power, far) in [(0, 0.0), (1, 0.0), (3, 0.0), (5, 0.0), (1, 1e7)] {
        // Far away a body that turns fast takes many steps, which add little each.
        let fast = if far > 0.0 { 300.0 } else { 1.0 };
        let angular_momentum = fast * start(0).angular_momentum;
        let at = Moving { position: DVec3::X * far, velocity: DVec3::ZERO, angular_momentum, ..start(0) };
        let text = format!("mass * time^{power} * exp(-time) * vec(1, 2, -1)");
        let text = text.replace("time^0 * ", "");
        let force = Force::custom(&text, Parameters::new()).expect("a force");
        let torque = Torque::custom("0.2 * to_body(velocity)", Parameters::new()).expect("a torque");
        let scene = Scene::new(bodies_from(&[at])).until(5.0).force(force).torque(torque).taylor(steps(1e-13));
        let ends = ended(&scene);
        // ∫ tⁿ e⁻ᵗ = n! (1 − e⁻ᵗ Σ tᵏ/k!), and its integral, by Simpson's rule on 20,000 pieces.
        let acceleration = |t: f64| t.powi(power) * (-t).exp();
        let pieces = 20_000;
        let h = 5.0 / f64::from(pieces);
        let weight = |k: i32| if k == 0 || k == pieces { 1.0 } else { [2.0, 4.0][(k % 2) as usize] };
        let (mut speed, mut path) = (0.0, 0.0);
        for k in 0..=pieces {
            let t = f64::from(k) * h;
            speed += weight(k) * h / 3.0 * acceleration(t);
            path += weight(k) * h / 3.0 * (5.0 - t) * acceleration(t);
        }
        let (direction, place) = (DVec3::new(1.0, 2.0, -1.0), DVec3::X * far);
        let wrong = [ends[0].velocity.distance(direction * speed), ends[0].position.distance(place + direction * path)];
        // A unit in the last place of 1e7 m is 2e-9 m; without what sums have lost it is two.
        assert!(wrong[0] < 1e-11 && wrong[1] < 1e-11 + 2e-16 * far, "t^{power}, {far} m: {wrong:?}");
    }
}

/// Bodies that hardly turn, on springs that swing fast: steps follow the centre of mass as well.
#[test]
fn a_fast_centre_of_mass_is_followed_beside_a_slow_rotation() {
    const PACE: f64 = 25.0;
    let slow: Vec<Moving> = (0..BODIES)
        .map(|body| Moving { angular_momentum: 1e-4 * start(body).angular_momentum, ..start(body) })
        .collect();
    let force = Force::custom(&format!("-{:?} * mass * position", PACE * PACE), Parameters::new()).expect("a force");
    let torque = Torque::custom("1e-9 * to_body(position)", Parameters::new()).expect("a torque");
    let scene = Scene::new(bodies_from(&slow)).until(END).force(force).torque(torque).taylor(steps(1e-12));
    for (body, (end, start)) in ended(&scene).iter().zip(&slow).enumerate() {
        let (sin, cos) = (PACE * END).sin_cos();
        let off = end.position.distance(start.position * cos + start.velocity * (sin / PACE));
        let size = start.position.length() + start.velocity.length() / PACE;
        assert!(off <= 1e-9 * size, "body {body}: {off:e} m of {size:e}");
    }
}

#[test]
fn an_accuracy_that_is_asked_for_is_kept_and_reported_with_that_of_positions() {
    for wanted in [1e-5, 1e-9] {
        let scene = under_everything().accuracy(polhode::Accuracy::attitude(wanted));
        let record = run(&scene);
        let trust = record.trust();
        assert_eq!(trust.method, polhode::Method::Taylor);
        assert_eq!(trust.precision, Precision::F64);
        let sample = &trust.recomputed_sample;
        assert_eq!((sample.met, sample.translating), (Some(true), BODIES), "{sample}");
        let end = record.final_state();
        for body in 0..BODIES {
            let truth = stepped(body, everything, END, STEPS);
            let turned = end.orientation(body).conjugate() * truth.orientation.normalize();
            let angle = 2.0 * DVec3::new(turned.x, turned.y, turned.z).length();
            assert!(angle < wanted, "body {body}: {angle:e} of {wanted:e}");
            let place = end.positions()[body].distance(truth.position);
            assert!(place <= 1.1 * sample.position.max + OWN_ERROR, "body {body}: {place:e} m, {sample}");
        }
        assert!(sample.position.max > 0.0);
    }
}

/// A body alone, as in parts of a study and in checkpoints, has the bits that it has among others; a replay comes as near as its own error.
#[test]
fn a_body_alone_moves_as_among_others_and_a_replay_follows_it() {
    let engine = Engine::cpu();
    let scene = under_everything().outputs(Outputs::Every(3.0)).accuracy(polhode::Accuracy::attitude(1e-7));
    let plan = Plan::new(&scene, &engine).expect("a plan");
    let record = engine.run(&plan).expect("runs");
    for body in [0, 13, BODIES - 1] {
        let own = alone(&engine, &plan, body).expect("runs");
        for ((time, state), snapshot) in own.iter().zip(record.snapshots()) {
            assert_eq!(*time, snapshot.time());
            let among = (snapshot.positions()[body], snapshot.velocities()[body]);
            assert_eq!(state.translation, Some(among), "body {body}, {time} s");
            assert_eq!(state.rotation.orientation, snapshot.orientation(body), "body {body}, {time} s");
        }
        let replayed = replay(&plan, body, 2).expect("replays");
        assert_eq!(replayed.how, How::Series { tolerance: 1e-14 });
        let (end, last) = (replayed.track.last().expect("an end"), own.last().expect("an end"));
        let error = StateError::between(&last.1, &end.1);
        assert!(error.attitude < 1e-7 && error.position.is_some_and(|error| error < 1e-6), "body {body}: {error}");
        let of_replay = replayed.own_error.expect("measured");
        assert!(of_replay.attitude < 1e-10 && of_replay.position.is_some_and(|error| error < 1e-10), "{of_replay}");
    }
}

/// The same as a closure, to the bit.
#[test]
fn a_closure_asks_where_the_body_is_as_a_text_does() {
    let parameters = || Parameters::new().number("k", STIFFNESS).and_then(|all| all.vector("c", ARM)).expect("names");
    let force = |s: &polhode::expression::Scope<'_>| -((s.position() + s.to_world(s.vector("c"))) * s.number("k"));
    let recorded = Torque::recorded(parameters(), |s| s.vector("c").cross(s.to_body(force(s)))).expect("a torque");
    let scene = Scene::new(bodies())
        .until(END)
        .force(Force::recorded(parameters(), force).expect("a force"))
        .torque(recorded)
        .taylor(steps(1e-14));
    let found = error(&scene, tether);
    assert!(found < 1e-10, "{found:e}");
}

/// What is not there where the centre of mass is part of the state says so.
#[test]
fn what_is_not_known_is_said() {
    let event = Event::new("fast", Quantity::SpinRate, Condition::Above(1.5)).expect("a level");
    let scene = tethered(bodies()).outputs(Outputs::Every(0.5)).taylor(steps(1e-10)).event(event);
    let record = run(&scene);
    let occurrences = &record.events()[0].occurrences;
    let later: Vec<_> = occurrences.iter().filter(|event| event.known_to != EventTime::Start).collect();
    assert!(
        !later.is_empty() && later.iter().all(|event| event.known_to == EventTime::Output && event.time % 0.5 == 0.0)
    );
    let engine = Engine::cpu();
    let explained = Plan::new(&scene, &engine).expect("a plan").explain().to_string();
    let line =
        "integrated: position and velocity with the rotation, by taylor on the CPU, as torque 1 (custom) names them";
    assert!(explained.contains(line), "{explained}");
    let report = verify(&engine, &scene, &Options::default()).expect("a report").to_string();
    assert!(report.contains("position and velocity are part of the state"), "{report}");
}
