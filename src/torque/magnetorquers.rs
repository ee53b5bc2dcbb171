//! `magnetorquers`: three coils that brake the rotation by the sampled change of a planet's dipole field (B-dot).

use std::sync::LazyLock;

use glam::DVec3;

use super::control::{self, SOUND, SampledLaw, Sampling, limited};
use super::orbit::{self, elements};
use super::orbiting_dipole::{field_parameters, field_values};
use super::{
    Declaration, Frame, Model, Orbit, Parameter, ParameterDeclaration, Torque, ValidationContext, Validity, Value,
    Values,
};
use crate::error::Result;

/// τ = m × Rᵀ B, with m = −k ΔB/Δt from the fields seen at a sample and at the previous one in body axes, clamped to ±`moment_limit` axis
/// by axis and held (A. C. Stickler, K. T. Alfriend, *J. Spacecraft Rockets* 13 (1976) 282; T. W. Flatley et al., *A B-Dot Acquisition
/// Controller for the RADARSAT Spacecraft*, NASA CP-3345, 1997, p. 79, which is the limit alone, k → ∞). B is the field of
/// [`orbiting-dipole`](super::orbiting_dipole) along the orbit, also at times between samples. The first sample has no previous field, and
/// gives no moment. The own state is `b`, the field seen last (T, body axes), and `seen`, whether there is one.
pub struct Magnetorquers;

static DECLARATION: LazyLock<Declaration> = LazyLock::new(|| {
    let source = "T. W. Flatley et al., NASA CP-3345, 1997, p. 79";
    let number = ParameterDeclaration::number;
    let [every, delay] = control::parameters();
    Declaration::new("magnetorquers", "τ = m × Rᵀ B, m = −k ΔB/Δt of a sample, within a limit", source)
        .parameters(orbit::parameters())
        .parameters([number("gain", "A m² s/T", "k").valid(Validity::NotNegative)])
        .parameters(field_parameters())
        .parameters([
            number("moment_limit", "A m²", "the greatest moment of a coil").valid(Validity::Positive).drawn_as(14),
            every.drawn_as(15),
            delay.drawn_as(16),
        ])
        .parameters(orbit::drift::parameters())
        .own_state([
            ParameterDeclaration::vector("b", "T", Frame::Body, "the field that was seen last"),
            number("seen", "1", "1 once a field was seen"),
        ])
});
/// The index of `every`.
const EVERY: usize = orbit::ELEMENTS + 6;

impl Torque {
    /// Three coils that brake the rotation in a planet's dipole field along an orbit: k (A m² s/T), the limit of each coil's moment (A m²), and the
    /// field as [`Torque::orbiting_dipole`] has it: strength [T m³], tilt and azimuth of the dipole (rad), rate of the planet's rotation (rad/s);
    /// see [`Magnetorquers`].
    pub fn magnetorquers(
        gain: impl Into<Parameter<f64>>,
        moment_limit: impl Into<Parameter<f64>>,
        orbit: Orbit,
        [strength, tilt, azimuth, rotation]: [Parameter<f64>; 4],
        sampling: Sampling,
    ) -> Self {
        let mut values = field_values(orbit, Value::Number(gain.into()), [strength, tilt, azimuth, rotation]);
        let [every, delay] = sampling.values();
        values.splice(EVERY - 1..EVERY - 1, [Value::Number(moment_limit.into()), every, delay]);
        of_values(&values)
    }
}

/// The field in world axes, T, as definitions of a formula; `circular` orbits need no Kepler's equation.
fn field(circular: bool) -> String {
    let place = match circular {
        true => {
            "let u = (anomaly_rate + pericentre_rate) * time + (orbit_mean_anomaly + orbit_pericentre);
let along = cos(u); let across = sin(u); let distance = orbit_semi_major_axis;
"
        }
        false => {
            "let mean = anomaly_rate * time + orbit_mean_anomaly;
let turned = atan2(sin(mean), cos(mean));
let cos_e = kepler_cos(turned, orbit_eccentricity); let sin_e = kepler_sin(turned, orbit_eccentricity);
let q = 1 - orbit_eccentricity * cos_e;
let x = (cos_e - orbit_eccentricity) / q;
let y = sqrt(1 - orbit_eccentricity * orbit_eccentricity) * sin_e / q;
let w = pericentre_rate * time + orbit_pericentre;
let along = x * cos(w) - y * sin(w); let across = x * sin(w) + y * cos(w); let distance = orbit_semi_major_axis * q;
"
        }
    };
    let field = "let node = node_rate * time + orbit_ascending_node;
let level = across * cos(orbit_inclination);
let r = vec(along * cos(node) - level * sin(node), along * sin(node) + level * cos(node), across * sin(orbit_inclination));
let turn = rotation * time + azimuth;
let d = vec(sin(tilt) * cos(turn), sin(tilt) * sin(turn), cos(tilt));
let field = to_body((strength / distance / distance / distance) * (3 * dot(d, r) * r - d));
";
    place.to_owned() + field
}

fn of_values(values: &[Value]) -> Torque {
    let own = Values { values, first_body: 0 };
    let field = field(orbit::is_circular(own));
    let law = SampledLaw::of_model(&DECLARATION, values, rates(own)).expect(SOUND);
    let law = law.vector("b", DVec3::ZERO).and_then(|law| law.number("seen", 0.0)).expect(SOUND);
    let moment = format!(
        "{field}let m = (-gain / every) * (field - b); select(seen > 0.5, {}, vec(0, 0, 0))",
        limited("m", "moment_limit")
    );
    let law = law.sample_vector("moment", &moment).expect(SOUND);
    let law = law.next("b", &format!("{field}field")).and_then(|law| law.next("seen", "1")).expect(SOUND);
    law.torque_of(&DECLARATION, &format!("{field}cross(moment, field)")).expect(SOUND)
}

/// The rates of the mean anomaly, the pericentre and the node, rad/s; one for each body if their orbits differ.
fn rates(values: Values<'_>) -> [(&'static str, Parameter<f64>); 3] {
    let of_orbit = values
        .values
        .iter()
        .enumerate()
        .filter(|(place, _)| *place < orbit::ELEMENTS || *place + orbit::drift::DRIFT >= values.values.len());
    let bodies = of_orbit.filter_map(|(_, value)| match value.as_number() {
        Some(Parameter::PerBody(column)) => Some(column.len()),
        _ => None,
    });
    let bodies = bodies.min();
    let column = |which: usize| -> Parameter<f64> {
        // A NaN is refused with the orbit that it follows from.
        let rate = |body: usize| Some(elements(values, body).rates()[which].0).filter(|x| x.is_finite()).unwrap_or(0.0);
        match bodies {
            Some(bodies) => (0..bodies).map(rate).collect::<Vec<f64>>().into(),
            None => rate(0).into(),
        }
    };
    [("anomaly_rate", column(0)), ("pericentre_rate", column(1)), ("node_rate", column(2))]
}

impl Model for Magnetorquers {
    declared!(Custom);

    /// Also called for the torque made for the values; the parameters that it adds follow from these.
    fn validate(&self, values: Values<'_>, context: &ValidationContext) -> Result<()> {
        orbit::validate(values, context)
    }

    fn made_for(&self, values: &[Value], _: &ValidationContext) -> Option<Result<Torque>> {
        Some(Ok(of_values(values)))
    }
}
