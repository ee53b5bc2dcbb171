//! How bodies lie in columns, and that scaling changes no digit.

use glam::{DQuat, DVec3};
use polhode::bodies::columns::{STRIDE_UNIT, parameter_columns, state_columns, stride_of};
use polhode::engine::batch::{AnyBatch, Batch, prepare};
use polhode::math::Precision;
use polhode::math::real::Scalar;
use polhode::{Ensemble, Error};

const MOMENTS: DVec3 = DVec3::new(0.75, 1.3, 1.9);
const SPIN: DVec3 = DVec3::new(0.3, -1.2, 0.8);

fn orientation() -> DQuat {
    DQuat::from_xyzw(0.1, -0.4, 0.3, 0.8).normalize()
}

fn one(moments: DVec3, spin: DVec3) -> Ensemble {
    Ensemble::from_columns(&[moments], &[orientation()], &[spin]).expect("valid")
}

fn f32_batch(ensemble: &Ensemble) -> Batch<f32> {
    match prepare(ensemble, Precision::F32).expect("prepared").1 {
        AnyBatch::F32(batch) => batch,
        AnyBatch::F64(_) => panic!("f32 was asked for"),
    }
}

#[test]
fn component_c_of_body_i_is_at_c_times_stride_plus_i() {
    let count = 67;
    let ensemble = Ensemble::from_fn(count, |body| {
        (MOMENTS * (1.0 + body as f64 / 512.0), orientation(), SPIN * (1.0 + body as f64 / 4096.0))
    })
    .expect("valid");
    let (frames, batch) = prepare(&ensemble, Precision::F64).expect("prepared");
    let AnyBatch::F64(batch) = batch else { panic!("f64 was asked for") };
    assert_eq!(batch.stride, 2 * STRIDE_UNIT);
    assert_eq!(batch.state.len(), state_columns::<f64>() * batch.stride);
    assert_eq!(batch.parameters.len(), parameter_columns::<f64>() * batch.stride);
    for (body, frame) in frames.iter().enumerate() {
        for component in 0..3 {
            let m = batch.state[(4 + component) * batch.stride + body];
            let spin = ensemble.angular_velocity_body()[body][component];
            assert_eq!(m, frame.scaled_moments[component] * spin, "m {component} of {body}");
            assert_eq!(batch.parameters[component * batch.stride + body], 1.0 / frame.scaled_moments[component]);
        }
        let q = ensemble.orientation()[body];
        for (component, expected) in q.to_array().into_iter().enumerate() {
            let found = batch.state[component * batch.stride + body];
            assert!((found - expected).abs() <= f64::EPSILON, "q {component} of {body}: {found}, not {expected}");
        }
    }
}

/// Columns that are a power of two apart fall into the same lines of a cache.
#[test]
fn columns_of_many_bodies_are_an_odd_number_of_units_apart() {
    for bodies in [1, 64, 65, 1000, 4096, 100_000, 131_072, 1 << 20] {
        let (stride, least) = (stride_of(bodies), bodies.next_multiple_of(STRIDE_UNIT));
        assert!(stride == least || stride == least + STRIDE_UNIT, "{bodies}: {stride}");
        assert!(stride / STRIDE_UNIT % 2 == 1 || bodies < 1024, "{bodies}: {stride}");
    }
}

#[test]
fn rows_beyond_the_last_body_are_at_rest() {
    let batch = f32_batch(&one(MOMENTS, SPIN));
    for row in 1..batch.stride {
        let column = |c: usize| batch.state[c * batch.stride + row];
        assert_eq!([column(0), column(1), column(2), column(3)], [0.0, 0.0, 0.0, 1.0]);
        assert_eq!([column(4), column(5), column(6)], [0.0, 0.0, 0.0]);
        assert_eq!(batch.parameters[row], 1.0);
        assert_eq!(batch.parameters[3 * batch.stride + row], 0.0);
    }
}

#[test]
fn two_words_of_f32_hold_48_bits() {
    for x in [1.0 / 3.0, 0.1, 123.456, -2.0_f64.sqrt(), 1e-20 / 7.0] {
        let (value, residue) = f32::two_words(x);
        let error = (value.to_f64() + residue.to_f64() - x).abs();
        assert!(error <= 2.0_f64.powi(-48) * x.abs(), "{x}: off by {error:e}");
        assert!(residue.abs() <= value.abs() * 2.0_f32.powi(-24), "{x}: residue {residue:e} of {value:e}");
    }
}

#[test]
fn units_that_are_powers_of_two_leave_every_column_but_the_rate_unchanged() {
    let batch = f32_batch(&one(MOMENTS, SPIN));
    // Rigid molecules to planets, and one asteroid's spin to one molecule's.
    for (moment_exponent, rate_exponent) in [(-153, 0), (127, 0), (0, -30), (0, 50), (-153, 50), (127, -30)] {
        let other = f32_batch(&one(MOMENTS * 2.0_f64.powi(moment_exponent), SPIN * 2.0_f64.powi(rate_exponent)));
        assert_eq!(batch.state, other.state);
        let stride = batch.stride;
        assert_eq!(batch.parameters[..3 * stride], other.parameters[..3 * stride]);
        assert_eq!(batch.parameters[4 * stride..], other.parameters[4 * stride..]);
        assert_eq!(
            f64::from(other.parameters[3 * stride]),
            f64::from(batch.parameters[3 * stride]) * 2.0_f64.powi(rate_exponent)
        );
    }
}

#[test]
fn every_scaled_number_is_of_the_order_of_one_over_the_stated_ranges() {
    for moment in [1e-46, 1e-20, 1.0, 1e38] {
        for rate in [1e-9, 1.0, 1e15] {
            let batch = f32_batch(&one(MOMENTS * moment, SPIN * rate));
            for column in 0..7 {
                let x = batch.state[column * batch.stride].abs();
                assert!(
                    (0.01..10.0).contains(&x),
                    "state column {column} is {x:e} at {moment:e} kg m², {rate:e} rad/s"
                );
            }
            for column in 0..3 {
                let x = batch.parameters[column * batch.stride];
                assert!((0.1..10.0).contains(&x), "1/I column {column} is {x:e} at {moment:e} kg m²");
            }
            let reference_rate = batch.parameters[3 * batch.stride];
            assert!(reference_rate.is_normal(), "rate {reference_rate:e} at {rate:e} rad/s");
        }
    }
}

#[test]
fn a_state_comes_back_in_the_users_axes_and_units() {
    // A full tensor: the principal axes are not the body's.
    let turn = DQuat::from_xyzw(0.5, 0.1, -0.3, 0.7).normalize();
    let frame = glam::DMat3::from_quat(turn);
    let inertia = frame * glam::DMat3::from_diagonal(MOMENTS * 1e-30) * frame.transpose();
    let spin = SPIN * 1e9;
    let ensemble = Ensemble::from_columns(&[inertia], &[orientation()], &[spin]).expect("valid");
    let (frames, batch) = prepare(&ensemble, Precision::F64).expect("prepared");
    let AnyBatch::F64(batch) = batch else { panic!("f64 was asked for") };
    let state = frames[0].body_state(batch.read(0..1).combined(0));
    // Diagonalising, two quaternion products and two rotations: a few tens of roundings.
    let tolerance = 32.0 * f64::EPSILON;
    assert!(state.orientation.dot(orientation()).abs() >= 1.0 - tolerance, "{:?}", state.orientation);
    assert!(
        (state.angular_velocity_body - spin).length() <= tolerance * spin.length(),
        "{:?}",
        state.angular_velocity_body
    );
    let momentum = orientation() * (inertia * spin);
    assert!((state.angular_momentum_world - momentum).length() <= tolerance * momentum.length());
    let energy = 0.5 * spin.dot(inertia * spin);
    assert!((state.kinetic_energy - energy).abs() <= tolerance * energy, "{} is not {energy}", state.kinetic_energy);
}

#[test]
fn a_body_that_is_not_valid_is_named_with_field_value_and_remedy() {
    let valid = (MOMENTS, DQuat::IDENTITY, SPIN);
    let with = |bad: (DVec3, DQuat, DVec3)| Ensemble::from_fn(9, |body| if body == 7 { bad } else { valid });
    let field_of = |bad| match with(bad) {
        Err(Error::Body { body, field, .. }) => (body, field),
        other => panic!("{other:?}"),
    };
    assert_eq!(field_of((DVec3::new(1.0, f64::NAN, 1.0), valid.1, valid.2)), (7, "iyy"));
    assert_eq!(field_of((valid.0, DQuat::from_xyzw(0.0, f64::INFINITY, 0.0, 1.0), valid.2)), (7, "qy"));
    assert_eq!(field_of((valid.0, valid.1, DVec3::new(0.0, 0.0, f64::NAN))), (7, "wz"));
    assert_eq!(field_of((valid.0, DQuat::from_xyzw(0.0, 0.0, 0.0, 0.0), valid.2)), (7, "orientation (qx, qy, qz, qw)"));
    assert_eq!(field_of((DVec3::new(1.0, -1.0, 1.0), valid.1, valid.2)), (7, "the least principal moment of inertia"));
    assert_eq!(field_of((DVec3::new(1.0, 1.0, 2.1), valid.1, valid.2)), (7, "I1 + I2 - I3"));
    // A flat plate, and one that misses it by rounding, are valid.
    assert!(with((DVec3::new(1.0, 1.0, 2.0), valid.1, valid.2)).is_ok());
    assert!(with((DVec3::new(1.0, 1.0, 2.0 + 1e-13), valid.1, valid.2)).is_ok());
}

#[test]
fn columns_of_unequal_length_are_refused() {
    let error = Ensemble::from_columns(&[MOMENTS; 3], &[DQuat::IDENTITY; 3], &[SPIN; 2]).unwrap_err();
    assert_eq!(error, Error::ColumnLength { column: "angular_velocity_body".into(), found: 2, expected: 3 });
}

#[test]
fn more_bodies_than_memory_are_refused_before_anything_is_allocated() {
    let error = Ensemble::from_fn(usize::MAX / 256, |_| (MOMENTS, DQuat::IDENTITY, SPIN)).unwrap_err();
    assert!(matches!(error, Error::TooManyBodies { .. }), "{error}");
}
