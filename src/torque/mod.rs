//! Torques: what acts on a body besides its own inertia.
//!
//! A scene holds any number of [`Torque`]s, each a model and the values of its parameters. Each model has its own file with its
//! [`Declaration`], its constructor, what does not follow from the declaration, and the kernel's function, the same as in the WGSL file of
//! the same stem. A plan turns torques into columns beside the bodies' own ([`TorqueTable`]), in principal axes and in the units of each
//! body's scale.
//!
//! # Models
//!
//! Keys are those of `[[torque]]` in a study; one with a dot stands in a table, `orbit = { radius = 7.0e6 }`.
//!
//! | model | equation | keys | source |
//! | --- | --- | --- | --- |
//! | [`constant-body`](constant_body) | τ = const in body axes | `torque` (N m) | J. M. Longuski, Acta Astronautica 25 (1991) 131 |
//! | [`constant-world`](constant_world) | τ = Rᵀ τ_world, constant in world axes | `torque` (N m) | by definition |
//! | [`linear-drag`](linear_drag), `viscous` | τ = −c ω | `coefficient` (N m s) | G. Kirchhoff, Mechanik, 1876, lecture 26 |
//! | [`matrix-drag`](matrix_drag) | τ = −C ω | `matrix` (N m s) | J. Happel, H. Brenner, Low Reynolds Number Hydrodynamics, 1965, section 5.2 |
//! | [`quadratic-drag`](quadratic_drag) | τ = −c \|ω\| ω | `coefficient` (N m s²) | I. Newton, Principia, 1687, book II, section II |
//! | [`sinusoidal`] | τ = τ_sin sin Ωt + τ_cos cos Ωt in body axes | `sine` (N m, else 0), `cosine` (N m, else 0), `rate` (rad/s) | by definition |
//! | [`gravity-gradient`](gravity_gradient) | τ = 3 μ/r³ u × I u, u = Rᵀ r̂ | `mu` (m³/s²), `orbit.semi_major_axis` or `orbit.radius` (m), `orbit.eccentricity` (else 0), `orbit.inclination` (rad, else 0), `orbit.ascending_node` (rad, else 0), `orbit.pericentre` (rad, else 0), `orbit.mean_anomaly` (rad, else 0), `orbit.j2` (else 0), `orbit.equatorial_radius` (m, else 6378136.3) | P. C. Hughes, Spacecraft Attitude Dynamics, 1986, equation 8.1.14 |
//! | [`heavy-top`](heavy_top) | τ = c × Rᵀ (M g); the body's inertia tensor is the one about the pivot | `mass` (kg), `centre` (m), `gravity` (m/s²) | F. Klein, A. Sommerfeld, Über die Theorie des Kreisels, 1897, chapter IV |
//! | [`magnetic-dipole`](magnetic_dipole) | τ = m × Rᵀ B | `moment` (A m²), `field` (T) | J. C. Maxwell, A Treatise on Electricity and Magnetism, 1873, § 390 |
//! | [`orbiting-dipole`](orbiting_dipole) | τ = m × Rᵀ B, B = b/r³ (3 (d · r̂) r̂ − d) | `mu` (m³/s²), `orbit.semi_major_axis` or `orbit.radius` (m), `orbit.eccentricity` (else 0), `orbit.inclination` (rad, else 0), `orbit.ascending_node` (rad, else 0), `orbit.pericentre` (rad, else 0), `orbit.mean_anomaly` (rad, else 0), `moment` (A m²), `strength` (T m³), `tilt` (rad, else 0), `azimuth` (rad, else 0), `rotation` (rad/s, else 0), `orbit.j2` (else 0), `orbit.equatorial_radius` (m, else 6378136.3) | J. R. Wertz, Spacecraft Attitude Determination and Control, 1978, equation H-16 |
//! | [`eddy-current`](eddy_current) | τ = k (ω × B) × B | `coefficient` (N m s/T²), `field` (T) | G. L. Smith, NASA TR R-129, 1962 |
//! | [`orbiting-eddy-current`](orbiting_eddy_current) | τ = k (ω × B) × B, B = b/r³ (3 (d · r̂) r̂ − d) | `mu` (m³/s²), `orbit.semi_major_axis` or `orbit.radius` (m), `orbit.eccentricity` (else 0), `orbit.inclination` (rad, else 0), `orbit.ascending_node` (rad, else 0), `orbit.pericentre` (rad, else 0), `orbit.mean_anomaly` (rad, else 0), `coefficient` (N m s/T²), `strength` (T m³), `tilt` (rad, else 0), `azimuth` (rad, else 0), `rotation` (rad/s, else 0), `orbit.j2` (else 0), `orbit.equatorial_radius` (m, else 6378136.3) | N. Praly et al., Acta Astronautica 76 (2012) 145 |
//! | [`flat-plates`](flat_plates) | τ = Σ r × F, F = −p A c (a u + (b + d c) n), c = n · u > 0 | `pressure` (N/m²), `direction`, `facets`: 1 to 16 tables of `area` (m²), `normal`, `centre` (m), `along` (else 0), `constant` (else 0), `across` (else 0), `solar.specular`, `solar.diffuse`, `drag.normal_accommodation`, `drag.tangential_accommodation`, `drag.wall_speed_ratio` (else 0) | C. R. McInnes, Solar Sailing, 1999, section 2.6; S. A. Schaaf, P. L. Chambré, Flow of Rarefied Gases, 1961 |
//! | [`sine-spring`](sine_spring) | τ = −k sin θ n | `stiffness` (N m), `target` | B. Wie, P. M. Barba, J. Guid. Control Dyn. 8 (1985) 360 |
//! | [`log-spring`](log_spring) | τ = −k θ n | `stiffness` (N m), `target` | F. Bullo, R. M. Murray, Proportional derivative control on the Euclidean group, ECC 1995 |
//! | [`internal-dissipation`](internal_dissipation) | dm/dt = m × ω + k m × (m × ω); not a torque: m is constant in the world; axes turn at ω + k m × ω, torques read ω = I⁻¹ m | `coefficient` (s/(kg m²)) | A. M. Bloch et al., Comm. Math. Phys. 175 (1996) 1, section 5 |
//! | [`pd-attitude`](pd_attitude) | τ = −k θ − d ω of a sample, within a limit; θ = 2 (x, y, z) of the rotation from the target to the attitude, in body axes, with w ≥ 0 | `stiffness` (N m), `damping` (N m s), `target`, `torque_limit` (N m), `every` (s), `delay` (s, else 0) | F. L. Markley, J. L. Crassidis, Fundamentals of Spacecraft Attitude Determination and Control, 2014, equation 7.14 |
//! | [`pd-direction`](pd_direction) | τ = k a × Rᵀ d̂ − d ω of a sample, within a limit | `stiffness` (N m), `damping` (N m s), `axis`, `direction`, `torque_limit` (N m), `every` (s), `delay` (s, else 0) | P. C. Hughes, Spacecraft Attitude Dynamics, 1986, section 7.3 |
//! | [`reaction-wheels`](reaction_wheels) | τ = −dh/dt − ω × h, dh/dt = k θ + d ω of a sample, within limits; θ = 2 (x, y, z) of the rotation from the target to the attitude, in body axes, with w ≥ 0 | `stiffness` (N m), `damping` (N m s), `target`, `torque_limit` (N m), `momentum_limit` (kg m²/s), `momentum` (kg m²/s, else 0), `every` (s), `delay` (s, else 0) | F. L. Markley, J. L. Crassidis, Fundamentals of Spacecraft Attitude Determination and Control, 2014, equation 3.147 |
//! | [`magnetorquers`] | τ = m × Rᵀ B, m = −k ΔB/Δt of a sample, within a limit | `mu` (m³/s²), `orbit.semi_major_axis` or `orbit.radius` (m), `orbit.eccentricity` (else 0), `orbit.inclination` (rad, else 0), `orbit.ascending_node` (rad, else 0), `orbit.pericentre` (rad, else 0), `orbit.mean_anomaly` (rad, else 0), `gain` (A m² s/T), `strength` (T m³), `tilt` (rad, else 0), `azimuth` (rad, else 0), `rotation` (rad/s, else 0), `moment_limit` (A m²), `every` (s), `delay` (s, else 0), `orbit.j2` (else 0), `orbit.equatorial_radius` (m, else 6378136.3) | T. W. Flatley et al., NASA CP-3345, 1997, p. 79 |
//! | [`white-noise`](white_noise) | dm = σ dW | `intensity` (N m √s), `seed` (else from the study's seed), `draws_per_step` (else 1) | J. R. McConnell, Rotational Brownian Motion and Dielectric Theory, 1980, chapter 2 |
//! | [`variable-inertia`](variable_inertia) | ω = I(t)⁻¹ m, I(t) = I₀ + (I₁ − I₀) s(t); s = ½ (1 − cos rate t), or the incomplete beta I_u(7, 7), u = (t − start)/duration | `inertia` (kg m²), `factor`, `ramp.start` (s), `ramp.duration` (s), `oscillation.rate` (rad/s) | P. C. Hughes, Spacecraft Attitude Dynamics, 1986, section 3.3 |
//!
//! For `variable-inertia` either `inertia` or `factor` is given, and either `ramp` or `oscillation`; for a facet of `flat-plates`
//! either `along`, `constant` and `across`, or `solar`, or `drag`.
//!
//! # Kernels
//!
//! Integrators are generic over a [`TorqueKernel`], which is the sum of all torques. [`Free`] is the kernel without torques;
//! with it no torque code is compiled into an integrator. The WGSL twin of a torque kernel is one chunk that defines `torque`
//! (`shaders/torque/none.wgsl` or `sum.wgsl`). Internal dissipation and changing moments of inertia are in the same list:
//! they do not change the angular momentum in the world, but the rate at which the axes turn ([`TorqueKernel::motion`]).
//!
//! A new model is a file here, with its declaration and its formula, its `pub mod`, a line in `registry.rs` and, if it has a kernel of its
//! own, a line in `kind.rs`; `docs/extending.md` lists these and the tests' places. A model whose formula follows from its values is built for them (`Model::made_for`), as [`flat_plates`] is.
//!
//! A formula (`formula.rs`) is written once over [`Real`]. With scalars it is the reference and the shader's twin; SIMD lanes run on
//! tiles of bodies (`tile`); a [`Symbol`](crate::expression::Symbol) records it as a graph, from which its WGSL text
//! (`shader.rs`) and its dependences follow. A custom torque ([`custom`]), or moments that change by a formula
//! ([`custom_inertia`]), are such a graph to begin with (`expressed.rs`):
//! the CPU interprets it over tiles, the GPU compiles its text.
//!
//! A torque with a part that is sampled and held ([`control`]) is such a formula too, with the held values among its parameters; the
//! sampled models here, [`pd_attitude`], [`pd_direction`], [`reaction_wheels`] and [`magnetorquers`], are built from texts.
//!
//! `shaders/torque` holds what is not in a formula: how columns and times are read, the draws of white noise, moments that change. Each
//! file names its twin in its first line.
//!
//! [`TorqueKernel`]: crate::kernel::torque_kernel::TorqueKernel
//! [`TorqueKernel::motion`]: crate::kernel::torque_kernel::TorqueKernel::motion
//! [`Free`]: crate::kernel::torque_kernel::Free
//! [`Real`]: crate::math::real::Real

pub use crate::error::Text;

/// The functions of a model that return its file's `DECLARATION` and, where it is always the same, its kind.
macro_rules! declared {
    ($($kind:ident)?) => {
        fn declaration(&self) -> &$crate::torque::Declaration {
            &DECLARATION
        }
        $(
            fn kind(&self, _: $crate::torque::Values<'_>) -> $crate::torque::Kind {
                $crate::torque::Kind::$kind
            }
        )?
    };
}

pub mod constant_body;
pub mod constant_world;
pub mod control;
pub(crate) mod coupled;
pub mod custom;
pub mod custom_inertia;
pub(crate) mod declaration;
pub mod eddy_current;
pub(crate) mod expressed;
pub mod flat_plates;
pub mod force;
pub(crate) mod formula;
pub mod gravity_gradient;
pub mod gravity_gradient_drifting;
pub mod gravity_gradient_kepler;
pub mod heavy_top;
mod inertia_change;
pub mod internal_dissipation;
mod kind;
pub mod linear_drag;
pub mod linear_rotor;
pub mod log_spring;
pub mod magnetic_dipole;
pub mod magnetorquers;
pub mod matrix_drag;
mod model;
pub(crate) mod motion;
mod named;
pub mod orbit;
pub mod orbiting_dipole;
pub mod orbiting_dipole_drifting;
pub mod orbiting_eddy_current;
pub mod orbiting_eddy_current_drifting;
mod parameter;
pub mod pd_attitude;
pub mod pd_direction;
pub mod quadratic_drag;
pub mod reaction_wheels;
pub(crate) mod registry;
pub(crate) mod shader;
pub mod sine_spring;
pub mod sinusoidal;
pub(crate) mod sum;
pub(crate) mod table;
pub(crate) mod tile;
pub(crate) mod time_functions;
pub(crate) mod translated;
#[doc(hidden)]
pub mod twin;
mod validation;
mod value;
pub mod variable_inertia;
pub mod white_noise;

pub use control::{SampledLaw, Sampling};
pub use custom::Parameters;
pub use declaration::{Declaration, Frame, OtherKey, ParameterDeclaration, Preset, Shape, Validity};
pub(crate) use expressed::{Expressed, host_numbers, numbers_of_body, tensor_of, user_number};
pub use kind::Kind;
pub(crate) use model::Model;
pub(crate) use model::ModelRef;
pub use model::{Needs, Torque};
pub use named::Argument;
pub use orbit::Orbit;
pub use parameter::Parameter;
pub use registry::declarations;
pub(crate) use table::{Bodies, PER_TICK, bytes_per_body, damping_of, rate_of};
pub use table::{Instances, TorqueTable};
pub(crate) use validation::ValidationContext;
pub use value::Value;
pub(crate) use value::Values;
