//! Names as identifiers of WGSL.
//!
//! Formulas may use any names for their values, including words of WGSL and functions of the shaders. A name is kept if
//! possible; otherwise an underscore or a number is appended.

use std::collections::{BTreeSet, HashSet};

use wgpu::naga::keywords::wgsl::{BUILTIN_IDENTIFIERS, RESERVED};

/// Functions that texts call besides WGSL's own.
const CALLED: [&str; 8] =
    ["real", "vector", "quaternion", "mul_add", "ln", "arctangent_ratio", "sin_cos", "eccentric_anomaly"];

/// Allocates the identifiers of a function: each is legal, unique, and different from those around it.
pub(super) struct Identifiers<'a> {
    /// The names that the surrounding text declares.
    declared: &'a BTreeSet<String>,
    given: HashSet<String>,
}

impl<'a> Identifiers<'a> {
    /// An allocator without identifiers so far; it never returns a `declared` one.
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

    /// Reserves `identifier`, unless it is taken.
    pub(super) fn take(&mut self, identifier: &str) -> bool {
        let is_free = !is_word(identifier) && !self.declared.contains(identifier);
        is_free && self.given.insert(identifier.to_owned())
    }
}

/// Whether it has a meaning in WGSL or in the texts themselves.
fn is_word(identifier: &str) -> bool {
    let means = |words: &[&str]| words.contains(&identifier);
    identifier == "_" || means(RESERVED) || means(BUILTIN_IDENTIFIERS) || means(&CALLED)
}

/// ASCII letters, digits and single underscores, not starting with a digit. WGSL has no identifiers that begin with two underscores, and
/// other languages to which drivers translate reserve all those with two.
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
