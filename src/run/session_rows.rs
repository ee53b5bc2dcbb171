//! Which row of a session has the body in which row of its group.

use std::ops::Range;

use crate::engine::reduction::BlockRows;

/// The rows of a session beside those of its group, which have the order in which states are read.
#[derive(Debug)]
pub(super) struct SessionRows {
    /// The number of the group's rows.
    count: usize,
    /// The session's row of each of the group's rows at the start, if the session has an order of its own.
    order: Option<Vec<u32>>,
    /// The group's rows in pieces that are ordered separately, so that outputs are assembled piece by piece in bounded
    /// memory; none without an order.
    pieces: Vec<Range<usize>>,
    /// The rows that the session still has after others were left out, as they were at the start, ascending; `None`
    /// while it has all.
    kept: Option<Vec<u32>>,
}

impl SessionRows {
    /// Rows in the group's own order.
    pub fn new(count: usize) -> Self {
        Self { count, order: None, pieces: Vec::new(), kept: None }
    }

    /// Rows in the order that `order` gives; a row is in the same of the `pieces` in both orders.
    pub fn ordered(order: Vec<u32>, pieces: Vec<Range<usize>>) -> Self {
        Self { count: order.len(), order: Some(order), pieces, kept: None }
    }

    /// The number of rows that the session has.
    pub fn count(&self) -> usize {
        self.kept.as_ref().map_or(self.count, Vec::len)
    }

    /// Whether the session has all rows.
    pub fn is_all(&self) -> bool {
        self.kept.is_none()
    }

    /// Whether the session has an order of its own.
    pub fn is_ordered(&self) -> bool {
        self.order.is_some()
    }

    /// The session's row at the start of one of the group's.
    pub fn at_start(&self, row: usize) -> usize {
        self.order.as_ref().map_or(row, |order| order[row] as usize)
    }

    /// The row at the start of one of the session's: the group's row, if the session has no order of its own.
    pub fn kept(&self, session_row: usize) -> usize {
        self.kept.as_ref().map_or(session_row, |kept| kept[session_row] as usize)
    }

    /// The session's row of one of the group's, if the session still has it.
    pub fn session_row(&self, row: usize) -> Option<usize> {
        let row = self.at_start(row);
        self.kept.as_ref().map_or(Some(row), |kept| kept.binary_search(&(row as u32)).ok())
    }

    /// Those of some of the group's rows that the session still has, each with the session's row.
    pub fn pairs(&self, rows: Range<usize>) -> Vec<(usize, usize)> {
        match self.order {
            None => self.session_rows(&rows).map(|own| (self.kept(own), own)).collect(),
            Some(_) => rows.filter_map(|row| Some((row, self.session_row(row)?))).collect(),
        }
    }

    /// The rows that are read with the first of some of the group's: its piece, or all of them if the session has the
    /// group's order.
    pub fn piece(&self, rows: &Range<usize>) -> Range<usize> {
        let number = self.pieces.partition_point(|piece| piece.end <= rows.start);
        self.pieces.get(number).unwrap_or(rows).clone()
    }

    /// The session's rows of a [`SessionRows::piece`], as far as the session still has them.
    pub fn session_rows(&self, piece: &Range<usize>) -> Range<usize> {
        let Some(kept) = &self.kept else { return piece.clone() };
        let place = |row: usize| kept.partition_point(|&other| (other as usize) < row);
        place(piece.start)..place(piece.end)
    }

    /// The session's rows that remain when those of the group's for which `stands` is true are left out; `None` if all
    /// remain. Even a single row is left out, so that the steps taken do not depend on how many bodies are computed
    /// together.
    pub fn moving(&self, stands: &dyn Fn(usize) -> bool) -> Option<Vec<usize>> {
        let mut standing = vec![false; self.count];
        (0..self.count).for_each(|row| standing[self.at_start(row)] = stands(row));
        let moving: Vec<usize> = (0..self.count()).filter(|&row| !standing[self.kept(row)]).collect();
        (moving.len() < self.count()).then_some(moving)
    }

    /// Keeps only these of the session's rows.
    pub fn keep(&mut self, session_rows: &[usize]) {
        self.kept = Some(session_rows.iter().map(|&row| self.kept(row) as u32).collect());
    }

    /// The session's rows at the start by blocks that end before these of the group's rows.
    pub fn blocks(&self, ends: Vec<usize>) -> BlockRows {
        BlockRows::new(ends, self.order.clone())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_are_found_after_others_were_left_out_twice() {
        let mut rows = SessionRows::new(10);
        assert_eq!(
            (rows.count(), rows.kept(7), rows.session_row(7), rows.session_rows(&(2..5))),
            (10, 7, Some(7), 2..5)
        );
        let moving = rows.moving(&|row| row % 2 == 1).expect("half of them stand");
        rows.keep(&moving);
        assert_eq!((rows.count(), rows.kept(3), rows.session_row(6), rows.session_row(7)), (5, 6, Some(3), None));
        assert_eq!((rows.session_rows(&(3..9)), rows.pairs(3..9)), (2..5, vec![(4, 2), (6, 3), (8, 4)]));
        let moving = rows.moving(&|row| row < 4).expect("two of five stand");
        rows.keep(&moving);
        assert_eq!((rows.count(), rows.kept(0), rows.session_rows(&(0..10))), (3, 4, 0..3));
    }

    #[test]
    fn rows_of_a_session_with_an_order_of_its_own_are_found_in_their_piece() {
        let mut rows = SessionRows::ordered(vec![2, 0, 1, 4, 3], vec![0..3, 3..5]);
        assert_eq!((rows.piece(&(1..2)), rows.piece(&(3..4))), (0..3, 3..5));
        assert_eq!((rows.session_row(0), rows.session_row(4)), (Some(2), Some(3)));
        // The session's row 0 is left out, so the others of its piece are one lower.
        let moving = rows.moving(&|row| row == 1).expect("one stands");
        assert_eq!(moving, [1, 2, 3, 4]);
        rows.keep(&moving);
        assert_eq!((rows.session_rows(&(0..3)), rows.pairs(0..5)), (0..2, vec![(0, 1), (2, 0), (3, 3), (4, 2)]));
    }

    #[test]
    fn one_row_is_left_out_and_none_where_all_move() {
        let rows = SessionRows::new(1000);
        assert_eq!(rows.moving(&|_| false), None);
        assert!(rows.moving(&|row| row == 3).is_some_and(|moving| moving.len() == 999));
        assert_eq!(SessionRows::new(2).moving(&|_| true), Some(vec![]));
    }
}
