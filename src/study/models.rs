//! Lists the models of torques for help and documentation, from their declarations.

use std::fmt::Write;

use crate::torque::declaration::in_brackets;
use crate::torque::{Declaration, ParameterDeclaration, Preset, Validity, declarations};

/// All models with their equations and the keys of their parameters, as `polhode run --help` prints them.
pub fn describe_models() -> String {
    let mut text = String::new();
    for model in declarations() {
        let names: Vec<&str> = model.names().collect();
        // Writing to a string cannot fail.
        let _ = writeln!(text, "    {}: {}", names.join(", "), model.summary);
        if let Some(note) = &model.note {
            let _ = writeln!(text, "        ({note})");
        }
        for parameter in &model.parameters {
            describe(&mut text, "", parameter);
            parameter.elements.iter().for_each(|element| describe(&mut text, "- ", element));
        }
        for part in &model.own_state {
            let _ =
                writeln!(text, "        own state {:<14}{}{}", part.name, part.with_axes(), in_brackets(&part.unit));
        }
    }
    text += CUSTOM;
    text
}

/// The model whose parameters are the user's own.
const CUSTOM: &str = "    custom: as written
        torque                  a formula (N m, body axes): `let name = ...;`, then a vector
        parameters              names: numbers, vectors, rotations, distributions, columns [none]
        energy                  a formula (J) of attitude and parameters, for the balance [none]
        moments                 instead of torque: the moments of inertia (kg m², vector along body
                                axes) as a formula of time, inertia (at the start) and parameters
        factor                  instead of torque: a factor of the inertia, as such a formula
        every                   the period (s) of a sampled torque, from t = 0 [none: not sampled]
        delay                   until what was sampled takes effect (s) [0]
        sample                  names: formulas, of a number or a vector, that are formed at samples
                                and hold in between; the torque may name them
        state                   names: own state at t = 0, numbers or vectors, for all formulas;
                                torque1_NAME in statistics, events and formulas of quantities
        d_NAME                  the rate of the own state NAME: a formula, formed when sampled
                                values take effect; the torque may name it
        next_NAME               or its value after each sample: a formula
        inputs                  attitude, angular_velocity, angular_momentum, inertia, time,
                                position, velocity (SI); of a sampled torque also every, delay
                                and, in the torque, since: the time of its last sample or effect
        operators               + - * / ^ (whole powers), < <= > >= && || !, v.x
        functions               vec quat dot cross norm normalize to_body to_world rotate conjugate
                                sqrt abs sin cos tan asin acos atan2 exp ln pow
                                min max clamp step smoothstep select
        example                 torque = \"-k * angular_velocity\", parameters = { k = 0.3 }";

/// The width of the column of keys.
const KEY_WIDTH: usize = 24;

/// Describes a parameter in one line, or two if its key is long; `mark` precedes the keys of the tables of a list.
fn describe(text: &mut String, mark: &str, parameter: &ParameterDeclaration) {
    let name = format!("{mark}{}", parameter.name);
    // A key that fills its column has a line of its own.
    let gap = if name.chars().count() < KEY_WIDTH { String::new() } else { format!("\n        {:KEY_WIDTH$}", "") };
    let mut line = format!("        {name:<KEY_WIDTH$}{gap}{}{}", parameter.with_axes(), in_brackets(&parameter.unit));
    line += &match parameter.valid {
        Validity::NotNegative => ", not negative".to_owned(),
        Validity::Positive => ", above zero".to_owned(),
        Validity::NotZero => ", not zero".to_owned(),
        Validity::Range(low, high) => format!(", {low} to {high}"),
        Validity::Count(least, most) => format!(", a list of {least} to {most} tables with the keys"),
        _ => String::new(),
    };
    if let Some(other) = &parameter.other_key {
        line += &format!(", or {}", other.name);
    }
    let default = default(parameter).map(|value| format!(" [{value}]")).unwrap_or_default();
    // Writing to a string cannot fail.
    let _ = writeln!(text, "{line}{default}");
}

/// All models as a Markdown table, which is part of the documentation of [`crate::torque`].
pub fn models_table() -> String {
    let mut text = "| model | equation | keys | source |\n| --- | --- | --- | --- |\n".to_owned();
    for model in declarations() {
        let keys: Vec<String> = model.parameters.iter().map(key).collect();
        let note = model.note.as_ref().map(|note| format!("; {note}")).unwrap_or_default();
        let equation = format!("{}{note}", model.summary).replace('|', "\\|");
        let row = [named(model), equation, keys.join(", "), model.source.to_string()];
        let _ = writeln!(text, "| {} |", row.join(" | "));
    }
    text
}

/// A model's name, with a link to its file, and its other names.
fn named(model: &Declaration) -> String {
    let others: String = model.aliases.iter().map(|alias| format!(", `{alias}`")).collect();
    let file = model.name.replace('-', "_");
    // Rustdoc finds it by name if both are the same.
    if file == *model.name { format!("[`{file}`]{others}") } else { format!("[`{}`]({file}){others}", model.name) }
}

/// A key with its unit and its default.
fn key(parameter: &ParameterDeclaration) -> String {
    let notes = [Some(parameter.unit.to_string()).filter(|unit| unit != "1"), default(parameter)];
    let notes: Vec<String> = notes.into_iter().flatten().collect();
    let notes = if notes.is_empty() { String::new() } else { format!(" ({})", notes.join(", ")) };
    let other = parameter.other_key.as_ref().map(|other| format!(" or `{}`", other.name)).unwrap_or_default();
    let elements: Vec<String> = parameter.elements.iter().map(key).collect();
    let elements = match parameter.valid {
        Validity::Count(least, most) => format!(": {least} to {most} tables of {}", elements.join(", ")),
        _ => String::new(),
    };
    format!("`{}`{other}{notes}{elements}", parameter.name)
}

/// The default of a key.
fn default(parameter: &ParameterDeclaration) -> Option<String> {
    parameter.default.map(|preset| match preset {
        Preset::Number(number) => format!("else {number}"),
        Preset::Whole(number) => format!("else {number}"),
        Preset::Seed => "else from the study's seed".to_owned(),
    })
}
