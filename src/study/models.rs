//! The models of torques as help and documentation list them, from their declarations.

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
        for parameter in &model.parameters {
            let mut line = format!("        {:<24}{}", parameter.name, parameter.with_axes());
            line += &in_brackets(&parameter.unit);
            line += match parameter.valid {
                Validity::NotNegative => ", not negative",
                Validity::Positive => ", above zero",
                _ => "",
            };
            if let Validity::Range(low, high) = parameter.valid {
                let _ = write!(line, ", {low} to {high}");
            }
            if let Some(other) = &parameter.other_key {
                let _ = write!(line, ", or {}", other.name);
            }
            let _ =
                writeln!(text, "{line}{}", default(parameter).map(|value| format!(" [{value}]")).unwrap_or_default());
        }
    }
    text.truncate(text.trim_end().len());
    text
}

/// All models as a table in Markdown, which stands in the documentation of [`crate::torque`].
pub fn models_table() -> String {
    let mut text = "| model | equation | keys | source |\n| --- | --- | --- | --- |\n".to_owned();
    for model in declarations() {
        let keys: Vec<String> = model.parameters.iter().map(key).collect();
        let row = [named(model), model.summary.replace('|', "\\|"), keys.join(", "), model.source.to_string()];
        let _ = writeln!(text, "| {} |", row.join(" | "));
    }
    text
}

/// A model's name, with a link to its file, and its other names.
fn named(model: &Declaration) -> String {
    let others: String = model.aliases.iter().map(|alias| format!(", `{alias}`")).collect();
    let file = model.name.replace('-', "_");
    // Rustdoc finds it by the name where both are the same.
    if file == *model.name { format!("[`{file}`]{others}") } else { format!("[`{}`]({file}){others}", model.name) }
}

/// A key with its unit and what it is where it is left out.
fn key(parameter: &ParameterDeclaration) -> String {
    let notes = [Some(parameter.unit.to_string()).filter(|unit| unit != "1"), default(parameter)];
    let notes: Vec<String> = notes.into_iter().flatten().collect();
    let notes = if notes.is_empty() { String::new() } else { format!(" ({})", notes.join(", ")) };
    let other = parameter.other_key.as_ref().map(|other| format!(" or `{}`", other.name)).unwrap_or_default();
    format!("`{}`{other}{notes}", parameter.name)
}

/// What holds where a key is left out.
fn default(parameter: &ParameterDeclaration) -> Option<String> {
    parameter.default.map(|preset| match preset {
        Preset::Number(number) => format!("else {number}"),
        Preset::Whole(number) => format!("else {number}"),
        Preset::Seed => "else the study's seed".to_owned(),
    })
}
