//! Torques written out for the tests, and a body stepped under them without an engine around it.

use glam::{DQuat, DVec3};
use polhode::kernel::method::Step;
use polhode::kernel::method::rk8_adaptive::Timed;
use polhode::kernel::rigid_body::{Body, Invariants, State};
use polhode::kernel::torque_kernel::{TorqueKernel, VelocityDependence};
use polhode::math::quaternion::Quaternion;
use polhode::math::real::Real;
use polhode::math::vector::{TwoWords, Vector};

use super::double_double::{DoubleDouble, sin_cos};
use super::golden::{Case, number, vector};

/// The torque of a golden case; its body axes are the principal axes.
#[derive(Clone, Copy, Debug)]
pub enum Torque {
    None,
    /// com × Rᵀ (0, 0, −weight).
    HeavyTop {
        com: DVec3,
        weight: f64,
    },
    /// sin · sin(Ω t) + cos · cos(Ω t).
    Sinusoidal {
        sin: DVec3,
        cos: DVec3,
        rate: f64,
    },
    /// −c ω.
    LinearDrag {
        coefficient: f64,
    },
    /// −C ω, C by rows.
    MatrixDrag {
        rows: [DVec3; 3],
    },
    /// −c |ω| ω.
    QuadraticDrag {
        coefficient: f64,
    },
    /// 3 μ/r³ u × I u on a circular orbit, u the direction to the body from the centre.
    GravityGradient {
        strength: f64,
        rate: f64,
        moments: DVec3,
    },
}

impl Torque {
    /// The torque of a golden case.
    pub fn of(case: &Case) -> Self {
        let model = &case.record["model"];
        let field = |name: &str| number(&model[name]);
        match model["type"].as_str().expect("model type") {
            "free" => Torque::None,
            "heavy_top" => Torque::HeavyTop { com: vector(&model["com_body"]), weight: field("mass") * field("g") },
            "sin_body_torque" => Torque::Sinusoidal {
                sin: vector(&model["tau_sin"]),
                cos: vector(&model["tau_cos"]),
                rate: field("omega"),
            },
            "linear_drag" => Torque::LinearDrag { coefficient: field("c") },
            "matrix_drag" => {
                let row = |i: usize| -> DVec3 { vector(&model["C"][i]) };
                Torque::MatrixDrag { rows: [row(0), row(1), row(2)] }
            }
            "quadratic_drag" => Torque::QuadraticDrag { coefficient: field("c") },
            "gravity_gradient_circular" => {
                let (mu, r): (f64, f64) = (field("mu"), field("r"));
                let cube = r * r * r;
                Torque::GravityGradient { strength: 3.0 * mu / cube, rate: (mu / cube).sqrt(), moments: moments(case) }
            }
            other => panic!("no torque is written out for {other}"),
        }
    }
}

/// The principal moments of a golden case whose tensor is diagonal, in the order of its axes.
pub fn moments(case: &Case) -> DVec3 {
    let i = case.inertia;
    DVec3::new(i.x_axis.x, i.y_axis.y, i.z_axis.z)
}

/// The torque with what turns step numbers into times.
#[derive(Clone, Copy, Debug)]
pub struct Acting {
    pub torque: Torque,
    pub dt: f64,
    /// The time at the start of the interval, s.
    pub start: f64,
}

impl Acting {
    /// The torque for steps of `dt` from time 0.
    pub fn new(torque: Torque, dt: f64) -> Self {
        Self { torque, dt, start: 0.0 }
    }
}

/// Sine and cosine of a torque's phase, to 32 digits, so that tests of high orders see the methods alone.
#[derive(Clone, Copy, Debug)]
pub struct Phase {
    sin: DoubleDouble,
    cos: DoubleDouble,
}

impl Acting {
    fn at(&self, time: DoubleDouble) -> Phase {
        let rate = match self.torque {
            Torque::Sinusoidal { rate, .. } | Torque::GravityGradient { rate, .. } => rate,
            _ => 0.0,
        };
        let (sin, cos) = sin_cos(DoubleDouble::from(rate) * time);
        Phase { sin, cos }
    }
}

/// Both words as a number of the kernels.
fn wide<R: Real>(x: DoubleDouble) -> R {
    R::splat(x.hi) + R::splat(x.lo)
}

impl<R: Real<Scalar = R> + polhode::math::real::Scalar> Timed<R> for Acting {
    fn start_at(&self, time: TwoWords<R>) -> DoubleDouble {
        let [start, value, residue] = [self.start, time.value.to_f64(), time.residue.to_f64()].map(DoubleDouble::from);
        start + value + residue
    }

    fn epoch_after(&self, start: &DoubleDouble, elapsed: R) -> Phase {
        self.at(*start + DoubleDouble::from(elapsed.to_f64()))
    }
}

fn splat<R: Real>(v: DVec3) -> Vector<R> {
    Vector::new(R::splat(v.x), R::splat(v.y), R::splat(v.z))
}

impl<R: Real> TorqueKernel<R> for Acting {
    /// s.
    type Start = DoubleDouble;
    /// Sine and cosine of the torque's phase.
    type Epoch = Phase;
    const FREE: bool = false;

    fn start(&self, step: u64) -> DoubleDouble {
        let [start, step, dt] = [self.start, step as f64, self.dt].map(DoubleDouble::from);
        start + step * dt
    }

    fn epoch(&self, start: &DoubleDouble, fraction: f64) -> Phase {
        let [fraction, dt] = [fraction, self.dt].map(DoubleDouble::from);
        self.at(*start + fraction * dt)
    }

    fn torque(&self, phase: &Phase, _: &Body<R>, orientation: Quaternion<R>, omega: Vector<R>) -> Vector<R> {
        match self.torque {
            Torque::None => Vector::zero(),
            Torque::HeavyTop { com, weight } => {
                let down = orientation.rotate_inverse(splat(DVec3::new(0.0, 0.0, -weight)));
                splat::<R>(com).cross(down)
            }
            Torque::Sinusoidal { sin, cos, .. } => {
                splat::<R>(sin) * wide(phase.sin) + splat::<R>(cos) * wide(phase.cos)
            }
            Torque::LinearDrag { coefficient } => omega * R::splat(-coefficient),
            Torque::MatrixDrag { rows } => {
                -Vector::new(splat(rows[0]).dot(omega), splat(rows[1]).dot(omega), splat(rows[2]).dot(omega))
            }
            Torque::QuadraticDrag { coefficient } => omega * (R::splat(-coefficient) * omega.dot(omega).sqrt()),
            Torque::GravityGradient { strength, moments, .. } => {
                let outward = Vector::new(wide(phase.cos), wide(phase.sin), R::splat(0.0));
                let u = orientation.rotate_inverse(outward);
                u.cross(splat::<R>(moments).scaled_by(u)) * R::splat(strength)
            }
        }
    }

    fn velocity_dependence(&self) -> VelocityDependence {
        match self.torque {
            Torque::LinearDrag { .. } => VelocityDependence::LinearDrag,
            Torque::MatrixDrag { .. } | Torque::QuadraticDrag { .. } => VelocityDependence::General,
            _ => VelocityDependence::None,
        }
    }

    fn drag_coefficient(&self) -> R {
        match self.torque {
            Torque::LinearDrag { coefficient } => R::splat(coefficient),
            _ => R::splat(0.0),
        }
    }
}

/// A number in the words of `R`.
pub fn two_words<R: Real>(x: f64) -> TwoWords<R> {
    use polhode::math::real::Scalar;
    let (value, residue) = R::Scalar::two_words(x);
    TwoWords { value: R::splat(value.to_f64()), residue: R::splat(residue.to_f64()) }
}

fn vector_words<R: Real>(v: DVec3) -> TwoWords<Vector<R>> {
    let [x, y, z] = v.to_array().map(two_words::<R>);
    TwoWords { value: Vector::new(x.value, y.value, z.value), residue: Vector::new(x.residue, y.residue, z.residue) }
}

/// A body and its state.
#[derive(Clone, Copy, Debug)]
pub struct Moving<R> {
    pub body: Body<R>,
    pub invariants: Invariants<R>,
    pub state: State<R>,
}

/// A body in its principal axes at its start; `raw` is the orientation x, y, z, w before it is normalised.
pub fn at_start<R: Real>(moments: DVec3, raw: [f64; 4], angular_velocity: DVec3) -> Moving<R> {
    use polhode::math::real::Scalar;
    let m = moments * angular_velocity;
    if R::Scalar::WORDS == 1 {
        // In the arithmetic of the words themselves, which may be wider than f64; m is exact in it for golden bodies.
        let (one, i, omega) = (R::splat(1.0), splat::<R>(moments), splat::<R>(angular_velocity));
        let [x, y, z, w] = raw.map(R::splat);
        let q = Quaternion::new(x, y, z, w);
        let zero = R::splat(0.0);
        let m = i.scaled_by(omega);
        let inverse = Vector::new(one / i.x, one / i.y, one / i.z);
        return Moving {
            body: Body::new(TwoWords { value: inverse, residue: Vector::zero() }),
            invariants: Invariants { angular_momentum_squared: m.dot(m), kinetic_energy: R::splat(0.5) * m.dot(omega) },
            state: State {
                orientation: TwoWords {
                    value: q * (one / q.norm_squared().sqrt()),
                    residue: Quaternion::new(zero, zero, zero, zero),
                },
                angular_momentum_principal: TwoWords { value: m, residue: Vector::zero() },
                status: zero,
            },
        };
    }
    let orientation = DQuat::from_array(raw).normalize();
    let [x, y, z, w] = orientation.to_array().map(two_words::<R>);
    Moving {
        body: Body::new(vector_words(moments.recip())),
        invariants: Invariants {
            angular_momentum_squared: R::splat(m.length_squared()),
            kinetic_energy: R::splat(0.5 * m.dot(angular_velocity)),
        },
        state: State {
            orientation: TwoWords {
                value: Quaternion::new(x.value, y.value, z.value, w.value),
                residue: Quaternion::new(x.residue, y.residue, z.residue, w.residue),
            },
            angular_momentum_principal: vector_words(m),
            status: R::splat(0.0),
        },
    }
}

/// A golden case at its start.
pub fn start_of<R: Real>(case: &Case) -> Moving<R> {
    let raw = &case.record["initial"]["q_raw"];
    at_start(moments(case), [1, 2, 3, 0].map(|i| number(&raw[i])), case.angular_velocity_body)
}

/// `steps` steps of `dt` by `M`.
pub fn stepped<R: Real, M: Step, E: TorqueKernel<R>>(moving: &Moving<R>, torques: &E, dt: f64, steps: u64) -> State<R> {
    let dt = two_words::<R>(dt);
    let prepared = M::prepare::<R, E>(&moving.body, &moving.invariants, dt);
    let mut state = moving.state;
    for step in 0..steps {
        state = M::step(&moving.body, &prepared, torques, step, dt, state);
    }
    state
}

/// The attitude of a scalar state, both words added.
pub fn attitude<R: Real<Scalar = R> + polhode::math::real::Scalar>(state: &State<R>) -> DQuat {
    let (q, r) = (state.orientation.value, state.orientation.residue);
    let sum = |a: R, b: R| a.to_f64() + b.to_f64();
    DQuat::from_xyzw(sum(q.x, r.x), sum(q.y, r.y), sum(q.z, r.z), sum(q.w, r.w)).normalize()
}

/// The angle between two attitudes, rad, from all their digits.
pub fn between(a: Quaternion<DoubleDouble>, b: Quaternion<DoubleDouble>) -> f64 {
    use polhode::math::real::Scalar;
    let difference = a.conjugate().product(b);
    let v = difference.vector();
    2.0 * v.dot(v).to_f64().sqrt().atan2(difference.w.to_f64().abs())
}

/// A golden case by name.
pub fn case(file: &str, name: &str) -> Case {
    super::golden::load(file).into_iter().find(|case| case.name == name).unwrap_or_else(|| panic!("{file}: no {name}"))
}
