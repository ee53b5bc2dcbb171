//! The mass properties of what a file describes: a mesh, point masses, or the `inertia` of a study.

use std::ffi::OsStr;
use std::fmt;
use std::path::Path;

use glam::DVec3;
use serde::Serialize;

use super::Study;
use super::draw::Draw;
use super::inertia::Inertia;
use super::points::points_with_lines;
use super::reader::FileText;
use super::rows::input_error;
use super::text::read_text;
use crate::bodies::inertia::{InertiaClass, InertiaTensor, MassProperties, Validity, classify, point_masses, positive};
use crate::error::{Error, Result};
use crate::error::{InputError, InputFault};

/// Options for what a file leaves open.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MassFileOptions {
    /// Mass of a mesh, kg; for points, the total to which their masses are scaled.
    pub mass: Option<f64>,
    /// Density of a mesh, kg/m³.
    pub density: Option<f64>,
    /// The length in m of the unit of a mesh or of points; 1 if omitted.
    pub scale: Option<f64>,
    /// Whether a mesh is a thin skin instead of a solid.
    pub shell: bool,
    /// The index of the body in a study, from 0; the first if omitted.
    pub body: Option<usize>,
}

/// Relative difference up to which two moments count as equal when a class is named.
pub const CLASS_TOLERANCE: f64 = 1e-9;

/// Mass, centre of mass, inertia and principal frame of a body, as `polhode inertia` prints them, in the frame in which the body is
/// described. SI units.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MassReport {
    /// The file as named by the caller.
    pub file: String,
    /// m³; 0 for matter without volume. `None` if the file gives only a tensor.
    pub volume: Option<f64>,
    /// kg; `None` if the file gives only a tensor.
    pub mass: Option<f64>,
    /// m; `None` if the file gives only a tensor.
    pub centre_of_mass: Option<[f64; 3]>,
    /// About the centre of mass: ixx, iyy, izz, ixy, ixz, iyz, kg m², where ixy = −∫ρxy.
    pub inertia: [f64; 6],
    /// The tensor about another point, if one was asked for.
    pub about: Option<TensorAbout>,
    /// I₁ ≤ I₂ ≤ I₃, kg m².
    pub principal_moments: [f64; 3],
    /// The axis of each, a unit vector; together right-handed.
    pub principal_axes: [[f64; 3]; 3],
    /// The kind of rotor: point, linear, spherical, prolate, oblate or asymmetric; moments that differ by at most
    /// [`CLASS_TOLERANCE`] count as equal.
    pub class: &'static str,
    /// I₁/I₃; above 0 for a body that can spin about every axis.
    pub least_over_largest: f64,
    /// (I₃ − I₁ − I₂)/I₃: 0 for a flat plate, −1 for a sphere; above [`crate::error::TRIANGLE_TOLERANCE`] for a tensor that no
    /// body has.
    pub relative_excess: f64,
    /// Why the tensor is not that of a body that can spin about every axis, if it is not.
    pub defect: Option<String>,
}

/// A tensor about a point.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct TensorAbout {
    /// m.
    pub point: [f64; 3],
    /// ixx, iyy, izz, ixy, ixz, iyz, kg m².
    pub inertia: [f64; 6],
}

impl MassReport {
    /// Reads `file` and computes its mass properties; `about` is a further point (m) about which the tensor is wanted.
    ///
    /// The extension determines the contents: a mesh (.stl, .obj), point masses (.csv, see [`super::read_points`]), or a table
    /// `inertia` as in a study, alone or in a study (.toml).
    ///
    /// ```
    /// use glam::DVec3;
    /// use polhode::study::{MassFileOptions, MassReport};
    ///
    /// let path = std::env::temp_dir().join(format!("polhode-mass-{}.toml", std::process::id()));
    /// std::fs::write(&path, "inertia = { shape = 'sphere', mass = 10.0, radius = 1.0 }")?;
    /// let report = MassReport::of_file(&path, &MassFileOptions::default(), Some(DVec3::X))?;
    /// std::fs::remove_file(&path)?;
    /// assert_eq!((report.class, report.principal_moments), ("spherical", [4.0, 4.0, 4.0]));
    /// assert_eq!(report.about.expect("asked for").inertia, [4.0, 14.0, 14.0, 0.0, 0.0, 0.0]);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    ///
    /// [`Error::File`], [`Error::MeshFile`](crate::Error) and [`Error::Input`] if the file cannot be read or is not valid; [`Error::Mesh`]
    /// if a mesh is open or inside out; [`Error::Setting`] if mass, density or scale is not positive, is missing, or is given although the
    /// file has its own, or if `about` is used with only a tensor.
    pub fn of_file(file: &Path, options: &MassFileOptions, about: Option<DVec3>) -> Result<Self> {
        let (body, inertia) = match mass_properties(file, options)? {
            Described::Body(body) => (Some(body), body.inertia),
            Described::Tensor(tensor) => (None, tensor),
        };
        let about = match (about, body) {
            (None, _) => None,
            (Some(point), Some(body)) => {
                Some(TensorAbout { point: point.to_array(), inertia: body.inertia_about(point).to_array() })
            }
            (Some(point), None) => {
                let expected = "expected a body with a mass: a tensor alone says nothing about other points";
                return Err(Error::Setting { field: "about", value: point.x, expected });
            }
        };
        let validity = Validity::of(&inertia);
        let axes = validity.axes;
        Ok(Self {
            file: file.display().to_string(),
            volume: body.map(|body| body.volume),
            mass: body.map(|body| body.mass),
            centre_of_mass: body.map(|body| body.centre_of_mass.to_array()),
            inertia: inertia.to_array(),
            about,
            principal_moments: axes.moments.to_array(),
            principal_axes: [0, 1, 2].map(|axis| axes.axis_body(axis).to_array()),
            class: class_name(classify(axes.moments, CLASS_TOLERANCE)),
            least_over_largest: validity.least_over_largest,
            relative_excess: validity.relative_excess,
            defect: validity.defect().map(|defect| defect.to_string()),
        })
    }

    /// The report as JSON; a number that is not finite becomes `null`.
    pub fn to_json(&self) -> String {
        // Keys are fixed and values plain numbers and strings, so serialisation cannot fail.
        let mut text = serde_json::to_string_pretty(self).unwrap_or_default();
        text.push('\n');
        text
    }
}

/// What a file describes.
enum Described {
    Body(MassProperties),
    Tensor(InertiaTensor),
}

fn mass_properties(file: &Path, options: &MassFileOptions) -> Result<Described> {
    let ending = file.extension().and_then(OsStr::to_str).map(str::to_ascii_lowercase);
    let own = |field, value: Option<f64>| match value {
        Some(value) => Err(Error::Setting { field, value, expected: "the file says this itself: leave it out" }),
        None => Ok(()),
    };
    let is_mesh = matches!(ending.as_deref(), Some("stl" | "obj"));
    if options.shell && !is_mesh {
        return Err(Error::Setting { field: "shell", value: 1.0, expected: "only a mesh can be a skin: leave it out" });
    }
    if let Some(body) = options.body.filter(|_| ending.as_deref() != Some("toml")) {
        let expected = "only a study has several bodies: leave it out";
        return Err(Error::Setting { field: "body", value: body as f64, expected });
    }
    match ending.as_deref() {
        Some("stl" | "obj") => of_mesh(file, options).map(Described::Body),
        Some("csv") => {
            own("density", options.density)?;
            let scale = positive("scale", options.scale.unwrap_or(1.0))?;
            let (lines, points): (Vec<_>, Vec<_>) = points_with_lines(file)?.into_iter().unzip();
            let points: Vec<_> = points.into_iter().map(|(mass, place)| (mass, place * scale)).collect();
            let located = |error| match error {
                Error::Item { index, field, value, expected, .. } => {
                    let fault = InputFault::Value { value: format!("{value:?}"), expected: expected.into() };
                    input_error(file, lines.get(index).copied().unwrap_or(1), field, fault)
                }
                // An error of all points together.
                error => {
                    let line = lines.first().copied().unwrap_or(1);
                    input_error(file, line, "", InputFault::Syntax { reason: error.to_string() })
                }
            };
            let body = point_masses(&points).map_err(located)?;
            Ok(Described::Body(options.mass.map_or(Ok(body), |mass| body.with_mass(mass))?))
        }
        Some("toml") => {
            own("mass", options.mass)?;
            own("density", options.density)?;
            own("scale", options.scale)?;
            of_study(file, options.body.unwrap_or(0))
        }
        _ => {
            let reason = "the name must end in .stl, .obj, .csv or .toml".to_owned();
            Err(InputError { file: file.to_owned(), line: 1, key: String::new(), fault: InputFault::Syntax { reason } }
                .into())
        }
    }
}

#[cfg(feature = "mesh")]
fn of_mesh(file: &Path, options: &MassFileOptions) -> Result<MassProperties> {
    use crate::error::MeshFileProblem;

    let mesh = crate::bodies::inertia::read_mesh(file)?.scaled(options.scale.unwrap_or(1.0))?;
    let properties = match (options.mass, options.density) {
        (Some(mass), None) if options.shell => mesh.shell_mass_properties(mass),
        (Some(mass), None) => mesh.mass_properties(mass),
        (None, Some(density)) if !options.shell => mesh.mass_properties_of_density(density),
        (Some(_), Some(density)) => Err(Error::Setting {
            field: "density",
            value: density,
            expected: "the mass is given: leave one of them out",
        }),
        (None, Some(density)) => {
            Err(Error::Setting { field: "density", value: density, expected: "a shell has no volume: give its mass" })
        }
        (None, None) => {
            let expected = "expected the mass of the mesh (kg), or its density (kg/m³)";
            Err(Error::Setting { field: "mass", value: 0.0, expected })
        }
    };
    let sound = properties.and_then(|properties| match mesh.overlap().filter(|_| !options.shell) {
        Some(defect) => Err(Error::Mesh(defect)),
        None => Ok(properties),
    });
    sound.map_err(|error| match error {
        Error::Mesh(defect) => Error::MeshFile { path: file.to_owned(), problem: MeshFileProblem::Surface(defect) },
        error => error,
    })
}

#[cfg(not(feature = "mesh"))]
fn of_mesh(file: &Path, _: &MassFileOptions) -> Result<MassProperties> {
    let reason = super::solid::NO_MESHES.to_owned();
    Err(InputError { file: file.to_owned(), line: 1, key: String::new(), fault: InputFault::Syntax { reason } }.into())
}

/// A body of a study, or of `inertia = { ... }` alone.
fn of_study(file: &Path, body: usize) -> Result<Described> {
    let text = read_text(file)?;
    let alone = FileText::new(file, &text).parse(|root| match root.find("inertia") {
        Some(node) => {
            root.only(&["title", "seed", "inertia"])?;
            let seed = root
                .find("seed")
                .map(|node| node.whole("expected a whole number that is not negative"))
                .transpose()?
                .unwrap_or(0);
            Ok(Some((Inertia::read(&node)?, seed, node.line())))
        }
        None => Ok(None),
    })?;
    if let Some((inertia, seed, line)) = alone {
        let located = |error: Error| match error {
            error @ (Error::Input(_) | Error::File { .. }) => error,
            #[cfg(feature = "mesh")]
            error @ Error::MeshFile { .. } => error,
            error => input_error(file, line as u64, "inertia", InputFault::Syntax { reason: error.to_string() }),
        };
        return described(&inertia, Draw::new(seed), body).map_err(located);
    }
    let study = Study::parse(file, &text)?;
    let bodies = study.bodies();
    if body >= bodies.count {
        let expected = "expected the index of one of the study's bodies, from 0";
        return Err(Error::Setting { field: "body", value: body as f64, expected });
    }
    match (&bodies.table, &bodies.inertia) {
        (_, Some(inertia)) => described(inertia, study.draw(), body).map_err(|error| study.located(error)),
        (Some(table), None) => Ok(Described::Tensor(table.inertia(bodies.row(body)))),
        (None, None) => Ok(Described::Tensor(InertiaTensor::default())),
    }
}

fn described(inertia: &Inertia, draw: Draw, body: usize) -> Result<Described> {
    match inertia {
        Inertia::Solid { solid, .. } => solid.sample(draw, body).map(Described::Body),
        inertia => Ok(Described::Tensor(inertia.sample(draw, body))),
    }
}

fn class_name(class: InertiaClass) -> &'static str {
    match class {
        InertiaClass::Point => "point",
        InertiaClass::LinearRotor => "linear rotor",
        InertiaClass::Spherical => "spherical",
        InertiaClass::Prolate => "prolate",
        InertiaClass::Oblate => "oblate",
        InertiaClass::Asymmetric => "asymmetric",
    }
}

impl fmt::Display for MassReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let row = |numbers: [f64; 3]| numbers.map(|x| format!("{x:>24.16e}")).join(" ");
        let tensor = |f: &mut fmt::Formatter<'_>, [xx, yy, zz, xy, xz, yz]: [f64; 6]| {
            [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]
                .into_iter()
                .try_for_each(|numbers| writeln!(f, "  {}", row(numbers)))
        };
        writeln!(f, "{}", self.file.replace(char::is_control, " "))?;
        if let (Some(volume), Some(mass), Some(centre)) = (self.volume, self.mass, self.centre_of_mass) {
            writeln!(f, "volume [m³]         {volume:e}")?;
            writeln!(f, "mass [kg]           {mass:e}")?;
            writeln!(f, "centre of mass [m]\n  {}", row(centre))?;
        }
        writeln!(f, "inertia tensor about the centre of mass [kg m²]")?;
        tensor(f, self.inertia)?;
        if let Some(about) = self.about {
            let [x, y, z] = about.point;
            writeln!(f, "inertia tensor about ({x}, {y}, {z}) m [kg m²]")?;
            tensor(f, about.inertia)?;
        }
        writeln!(f, "principal moments [kg m²]\n  {}", row(self.principal_moments))?;
        writeln!(f, "principal axes, one a row")?;
        self.principal_axes.into_iter().try_for_each(|axis| writeln!(f, "  {}", row(axis)))?;
        writeln!(f, "class               {}", self.class)?;
        writeln!(f, "I1/I3               {:e}", self.least_over_largest)?;
        writeln!(
            f,
            "(I3 - I1 - I2)/I3   {:e} (at most 0 for a body: 0 is a flat plate, -1 a sphere)",
            self.relative_excess
        )?;
        match &self.defect {
            None => writeln!(f, "valid               yes"),
            Some(defect) => writeln!(f, "valid               no: {defect}"),
        }
    }
}
