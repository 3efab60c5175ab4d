//! Working memory for states of laws.

use std::cell::RefCell;

thread_local! {
    /// Rows that nobody uses.
    static ROWS: RefCell<Vec<Vec<f64>>> = const { RefCell::new(Vec::new()) };
}

/// Calls `use_copy` with a copy of a state. Each thread keeps the memory; calls may be nested.
pub(super) fn with_copy<R>(state: &[f64], use_copy: impl FnOnce(&mut [f64]) -> R) -> R {
    if state.is_empty() {
        return use_copy(&mut []);
    }
    let mut row = ROWS.with_borrow_mut(|rows| rows.pop().unwrap_or_default());
    row.clear();
    row.extend_from_slice(state);
    let result = use_copy(&mut row);
    ROWS.with_borrow_mut(|rows| rows.push(row));
    result
}
