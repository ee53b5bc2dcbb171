//! The arguments of a formula's function in the shader, and their names.

use std::collections::BTreeSet;

use super::{Expressed, Given, INERTIA, Instructions, MATRIX, MOMENTS, RATE, TO_PRINCIPAL, UNIT, USER, components};
use crate::expression::graph::Operation;
use crate::expression::wgsl::{self, Argument, Signature};
use crate::expression::{Fault, Input, Shape};

impl Expressed {
    /// Refuses constants that shaders cannot hold.
    pub fn check_constants(&self) -> Result<(), Fault> {
        match self.shader("custom", Vec::new(), &BTreeSet::new()) {
            Err(wgsl::WgslError::ConstantOutOfRange(value)) => Err(Fault::ConstantOutOfRange { value }),
            _ => Ok(()),
        }
    }

    /// Its function in WGSL; `declared` are the names already used in the shader.
    pub fn shader(
        &self,
        name: &str,
        comment: Vec<String>,
        declared: &BTreeSet<String>,
    ) -> Result<String, wgsl::WgslError> {
        let arguments = self.arguments().into_iter().map(|(argument, _)| argument).collect();
        let signature = Signature { name: name.to_owned(), comment, parameters: arguments };
        wgsl::function_beside(&self.whole.graph.graph, &self.whole.graph.outputs, &signature, declared)
    }

    /// The name of an input that is a column, as the formula or the host has it; a number if neither names it.
    fn column_name(&self, column: usize, input: Input) -> String {
        let graph = &self.whole.graph.graph;
        let node = graph.nodes().find(|&node| graph.operation(node) == Operation::Input(input));
        let name = node.and_then(|node| graph.name(node)).map(ToString::to_string);
        let of_host = || self.raw.get(column).copied().and_then(host_name);
        name.or_else(of_host).unwrap_or_else(|| format!("c{column}"))
    }

    /// The arguments of its function in WGSL, and their locations; the text may use names like these.
    pub fn arguments(&self) -> Vec<(Argument, Given)> {
        let mut arguments: Vec<(Argument, Given)> = Vec::new();
        let Instructions { program, inputs } = &self.whole.instructions;
        for (&input, &given) in program.inputs().iter().zip(inputs) {
            if arguments.iter().any(|(argument, _)| argument.inputs.contains(&input)) {
                continue;
            }
            let (name, numbers) = match given {
                Given::Column(column) => (self.column_name(column, input), 1),
                Given::Phase(phase) => (format!("phase_{phase}"), 1),
                Given::Time => ("time".to_owned(), 1),
                Given::Epoch(number) => (format!("epoch_{number}"), 1),
                Given::Orientation(_) => ("orientation".to_owned(), 4),
                Given::AngularVelocity(_) => ("angular_velocity_principal".to_owned(), 3),
                Given::MomentRatio(_) => ("moment_ratio".to_owned(), 3),
                Given::Position(_) => ("position".to_owned(), 3),
                Given::Velocity(_) => ("velocity".to_owned(), 3),
            };
            let argument = match numbers {
                1 => Argument::new(name, Shape::Number, [input]),
                3 => Argument::new(name, Shape::Vector, components(input.kind, 3)),
                _ => Argument::new(name, Shape::Quaternion, components(input.kind, 4)),
            };
            arguments.push((argument, given));
        }
        arguments
    }
}

/// The shader's name for a number of the host; the user's numbers have names of their own.
fn host_name(number: usize) -> Option<String> {
    const AXES: [&str; 4] = ["x", "y", "z", "w"];
    const ELEMENTS: [&str; 6] = ["xx", "yy", "zz", "xy", "xz", "yz"];
    Some(match number {
        RATE => "reference_rate".to_owned(),
        UNIT => "torque_unit".to_owned(),
        MATRIX..TO_PRINCIPAL => {
            let element = number - MATRIX;
            format!("to_body_{}{}", AXES[element / 3], AXES[element % 3])
        }
        TO_PRINCIPAL..INERTIA => format!("to_principal_{}", AXES[number - TO_PRINCIPAL]),
        INERTIA..MOMENTS => format!("inertia_{}", ELEMENTS[number - INERTIA]),
        MOMENTS..USER => format!("moment_{}", AXES[number - MOMENTS]),
        _ => return None,
    })
}
