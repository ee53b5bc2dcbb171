//! Shader text: chunks under `shaders/`, concatenated by precision and method, and compiled with errors that name the
//! original file and line.

mod compilation;

use std::borrow::Cow;
use std::collections::BTreeSet;
use std::sync::LazyLock;

use super::gather;
use crate::error::{Error, Result};
use crate::expression::wgsl::WgslError;
use crate::expression::{Graph, Input, Node};
use crate::kernel::method::Method;
use crate::math::Precision;
use crate::torque::{Kind, TorqueTable, shader as torque_shader};

/// One file under `shaders/`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Chunk {
    /// Path below `shaders/`.
    pub file: &'static str,
    /// The file's text.
    pub text: Cow<'static, str>,
}

macro_rules! chunk {
    ($file:literal) => {
        Chunk { file: $file, text: Cow::Borrowed(include_str!(concat!("../../../shaders/", $file))) }
    };
}

/// A change of a shader's text: a planted fault, with which a check proves that it finds faults.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Patch {
    /// Path of the chunk below `shaders/`.
    pub file: String,
    /// Text that is replaced; it must occur in the chunk.
    pub from: String,
    /// The text that replaces it.
    pub to: String,
}

/// The text of a compute shader with one entry point, as a sequence of chunks; the entry point is in the last one.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Source {
    chunks: Vec<Chunk>,
    entry_point: &'static str,
    constants: Constants,
}

/// The chunk that a projecting kernel replaces.
const UNPROJECTED: &str = "method/unprojected.wgsl";

/// The functions that `tap.wgsl` replaces.
const TAPPED: [&str; 5] = ["load_torques", "motion", "torque", "orientation_rate", "store_state"];

/// The new name of a function that `tap.wgsl` replaces.
fn untapped(name: &str) -> String {
    format!("untapped_{name}")
}

/// Values of the `override` constants of a shader, by name.
pub type Constants = Vec<(String, u32)>;

/// What identifies a source: its text and its constants.
pub type Key = (String, Constants);

/// The `override` constants of `torque/sum.wgsl` for a table of torques.
fn torque_constants(torques: &TorqueTable) -> Constants {
    let mut constants = vec![
        ("torques_are_common".to_owned(), u32::from(torques.is_common())),
        ("torque_velocity_dependence".to_owned(), torques.velocity_dependence() as u32),
    ];
    // The kinds whose texts are not recorded from formulas.
    let asked = [
        Kind::ConstantBody,
        Kind::LinearDrag,
        Kind::WhiteNoise,
        Kind::InternalDissipation,
        Kind::InertiaRamp,
        Kind::InertiaOscillation,
        Kind::InertiaFormula,
    ];
    for kind in asked {
        let instances = torques.instances(kind);
        if instances.count > 0 {
            constants.push((format!("{}_count", kind.stem()), instances.count as u32));
            constants.push((format!("{}_first", kind.stem()), instances.first as u32));
        }
    }
    constants
}

/// All names declared in files that may accompany a user's formula, in any kernel, so that names in its text do not
/// depend on the kernel.
static DECLARED: LazyLock<BTreeSet<String>> = LazyLock::new(|| {
    let none = TorqueTable::none(0.0);
    let kernels = Precision::ALL.into_iter().flat_map(|precision| {
        let equal = Method::ALL.map(|method| Source::advance_with_forces(precision, method, &none, Some(0)));
        let torques = Source::torque_functions(precision, true);
        equal.into_iter().chain([Source::adaptive(precision, &none)]).flat_map(|source| source.chunks).chain(torques)
    });
    let others = [
        chunk!("torque/sum.wgsl"),
        chunk!("torque/equal_steps.wgsl"),
        chunk!("torque/own_steps.wgsl"),
        chunk!("method/projection.wgsl"),
        chunk!("force/none.wgsl"),
        chunk!("tap.wgsl"),
    ];
    let names =
        kernels.chain(others).flat_map(|chunk| declarations(&chunk.text).map(str::to_owned).collect::<Vec<_>>());
    names.chain(TAPPED.map(untapped)).collect()
});

/// The names that a text declares for the whole shader.
fn declarations(text: &str) -> impl Iterator<Item = &str> {
    text.lines().filter_map(|line| {
        let mut line = line;
        // Attributes, in which the shaders have no spaces.
        while line.starts_with('@') {
            line = line.split_once(' ')?.1;
        }
        let (word, rest) = line.split_once(' ')?;
        let declares = ["fn", "struct", "alias", "const", "override"].contains(&word);
        let rest = match word.starts_with("var<") {
            // The list of an address space and an access mode may contain a space.
            true => line.split_once("> ")?.1,
            false if declares => rest,
            false => return None,
        };
        rest.split(|letter: char| !(letter.is_ascii_alphanumeric() || letter == '_')).next()
    })
}

/// Text recorded from a formula, as a chunk under a file name.
fn recorded_chunk((file, text): (&'static str, String)) -> Chunk {
    Chunk { file, text: Cow::Owned(text) }
}

/// The chunks of the number type.
fn real_chunks(precision: Precision) -> Vec<Chunk> {
    match precision {
        Precision::F32 => vec![chunk!("real_f32.wgsl")],
        Precision::F64 => vec![chunk!("real_f64.wgsl"), chunk!("separated_int64.wgsl")],
    }
}

/// The chunk that is replaced on adapters without 64-bit integers.
const SEPARATED: &str = "separated_int64.wgsl";

/// The chunks that make up a method, in the order of their use.
fn method_chunks(method: Method) -> Vec<Chunk> {
    let unprepared = || chunk!("method/unprepared.wgsl");
    let slope = || chunk!("method/slope.wgsl");
    let kick = || [slope(), chunk!("method/kick.wgsl")];
    let midpoint = || chunk!("method/midpoint.wgsl");
    let status = || chunk!("method/status.wgsl");
    let splitting = |order: Chunk| {
        let [slope, kick] = kick();
        vec![
            slope,
            kick,
            midpoint(),
            status(),
            chunk!("method/moser_veselov.wgsl"),
            order,
            chunk!("method/splitting.wgsl"),
        ]
    };
    match method {
        Method::Rk4 => vec![unprepared(), slope(), chunk!("method/rk4.wgsl")],
        Method::Rk8 => vec![unprepared(), slope(), chunk!("method/rk8.wgsl"), chunk!("method/rk8_equal.wgsl")],
        Method::Cf4 => vec![unprepared(), slope(), chunk!("method/cf4.wgsl")],
        Method::Splitting2 => splitting(chunk!("method/splitting2.wgsl")),
        Method::Splitting4 => splitting(chunk!("method/splitting4.wgsl")),
        Method::Splitting6 => splitting(chunk!("method/splitting6.wgsl")),
        Method::ImplicitMidpoint => vec![unprepared(), midpoint(), status(), chunk!("method/implicit_midpoint.wgsl")],
        Method::Dlm => {
            let [slope, kick] = kick();
            vec![unprepared(), slope, kick, chunk!("method/dlm.wgsl")]
        }
        // Refused before a shader is asked for.
        Method::Taylor => vec![],
        Method::ExplicitEuler => vec![unprepared(), chunk!("method/explicit_euler.wgsl")],
        Method::GyroNewton => vec![unprepared(), midpoint(), chunk!("method/gyro_newton.wgsl")],
        Method::ClampedEuler => vec![unprepared(), chunk!("method/clamped_euler.wgsl")],
        Method::Spiral => vec![unprepared(), chunk!("method/spiral.wgsl")],
    }
}

impl Source {
    /// The kernel that advances torque-free bodies by `method`.
    pub fn advance(precision: Precision, method: Method) -> Self {
        Self::advance_under(precision, method, &TorqueTable::none(0.0))
    }

    /// The kernel that advances bodies under torques by `method`; code for torques that the table does not have is
    /// removed when the pipeline is made. With an empty table it is [`Source::advance`].
    pub fn advance_under(precision: Precision, method: Method, torques: &TorqueTable) -> Self {
        Self::advance_with_forces(precision, method, torques, None)
    }

    /// The kernel that advances torque-free bodies by `method` and projects them onto their conserved quantities after
    /// each step.
    pub fn advance_projected(precision: Precision, method: Method) -> Self {
        let mut source = Self::advance(precision, method);
        for chunk in &mut source.chunks {
            if chunk.file == UNPROJECTED {
                *chunk = chunk!("method/projection.wgsl");
            }
        }
        source
    }

    /// As [`Source::advance_under`]; it also moves the centres of mass if their forces have columns, from
    /// `forces_first` on.
    pub fn advance_with_forces(
        precision: Precision,
        method: Method,
        torques: &TorqueTable,
        forces_first: Option<u32>,
    ) -> Self {
        let (mut chunks, mut constants) = (Self::functions(precision), Vec::new());
        if torques.is_empty() {
            chunks.push(chunk!("torque/none.wgsl"));
        } else {
            chunks.extend(Self::torques_of(precision, torques));
            chunks.push(chunk!("torque/equal_steps.wgsl"));
            constants = torque_constants(torques);
        }
        chunks.extend(method_chunks(method));
        chunks.extend(Self::forces(forces_first.is_some()));
        constants.extend(forces_first.map(|first| ("forces_first".to_owned(), first)));
        chunks.extend([chunk!("columns.wgsl"), chunk!("method/unprojected.wgsl"), chunk!("advance.wgsl")]);
        Self { chunks, entry_point: "advance", constants }
    }

    /// The chunks of forces and of the translation along a stepped rotation, or the chunk of none.
    pub fn forces(carried: bool) -> Vec<Chunk> {
        if !carried {
            return vec![chunk!("force/none.wgsl")];
        }
        vec![
            chunk!("force/thrust.wgsl"),
            chunk!("force/quadratic_drag.wgsl"),
            chunk!("force/stepped.wgsl"),
            chunk!("force/carried.wgsl"),
        ]
    }

    /// The kernel that advances bodies under torques in adaptive steps of `rk8`.
    pub fn adaptive(precision: Precision, torques: &TorqueTable) -> Self {
        let (mut chunks, mut constants) = (Self::functions(precision), Vec::new());
        if torques.is_empty() {
            chunks.push(chunk!("torque/none.wgsl"));
        } else {
            chunks.extend(Self::torques_of(precision, torques));
            chunks.push(chunk!("torque/own_steps.wgsl"));
            constants = torque_constants(torques);
        }
        chunks.extend(Self::adaptive_method());
        chunks.extend([chunk!("columns.wgsl"), chunk!("control.wgsl"), chunk!("adaptive.wgsl")]);
        Self { chunks, entry_point: "adaptive", constants }
    }

    /// The kernels after a round of adaptive steps: `tally` sums up what its bodies did, and `compact` lists the bodies
    /// of the next round.
    pub fn compact() -> [Self; 2] {
        ["tally", "compact"].map(|entry_point| {
            let chunks = vec![chunk!("control.wgsl"), chunk!("compact.wgsl")];
            Self { chunks, entry_point, constants: Vec::new() }
        })
    }

    /// The chunks of `rk8` in adaptive steps. They read times by `start_at` and `epoch_after`, which `torque/none.wgsl` and
    /// `torque/own_steps.wgsl` define.
    pub fn adaptive_method() -> Vec<Chunk> {
        vec![
            chunk!("method/slope.wgsl"),
            chunk!("method/status.wgsl"),
            chunk!("method/rk8.wgsl"),
            chunk!("method/rk8_adaptive.wgsl"),
        ]
    }

    /// The chunks of a table's torques and their sum. They read columns by `parameter_at`; the chunk after them forms
    /// times.
    pub fn torques_of(precision: Precision, torques: &TorqueTable) -> Vec<Chunk> {
        let has = |kind: Kind| torques.instances(kind).count > 0;
        let has_formulas = has(Kind::Custom) || has(Kind::InertiaFormula);
        let mut chunks = Self::torque_functions(precision, has(Kind::LogSpring) || has_formulas);
        chunks.extend(torque_shader::functions(has).into_iter().map(recorded_chunk));
        chunks.push(chunk!("torque/sum.wgsl"));
        if has_formulas {
            // This text does not compile, and the compiler's message repeats the error.
            let text = torque_shader::custom_functions(torques, &DECLARED)
                .unwrap_or_else(|error| format!("formula: {error}\n"));
            chunks.push(recorded_chunk(("torque/custom.wgsl", text)));
        }
        chunks.push(recorded_chunk(("torque/terms.wgsl", torque_shader::terms(torques))));
        chunks
    }

    /// The chunks that the torques of every table share, except those that read columns; and the functions of all kinds
    /// of torque.
    pub fn torques(precision: Precision) -> Vec<Chunk> {
        let mut chunks = Self::torque_functions(precision, true);
        chunks.extend(torque_shader::functions(|_| true).into_iter().map(recorded_chunk));
        chunks
    }

    fn torque_functions(precision: Precision, elementary: bool) -> Vec<Chunk> {
        let series = match precision {
            Precision::F32 => chunk!("torque/series_f32.wgsl"),
            Precision::F64 => chunk!("torque/series_f64.wgsl"),
        };
        let mut chunks = vec![chunk!("wide_product.wgsl"), chunk!("clock.wgsl"), series, chunk!("kepler.wgsl")];
        if elementary {
            chunks.extend(Self::elementary_functions(precision));
        }
        chunks.extend([
            chunk!("torque/white_noise.wgsl"),
            chunk!("torque/internal_dissipation.wgsl"),
            chunk!("torque/variable_inertia.wgsl"),
        ]);
        chunks
    }

    /// The kernel that evaluates torque-free motions in closed form.
    pub fn free_motion(precision: Precision) -> Self {
        let mut chunks = Self::functions(precision);
        chunks.extend(Self::free_motion_functions(precision));
        chunks.push(chunk!("free_motion.wgsl"));
        Self { chunks, entry_point: "free_motion", constants: Vec::new() }
    }

    /// The kernel that reduces the state to statistics, by workgroup.
    pub fn observe(precision: Precision) -> Self {
        let numbers = match precision {
            Precision::F32 => chunk!("observe_f32.wgsl"),
            Precision::F64 => chunk!("observe_f64.wgsl"),
        };
        let mut chunks = Self::functions(precision);
        chunks.extend([numbers, chunk!("observe.wgsl")]);
        Self { chunks, entry_point: "observe", constants: Vec::new() }
    }

    /// The kernels that form quantities, their moments and histograms, of states in `precision`: the entry points `evaluate`, `reduce` and
    /// `count`, of which this is the first. Numbers that do not change in time are read from the columns that `constants` says.
    ///
    /// # Errors
    ///
    /// If a quantity has no text in WGSL or reads an input that the kernels do not have.
    pub fn gather(
        precision: Precision,
        (graph, outputs): (&Graph, &[Node]),
        constants: &[(Input, usize)],
    ) -> std::result::Result<Self, WgslError> {
        let mut chunks = Self::functions(Precision::F64);
        chunks.extend(Self::elementary_functions(Precision::F64));
        chunks.push(match precision {
            Precision::F32 => chunk!("gather_f32.wgsl"),
            Precision::F64 => chunk!("gather_f64.wgsl"),
        });
        let kernels = chunk!("gather.wgsl");
        let declared = chunks.iter().chain([&kernels]).flat_map(|chunk| declarations(&chunk.text)).map(str::to_owned);
        let text = gather::quantities(graph, outputs, constants, &declared.collect())?;
        chunks.extend([recorded_chunk(("gather/quantities.wgsl", text)), kernels]);
        Ok(Self { chunks, entry_point: "evaluate", constants: Vec::new() })
    }

    /// The same text with another entry point of its last chunk.
    #[must_use]
    pub fn entered_at(self, entry_point: &'static str) -> Self {
        Self { entry_point, ..self }
    }

    /// The chunks that the closed form adds to [`Source::functions`].
    pub fn free_motion_functions(precision: Precision) -> Vec<Chunk> {
        let numbers = match precision {
            Precision::F32 => chunk!("elementary_f32.wgsl"),
            Precision::F64 => chunk!("elementary_f64.wgsl"),
        };
        vec![
            numbers,
            chunk!("elementary.wgsl"),
            chunk!("wide_product.wgsl"),
            chunk!("phase.wgsl"),
            chunk!("free_motion/evaluation.wgsl"),
        ]
    }

    /// The chunks of the elementary functions that formulas name: `exp`, `ln`, `pow`, `tan`, `asin`, `acos`, `atan2`
    /// and `arctangent_ratio`. They need only [`Source::functions`].
    pub fn elementary_functions(precision: Precision) -> Vec<Chunk> {
        let numbers = match precision {
            Precision::F32 => chunk!("functions_f32.wgsl"),
            Precision::F64 => chunk!("functions_f64.wgsl"),
        };
        vec![numbers, chunk!("functions.wgsl")]
    }

    /// The kernel that probes an adapter's arithmetic.
    pub fn probe(precision: Precision) -> Self {
        let mut chunks = real_chunks(precision);
        chunks.push(chunk!("probe.wgsl"));
        Self { chunks, entry_point: "probe", constants: Vec::new() }
    }

    /// The same kernel for an adapter that has no 64-bit integers.
    #[must_use]
    pub fn without_int64(mut self) -> Self {
        for chunk in self.chunks.iter_mut().filter(|chunk| chunk.file == SEPARATED) {
            *chunk = chunk!("separated_select.wgsl");
        }
        self
    }

    /// A kernel of `rates.wgsl`.
    pub(super) fn rates(precision: Precision, entry_point: &'static str) -> Self {
        let (file, alias) = match precision {
            Precision::F32 => ("rates_f32.wgsl", "alias real = f32;"),
            Precision::F64 => ("rates_f64.wgsl", "alias real = f64;"),
        };
        let alias = Chunk { file, text: Cow::Borrowed(alias) };
        Self { chunks: vec![alias, chunk!("rates.wgsl")], entry_point, constants: Vec::new() }
    }

    /// The chunks that every kernel shares: numbers, algebra, Euler's equations. They read `settings.zero`, which the
    /// entry point's chunk declares.
    pub fn functions(precision: Precision) -> Vec<Chunk> {
        let mut chunks = real_chunks(precision);
        chunks.extend([chunk!("trigonometry.wgsl"), chunk!("quaternion.wgsl"), chunk!("rigid_body.wgsl")]);
        chunks
    }

    /// The source with patches applied, in order.
    ///
    /// # Errors
    ///
    /// [`Error::Patch`] where a patch's text does not occur in the chunk that it names. A patch of a chunk that this
    /// source does not contain is ignored.
    pub fn patched(mut self, patches: &[Patch]) -> Result<Self> {
        for patch in patches {
            for chunk in self.chunks.iter_mut().filter(|chunk| chunk.file == patch.file) {
                if !chunk.text.contains(&patch.from) {
                    return Err(Error::Patch { file: chunk.file, text: patch.from.clone() });
                }
                chunk.text = Cow::Owned(chunk.text.replace(&patch.from, &patch.to));
            }
        }
        Ok(self)
    }

    /// The kernel of bodies under torques that stores an evaluation of its step in place of the state
    /// (`engine/tap.rs`). Apply patches first, as this renames some functions.
    #[must_use]
    pub fn tapped(mut self) -> Self {
        for chunk in &mut self.chunks {
            for name in TAPPED {
                let definition = format!("fn {name}(");
                if chunk.text.contains(&definition) {
                    chunk.text = Cow::Owned(chunk.text.replace(&definition, &format!("fn {}(", untapped(name))));
                }
            }
        }
        // The entry point stays in the last chunk.
        self.chunks.insert(self.chunks.len() - 1, chunk!("tap.wgsl"));
        self
    }

    /// The chunks in order.
    pub fn chunks(&self) -> &[Chunk] {
        &self.chunks
    }

    /// Values of its `override` constants.
    pub fn constants(&self) -> &Constants {
        &self.constants
    }

    /// Name of the entry point.
    pub fn entry_point(&self) -> &'static str {
        self.entry_point
    }

    /// What identifies it among other sources.
    pub fn key(&self) -> Key {
        (self.text(), self.constants.clone())
    }

    /// The whole text.
    pub fn text(&self) -> String {
        let mut text = String::with_capacity(self.chunks.iter().map(|chunk| chunk.text.len() + 1).sum());
        for chunk in &self.chunks {
            text.push_str(&chunk.text);
            if !chunk.text.ends_with('\n') {
                text.push('\n');
            }
        }
        text
    }
}
