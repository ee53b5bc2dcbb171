//! Splits a formula's text into words.

use super::fault::Fault;
use super::text::Span;

/// A word.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Token<'a> {
    Number(f64),
    Name(&'a str),
    /// An operator or a bracket.
    Sign(&'static str),
    End,
}

impl Token<'_> {
    /// Its description in messages.
    pub(super) fn described(&self) -> String {
        match self {
            Token::Number(x) => format!("the number {x:?}"),
            Token::Name(name) => format!("`{name}`"),
            Token::Sign(sign) => format!("`{sign}`"),
            Token::End => "the end".to_owned(),
        }
    }
}

/// All operators; of two that begin alike the longer one comes first.
const SIGNS: [&str; 20] =
    ["<=", ">=", "&&", "||", "==", "!=", "<", ">", "!", "+", "-", "*", "/", "^", "(", ")", ",", ";", "=", "."];

/// Splits a text into words, each with its position; the last is the end. Refuses the first character that begins no word, or an invalid
/// number.
pub(super) fn tokens(text: &str) -> Result<Vec<(Token<'_>, Span)>, (Fault, Span)> {
    let bytes = text.as_bytes();
    let mut tokens = vec![];
    let mut at = 0;
    while at < bytes.len() {
        let rest = &text[at..];
        let length = match bytes[at] {
            b' ' | b'\t' | b'\r' | b'\n' => 1,
            b'#' => line_length(rest),
            b'/' if rest.starts_with("//") => line_length(rest),
            byte if byte.is_ascii_alphabetic() || byte == b'_' => {
                let length = run(rest, |byte| byte.is_ascii_alphanumeric() || byte == b'_');
                tokens.push((Token::Name(&rest[..length]), Span { start: at, length }));
                length
            }
            byte if byte.is_ascii_digit() || (byte == b'.' && bytes.get(at + 1).is_some_and(u8::is_ascii_digit)) => {
                let length = number_length(rest);
                let span = Span { start: at, length };
                let number: f64 = rest[..length].parse().map_err(|_| {
                    let found = format!("`{}`", &rest[..length]);
                    (Fault::Syntax { found, needed: "a number".to_owned() }, span)
                })?;
                if !number.is_finite() {
                    return Err((Fault::NotFinite, span));
                }
                tokens.push((Token::Number(number), span));
                length
            }
            _ => {
                let character = rest.chars().next().map_or(1, char::len_utf8);
                let Some(sign) = SIGNS.into_iter().find(|sign| rest.starts_with(sign)) else {
                    let found = format!("`{}`", &rest[..character]);
                    let needed = "a number, a name or an operator".to_owned();
                    return Err((Fault::Syntax { found, needed }, Span { start: at, length: character }));
                };
                tokens.push((Token::Sign(sign), Span { start: at, length: sign.len() }));
                sign.len()
            }
        };
        at += length;
    }
    tokens.push((Token::End, Span { start: text.trim_end().len(), length: 1 }));
    Ok(tokens)
}

fn line_length(rest: &str) -> usize {
    rest.find('\n').unwrap_or(rest.len())
}

fn run(rest: &str, belongs: impl Fn(u8) -> bool) -> usize {
    rest.bytes().take_while(|byte| belongs(*byte)).count()
}

/// The length of digits, a point, digits, and an exponent. Letters that follow without a space belong to it, so that `2x` is not a number.
fn number_length(rest: &str) -> usize {
    let bytes = rest.as_bytes();
    let mut length = 0;
    while let Some(&byte) = bytes.get(length) {
        let is_exponent_sign = matches!(byte, b'+' | b'-')
            && length > 0
            && matches!(bytes[length - 1], b'e' | b'E')
            && is_plain(&rest[..length - 1]);
        // Study files may group digits by underscores, but f64's parser does not know them: they are refused.
        if !(byte.is_ascii_alphanumeric() || matches!(byte, b'.' | b'_') || is_exponent_sign) {
            break;
        }
        length += 1;
    }
    length
}

fn is_plain(digits: &str) -> bool {
    digits.bytes().all(|byte| byte.is_ascii_digit() || byte == b'.')
}
