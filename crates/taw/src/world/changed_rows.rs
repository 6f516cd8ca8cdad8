//! Rows of marbles that were set since a solver last read them.

use crate::swarm::SyncToken;
use crate::uncompared::Uncompared;

/// Rows that were set; all while the token is unset.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct ChangedRows {
    token: SyncToken,
    /// In any order, some more than once.
    rows: Uncompared<Vec<u32>>,
}

impl ChangedRows {
    /// Adds a row, given how many there are.
    pub fn add(&mut self, row: usize, rows: usize) {
        if !self.token.is_set() {
            return;
        }
        if self.rows.0.len() > rows / 2 {
            self.add_all();
        } else {
            self.rows.0.push(row as u32);
        }
    }

    /// Adds all rows.
    pub fn add_all(&mut self) {
        self.token = SyncToken::default();
        self.rows.0.clear();
    }

    /// Returns true if only listed rows differ from those of the solver with this token.
    pub fn agrees(&self, token: &SyncToken) -> bool {
        self.token.agrees(token)
    }

    /// Empties the list: none has changed for the solver with this token.
    pub fn reset(&mut self, token: SyncToken) {
        self.token = token;
        self.rows.0.clear();
    }

    /// The listed rows.
    pub fn rows(&self) -> &[u32] {
        &self.rows.0
    }

    /// Takes the listed rows out.
    pub fn take(&mut self) -> Vec<u32> {
        std::mem::take(&mut self.rows.0)
    }

    /// Gives the memory of a list back.
    pub fn recycle(&mut self, mut rows: Vec<u32>) {
        rows.clear();
        self.rows.0 = rows;
    }
}
