//! One torque of every model, and how a batch under them is prepared.

use glam::{DMat3, DQuat, DVec3};
use polhode::engine::batch::{AnyBatch, prepare_with};
use polhode::math::Precision;
use polhode::torque::flat_plates::{Facet, Surface};
use polhode::torque::{Orbit, Parameter, Parameters, Torque};

use super::asymmetric_ensemble;
use super::random::Random;

/// Every model of torque, several instances of some, with parameters of each body's own where `body_count` is not zero.
///
/// Tests name some by their place, and draw from one stream after another: a new torque goes to the end, with its draws behind all others.
/// Its torque should have all derivatives where these bodies go, or orders cannot be measured (see `mirrors`).
///
/// Amplitudes are in proportion to the bodies' moments (`scale`), so that all of them turn by about a radian a second.
pub fn every_torque(scale: &[f64]) -> Vec<Torque> {
    every_torque_where(scale, |_, _| true)
}

/// The same, with torque k on the bodies alone whose index modulo `kinds` is k; where there are fewer torques the other bodies are free.
pub fn each_torque_alone(scale: &[f64], kinds: usize) -> Vec<Torque> {
    every_torque_where(scale, |torque, body| body % kinds == torque)
}

/// The same, where `acts` says so of the number of a torque and of a body; elsewhere they have no strength.
pub fn every_torque_where(scale: &[f64], acts: impl Fn(usize, usize) -> bool) -> Vec<Torque> {
    let count = scale.len();
    let part = |torque: usize, body: usize| if acts(torque, body) { 1.0 } else { 0.0 };
    let numbers = |torque: usize, column: &[f64]| -> Vec<f64> {
        column.iter().enumerate().map(|(body, number)| part(torque, body) * number).collect()
    };
    let on = |torque: usize, column: &[DVec3]| -> Vec<DVec3> {
        column.iter().enumerate().map(|(body, vector)| part(torque, body) * *vector).collect()
    };
    // A planet of next to no mass, where a gradient has no strength of its own.
    let planet = |torque: usize| -> Parameter<f64> {
        if (0..count).all(|body| acts(torque, body)) {
            return 1.0.into();
        }
        (0..count).map(|body| if acts(torque, body) { 1.0 } else { 1e-60 }).collect::<Vec<_>>().into()
    };
    let mut random = Random::new(77);
    let mut column = |size: f64| -> Vec<f64> { scale.iter().map(|s| s * size * random.between(0.5, 1.0)).collect() };
    let (drag, quadratic, stiffness, noise, slip) =
        (column(0.05), column(0.03), column(0.3), column(0.02), scale.iter().map(|s| 0.02 / s).collect::<Vec<_>>());
    let eddy = column(0.1);
    let matrix: Vec<DMat3> = numbers(4, &drag)
        .iter()
        .map(|d| DMat3::from_diagonal(DVec3::new(1.0, 2.0, 3.0)) * *d + DMat3::IDENTITY * (0.1 * d))
        .collect();
    let mut random = Random::new(78);
    let mut vectors = |size: f64| -> Vec<DVec3> {
        scale.iter().map(|s| DVec3::from_array([(); 3].map(|()| random.between(-1.0, 1.0))) * (s * size)).collect()
    };
    let (constant, world, sine, cosine, second_sine) =
        (vectors(0.2), vectors(0.2), vectors(0.3), vectors(0.3), vectors(0.1));
    let (centre, moment, orbiting) = (vectors(0.3), vectors(0.3), vectors(0.3));
    let rates: Vec<f64> = (0..count).map(|_| random.between(-5.0, 5.0)).collect();
    let eccentricity: Vec<f64> = (0..count).map(|_| random.between(0.0, 0.9)).collect();
    let inclination: Vec<f64> = eccentricity.iter().map(|number| 3.0 * number).collect();
    let target = DQuat::from_xyzw(0.3, -0.2, 0.5, 0.7);
    let mut random = Random::new(79);
    let pressure: Vec<f64> = scale.iter().map(|s| s * random.between(0.05, 0.1)).collect();
    let pulled: Vec<DVec3> =
        scale.iter().map(|s| DVec3::from_array([(); 3].map(|()| random.between(-0.3, 0.3))) * *s).collect();
    let damping: Vec<f64> = scale.iter().map(|s| s * random.between(0.02, 0.05)).collect();
    let text = "(1 + 0.4 * sin(1.1 * time)) * cross(vec(0.3, -0.5, 0.8), to_body(pulled)) - damping * angular_velocity";
    let parameters = Parameters::new()
        .vector("pulled", on(20, &pulled))
        .and_then(|own| own.number("damping", numbers(20, &damping)));
    vec![
        Torque::constant_body(on(0, &constant)),
        Torque::constant_body(DVec3::ZERO),
        Torque::constant_world(on(2, &world)),
        Torque::linear_drag(numbers(3, &drag)),
        Torque::matrix_drag(matrix),
        Torque::quadratic_drag(numbers(5, &quadratic)),
        Torque::sinusoidal(on(6, &sine), on(6, &cosine), 1.75),
        Torque::sinusoidal(on(7, &second_sine), DVec3::ZERO, rates),
        Torque::gravity_gradient(Orbit::circular(planet(8), 1.3).inclined(0.7).with_mean_anomaly(0.4)),
        Torque::gravity_gradient(
            Orbit::kepler(planet(9), 2.0, eccentricity).with_pericentre(0.3).with_mean_anomaly(-2.0),
        ),
        Torque::heavy_top(1.5, on(10, &centre), DVec3::new(0.1, 0.2, -1.0)),
        Torque::magnetic_dipole(on(11, &moment), DVec3::new(0.3, 0.1, 0.5)),
        Torque::orbiting_dipole(on(12, &orbiting), Orbit::kepler(1.0, 1.5, 0.3), 1.0, 2.97, 0.2, 0.5),
        Torque::eddy_current(numbers(13, &eddy), DVec3::new(0.6, 0.1, 0.4)),
        Torque::orbiting_eddy_current(
            numbers(14, &eddy),
            Orbit::kepler(1.0, 1.5, 0.2).inclined(0.4),
            1.5,
            0.4,
            1.2,
            -0.5,
        ),
        Torque::sine_spring(numbers(15, &stiffness), target),
        Torque::log_spring(numbers(16, &stiffness), target),
        Torque::white_noise(numbers(17, &noise), 1_234_567_890_123),
        Torque::internal_dissipation(numbers(18, &slip)),
        Torque::flat_plates(numbers(19, &pressure), DVec3::new(0.4, -0.7, 0.2), &mirrors()).expect("valid plates"),
        Torque::custom(text, parameters.expect("names")).expect("a formula"),
        // A pole and an ellipse that turn by some tenths of a radian a second.
        Torque::gravity_gradient(drifting(Orbit::kepler(planet(21), 1.7, 0.3).inclined(0.9))),
        Torque::orbiting_dipole(
            on(22, &orbiting),
            drifting(Orbit::circular(1.0, 1.4).inclined(inclination)),
            1.0,
            2.9,
            0.1,
            0.4,
        ),
        Torque::orbiting_eddy_current(numbers(23, &eddy), drifting(Orbit::kepler(1.0, 1.5, 0.2)), 1.5, 0.5, 0.7, -0.3),
    ]
}

/// An orbit that drifts about an oblate centre.
fn drifting(orbit: Orbit) -> Orbit {
    orbit.with_ascending_node(0.8).with_pericentre(-0.6).with_mean_anomaly(1.1).with_j2(0.3, 1.2)
}

/// Two vanes of perfect mirrors, each back to back with its like on the other side of the body: where light leaves one it meets the other
/// with the same torque, -2 p A c² r × n, which so has all derivatives. That of a plate alone has a kink where no method has its order.
fn mirrors() -> [Facet; 4] {
    let surface = Surface::Solar { specular: 1.0, diffuse: 0.0 };
    let vane = |normal_body, centre_body| Facet { area: 1.0, normal_body, centre_body, surface };
    let [first, second] = [
        vane(DVec3::new(0.6, 0.0, 0.8), DVec3::new(0.2, 1.1, -0.3)),
        vane(DVec3::new(-0.3, 0.9, 0.1), DVec3::new(0.9, 0.2, 0.7)),
    ];
    let like = |facet: Facet| Facet { normal_body: -facet.normal_body, centre_body: -facet.centre_body, ..facet };
    [first, like(first), second, like(second)]
}

/// The middle moments of [`asymmetric_ensemble`]'s bodies.
pub fn middle_moments(count: usize, seed: u64) -> Vec<f64> {
    let ensemble = asymmetric_ensemble(count, seed);
    ensemble.inertia().iter().map(|tensor| polhode::bodies::inertia::principal_axes(tensor).moments.y).collect()
}

/// The batch of [`asymmetric_ensemble`] under some torques, for a span of 100 s.
pub fn batch_under(count: usize, seed: u64, torques: &[Torque], precision: Precision) -> AnyBatch {
    prepare_with(&asymmetric_ensemble(count, seed), torques, 100.0, precision).expect("enough memory").1
}
