//! Puts operations into the order of execution, and places their rows.

use super::super::{DirectionState, Fading, Jets, MOST_ORDER, Operation, Place, RowNumber, TurningState};
use super::{Draft, Lowered};

/// The greatest number of operations below each row.
pub(super) fn heights(drafts: &[Draft], rows: usize) -> Vec<usize> {
    let mut heights = vec![0_usize; rows];
    // A shared operation may come before those that form its operands; no row needs more rounds than there are operations.
    for _ in 0..=drafts.len() {
        let mut has_changed = false;
        for draft in drafts {
            let (written, read) = draft.rows.split_at(draft.writes);
            let height = read.iter().map(|row| heights[*row as usize] + 1).max().unwrap_or(1);
            for row in written {
                has_changed |= heights[*row as usize] != height;
                heights[*row as usize] = height;
            }
        }
        if !has_changed {
            break;
        }
    }
    heights
}

impl Lowered {
    /// Series of the states up to this order.
    pub fn up_to(&self, order: usize) -> Jets {
        assert!(order <= MOST_ORDER, "{order} is more than the highest order");
        let mut room = 0;
        let rows: Vec<Place> = self
            .rows
            .iter()
            .map(|row| {
                let base = room;
                room += if row.is_kept { order + 1 } else { 1 };
                Place { base: base as u32, stride: u32::from(row.is_kept) }
            })
            .collect();
        let mut jets = Jets {
            order,
            operations: vec![],
            runs: vec![],
            rows: vec![],
            factor_numbers: vec![],
            room,
            factors: self.factors.clone(),
            given: self.given.iter().map(|(input, row)| (*input, rows[*row as usize])).collect(),
            outputs: self.outputs.iter().map(|row| rows[*row as usize]).collect(),
            switches: self.switches.iter().map(|row| rows[*row as usize]).collect(),
            roots: self.roots.iter().map(|[_, argument]| rows[*argument as usize]).collect(),
            fading: self.fading.iter().map(|fading| fading.placed(&rows)).collect(),
            directions: self.directions.iter().map(|direction| direction.placed(&rows)).collect(),
        };
        for draft in self.sorted() {
            let (draft, (factors, constant)) = (&self.drafts[draft], &self.numbers[draft]);
            let factor = jets.factor_numbers.len();
            jets.factor_numbers.extend(factors.iter().chain(constant));
            let constant = constant.map(|_| factor + factors.len());
            let (first, count) = (jets.rows.len(), draft.rows.len());
            jets.rows.extend(draft.rows.iter().map(|row| rows[*row as usize]));
            jets.operations.push(Operation { kind: draft.kind, first, count, factor, constant });
            match jets.runs.last_mut() {
                Some((kind, count)) if *kind == draft.kind => *count += 1,
                _ => jets.runs.push((draft.kind, 1)),
            }
        }
        jets
    }

    /// The drafts by height, and within one height by kind; those that only the next order reads come last.
    fn sorted(&self) -> Vec<usize> {
        let heights = heights(&self.drafts, self.rows.len());
        let height = |draft: &Draft| match draft.writes {
            0 => usize::MAX,
            _ => heights[draft.rows[0] as usize],
        };
        let mut order: Vec<usize> = (0..self.drafts.len()).collect();
        order.sort_by_key(|&draft| (height(&self.drafts[draft]), self.drafts[draft].kind));
        order
    }
}

impl Fading<RowNumber> {
    fn placed(&self, places: &[Place]) -> Fading<Place> {
        let of = |row: RowNumber| places[row as usize];
        Fading { power: of(self.power), levels: self.levels.map(of) }
    }
}

impl DirectionState<RowNumber> {
    fn placed(&self, places: &[Place]) -> DirectionState<Place> {
        let of = |rows: [RowNumber; 3]| rows.map(|row| places[row as usize]);
        let turning = self.turning.map(|turning| {
            let TurningState { rows, world, angle } = turning;
            TurningState { rows: of(rows), world, angle }
        });
        DirectionState { rows: of(self.rows), world: self.world, turning }
    }
}
