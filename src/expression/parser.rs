//! Parses words into a recording, by precedence climbing.
//!
//! Only values are kept: each operator records itself as soon as its operands are read, so that an error of shape or a division by zero is
//! found where it occurs.

use std::collections::{BTreeMap, BTreeSet};

use super::fault::Fault;
use super::lexer::{Token, tokens};
use super::symbol::Symbol;
use super::symbols::{Scope, Shape};
use super::text::{MOST_LEVELS, Placed, Span};
use super::value::{MOST_EXPONENT, Value, called, joined, power, prefixed};
use super::vocabulary;
use crate::math::quaternion::Quaternion;
use crate::math::real::Real;
use crate::math::vector::Vector;

/// How tightly operators bind, from the loosest.
fn binding(sign: &str) -> Option<u8> {
    Some(match sign {
        "||" => 1,
        "&&" => 2,
        "<" | "<=" | ">" | ">=" => 3,
        "+" | "-" => 4,
        "*" | "/" => 5,
        _ => return None,
    })
}

/// The binding of a sign before its operand: tighter than a product, looser than a power.
const PREFIX: u8 = 6;

pub(super) struct Parser<'a> {
    tokens: Vec<(Token<'a>, Span)>,
    at: usize,
    scope: Scope<'a>,
    definitions: BTreeMap<&'a str, Value>,
    /// The names that are defined anywhere in the text.
    to_be_defined: BTreeSet<&'a str>,
    depth: usize,
}

impl<'a> Parser<'a> {
    pub(super) fn new(text: &'a str, scope: Scope<'a>) -> Result<Self, Placed> {
        let tokens = tokens(text).map_err(|(fault, span)| Placed { fault, span })?;
        let to_be_defined = tokens
            .windows(2)
            .filter_map(|pair| match (&pair[0].0, &pair[1].0) {
                (Token::Name("let"), Token::Name(name)) => Some(*name),
                _ => None,
            })
            .collect();
        Ok(Self { tokens, at: 0, scope, definitions: BTreeMap::new(), to_be_defined, depth: 0 })
    }

    /// The whole text.
    pub(super) fn formula(mut self, wanted: Shape) -> Result<Vec<Symbol>, Placed> {
        while self.peek() == &Token::Name("let") {
            self.definition()?;
        }
        let first = self.at;
        let value = self.expression(0)?;
        // A trailing semicolon is accepted.
        self.accept(";");
        if self.peek() != &Token::End {
            return Err(self.unexpected("an operator or the end"));
        }
        let span = self.span_since(first);
        value.into_symbols(wanted).map_err(|fault| Placed { fault, span })
    }

    /// `let name = expression;`
    fn definition(&mut self) -> Result<(), Placed> {
        self.at += 1;
        let Token::Name(name) = *self.peek() else { return Err(self.unexpected("a name")) };
        let span = self.span();
        let owned = || name.to_owned();
        if vocabulary::is_reserved(name) {
            return Err(Placed { fault: Fault::ReservedName { name: owned() }, span });
        }
        if self.definitions.contains_key(name) || self.scope.symbols().find(name).is_some() {
            return Err(Placed { fault: Fault::DuplicateName { name: owned() }, span });
        }
        self.at += 1;
        self.expect("=")?;
        let value = self.expression(0)?;
        self.expect(";")?;
        value.take_name(name, self.scope.recorder());
        self.definitions.insert(name, value);
        Ok(())
    }

    /// An expression whose operators bind at least as tightly as `least`.
    fn expression(&mut self, least: u8) -> Result<Value, Placed> {
        self.depth += 1;
        if self.depth > MOST_LEVELS {
            return Err(Placed { fault: Fault::TooDeep { limit: MOST_LEVELS }, span: self.span() });
        }
        let mut value = self.operand()?;
        let mut compared = false;
        while let Token::Sign(sign) = *self.peek() {
            let Some(strength) = binding(sign).filter(|strength| *strength >= least) else { break };
            if strength == 3 && std::mem::replace(&mut compared, true) {
                return Err(self.unexpected("`&&` between two comparisons"));
            }
            let span = self.span();
            self.at += 1;
            let right = self.expression(strength + 1)?;
            let result = joined(sign, value, right, &self.scope);
            value = self.placed(result, span)?;
        }
        self.depth -= 1;
        Ok(value)
    }

    /// A sign and its operand, or an operand between operators.
    fn operand(&mut self) -> Result<Value, Placed> {
        if let Token::Sign(sign @ ("-" | "!")) = *self.peek() {
            let span = self.span();
            self.at += 1;
            let value = self.expression(PREFIX)?;
            return self.placed(prefixed(sign, value), span);
        }
        let mut value = self.atom()?;
        loop {
            let span = self.span();
            if self.accept(".") {
                let Token::Name(name) = *self.peek() else { return Err(self.unexpected("the name of a component")) };
                let name_span = self.span();
                self.at += 1;
                value = self.placed(value.component(name, &self.scope), name_span)?;
            } else if self.accept("^") {
                let exponent = self.exponent()?;
                value = self.placed(power(value, exponent), span)?;
            } else {
                return Ok(value);
            }
        }
    }

    /// A whole number from −16 to 16.
    fn exponent(&mut self) -> Result<i32, Placed> {
        let span = self.span();
        let negative = self.accept("-");
        match *self.peek() {
            Token::Number(x) if x.fract() == 0.0 && x <= f64::from(MOST_EXPONENT) => {
                self.at += 1;
                Ok(if negative { -(x as i32) } else { x as i32 })
            }
            _ => Err(Placed { fault: Fault::Exponent, span }),
        }
    }

    fn atom(&mut self) -> Result<Value, Placed> {
        let span = self.span();
        match *self.peek() {
            Token::Number(x) => {
                self.at += 1;
                self.placed(Ok(Value::Number(Symbol::splat(x))), span)
            }
            Token::Sign("(") => {
                self.at += 1;
                let value = self.expression(0)?;
                self.expect(")")?;
                Ok(value)
            }
            Token::Name("let") => Err(self.unexpected("a value; definitions stand before the formula")),
            Token::Name(name) => {
                self.at += 1;
                if self.peek() == &Token::Sign("(") { self.call(name, span) } else { self.named(name, span) }
            }
            _ => Err(self.unexpected("a value")),
        }
    }

    fn call(&mut self, function: &str, span: Span) -> Result<Value, Placed> {
        self.at += 1;
        let mut arguments = vec![];
        if !self.accept(")") {
            loop {
                arguments.push(self.expression(0)?);
                if self.accept(")") {
                    break;
                }
                if !self.accept(",") {
                    return Err(self.unexpected("`,` or `)`"));
                }
            }
        }
        let result = called(function, &arguments, &self.scope);
        self.placed(result, span)
    }

    /// The value of a name.
    fn named(&mut self, name: &'a str, span: Span) -> Result<Value, Placed> {
        let result = self.value_of(name);
        self.placed(result, span)
    }

    fn value_of(&self, name: &str) -> Result<Value, Fault> {
        if let Some(value) = self.definitions.get(name) {
            return Ok(*value);
        }
        if let Some((_, constant)) = vocabulary::CONSTANTS.into_iter().find(|(constant, _)| *constant == name) {
            return Ok(Value::Number(Symbol::splat(constant)));
        }
        let symbols = self.scope.symbols();
        if name == "inertia" && symbols.offers_inertia() {
            return Ok(Value::Inertia);
        }
        match name {
            vocabulary::ORBIT_POSITION if symbols.offers_orbit() => {
                return Ok(Value::Vector(self.scope.orbit_position()));
            }
            vocabulary::ORBIT_VELOCITY if symbols.offers_orbit() => {
                return Ok(Value::Vector(self.scope.orbit_velocity()));
            }
            _ => {}
        }
        if let Some(known) = symbols.find(name) {
            let recorder = self.scope.recorder();
            let numbers: Vec<Symbol> = known.inputs().map(|input| recorder.input(input)).collect();
            self.scope.name_inputs(known, &numbers);
            return Ok(match *numbers {
                [x, y, z] => Value::Vector(Vector::new(x, y, z)),
                [x, y, z, w] => Value::Rotation(Quaternion::new(x, y, z, w)),
                _ => Value::Number(self.scope.number(name)),
            });
        }
        if self.to_be_defined.contains(name) {
            return Err(Fault::UsedBeforeDefinition { name: name.to_owned() });
        }
        let functions = vocabulary::FUNCTIONS.into_iter().map(|(function, _)| function);
        if functions.clone().any(|function| function == name) {
            let found = format!("`{name}` without arguments");
            return Err(Fault::Syntax { found, needed: format!("`{name}(...)`") });
        }
        let constants = vocabulary::CONSTANTS.into_iter().map(|(constant, _)| constant);
        Err(symbols.unknown(name, self.definitions.keys().copied().chain(constants)))
    }

    /// The value of a result, unless it or the recording has failed: then the error is reported at this position.
    fn placed(&self, result: Result<Value, Fault>, span: Span) -> Result<Value, Placed> {
        match (result, self.scope.recorder().fault()) {
            (Ok(value), None) => Ok(value),
            (Err(fault), _) | (Ok(_), Some(fault)) => Err(Placed { fault, span }),
        }
    }

    fn peek(&self) -> &Token<'a> {
        // Never beyond the end.
        &self.tokens[self.at.min(self.tokens.len() - 1)].0
    }

    fn span(&self) -> Span {
        self.tokens[self.at.min(self.tokens.len() - 1)].1
    }

    /// From a word to the one before this.
    fn span_since(&self, first: usize) -> Span {
        let start = self.tokens[first.min(self.tokens.len() - 1)].1.start;
        let last = self.tokens[self.at.saturating_sub(1).clamp(first, self.tokens.len() - 1)].1;
        Span { start, length: (last.start + last.length).saturating_sub(start).max(1) }
    }

    fn accept(&mut self, sign: &str) -> bool {
        let found = matches!(self.peek(), Token::Sign(next) if *next == sign);
        self.at += usize::from(found);
        found
    }

    fn expect(&mut self, sign: &str) -> Result<(), Placed> {
        if self.accept(sign) { Ok(()) } else { Err(self.unexpected(&format!("`{sign}`"))) }
    }

    fn unexpected(&self, needed: &str) -> Placed {
        let fault = Fault::Syntax { found: self.peek().described(), needed: needed.to_owned() };
        Placed { fault, span: self.span() }
    }
}
