//! The rows of a group that its session still has after others were left out.

use std::ops::Range;

/// The rows of a group that its session has, in their order.
#[derive(Debug, Default)]
pub(super) struct Kept {
    /// Ascending; `None` while it has all.
    rows: Option<Vec<u32>>,
}

impl Kept {
    /// The session's rows, out of the group's `count`, that remain when those for which `stands` is true are left out;
    /// `None` if all remain. Even a single row is left out, so that the steps taken do not depend on how many bodies
    /// are computed together.
    pub fn next(&self, count: usize, stands: impl Fn(usize) -> bool) -> Option<Vec<usize>> {
        let before = self.count(count);
        let moving: Vec<usize> = (0..before).filter(|&row| !stands(self.row(row))).collect();
        (moving.len() < before).then_some(moving)
    }

    /// Keeps only these of a session's rows.
    pub fn keep(&mut self, session_rows: &[usize]) {
        self.rows = Some(session_rows.iter().map(|&row| self.row(row) as u32).collect());
    }

    /// Whether the session has all rows.
    pub fn is_all(&self) -> bool {
        self.rows.is_none()
    }

    /// The number of a session's rows, out of the group's `count`.
    pub fn count(&self, count: usize) -> usize {
        self.rows.as_ref().map_or(count, Vec::len)
    }

    /// The group's row of one of the session's.
    pub fn row(&self, session_row: usize) -> usize {
        self.rows.as_ref().map_or(session_row, |rows| rows[session_row] as usize)
    }

    /// The session's row of one of the group's, if the session still has it.
    pub fn session_row(&self, row: usize) -> Option<usize> {
        self.rows.as_ref().map_or(Some(row), |rows| rows.binary_search(&(row as u32)).ok())
    }

    /// The session's rows for a range of the group's, as far as the session still has them.
    pub fn session_rows(&self, rows: &Range<usize>) -> Range<usize> {
        let Some(kept) = &self.rows else { return rows.clone() };
        let place = |row: usize| kept.partition_point(|&other| (other as usize) < row);
        place(rows.start)..place(rows.end)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_are_found_after_others_were_left_out_twice() {
        let mut kept = Kept::default();
        assert_eq!(
            (kept.count(10), kept.row(7), kept.session_row(7), kept.session_rows(&(2..5))),
            (10, 7, Some(7), 2..5)
        );
        let moving = kept.next(10, |row| row % 2 == 1).expect("half of them stand");
        kept.keep(&moving);
        assert_eq!((kept.count(10), kept.row(3), kept.session_row(6), kept.session_row(7)), (5, 6, Some(3), None));
        assert_eq!(kept.session_rows(&(3..9)), 2..5);
        let moving = kept.next(10, |row| row < 4).expect("two of five stand");
        kept.keep(&moving);
        assert_eq!((kept.count(10), kept.row(0), kept.session_rows(&(0..10))), (3, 4, 0..3));
    }

    #[test]
    fn one_row_is_left_out_and_none_where_all_move() {
        let kept = Kept::default();
        assert_eq!(kept.next(1000, |_| false), None);
        assert!(kept.next(1000, |row| row == 3).is_some_and(|moving| moving.len() == 999));
        assert_eq!(kept.next(2, |_| true), Some(vec![]));
    }
}
