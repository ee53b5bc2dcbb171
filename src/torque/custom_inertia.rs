//! Moments of inertia that follow a formula of the user's own, as text or as a closure.
//!
//! The formula gives the principal moments ([`Torque::custom_moments`]), or one factor of all three ([`Torque::custom_inertia_factor`]), as
//! functions of the time and of parameters; at t = 0 they must be the body's own. As under [`super::variable_inertia`], the internal motion
//! carries no angular momentum and leaves the principal axes where they are, so that m is unaffected and ω = I(t)⁻¹ m. The energy balance
//! needs the work −½ ω·(dI/dt) ω; the rate of the moments in it is the formula's derivative, which is recorded from it.
//!
//! # Kernels
//!
//! The prepared formula (`expressed.rs`) gives the relative increase σ = I₀/I − 1 of the reciprocal moments. These are shares of a change
//! to I₁ = I₀/2, κ = 2 and 1/I₁ − 1/I₀ = 1/I₀, by [`Change`](super::variable_inertia::Change).

use glam::{DMat3, DQuat, DVec3};

use super::custom::HostState;
use super::expressed::{self, Expressed, Preparations};
use super::formula::{Column, Formula, Role};
use super::model::InertiaModel;
use super::{Declaration, Kind, Model, ModelRef, Parameters, Torque, ValidationContext, Values};
use crate::bodies::BodyFrame;
use crate::bodies::Ensemble;
use crate::bodies::inertia::InertiaTensor;
use crate::error::Result;
use crate::expression::{Expression, Fault, InputKind, Program, Scope, Shape, Symbol, Symbols, TextError};
use crate::math::vector::Vector;

/// `custom` moments as kernels read them; the columns of the formula follow these.
#[derive(Clone, Copy, Debug)]
pub(crate) struct InertiaFormula;

impl Formula for InertiaFormula {
    const STEM: &'static str = "inertia_formula";
    const COLUMNS: &'static [Column] = &[
        Column::vector("kappa"),
        Column::vector("difference"),
        Column::vector("difference_residue"),
        Column::vector("moments"),
    ];
    const ROLE: Role = Role::Moments;
}

/// A model of moments whose formula is an expression.
pub(crate) struct InertiaFormulaModel {
    declaration: Declaration,
    formula: Expression,
    program: Program,
    /// The formula, followed by its derivative with respect to time.
    with_rates: Program,
    prepared: Preparations,
}

/// The names that a formula of moments may use.
pub(crate) fn symbols(parameters: &Parameters) -> Result<Symbols, Fault> {
    parameters.named_in(Symbols::inertia())
}

impl Torque {
    /// Moments of inertia that change in time, given by a text: a vector of the moments about the body's axes, kg m², formed from `time`
    /// (s), `inertia` (kg m², the tensor at the start) and the parameters; the language is that of [`crate::expression`]. The body's axes
    /// must be principal ones. A scene has at most one change of moments, this one or [`Torque::variable_inertia`].
    ///
    /// ```
    /// use glam::{DQuat, DVec3};
    /// use polhode::torque::Parameters;
    /// use polhode::{Engine, Ensemble, Method, Plan, Scene, Torque};
    ///
    /// // Two masses of m/2 run out along ±x within 20 s, to l.
    /// let parameters = Parameters::new().number("m", 0.5)?.number("l", 2.0)?;
    /// let text = "let out = m * (l * smoothstep(0, 20, time))^2; vec(inertia.xx, inertia.yy + out, inertia.zz + out)";
    /// let satellite = Ensemble::from_columns(&[DVec3::new(1.0, 1.2, 1.5)], &[DQuat::IDENTITY], &[DVec3::Z])?;
    /// let scene = Scene::new(satellite).until(30.0).torque(Torque::custom_moments(text, parameters)?);
    /// let (scene, engine) = (scene.pinned(Method::Rk4, 0.01, None), Engine::cpu());
    /// let record = engine.run(&Plan::new(&scene, &engine)?)?;
    /// assert!((record.final_state().angular_velocity_body(0).z - 1.5 / 3.5).abs() < 1e-12);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    ///
    /// If the text is not such a formula; the error says where and why.
    pub fn custom_moments(text: &str, parameters: Parameters) -> Result<Self, TextError> {
        let formula = Expression::parse(text, &symbols(&parameters)?, Shape::Vector)?;
        Ok(Self::of_moments(formula, parameters)?)
    }

    /// Moments of inertia that change in time, given by a text: a factor of the body's own tensor; otherwise as [`Torque::custom_moments`],
    /// for any axes.
    ///
    /// # Errors
    ///
    /// If the text is not such a formula; the error says where and why.
    pub fn custom_inertia_factor(text: &str, parameters: Parameters) -> Result<Self, TextError> {
        let formula = Expression::parse(text, &symbols(&parameters)?, Shape::Number)?;
        Ok(Self::of_moments(formula, parameters)?)
    }

    /// As [`Torque::custom_moments`], by a closure over the same symbols.
    ///
    /// # Errors
    ///
    /// As [`Expression::record`].
    pub fn recorded_moments(
        parameters: Parameters,
        formula: impl FnOnce(&Scope<'_>) -> Vector<Symbol>,
    ) -> Result<Self, Fault> {
        let formula = Expression::record(&symbols(&parameters)?, formula)?;
        Self::of_moments(formula, parameters)
    }

    /// As [`Torque::custom_inertia_factor`], by a closure over the same symbols.
    ///
    /// # Errors
    ///
    /// As [`Expression::record`].
    pub fn recorded_inertia_factor(
        parameters: Parameters,
        formula: impl FnOnce(&Scope<'_>) -> Symbol,
    ) -> Result<Self, Fault> {
        let formula = Expression::record(&symbols(&parameters)?, formula)?;
        Self::of_moments(formula, parameters)
    }

    fn of_moments(formula: Expression, parameters: Parameters) -> Result<Self, Fault> {
        let model = InertiaFormulaModel::of_user(formula, &parameters)?;
        Ok(Self::of_model(model, parameters.into_parts().1))
    }
}

impl InertiaFormulaModel {
    /// A custom model of the user's.
    pub(crate) fn of_user(formula: Expression, parameters: &Parameters) -> Result<ModelRef, Fault> {
        let name = if formula.shape() == Shape::Number { "custom-factor" } else { "custom-moments" };
        let declaration = Declaration::new(name, "ω = I(t)⁻¹ m, I(t) as written", "the user's own")
            .not_rigid()
            .only_one(
                "the moments of a body change by one law: expected one such entry, whose parameters may be columns",
            )
            .parameters(parameters.declarations().iter().cloned());
        let prepared = Preparations::new(|_| Expressed::of_moments(&formula, None))?;
        prepared.general().check_constants()?;
        let (graph, outputs) = formula.with_rates()?;
        let (program, with_rates) = (formula.program(), Program::new(&graph, &outputs));
        Ok(ModelRef::Shared(std::sync::Arc::new(Self { declaration, formula, program, with_rates, prepared })))
    }

    fn is_factor(&self) -> bool {
        self.formula.shape() == Shape::Number
    }

    fn field(&self) -> &'static str {
        if self.is_factor() { "factor" } else { "moments" }
    }

    /// The results of a program over the formula's inputs, for a body with this initial tensor.
    fn evaluated(
        &self,
        program: &Program,
        values: Values<'_>,
        body: usize,
        initial: InertiaTensor,
        time: f64,
    ) -> Vec<f64> {
        let parameters = expressed::numbers_of_body(values.values, body);
        let inertia = initial.to_array();
        let inputs = program.inputs().iter().map(|input| match input.kind {
            InputKind::Inertia => inertia[usize::from(input.index)],
            InputKind::Parameter => parameters[usize::from(input.index)],
            // There are no other inputs.
            _ => time,
        });
        program.evaluate_one(&inputs.collect::<Vec<f64>>())
    }

    /// The moments about the body's axes (for a factor, about its principal axes), relative to the initial ones.
    fn ratios(&self, values: Values<'_>, body: usize, initial: InertiaTensor, time: f64) -> DVec3 {
        match self.evaluated(&self.program, values, body, initial, time)[..] {
            [factor] => DVec3::splat(factor),
            [x, y, z] => DVec3::new(x / initial.xx, y / initial.yy, z / initial.zz),
            _ => DVec3::NAN,
        }
    }
}

/// How far the formula may be from the body's own moments at t = 0, relative to these: an allowance for rounding in a formula that
/// does not start from `inertia`.
const START_TOLERANCE: f64 = 1e-9;
/// Number of times within a span at which the greatest spin is sought.
const SAMPLES: u32 = 16;

const AXES: &str = "expected an inertia without off-diagonal elements (kg m²), as the moments stand along the body's axes; \
                    any other body takes a `factor`";
const LINEAR: &str = "a linear rotor has one moment: expected a `factor` in place of three moments (kg m²)";
const START: &str = "expected the body's own moments at t = 0 (this is their largest ratio to them, less 1)";
const FACTOR_START: &str = "expected the factor 1 at t = 0 (this is the factor, less 1)";

impl Model for InertiaFormulaModel {
    fn declaration(&self) -> &Declaration {
        &self.declaration
    }

    fn kind(&self, _: Values<'_>) -> Kind {
        Kind::InertiaFormula
    }

    fn formulas(&self) -> Vec<&Expression> {
        vec![&self.formula]
    }

    fn prepared(&self, axes: Option<DQuat>, varies: bool) -> Option<std::sync::Arc<Expressed>> {
        Some(self.prepared.of(axes, varies, || Expressed::of_moments(&self.formula, axes)))
    }

    /// Only the start is checked. Moments that no body can have at a later time fail the body then.
    fn validate_bodies(&self, values: Values<'_>, context: &ValidationContext, ensemble: &Ensemble) -> Result<()> {
        for (body, initial) in ensemble.inertia().iter().enumerate() {
            let refused = |value, expected| Err(context.refusal(Some(body), self.field(), value, expected));
            if !self.is_factor() {
                if ensemble.is_linear_rotor(body) {
                    return refused(0.0, LINEAR);
                }
                let across = [initial.xy, initial.xz, initial.yz].into_iter().find(|across| *across != 0.0);
                if let Some(across) = across {
                    return refused(across, AXES);
                }
            }
            let off = (self.ratios(values, body, *initial, 0.0) - DVec3::ONE).to_array();
            let of_magnitude = |a: &f64, b: &f64| a.abs().total_cmp(&b.abs());
            let most = off.into_iter().max_by(of_magnitude).unwrap_or(f64::NAN);
            if most.is_nan() || most.abs() > START_TOLERANCE {
                return refused(most, if self.is_factor() { FACTOR_START } else { START });
            }
        }
        Ok(())
    }

    /// The rate of its phases, or that of the moments at the start; pilots notice a formula that changes faster later.
    fn rate(&self, values: Values<'_>, body: usize, middle_moment: f64) -> f64 {
        let initial = InertiaTensor::from(DVec3::splat(middle_moment));
        let found = self.evaluated(&self.with_rates, values, body, initial, 0.0);
        let (moments, slopes) = found.split_at(found.len() / 2);
        let relative = moments.iter().zip(slopes).map(|(moment, slope)| (slope / moment).abs());
        let general = self.prepared.general();
        let mut unused = vec![0.0; general.columns()];
        let phases = general.row(&expressed::host_of(values, body, &BodyFrame::UNIT), &mut unused);
        let rates = relative.chain(phases.into_iter().map(f64::abs));
        rates.filter(|rate| rate.is_finite()).fold(0.0, f64::max)
    }

    fn columns(&self, _: Values<'_>, _: usize, frame: &BodyFrame, _: DQuat, out: &mut [f64]) {
        let inverse = frame.scaled_moments.recip().to_array();
        for (axis, inverse) in inverse.into_iter().enumerate() {
            let first_word = f64::from(inverse as f32);
            out[axis] = 2.0;
            out[3 + axis] = first_word;
            out[6 + axis] = inverse - first_word;
        }
        out[9..12].copy_from_slice(&frame.tensor_moments().to_array());
    }

    fn inertia_change(&self) -> Option<&dyn InertiaModel> {
        Some(self)
    }

    fn fault_of_formula(&self, values: Values<'_>, body: usize, at: &HostState) -> Option<String> {
        let of_start = HostState { tensor: at.initial, ..*at };
        let parameters = expressed::numbers_of_body(values.values, body);
        let fault = self.formula.first_fault(|input| of_start.input(input, &parameters)).or_else(|| {
            let found = self.evaluated(&self.program, values, body, at.initial, at.time);
            let sum: f64 = found.iter().sum();
            let is_of_body = |moment: &f64| *moment > 0.0 && (self.is_factor() || 2.0 * moment <= sum * (1.0 + 1e-9));
            let what = if self.is_factor() { "a factor" } else { "moments" };
            (!found.iter().all(is_of_body)).then(|| format!("{what} of {found:?}, which no body has,"))
        })?;
        let inputs = of_start.described(self.formula.dependence(), &self.declaration.parameters, values.values, body);
        Some(format!("{fault} where {inputs}"))
    }
}

impl InertiaModel for InertiaFormulaModel {
    fn tensor_at(&self, values: Values<'_>, body: usize, initial: InertiaTensor, time: f64) -> InertiaTensor {
        match self.evaluated(&self.program, values, body, initial, time)[..] {
            [xx, yy, zz] => InertiaTensor { xx, yy, zz, ..initial },
            [factor] => initial * factor,
            _ => initial,
        }
    }

    fn scaled_moments_at(&self, values: Values<'_>, body: usize, frame: &BodyFrame, time: f64) -> DVec3 {
        let initial = expressed::tensor_of(frame);
        match self.evaluated(&self.program, values, body, initial, time)[..] {
            [factor] => frame.scaled_moments * factor,
            [x, y, z] => {
                // The squared elements of the matrix, whose entries are 0 and ±1, put them in the order of the principal axes.
                let axes = DMat3::from_quat(frame.principal_to_body);
                let along = |axis: DVec3| frame.scaled((axis * axis).dot(DVec3::new(x, y, z)), 1, 0);
                DVec3::new(along(axes.x_axis), along(axes.y_axis), along(axes.z_axis))
            }
            _ => frame.scaled_moments,
        }
    }

    fn spin_growth(&self, values: Values<'_>, body: usize, initial: &InertiaTensor, span: f64) -> f64 {
        let at = |sample: u32| span * f64::from(sample) / f64::from(SAMPLES);
        let least = |time: f64| self.ratios(values, body, *initial, time).min_element();
        let growth = (0..=SAMPLES).map(|sample| least(at(sample)).recip());
        growth.filter(|growth| growth.is_finite()).fold(1.0, f64::max)
    }
}
