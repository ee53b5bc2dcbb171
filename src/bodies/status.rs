//! The status of a body: a number in a column of the state and of result tables, 0 as long as the body is under way and all is well.

use crate::math::real::Real;

/// Why a body's state is not to be trusted from some step on, or that an event has stopped it. The first reason is kept.
///
/// Steps set [`Status::NotConverged`], [`Status::StepTooLong`] and [`Status::StepBelowLimit`]; the others are found when states
/// are read.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Status {
    /// Every step so far did what it promises.
    #[default]
    Valid,
    /// An implicit equation was not solved to the precision of the arithmetic within the cap on iterations.
    NotConverged,
    /// The step is too long for the discrete free flow: a modified moment is not positive, or no rotation solves it.
    StepTooLong,
    /// The error asked for needs a step below the limit, or a thousand times the steps that were planned ([`crate::plan::Group::most_attempts`]).
    StepBelowLimit,
    /// A component of the attitude or rotation is infinite or NaN.
    NotFinite,
    /// A component of the position or velocity of the centre of mass is infinite or NaN.
    CentreNotFinite,
    /// An event has stopped the body ([`crate::scene::Event::stopping`]): it has not failed, and stays in the state of the event.
    Stopped,
}

impl Status {
    /// All values; the index of each is its number in the column.
    pub const ALL: [Status; 7] = [
        Status::Valid,
        Status::NotConverged,
        Status::StepTooLong,
        Status::StepBelowLimit,
        Status::NotFinite,
        Status::CentreNotFinite,
        Status::Stopped,
    ];

    /// Whether the numbers of a state are valid: those of a body under way, and of one that an event has stopped.
    pub(crate) const fn is_good(self) -> bool {
        matches!(self, Status::Valid | Status::Stopped)
    }

    /// The number in the column: its place above.
    pub const fn code(self) -> f64 {
        self as u8 as f64
    }

    /// The number in results.
    pub const fn number(self) -> u8 {
        self.code() as u8
    }

    /// The word in results.
    pub const fn name(self) -> &'static str {
        match self {
            Status::Valid => "valid",
            Status::NotConverged => "not_converged",
            Status::StepTooLong => "step_too_long",
            Status::StepBelowLimit => "step_below_limit",
            Status::NotFinite => "not_finite",
            Status::CentreNotFinite => "centre_not_finite",
            Status::Stopped => "stopped",
        }
    }

    /// The value with this number in the column. A number that no kernel writes, as in a row that none has reached, means a body that has
    /// not been solved.
    pub fn from_code(code: f64) -> Self {
        Self::ALL.iter().copied().find(|status| status.code() == code).unwrap_or(Status::NotConverged)
    }
}

impl std::fmt::Display for Status {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter.write_str(match self {
            Status::Valid => "valid",
            Status::NotConverged => "an implicit step was not solved",
            Status::StepTooLong => "the step is too long for the discrete free flow",
            Status::StepBelowLimit => "the error asked for needs a step below the limit, or steps almost without end",
            Status::NotFinite => "its attitude or rotation is not finite",
            Status::CentreNotFinite => "its position or velocity is not finite",
            Status::Stopped => "an event has stopped it",
        })
    }
}

/// `status`, or `reason` where the mask is set and there is no reason yet.
#[inline(always)]
pub fn flagged<R: Real>(status: R, fault: R::Mask, reason: Status) -> R {
    let unset = status.less_than(R::splat(0.5));
    R::select(fault & unset, R::splat(reason.code()), status)
}
