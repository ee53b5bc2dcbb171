//! Names as identifiers of WGSL.
//!
//! Formulas may call their values what they like, words of WGSL and functions of the shaders among it. A name is kept as it is where it can
//! be; else it gets an underscore or a number behind it.

use std::collections::{BTreeSet, HashSet};

use wgpu::naga::keywords::wgsl::{BUILTIN_IDENTIFIERS, RESERVED};

/// What texts call besides WGSL's own functions.
const CALLED: [&str; 8] =
    ["real", "vector", "quaternion", "mul_add", "ln", "arctangent_ratio", "sin_cos", "eccentric_anomaly"];

/// The identifiers of a function: each is legal, given once, and none of those around it.
pub(super) struct Identifiers<'a> {
    /// What the text around the function declares.
    declared: &'a BTreeSet<String>,
    given: HashSet<String>,
}

impl<'a> Identifiers<'a> {
    /// None are given yet; a `declared` one never is.
    pub(super) fn new(declared: &'a BTreeSet<String>) -> Self {
        Self { declared, given: HashSet::new() }
    }

    /// The identifier for `name`.
    pub(super) fn of_name(&mut self, name: &str) -> String {
        let mut stem = legal(name);
        if is_word(&stem) || self.declared.contains(&stem) {
            stem = legal(&(stem + "_"));
        }
        let numbered = (2_u32..).map(|number| format!("{}_{number}", stem.trim_end_matches('_')));
        std::iter::once(stem.clone()).chain(numbered).find(|identifier| self.take(identifier)).unwrap_or_default()
    }

    /// Gives `identifier`, unless it is taken.
    pub(super) fn take(&mut self, identifier: &str) -> bool {
        let is_free = !is_word(identifier) && !self.declared.contains(identifier);
        is_free && self.given.insert(identifier.to_owned())
    }
}

/// Whether WGSL or the texts themselves mean something by it.
fn is_word(identifier: &str) -> bool {
    let means = |words: &[&str]| words.contains(&identifier);
    identifier == "_" || means(RESERVED) || means(BUILTIN_IDENTIFIERS) || means(&CALLED)
}

/// Letters of ASCII, digits and single underscores, no digit first. WGSL has no identifiers that begin with two underscores, and other
/// languages that drivers translate to keep all those with two for themselves.
fn legal(name: &str) -> String {
    let mut identifier = String::with_capacity(name.len() + 1);
    for letter in name.chars() {
        let letter = if letter.is_ascii_alphanumeric() { letter } else { '_' };
        if identifier.is_empty() && letter.is_ascii_digit() {
            identifier.push('_');
        }
        if letter != '_' || !identifier.ends_with('_') {
            identifier.push(letter);
        }
    }
    if identifier.is_empty() { "_".to_owned() } else { identifier }
}
