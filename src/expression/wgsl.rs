//! A formula as a WGSL function, with the same operations in the same order as the evaluators on the CPU.
//!
//! The text calls what `real_f32.wgsl` or `real_f64.wgsl`, `trigonometry.wgsl`, `functions.wgsl` and, for Kepler's equation,
//! `kepler.wgsl` define; it does not know the precision.
//!
//! A value that the formula names is a `let` of that name, or of a similar one if it is taken (`identifiers.rs`); other values
//! that are used more than once are numbered.

use std::collections::{BTreeSet, HashMap, HashSet};
use std::fmt::Write;

use super::graph::{Binary, Graph, Input, Node, Operation, Unary};
use super::identifiers::Identifiers;
use super::symbols::Shape;
use crate::math::real::Function;

/// A function's name, its comment and its parameters.
#[derive(Clone, Debug, Default)]
pub struct Signature {
    /// The function's name.
    pub name: String,
    /// Lines of comment before it, without their slashes.
    pub comment: Vec<String>,
    /// The parameters, in order.
    pub parameters: Vec<Argument>,
}

/// A parameter of a function.
#[derive(Clone, Debug, PartialEq)]
pub struct Argument {
    /// Its name.
    pub name: String,
    /// Its shape: 1, 3 or 4 numbers.
    pub shape: Shape,
    /// The inputs of the formula that its components are.
    pub inputs: Vec<Input>,
}

impl Argument {
    /// A parameter.
    pub fn new(name: impl Into<String>, shape: Shape, inputs: impl IntoIterator<Item = Input>) -> Self {
        Self { name: name.into(), shape, inputs: inputs.into_iter().collect() }
    }
}

/// Why a formula has no text in WGSL.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum WgslError {
    /// A constant outside the range of `f32`.
    #[error("the constant {0:e} is outside the range of f32")]
    ConstantOutOfRange(f64),
    /// An input that is not among the parameters.
    #[error("{0:?} is not a parameter of the function")]
    UnknownInput(Input),
    /// No results.
    #[error("a function returns a number at least")]
    NoOutput,
    /// A function without a twin in WGSL.
    #[error("{0:?} is not a function of the shaders")]
    UnknownFunction(Function),
}

/// An expression longer than this many characters gets a name.
const LONGEST: usize = 100;

/// The binding strength of an expression.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Binding {
    Sum,
    Product,
    Sign,
    Whole,
}

/// The text of a node.
#[derive(Clone)]
struct Piece {
    text: String,
    binding: Binding,
}

impl Piece {
    fn whole(text: impl Into<String>) -> Self {
        Self { text: text.into(), binding: Binding::Whole }
    }

    /// The text, in parentheses if it binds less tightly than `least`.
    fn at_least(&self, least: Binding) -> String {
        if self.binding < least { format!("({})", self.text) } else { self.text.clone() }
    }
}

/// The text of a function that forms `outputs`: a number, a vector of 3, a quaternion of 4, or an array of any other count.
///
/// # Errors
///
/// If a constant is outside the range of `f32`, an input is not among the parameters, there are no outputs, or a function has no twin in
/// WGSL.
pub fn function(graph: &Graph, outputs: &[Node], signature: &Signature) -> Result<String, WgslError> {
    function_beside(graph, outputs, signature, &BTreeSet::new())
}

/// [`function`], without using any name that is `declared` around it.
pub(crate) fn function_beside(
    graph: &Graph,
    outputs: &[Node],
    signature: &Signature,
    declared: &BTreeSet<String>,
) -> Result<String, WgslError> {
    let result = match outputs.len() {
        0 => return Err(WgslError::NoOutput),
        1 => wgsl_type(Shape::Number).to_owned(),
        3 => wgsl_type(Shape::Vector).to_owned(),
        4 => wgsl_type(Shape::Quaternion).to_owned(),
        count => array_type(count),
    };
    let mut identifiers = Identifiers::new(declared);
    identifiers.take(&signature.name);
    let mut signature = signature.clone();
    signature.parameters.iter_mut().for_each(|parameter| parameter.name = identifiers.of_name(&parameter.name));
    let mut writer = Writer::new(graph, outputs, &signature, identifiers);
    for node in graph.live(outputs) {
        let piece = writer.piece(node)?;
        writer.keep(node, piece);
    }
    let parts: Vec<String> = outputs.iter().map(|output| writer.pieces[output].text.clone()).collect();
    let mut text = String::new();
    for line in &signature.comment {
        text += &if line.is_empty() { "//\n".to_owned() } else { format!("// {line}\n") };
    }
    text += &heading(&signature, &result);
    text += &writer.body;
    text += &match &parts[..] {
        [number] => format!("    return {number};\n"),
        _ => returned(&result, &parts),
    };
    text += "}\n";
    Ok(text)
}

/// The name of a shape's type.
fn wgsl_type(shape: Shape) -> &'static str {
    match shape {
        Shape::Number => "real",
        Shape::Vector => "vector",
        Shape::Quaternion => "quaternion",
    }
}

/// The name of the type of so many numbers.
pub(crate) fn array_type(count: usize) -> String {
    format!("array<real, {count}>")
}

fn heading(signature: &Signature, result: &str) -> String {
    let parameters: Vec<String> = signature
        .parameters
        .iter()
        .map(|parameter| format!("{}: {}", parameter.name, wgsl_type(parameter.shape)))
        .collect();
    let name = &signature.name;
    let line = format!("fn {name}({}) -> {result} {{\n", parameters.join(", "));
    if line.len() <= LONGEST + 20 {
        return line;
    }
    format!("fn {name}(\n    {},\n) -> {result} {{\n", parameters.join(",\n    "))
}

/// A value of several components, on one line if it fits.
fn returned(kind: &str, parts: &[String]) -> String {
    let line = format!("    return {kind}({});\n", parts.join(", "));
    if line.len() <= LONGEST + 20 {
        return line;
    }
    format!("    return {kind}(\n        {},\n    );\n", parts.join(",\n        "))
}

struct Writer<'a> {
    graph: &'a Graph,
    /// How often each node is used.
    uses: Vec<u32>,
    inputs: HashMap<Input, String>,
    identifiers: Identifiers<'a>,
    /// The nodes that the formula names.
    named: HashMap<Node, String>,
    pieces: HashMap<Node, Piece>,
    /// The pairs of sine and cosine so far, by the argument and, for Kepler's equation, the eccentricity.
    pairs: HashMap<(Node, Option<Node>), String>,
    body: String,
    count: usize,
}

impl<'a> Writer<'a> {
    fn new(graph: &'a Graph, outputs: &[Node], signature: &Signature, mut identifiers: Identifiers<'a>) -> Self {
        let mut uses = vec![0; graph.len()];
        let mut pairs = HashSet::new();
        // Allocated before all numbered names, which avoid them.
        let mut named = HashMap::new();
        for node in graph.live(outputs) {
            if let (Some(name), false) = (graph.name(node), matches!(graph.operation(node), Operation::Input(_))) {
                named.insert(node, identifiers.of_name(name));
            }
            // Sine and cosine of one argument use it once.
            let counts = pair_of(graph.operation(node)).is_none_or(|(arguments, _)| pairs.insert(arguments));
            if counts {
                graph.operation(node).operands().for_each(|operand| uses[operand.index()] += 1);
            }
        }
        outputs.iter().for_each(|output| uses[output.index()] += 1);
        let mut inputs = HashMap::new();
        for parameter in &signature.parameters {
            for (input, component) in parameter.inputs.iter().zip(["x", "y", "z", "w"]) {
                let name = match parameter.shape {
                    Shape::Number => parameter.name.clone(),
                    _ => format!("{}.{component}", parameter.name),
                };
                inputs.insert(*input, name);
            }
        }
        let (pieces, pairs) = (HashMap::new(), HashMap::new());
        Self { graph, uses, inputs, identifiers, named, pieces, pairs, body: String::new(), count: 0 }
    }

    /// A name that is not taken.
    fn fresh(&mut self, stem: &str) -> String {
        loop {
            self.count += 1;
            let name = format!("{stem}{}", self.count);
            if self.identifiers.take(&name) {
                return name;
            }
        }
    }

    fn define(&mut self, stem: &str, text: &str) -> String {
        let name = self.fresh(stem);
        self.define_as(&name, text);
        name
    }

    fn define_as(&mut self, name: &str, text: &str) {
        // Writing to a string cannot fail.
        let _ = writeln!(self.body, "    let {name} = {text};");
    }

    /// Keeps the text of a node: the expression itself, or a name for it.
    fn keep(&mut self, node: Node, piece: Piece) {
        if let Some(name) = self.named.remove(&node) {
            self.define_as(&name, &piece.text);
            self.pieces.insert(node, Piece::whole(name));
            return;
        }
        let operation = self.graph.operation(node);
        let is_short = match operation {
            Operation::Constant(_) | Operation::Input(_) | Operation::Truth(_) => true,
            Operation::Unary(Unary::Neg, a) => matches!(self.graph.operation(a), Operation::Input(_)),
            _ => pair_of(operation).is_some(),
        };
        let kept = if !is_short && (self.uses[node.index()] > 1 || piece.text.len() > LONGEST) {
            Piece::whole(self.define(if operation.is_truth() { "is" } else { "t" }, &piece.text))
        } else {
            piece
        };
        self.pieces.insert(node, kept);
    }

    fn text(&self, node: Node, least: Binding) -> String {
        self.pieces[&node].at_least(least)
    }

    /// An operand with an explicit type if a call could not infer it: constants alone do not have the shader's precision.
    fn typed(&self, node: Node) -> String {
        let text = self.text(node, Binding::Sum);
        if self.graph.constant(node).is_some() { format!("real({text})") } else { text }
    }

    fn piece(&mut self, node: Node) -> Result<Piece, WgslError> {
        let operation = self.graph.operation(node);
        if let Some((arguments, component)) = pair_of(operation) {
            let pair = self.pair(arguments);
            return Ok(Piece::whole(format!("{pair}.{component}")));
        }
        let call = |name: &str, arguments: &[String]| Piece::whole(format!("{name}({})", arguments.join(", ")));
        let plain = |node: Node| self.text(node, Binding::Sum);
        let joined = |a: Node, left: Binding, sign: &str, b: Node, right: Binding, binding: Binding| Piece {
            text: format!("{} {sign} {}", self.text(a, left), self.text(b, right)),
            binding,
        };
        use Binding::{Product, Sign, Sum, Whole};
        Ok(match operation {
            Operation::Constant(bits) => constant(f64::from_bits(bits))?,
            Operation::Truth(truth) => Piece::whole(truth.to_string()),
            Operation::Input(input) => {
                Piece::whole(self.inputs.get(&input).ok_or(WgslError::UnknownInput(input))?.as_str())
            }
            Operation::Unary(Unary::Neg, a) => Piece { text: format!("-{}", self.text(a, Whole)), binding: Sign },
            Operation::Unary(Unary::Not, a) => Piece { text: format!("!{}", self.text(a, Whole)), binding: Sign },
            Operation::Unary(Unary::Sqrt, a) => call("sqrt", &[plain(a)]),
            Operation::Unary(Unary::Abs, a) => call("abs", &[plain(a)]),
            Operation::Unary(Unary::Round, a) => call("round", &[plain(a)]),
            Operation::Binary(Binary::Add, a, b) => joined(a, Sum, "+", b, Product, Sum),
            Operation::Binary(Binary::Sub, a, b) => joined(a, Sum, "-", b, Product, Sum),
            Operation::Binary(Binary::Mul, a, b) => joined(a, Product, "*", b, Sign, Product),
            Operation::Binary(Binary::Div, a, b) => joined(a, Product, "/", b, Sign, Product),
            Operation::Binary(Binary::Min, a, b) => call("min", &[plain(a), plain(b)]),
            Operation::Binary(Binary::Max, a, b) => call("max", &[plain(a), plain(b)]),
            // Always in parentheses, so that it is not parsed as a template list.
            Operation::Binary(Binary::Less, a, b) => {
                Piece::whole(format!("({} < {})", self.text(a, Sum), self.text(b, Sum)))
            }
            Operation::Binary(Binary::And, a, b) => {
                Piece::whole(format!("({} && {})", self.text(a, Sign), self.text(b, Sign)))
            }
            Operation::Binary(Binary::Or, a, b) => {
                Piece::whole(format!("({} || {})", self.text(a, Sign), self.text(b, Sign)))
            }
            Operation::MulAdd(a, b, c) => call("mul_add", &[plain(a), plain(b), plain(c)]),
            Operation::Select(condition, a, b) => call("select", &[self.typed(b), self.typed(a), plain(condition)]),
            Operation::Function(function, a) => {
                call(name_of(function).ok_or(WgslError::UnknownFunction(function))?, &[plain(a)])
            }
            Operation::Function2(function, a, b) => {
                call(name_of(function).ok_or(WgslError::UnknownFunction(function))?, &[plain(a), plain(b)])
            }
        })
    }

    /// The name of the sine and cosine of an argument, or of an eccentric anomaly.
    fn pair(&mut self, arguments: (Node, Option<Node>)) -> String {
        if let Some(name) = self.pairs.get(&arguments) {
            return name.clone();
        }
        let first = self.text(arguments.0, Binding::Sum);
        let name = match arguments.1 {
            None => self.define("angle", &format!("sin_cos({first})")),
            Some(eccentricity) => {
                let eccentricity = self.text(eccentricity, Binding::Sum);
                self.define("anomaly", &format!("eccentric_anomaly({first}, {eccentricity})"))
            }
        };
        self.pairs.insert(arguments, name.clone());
        name
    }
}

/// The arguments of a function that is computed together with its partner, and which of the two it is.
fn pair_of(operation: Operation) -> Option<((Node, Option<Node>), &'static str)> {
    match operation {
        Operation::Function(Function::Sin, a) => Some(((a, None), "sin")),
        Operation::Function(Function::Cos, a) => Some(((a, None), "cos")),
        Operation::Function2(Function::KeplerSin, a, b) => Some(((a, Some(b)), "sin")),
        Operation::Function2(Function::KeplerCos, a, b) => Some(((a, Some(b)), "cos")),
        _ => None,
    }
}

/// The name of a function in `functions.wgsl`, which hides WGSL's own: those are not accurate enough and lack `f64`.
fn name_of(function: Function) -> Option<&'static str> {
    match function {
        Function::Sin | Function::Cos | Function::KeplerSin | Function::KeplerCos => None,
        Function::Tan => Some("tan"),
        Function::Asin => Some("asin"),
        Function::Acos => Some("acos"),
        Function::Atan2 => Some("atan2"),
        Function::Exp => Some("exp"),
        Function::Ln => Some("ln"),
        Function::Pow => Some("pow"),
        Function::ArctangentRatio => Some("arctangent_ratio"),
    }
}

/// A literal without suffix, which keeps all digits of an `f64` and works in either precision.
fn constant(x: f64) -> Result<Piece, WgslError> {
    if !(x as f32).is_finite() {
        return Err(WgslError::ConstantOutOfRange(x));
    }
    let text = format!("{x:?}");
    Ok(Piece { text, binding: if x.is_sign_negative() { Binding::Sum } else { Binding::Whole } })
}
