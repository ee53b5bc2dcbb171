//! Properties of the methods, as data.

use super::{Method, implicit_midpoint, midpoint};

/// The kind of torque that acts, as far as a method's order depends on it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum TorqueKind {
    /// No torque.
    Free,
    /// A torque that depends on attitude or time, not on the angular velocity.
    AttitudeOrTime,
    /// A torque that depends on the angular velocity.
    AngularVelocity,
}

impl TorqueKind {
    /// All kinds.
    pub const ALL: [TorqueKind; 3] = [TorqueKind::Free, TorqueKind::AttitudeOrTime, TorqueKind::AngularVelocity];
}

/// The properties of a method. Its module says more.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Properties {
    /// The name in study files, on the command line and of the source files.
    pub name: &'static str,
    /// The order of the attitude error in the step size under the torques that suit the method best.
    pub order: u32,
    /// The orders without torque, under a torque of attitude or time, and under one of angular velocity.
    orders: [u32; 3],
    /// Evaluations of the torque per step under a torque of attitude or time; for an implicit method, per iteration.
    pub evaluations: u32,
    /// The usable region: the longest step, as ω dt in rad, for which free bodies with moments of a ratio of at most 100, in f64, keep the
    /// method's order or have errors that grow by rounding alone. With longer steps they drift, lose their phase, flip or diverge. Found by
    /// `polhode bench stability` on a grid of half decades; `benches/results` has the rows.
    pub usable_angle: f64,
    /// Whether it assumes that the body's axes turn at I⁻¹ m with the initial moments, so that it cannot follow internal dissipation or
    /// moments of inertia that change.
    pub rigid_only: bool,
    /// Whether it shows what other programs do, rather than being meant for use.
    pub baseline: bool,
}

impl Properties {
    /// The order of the attitude error under a kind of torque; below [`Properties::order`] where the method loses order. Under torques
    /// of several kinds it is the lowest of their orders.
    pub const fn order_under(&self, kind: TorqueKind) -> u32 {
        match kind {
            TorqueKind::Free => self.orders[0],
            TorqueKind::AttitudeOrTime => self.orders[1],
            TorqueKind::AngularVelocity => self.orders[2],
        }
    }
}

impl Method {
    /// The properties of the method.
    pub const fn properties(self) -> Properties {
        let rk4 = Properties {
            name: "rk4",
            order: 4,
            orders: [4, 4, 4],
            evaluations: 4,
            usable_angle: 0.1,
            rigid_only: false,
            baseline: false,
        };
        // The free flow of the splittings is of order 6, whatever the composition.
        let splitting = Properties {
            name: "splitting2",
            order: 2,
            orders: [6, 2, 2],
            evaluations: 2,
            usable_angle: 1.0,
            rigid_only: true,
            baseline: false,
        };
        let first_order = Properties {
            name: "explicit_euler",
            order: 1,
            orders: [1, 1, 1],
            evaluations: 1,
            usable_angle: 1e-3,
            rigid_only: true,
            baseline: true,
        };
        match self {
            Method::Rk4 => rk4,
            Method::Rk8 => {
                Properties { name: "rk8", order: 8, orders: [8, 8, 8], evaluations: 12, usable_angle: 1.0, ..rk4 }
            }
            Method::Cf4 => Properties { name: "cf4", ..rk4 },
            Method::Splitting2 => splitting,
            Method::Splitting4 => {
                Properties { name: "splitting4", order: 4, orders: [6, 4, 4], evaluations: 7, ..splitting }
            }
            Method::Splitting6 => {
                Properties { name: "splitting6", order: 6, orders: [6, 6, 6], evaluations: 12, ..splitting }
            }
            Method::ImplicitMidpoint => Properties {
                name: "implicit_midpoint",
                orders: [2, 2, 2],
                evaluations: 4,
                usable_angle: 0.1,
                ..splitting
            },
            Method::Dlm => {
                Properties { name: "dlm", orders: [2, 2, 2], usable_angle: 0.1, baseline: true, ..splitting }
            }
            Method::ExplicitEuler => first_order,
            Method::GyroNewton => Properties { name: "gyro_newton", ..first_order },
            Method::ClampedEuler => Properties { name: "clamped_euler", ..first_order },
            // Order and step follow from the tolerance; these are the highest order and the step that it allows.
            Method::Taylor => Properties {
                name: "taylor",
                order: 30,
                orders: [30, 30, 30],
                evaluations: 1,
                usable_angle: f64::INFINITY,
                ..rk4
            },
            Method::Spiral => Properties {
                name: "spiral",
                order: 2,
                orders: [2, 1, 2],
                evaluations: 3,
                usable_angle: 0.1,
                ..first_order
            },
        }
    }

    /// The most evaluations of the torque in one step, under any torque and however slowly an iteration converges.
    pub(crate) const fn most_evaluations(self) -> u32 {
        match self {
            Method::Splitting2 | Method::Dlm => 2 * 4,
            Method::Splitting4 => 7 * 4,
            Method::Splitting6 => 12 * 7,
            Method::ImplicitMidpoint => 2 + 4 * implicit_midpoint::ITERATIONS,
            other => other.properties().evaluations,
        }
    }

    /// The most iterations of the loops in the method's own shader in one step.
    pub(crate) const fn most_loops(self, free: bool) -> u32 {
        match self {
            Method::Splitting2 | Method::Splitting4 | Method::Splitting6 if free => midpoint::DISCRETE_ITERATIONS,
            Method::Splitting2 => 2 + midpoint::DISCRETE_ITERATIONS,
            Method::Splitting4 => 7 + 6 * midpoint::DISCRETE_ITERATIONS,
            Method::Splitting6 => 12 + 11 * midpoint::DISCRETE_ITERATIONS,
            Method::ImplicitMidpoint => implicit_midpoint::ITERATIONS,
            _ => 0,
        }
    }

    /// Whether the method's kernel reads the invariants of a torque-free body.
    pub(crate) const fn reads_invariants(self) -> bool {
        matches!(self, Method::Splitting2 | Method::Splitting4 | Method::Splitting6)
    }
}
