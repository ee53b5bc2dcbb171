//! A plan as a table: what runs for which bodies, what it costs, and what is left out.

mod display;

use std::collections::BTreeMap;

use super::choice::CLOSED_FORM_F64;
use super::class::Bound;
use super::cost::evaluation_seconds;
use super::group::{Group, Treatment};
use super::parts::name_of;
use super::recomputation::{CHANGE, EVALUATION};
use super::{CLOSED_FORM_F32, Found, Plan, Resolution, Scheme, Shape, Skip, StatisticError, TorqueSet, coupled};
use crate::bodies::BodyFrame;
use crate::engine::batch::bytes_per_body_under;
use crate::engine::cpu::kept_bytes;
use crate::engine::{Description, EngineKind, Link};
use crate::kernel::free_motion::{ROW_COLUMNS, WORD_COLUMNS};
use crate::kernel::method::Method;
use crate::math::Precision;
use crate::math::Spread;
use crate::scene::{Part, Scene, Stepping};
use crate::torque::control::{Schedule, is_accumulation};
use crate::torque::{Sampling, Torque};

/// What a plan does and leaves out.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "study", derive(serde::Serialize))]
pub struct Explanation {
    /// What will compute.
    pub engine: String,
    /// What runs on the CPU beside a GPU, and why.
    pub on_host: Option<String>,
    /// Number of bodies that the plan has.
    pub bodies: usize,
    /// The whole of which these bodies are a part; absent where they are all.
    #[cfg_attr(feature = "study", serde(skip_serializing_if = "Option::is_none"))]
    pub part: Option<PartRow>,
    /// Simulated time, s.
    pub span: f64,
    /// Number of output times.
    pub outputs: usize,
    /// Number of times between them at which events are checked; absent if there are none.
    #[cfg_attr(feature = "study", serde(skip_serializing_if = "Option::is_none"))]
    pub checks: Option<usize>,
    /// Number of other times at which steps end, as a formula of the time changes fast near them.
    #[cfg_attr(feature = "study", serde(skip_serializing_if = "super::statistical::is_zero"))]
    pub breaks: usize,
    /// Whether steps by series go beyond all of these times, at which the series are evaluated.
    #[cfg_attr(feature = "study", serde(skip_serializing_if = "std::ops::Not::not"))]
    pub dense_output: bool,
    /// What was asked for: errors, or a method and its steps.
    pub asked: String,
    /// What is formed from the states at each output time, and where; `null` where nothing is.
    pub observed: Option<String>,
    /// Which torques are sampled, and when.
    #[cfg_attr(feature = "study", serde(skip_serializing_if = "Vec::is_empty"))]
    pub sampled: Vec<String>,
    /// Whether centres of mass are integrated with the rotation, and for which torques; absent where they are not.
    #[cfg_attr(feature = "study", serde(skip_serializing_if = "Option::is_none"))]
    pub coupled: Option<String>,
    /// One row for each class and treatment.
    pub classes: Vec<ClassRow>,
    /// What is left out, and why that is safe.
    pub skips: Vec<Skip>,
    /// The error of each statistic: what the integration contributes, and what the number of bodies does; empty where the plan does not
    /// depend on errors of statistics.
    #[cfg_attr(feature = "study", serde(skip_serializing_if = "Vec::is_empty"))]
    pub statistics: Vec<StatisticError>,
    /// The bodies that are recomputed more accurately after the run.
    pub sample: SampleRow,
    /// What a tenth of the error would cost; `null` where no error of statistics is asked for.
    #[cfg_attr(feature = "study", serde(skip_serializing_if = "Option::is_none"))]
    pub tenth: Option<TenthRow>,
    /// What bodies take to reach a GPU; `None` where none are stepped on one.
    #[cfg_attr(feature = "study", serde(skip_serializing_if = "Option::is_none"))]
    pub link: Option<LinkRow>,
}

/// The bodies of which a plan has a part.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "study", derive(serde::Serialize))]
pub struct PartRow {
    /// Their number.
    pub bodies: usize,
    /// The index among them of the part's body 0.
    pub first_body: usize,
    /// Wall time expected of them all, s, if the others are like the part; `None` where that of the part is not known.
    pub seconds: Option<f64>,
}

/// The way to a GPU, as measured (not the run's own).
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "study", derive(serde::Serialize))]
pub struct LinkRow {
    /// Bytes of the stepped bodies' columns, which are written to its memory.
    pub bytes: u64,
    /// Expected wall time of that, s.
    pub seconds: f64,
    /// Bytes of their states that come back at the outputs, at most: fewer if quantities are formed on the GPU, or only the last is asked for.
    pub read: u64,
    /// Expected wall time of that, s, where nothing else goes on meanwhile.
    pub read_seconds: f64,
    /// Wall time of a wait for the GPU, s. The expected times of classes contain one for each output, or two where steps are adaptive.
    pub wait: f64,
}

/// The bodies of a run that are recomputed, so that its errors are known.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "study", derive(serde::Serialize))]
pub struct SampleRow {
    /// Number of bodies, over all parts if a study is run in parts.
    pub bodies: usize,
    /// Expected wall time, s, on the CPU whatever the engine; `None` where it is not known because the run's own steps are not.
    pub seconds: Option<f64>,
}

/// What a tenth of the error of a statistic would cost, for each of its two sources.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "study", derive(serde::Serialize))]
pub struct TenthRow {
    /// Bodies for a tenth of the scatter, which falls as the inverse square root of their number.
    pub bodies: u64,
    /// The wall time that they would take, s, if known.
    pub bodies_seconds: Option<f64>,
    /// The factor by which the steps grow for a tenth of the error of the integration; `None` where no steps are taken.
    pub steps: Option<f64>,
    /// The wall time that they would take, s, if known.
    pub steps_seconds: Option<f64>,
}

/// Bodies of one class that are treated alike, whatever steps they take.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "study", derive(serde::Serialize))]
pub struct ClassRow {
    /// The free motion of the bodies; driven bodies count as asymmetric.
    pub class: &'static str,
    /// Names of the torques that act.
    pub torques: Vec<String>,
    /// Whether their centres of mass move too.
    pub translates: bool,
    /// Number of bodies.
    pub bodies: usize,
    /// The integrator, `closed form` or `rotation`.
    pub method: &'static str,
    /// Steps of a body over the whole span. Where bodies choose them: those of the pilot's bodies, including rejected attempts.
    pub steps: StepsRow,
    /// The arithmetic.
    pub precision: &'static str,
    /// The attitude error expected at the percentile asked for, rad; `None` where method and step are pinned.
    pub error: Option<f64>,
    /// Bodies of the pilot behind the error; 0 where it follows from a bound or from the shipped table.
    pub pilot_bodies: usize,
    /// How long the pilot followed them, s; 0 without one.
    pub pilot_span: f64,
    /// Wall time expected, s; `None` where no cost is known, as on a GPU.
    pub seconds: Option<f64>,
    /// Memory of the columns, bytes.
    pub bytes: u64,
}

/// Steps of some bodies.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "study", derive(serde::Serialize))]
pub struct StepsRow {
    /// The fewest that any takes.
    pub min: u64,
    /// Half of the bodies take no more.
    pub median: u64,
    /// The most that any takes.
    pub max: u64,
}

impl Explanation {
    /// Wall time expected of the plan's bodies, s; `None` where that of a class is not known.
    pub fn seconds(&self) -> Option<f64> {
        in_all(&self.classes)
    }
}

fn in_all(classes: &[ClassRow]) -> Option<f64> {
    classes.iter().map(|class| class.seconds).sum()
}

/// Rows of the table: shape, torques, whether it translates, method, and whether in `f64`.
type RowKey = (Shape, TorqueSet, bool, &'static str, bool);

impl Plan<'_> {
    /// What the plan does and leaves out, as a table that prints itself.
    pub fn explain(&self) -> Explanation {
        let mut rows: BTreeMap<RowKey, Vec<&Group>> = BTreeMap::new();
        for group in self.groups() {
            let (method, precision) = name_of(&group.treatment);
            let class = &group.class;
            let key = (class.shape, class.torques, class.translates, method, precision == Precision::F64);
            rows.entry(key).or_default().push(group);
        }
        let classes: Vec<ClassRow> = rows.into_iter().map(|(key, groups)| self.class_row(key, &groups)).collect();
        Explanation {
            sample: match self.recomputes() {
                true => SampleRow { bodies: self.sample().bodies.len(), seconds: self.recomputation_seconds() },
                false => SampleRow { bodies: 0, seconds: None },
            },
            tenth: self.tenth(&classes),
            part: self.part_row(&classes),
            link: self.link_row(),
            statistics: match self.resolution() {
                Resolution::Accuracy { statistics, .. } => statistics.clone(),
                Resolution::Pinned { .. } | Resolution::Adaptive { .. } => Vec::new(),
            },
            engine: self.engine.name.clone(),
            on_host: self.engine.on_host.clone(),
            bodies: self.scene().ensemble().len(),
            span: self.scene().end(),
            outputs: self.times().len(),
            checks: self.checks(),
            breaks: self.breaks().len(),
            dense_output: self.times.is_dense(),
            asked: asked(self.scene()),
            observed: observed(self.scene(), &self.engine),
            sampled: sampled(self.scene()),
            coupled: coupled::described(self.scene()),
            classes,
            skips: self.skips().to_vec(),
        }
    }

    fn part_row(&self, classes: &[ClassRow]) -> Option<PartRow> {
        let Part { first_body, of } = self.scene().part();
        let seconds = in_all(classes).map(|seconds| seconds * self.times_as_many());
        (of > self.scene().ensemble().len()).then_some(PartRow { bodies: of, first_body, seconds })
    }

    /// By how many times the bodies of which the plan has a part are more.
    fn times_as_many(&self) -> f64 {
        self.scene().part().of as f64 / self.scene().ensemble().len().max(1) as f64
    }

    fn link_row(&self) -> Option<LinkRow> {
        let of_group = |group: &Group| {
            let (scheme, precision) = group.treatment.steps()?;
            let link = self.costs.link(scheme, precision)?;
            let outputs = if self.leaves_states() { 0 } else { self.advance_times().len() };
            Some((link, self.bytes(group), group.treatment.state_bytes() * (group.members.len() * outputs) as u64))
        };
        let stepped: Vec<(Link, u64, u64)> = self.groups().iter().filter_map(of_group).collect();
        let (link, ..) = *stepped.first()?;
        let bytes = stepped.iter().map(|(_, bytes, _)| bytes).sum();
        let read = stepped.iter().map(|(.., read)| read).sum();
        Some(LinkRow {
            bytes,
            seconds: bytes as f64 / link.to_device,
            read,
            read_seconds: read as f64 / link.to_host,
            wait: link.wait,
        })
    }

    fn class_row(&self, key: RowKey, groups: &[&Group]) -> ClassRow {
        let (shape, torques, translates, method, wide) = key;
        let acting = torques.of(self.scene().stated_torques());
        let names = acting.iter().map(|torque| torque.name().to_owned()).collect();
        let (error, (pilot_bodies, pilot_span)) = self.expected_error(groups);
        ClassRow {
            class: shape.name(),
            torques: names,
            translates,
            bodies: groups.iter().map(|group| group.members.len()).sum(),
            method,
            steps: self.steps_row(groups),
            precision: if wide { Precision::F64.name() } else { Precision::F32.name() },
            error,
            pilot_bodies,
            pilot_span,
            seconds: groups.iter().map(|group| self.expected_seconds(group)).sum(),
            bytes: groups.iter().map(|group| self.bytes(group)).sum(),
        }
    }

    fn steps_row(&self, groups: &[&Group]) -> StepsRow {
        if let Some(Spread { min, median, max, .. }) = groups.iter().find_map(|group| self.found(group)?.steps) {
            return StepsRow { min, median, max };
        }
        let mut steps: Vec<(u64, usize)> =
            groups.iter().map(|group| (self.steps_of(group), group.members.len())).collect();
        steps.sort_unstable();
        let half = steps.iter().map(|(_, bodies)| bodies).sum::<usize>().div_ceil(2);
        let mut counted = 0;
        let median = steps.iter().find(|(_, bodies)| {
            counted += bodies;
            counted >= half
        });
        StepsRow {
            min: steps.first().map_or(0, |first| first.0),
            median: median.map_or(0, |middle| middle.0),
            max: steps.last().map_or(0, |last| last.0),
        }
    }

    /// What a pilot found of a group that is stepped.
    pub(super) fn found(&self, group: &Group) -> Option<&Found> {
        group.treatment.precision_of_steps()?;
        let Resolution::Accuracy { stepped, .. } = self.resolution() else { return None };
        stepped.iter().find(|entry| entry.torques == group.class.torques).map(|entry| &entry.found)
    }

    /// The attitude error expected of a row's groups, the number of the pilot's bodies behind it, and how long they were followed, s.
    fn expected_error(&self, groups: &[&Group]) -> (Option<f64>, (usize, f64)) {
        let Resolution::Accuracy { .. } = self.resolution() else {
            // Where steps are pinned, only bodies at rest have a known error.
            let bound = groups.iter().map(|group| group.bound).fold(Bound::default(), Bound::or);
            let still = groups.iter().all(|group| group.treatment == Treatment::RegularPrecession);
            return (still.then_some(bound.attitude), (0, 0.0));
        };
        let mut greatest = (0.0, (0, 0.0));
        for group in groups {
            let (error, pilot) = match group.treatment {
                Treatment::RegularPrecession => (group.bound.attitude.max(CLOSED_FORM_F64), (0, 0.0)),
                Treatment::ClosedForm { precision, .. } => {
                    let evaluated = if precision == Precision::F32 { CLOSED_FORM_F32 } else { CLOSED_FORM_F64 };
                    (evaluated + group.bound.attitude, (0, 0.0))
                }
                Treatment::Stepped { .. } | Treatment::Adaptive { .. } if self.scene().end() == 0.0 => (0.0, (0, 0.0)),
                Treatment::Stepped { .. } | Treatment::Adaptive { .. } => {
                    self.found(group).map_or((f64::NAN, (0, 0.0)), |found| (found.attitude, (found.bodies, found.span)))
                }
            };
            if error >= greatest.0 {
                greatest = (error, pilot);
            }
        }
        (Some(greatest.0), greatest.1)
    }

    /// The wall time that a group is expected to take, s, if known.
    fn expected_seconds(&self, group: &Group) -> Option<f64> {
        let of_centres = self.centres.of_group(self.scene(), group, self.engine.kind, || self.steps_of(group));
        Some(self.rotation_seconds(group)? + of_centres / rayon::current_num_threads() as f64)
    }

    fn rotation_seconds(&self, group: &Group) -> Option<f64> {
        let bodies = group.members.len() as f64;
        let evaluations = bodies * self.advance_times().len() as f64;
        let cores = rayon::current_num_threads() as f64;
        let step_seconds = |scheme, precision, tolerance| {
            let work = self.works.get(&group.class.torques)?;
            let of_step = work.step_seconds(self.costs.of(scheme)?, precision, tolerance);
            Some(of_step / self.costs.at_a_time(&self.engine)?)
        };
        // The values that sampled torques hold are formed on the host, whatever the engine.
        let schedule = Schedule::of(&group.class.torques.of(self.scene().torques()));
        let changes = schedule.map_or(0.0, |schedule| schedule.changes_in(self.scene().end()));
        let of_changes = bodies * changes * CHANGE / cores;
        let waiting = group.treatment.steps().map_or(0.0, |(scheme, precision)| {
            self.costs.waiting(scheme, precision, self.advance_times().len() as f64)
        });
        match group.treatment {
            // On the host, whatever the engine.
            Treatment::RegularPrecession => Some(evaluations * evaluation_seconds(None) / cores),
            Treatment::ClosedForm { .. } if self.engine.kind != EngineKind::Cpu => None,
            Treatment::ClosedForm { precision, .. } => Some(evaluations * evaluation_seconds(Some(precision)) / cores),
            Treatment::Adaptive { method, precision, steps } => {
                // Without a pilot, only the run itself shows the number of steps.
                let found = self.found(group)?;
                let body_steps = found.steps?.total as f64 / found.bodies as f64 * bodies;
                let scheme = Scheme::Adaptive(method);
                let seconds = step_seconds(scheme, precision, steps.tolerance)?;
                let evaluated = match group.is_dense {
                    true => {
                        evaluations * self.costs.of(scheme)?.output_seconds() / self.costs.at_a_time(&self.engine)?
                    }
                    false => 0.0,
                };
                Some(body_steps * seconds + evaluated + of_changes + waiting)
            }
            Treatment::Stepped { method, precision, .. } => {
                let body_steps = self.steps_of(group) as f64 * bodies;
                let scheme = Scheme::Equal(method);
                let seconds = step_seconds(scheme, precision, 1.0);
                // For a method that no plan chooses, estimated from its evaluations.
                let rough = || {
                    let of_step = f64::from(method.properties().evaluations) * EVALUATION;
                    self.costs.of(scheme).is_none().then_some(of_step / self.costs.at_a_time(&self.engine)?)
                };
                Some(body_steps * seconds.or_else(rough)? + of_changes + waiting)
            }
        }
    }

    /// What a tenth of the error of statistics would take, where one is asked for.
    fn tenth(&self, classes: &[ClassRow]) -> Option<TenthRow> {
        self.scene().wanted_statistical_accuracy()?;
        let seconds = in_all(classes);
        // By class, since a row holds the steps of groups whose bodies choose them.
        let (mut steps, mut more) = (0.0, 0.0);
        let mut longer = seconds;
        for group in self.groups() {
            let Some((in_steps, in_time)) = self.tenth_of_group(group) else { continue };
            let bodies = group.members.len() as f64;
            let of_body = match self.found(group).and_then(|found| Some((found.steps?.total, found.bodies))) {
                Some((total, bodies)) => total as f64 / bodies.max(1) as f64,
                None => self.steps_of(group).max(1) as f64,
            };
            steps += bodies * of_body;
            more += bodies * of_body * in_steps;
            let own = self.expected_seconds(group);
            longer = longer.zip(own).map(|(sum, own)| sum + own * (in_time - 1.0));
        }
        Some(TenthRow {
            bodies: 100 * self.scene().part().of as u64,
            bodies_seconds: seconds.map(|seconds| 100.0 * self.times_as_many() * seconds),
            steps: (steps > 0.0).then(|| more / steps),
            steps_seconds: longer.filter(|_| steps > 0.0).map(|seconds| self.times_as_many() * seconds),
        })
    }

    /// The factors by which the steps and the time of a group grow for a tenth of its errors; `None` for a group that is not stepped.
    fn tenth_of_group(&self, group: &Group) -> Option<(f64, f64)> {
        let ratio = |order: u32| 10.0_f64.powf(f64::from(order).recip());
        match group.treatment {
            Treatment::RegularPrecession | Treatment::ClosedForm { .. } => None,
            Treatment::Stepped { method, .. } => Some((ratio(method.order()), ratio(method.order()))),
            // Their order grows, not their number.
            Treatment::Adaptive { method: Method::Taylor, precision, steps } => {
                let cost = self.costs.of(Scheme::TAYLOR);
                let seconds =
                    |tolerance| Some(self.works.get(&group.class.torques)?.step_seconds(cost?, precision, tolerance));
                let longer =
                    seconds(0.1 * steps.tolerance).zip(seconds(steps.tolerance)).map(|(after, before)| after / before);
                Some((1.0, longer.unwrap_or(1.0)))
            }
            Treatment::Adaptive { method, .. } => Some((ratio(method.order()), ratio(method.order()))),
        }
    }

    /// Memory that a group's columns take, bytes.
    fn bytes(&self, group: &Group) -> u64 {
        let of_body = match group.treatment {
            // Evaluated when read, and not kept.
            Treatment::RegularPrecession => 0,
            Treatment::ClosedForm { .. } if self.engine.kind == EngineKind::Cpu && self.reads_states_once() => 0,
            Treatment::ClosedForm { precision, .. } => {
                let numbers =
                    ROW_COLUMNS * if precision == Precision::F32 { size_of::<f32>() } else { size_of::<f64>() };
                WORD_COLUMNS * size_of::<u64>() + numbers + size_of::<BodyFrame>()
            }
            Treatment::Stepped { precision, .. } | Treatment::Adaptive { precision, .. } => {
                let torques = group.class.torques.of(self.scene().torques());
                let series = match group.treatment {
                    Treatment::Adaptive { steps, .. } if group.is_dense => kept_bytes(steps.tolerance),
                    _ => 0,
                };
                bytes_per_body_under(precision, &torques, self.scene().end()) + series
            }
        };
        (of_body as u64).saturating_mul(group.members.len() as u64)
    }
}

/// What a scene asks for.
fn asked(scene: &Scene) -> String {
    let stepping = scene.stepping();
    match (stepping, scene.wanted_statistical_accuracy()) {
        (Stepping::Statistics(_), _) | (_, None) => stepping.to_string(),
        (_, Some(wanted)) => format!("{stepping}; {wanted}"),
    }
}

#[cfg(feature = "study")]
impl Explanation {
    /// The table as JSON.
    pub fn to_json(&self) -> String {
        // Keys are fixed strings and values plain numbers and strings, so there is nothing to fail on.
        let mut text = serde_json::to_string_pretty(self).unwrap_or_default();
        text.push('\n');
        text
    }
}

/// What a scene asks for beside the states of its bodies, and where an engine forms it.
fn observed(scene: &Scene, engine: &Description) -> Option<String> {
    let counted = |count: usize, one: &str, more: &str| {
        (count > 0).then(|| format!("{count} {}", if count == 1 { one } else { more }))
    };
    let parts = [
        counted(scene.wanted_statistics().len(), "quantity's statistics", "quantities' statistics"),
        counted(scene.wanted_histograms().len(), "histogram", "histograms"),
        counted(scene.wanted_events().len(), "event", "events"),
        counted(
            scene.wanted_events().iter().filter(|event| event.stops()).count(),
            "of which stops bodies",
            "of which stop bodies",
        ),
    ];
    let mut parts: Vec<String> = parts.into_iter().flatten().collect();
    parts.extend(scene.observed().cells.map(|cells| format!("of each of {cells} cells too")));
    let has_f64 = engine.arithmetic.as_ref().is_some_and(|found| found.precisions().contains(&Precision::F64));
    let is_on_device = scene.may_skip() && scene.forms_on_devices() && has_f64 && !engine.software;
    let place = match scene.reduced_statistics().is_empty() {
        true if is_on_device => "where the states are, if the GPU computes all classes",
        true => "from all states, which are read for that",
        false => "where the states are",
    };
    (!parts.is_empty()).then(|| format!("{}, {place}", parts.join(", ")))
}

/// Which torques are sampled, and when.
fn sampled(scene: &Scene) -> Vec<String> {
    let of = |(place, torque): (usize, &Torque)| {
        let Sampling { every, delay } = torque.control()?.sampling();
        let delay = if delay > 0.0 { format!(", in effect {delay:?} s later") } else { String::new() };
        let count = (scene.end() / every).floor() + 1.0;
        let whose = match is_accumulation(torque.declaration()) {
            true => "a quantity that adds up".to_owned(),
            false => format!("torque {} ({})", place + 1, torque.name()),
        };
        Some(format!("{whose} every {every:?} s{delay}: {count} samples, each of which ends a step"))
    };
    scene.torques().iter().enumerate().filter_map(of).collect()
}
