//! Which torques act on a body.

use crate::torque::Torque;

/// Torques of a scene as a set of their indices.
///
/// With more than 32 torques the last bit stands for all the rest.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct TorqueSet(u32);

/// Number of torques that have a bit of their own.
const OWN_BITS: usize = 31;

/// Which torques of a scene act on its bodies, where many are looked at.
pub(crate) struct ActingTorques<'t> {
    /// Those that act on all bodies.
    always: TorqueSet,
    /// Those that are zero for some.
    others: Vec<(usize, &'t Torque)>,
}

impl<'t> ActingTorques<'t> {
    /// Looks at the strengths of all bodies.
    pub fn of(torques: &'t [Torque]) -> Self {
        let (always, others): (Vec<_>, Vec<_>) =
            torques.iter().enumerate().partition(|(_, torque)| torque.acts_on_all());
        Self { always: TorqueSet::of_indices(always.into_iter().map(|(index, _)| index)), others }
    }

    /// The torques that act on a body: those whose strength is not zero for it.
    #[inline]
    pub fn on(&self, body: usize) -> TorqueSet {
        let acting = self.others.iter().filter(|(_, torque)| torque.acts_on(body));
        TorqueSet(self.always.0 | TorqueSet::of_indices(acting.map(|(index, _)| *index)).0)
    }
}

impl TorqueSet {
    /// The torques that act on a body: those whose strength is not zero for it.
    pub(crate) fn acting_on(torques: &[Torque], body: usize) -> Self {
        Self::of_indices((0..torques.len()).filter(|&index| torques[index].acts_on(body)))
    }

    /// The set of the first `count` torques.
    pub(crate) fn all(count: usize) -> Self {
        Self::of_indices(0..count)
    }

    /// Whether there are none.
    pub fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// Whether torque `index` of the scene is in the set.
    pub fn contains(self, index: usize) -> bool {
        self.0 & (1 << index.min(OWN_BITS)) != 0
    }

    /// The set of some indices.
    pub(crate) fn of_indices(indices: impl IntoIterator<Item = usize>) -> Self {
        Self(indices.into_iter().fold(0, |set, index| set | 1 << index.min(OWN_BITS)))
    }

    /// The indices of the members; the last index stands for all the rest.
    #[cfg(feature = "study")]
    pub(crate) fn indices(self) -> Vec<usize> {
        (0..=OWN_BITS).filter(|&index| self.contains(index)).collect()
    }

    /// The members, in the scene's order.
    pub fn of(self, torques: &[Torque]) -> Vec<Torque> {
        torques
            .iter()
            .enumerate()
            .filter(|(index, _)| self.contains(*index))
            .map(|(_, torque)| torque.clone())
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::torque::Parameter;
    use crate::torque::variable_inertia::{InertiaChange, Law};

    #[test]
    fn what_is_looked_at_beforehand_is_what_acts_on_each_body() {
        let strength = |zero: usize| (0..4).map(|body| if body == zero { 0.0 } else { 0.1 }).collect::<Vec<f64>>();
        let amplitude = |zero: usize| strength(zero).into_iter().map(|x| DVec3::X * x).collect::<Vec<DVec3>>();
        let torques = [
            Torque::constant_body(DVec3::ZERO),
            Torque::constant_body(DVec3::Y),
            Torque::constant_body(amplitude(2)),
            Torque::linear_drag(strength(1)),
            Torque::linear_drag(strength(9)),
            Torque::sinusoidal(amplitude(2), amplitude(9), 1.0),
            Torque::sinusoidal(amplitude(2), DVec3::ZERO, 1.0),
            Torque::variable_inertia(
                InertiaChange::Factor(Parameter::from(vec![0.5, 1.0, 1.0, 0.5])),
                Law::Ramp { start: Parameter::Shared(1.0), duration: Parameter::Shared(2.0) },
            ),
        ];
        let acting = ActingTorques::of(&torques);
        assert_eq!((acting.always.indices(), acting.others.len()), (vec![1, 4, 5], 5));
        for body in 0..4 {
            assert_eq!(acting.on(body), TorqueSet::acting_on(&torques, body), "body {body}");
        }
    }
}
