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

/// What a method conserves in torque-free motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Conserved {
    /// Only |q|; invariants drift by the method's truncation error.
    Norm,
    /// |m| to rounding; energy and the direction of the angular momentum drift.
    AngularMomentumMagnitude,
    /// The angular momentum in the world to rounding; the energy error is bounded.
    AngularMomentumWorld,
    /// Energy and the angular momentum in the world to rounding.
    EnergyAndAngularMomentumWorld,
}

impl std::fmt::Display for Conserved {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter.write_str(match self {
            Conserved::Norm => "|q|",
            Conserved::AngularMomentumMagnitude => "|q|, |m|",
            Conserved::AngularMomentumWorld => "|q|, L; energy error bounded",
            Conserved::EnergyAndAngularMomentumWorld => "|q|, L, energy",
        })
    }
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
    /// What a free body conserves.
    pub conserves: Conserved,
    /// The range of stability, in words.
    pub stability: &'static str,
    /// The usable region: the longest step, as ω dt in rad, for which free bodies with moments of a ratio of at most 100, in f64, keep the
    /// method's order or have errors that grow by rounding alone. With longer steps they drift, lose their phase, flip or diverge. Found by
    /// `polhode bench stability` on a grid of half decades; `benches/results` has the rows.
    pub usable_angle: f64,
    /// Author and year.
    pub source: &'static str,
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

const ANY: &str = "any step";

impl Method {
    /// The properties of the method.
    pub const fn properties(self) -> Properties {
        let rk4 = Properties {
            name: "rk4",
            order: 4,
            orders: [4, 4, 4],
            evaluations: 4,
            conserves: Conserved::Norm,
            stability: "omega dt < 2.8 on a steady rotation",
            usable_angle: 0.1,
            source: "Kutta 1901",
            rigid_only: false,
            baseline: false,
        };
        // The free flow of the splittings is of order 6, whatever the composition.
        let splitting = Properties {
            name: "splitting2",
            order: 2,
            orders: [6, 2, 2],
            evaluations: 2,
            conserves: Conserved::EnergyAndAngularMomentumWorld,
            stability: "omega dt < 1 in the longest substep, flagged beyond",
            usable_angle: 1.0,
            source: "Strang 1968; Moser and Veselov 1991; Hairer and Vilmart 2006",
            rigid_only: true,
            baseline: false,
        };
        let first_order = Properties {
            name: "explicit_euler",
            order: 1,
            orders: [1, 1, 1],
            evaluations: 1,
            conserves: Conserved::Norm,
            stability: "unstable at any step",
            usable_angle: 1e-3,
            source: "Euler 1768",
            rigid_only: true,
            baseline: true,
        };
        match self {
            Method::Rk4 => rk4,
            Method::Rk8 => Properties {
                name: "rk8",
                order: 8,
                orders: [8, 8, 8],
                evaluations: 12,
                stability: "omega dt < 6 on a steady rotation",
                usable_angle: 1.0,
                source: "Dormand and Prince 1980; Hairer, Norsett and Wanner 1993",
                ..rk4
            },
            Method::Cf4 => Properties { name: "cf4", source: "Celledoni, Marthinsen and Owren 2003", ..rk4 },
            Method::Splitting2 => splitting,
            Method::Splitting4 => Properties {
                name: "splitting4",
                order: 4,
                orders: [6, 4, 4],
                evaluations: 7,
                source: "Blanes and Moan 2002; Moser and Veselov 1991; Hairer and Vilmart 2006",
                ..splitting
            },
            Method::Splitting6 => Properties {
                name: "splitting6",
                order: 6,
                orders: [6, 6, 6],
                evaluations: 12,
                source: "Blanes and Moan 2002; Moser and Veselov 1991; Hairer and Vilmart 2006",
                ..splitting
            },
            Method::ImplicitMidpoint => Properties {
                name: "implicit_midpoint",
                orders: [2, 2, 2],
                evaluations: 4,
                stability: ANY,
                usable_angle: 0.1,
                source: "Lewis and Simo 1994",
                ..splitting
            },
            Method::Dlm => Properties {
                name: "dlm",
                orders: [2, 2, 2],
                conserves: Conserved::AngularMomentumWorld,
                stability: ANY,
                usable_angle: 0.1,
                source: "Dullweber, Leimkuhler and McLachlan 1997",
                baseline: true,
                ..splitting
            },
            Method::ExplicitEuler => first_order,
            Method::GyroNewton => {
                Properties { name: "gyro_newton", stability: ANY, source: "Catto 2015", ..first_order }
            }
            Method::ClampedEuler => Properties {
                name: "clamped_euler",
                conserves: Conserved::AngularMomentumMagnitude,
                stability: ANY,
                source: "Jolt Physics, Rapier, Avian",
                ..first_order
            },
            // Order and step follow from the tolerance; these are the highest order and the step that it allows.
            Method::Taylor => Properties {
                name: "taylor",
                order: 30,
                orders: [30, 30, 30],
                evaluations: 1,
                stability: "steps follow the tolerance",
                usable_angle: f64::INFINITY,
                source: "Jorba and Zou 2005; Hermite and Obreshkov",
                ..rk4
            },
            Method::Spiral => Properties {
                name: "spiral",
                order: 2,
                orders: [2, 1, 2],
                evaluations: 3,
                stability: "omega dt < 1.7",
                usable_angle: 0.1,
                source: "del Valle, Angeles, Gonzalez and Luding 2024",
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
