//! Bodies that are not stepped, at the output times: the closed form by elliptic functions on the engine against the scalar twin, and
//! regular precessions, which the host computes in `f64` whatever the engine, against the closed form.

use super::bound::{RowBound, Slopes};
use super::compare::{Comparison, Field, Gap, Place};
use super::steps::enter_row;
use super::subject::{Side, Subject, TWIN, in_one_word};
use super::{Found, Window};
use crate::bodies::BodyFrame;
use crate::bodies::columns::StateWords;
use crate::engine::cpu::Cpu;
use crate::engine::{Backend, End, unobserved};
use crate::error::Result;
use crate::kernel::free_motion::{AnyRows, FORMED_BODIES, Formed, PrecessionBlock, SetUp};
use crate::math::Precision;
use crate::math::Width;
use crate::math::real::Scalar;
use crate::plan::{Group, Plan};

/// Roundings between the phases, which both sides have to the bit, and a component: some eight of half an ulp on either side
/// (tests/mirror/free_motion_parity.rs), in units of roundoff of the largest component.
const ROUNDINGS: f64 = 16.0;
/// The same for a precession, and for the closed form that it is compared with.
const PRECESSION_ROUNDINGS: f64 = 64.0;

/// Compares the closed form at the output times of a window.
pub(super) fn compare(
    engine: &dyn Backend,
    plan: &Plan<'_>,
    subject: &Subject<'_>,
    set_up: SetUp,
    window: Window,
) -> Result<Found> {
    let times = window.of(plan.advance_times().len() as u64);
    let mut found = Found { steps: times.clone(), total: plan.advance_times().len() as u64, ..Found::default() };
    let (ensemble, precision) = (plan.scene().ensemble(), subject.precision);
    let host = Cpu::new(Width::Lanes);
    let sides = if engine.precisions().contains(&precision) { Side::all(engine) } else { Side::all(&host) };
    let rows = |precision, set_up| -> Result<AnyRows> {
        Ok(AnyRows::prepare_members(ensemble, &subject.members, precision, set_up)?.1)
    };
    let evaluated = |engine: &dyn Backend, rows: AnyRows, time: f64| -> Result<StateWords> {
        let mut session = engine.start_free(rows)?;
        session.advance_to(End::at(time), &mut unobserved)?;
        session.read(0..subject.len())
    };
    let mut reference = Comparison::new(["the scalar twin".into(), "the f64 reference".into()], false);
    let mut comparisons: Vec<Comparison> =
        sides.iter().map(|side| Comparison::new([side.name.clone(), "the scalar twin".into()], true)).collect();
    let own = rows(precision, set_up)?;
    let wide = rows(Precision::F64, SetUp::TwoWords)?;
    for number in times {
        let time = plan.advance_times()[number as usize];
        let expected = evaluated(&Cpu::new(TWIN), own.clone(), time)?;
        let place = |row: usize| Place { body: subject.members.body(row), step: number + 1, time };
        for (side, comparison) in sides.iter().zip(&mut comparisons) {
            let after = side.with(|engine| evaluated(engine, own.clone(), time))?;
            for row in 0..subject.len() {
                let bound = bound(&expected, row, precision);
                enter_row(comparison, subject, place(row), (&expected, &after, row), Some(&bound));
            }
        }
        if precision != Precision::F64 || set_up != SetUp::TwoWords {
            let after = evaluated(&Cpu::new(TWIN), wide.clone(), time)?;
            let expected = in_one_word(&expected);
            for row in 0..subject.len() {
                let bound = bound(&after, row, precision);
                enter_row(&mut reference, subject, place(row), (&after, &expected, row), Some(&bound));
            }
        }
    }
    found.comparisons = comparisons;
    if reference.compared > 0 {
        found.comparisons.push(reference);
    }
    found.notes.push("constants of the closed form: the host forms them for either side".into());
    Ok(found)
}

fn bound(expected: &StateWords, row: usize, precision: Precision) -> RowBound {
    let u = match precision {
        Precision::F32 => f32::UNIT_ROUNDOFF,
        Precision::F64 => f64::UNIT_ROUNDOFF,
    };
    let state = expected.combined(row);
    let momentum = state[4..].iter().fold(0.0_f64, |largest, x| largest.max(x.abs()));
    let of_q = ROUNDINGS * u;
    RowBound { across: of_q, norm: of_q, momentum: of_q * momentum, slopes: Slopes::default() }
}

/// Compares regular precessions with the closed form of the same bodies, at the output times of a window.
pub(super) fn compare_precession(
    plan: &Plan<'_>,
    subject: &Subject<'_>,
    group: &Group,
    window: Window,
) -> Result<Found> {
    let times = window.of(plan.advance_times().len() as u64);
    let mut found = Found { steps: times.clone(), total: plan.advance_times().len() as u64, ..Found::default() };
    let (scene, members) = (plan.scene(), &subject.members);
    let (frames, rows) = AnyRows::prepare_members(scene.ensemble(), members, Precision::F64, SetUp::TwoWords)?;
    let mut session = Cpu::new(TWIN).start_free(rows)?;
    let sides = ["the host's precession in f64".to_owned(), "the closed form, one body at a time".to_owned()];
    let mut comparison = Comparison::new(sides, true);
    let shape = group.class.shape;
    let axis = |frame: &BodyFrame, m| shape.axis_of(frame, m, scene.end());
    let mut block = PrecessionBlock::new();
    for number in times {
        let time = plan.advance_times()[number as usize];
        session.advance_to(End::at(time), &mut unobserved)?;
        let words = session.read(0..members.len())?;
        for (row, frame) in frames.iter().enumerate() {
            let first = row - row % FORMED_BODIES;
            if row == first {
                let count = FORMED_BODIES.min(members.len() - first);
                let body = |place| members.body(first + place);
                block.form(scene.ensemble(), count, body, (shape.rotations(), axis), (time, false));
            }
            let (expected, found) = (frame.state_of(&words, row), block.state(row - first));
            let place = Place { body: members.body(row), step: number + 1, time };
            let rounding = PRECESSION_ROUNDINGS * f64::UNIT_ROUNDOFF;
            // Both signs of a quaternion are the same orientation; its deviation is half of the angle.
            let (q, mut p) = (expected.orientation, found.orientation);
            if q.dot(p) < 0.0 {
                p = -p;
            }
            let off = (p - q).to_array();
            let orientation = Gap::vector(Field::Orientation, &q.to_array(), &p.to_array(), &off);
            comparison.enter(&orientation, Some(0.5 * group.bound.attitude + rounding), Precision::F64, place);
            let (l, k) = (expected.angular_momentum_world, found.angular_momentum_world);
            let momentum = Gap::vector(Field::AngularMomentum, &l.to_array(), &k.to_array(), &(k - l).to_array());
            comparison.enter(&momentum, Some(rounding * l.length()), Precision::F64, place);
            comparison.decided += 1;
        }
    }
    found.comparisons.push(comparison);
    Ok(found)
}
