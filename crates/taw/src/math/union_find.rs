//! Disjoint sets (union-find).

/// Disjoint sets of rows that pairs connect.
#[derive(Clone, Debug, Default)]
pub(crate) struct UnionFind {
    /// Parent of each row in its tree.
    parent: Vec<u32>,
    /// Set of each row that is a root; `u32::MAX` for none yet.
    set_of_root: Vec<u32>,
    count: u32,
}

impl UnionFind {
    /// Joins the rows of all pairs (Tarjan 1975).
    pub fn build(&mut self, pairs: impl Iterator<Item = (Option<usize>, usize)>, rows: usize) {
        self.reset(rows);
        for (a, b) in pairs {
            let Some(a) = a else { continue };
            self.join(a, b);
        }
    }

    /// Puts each row into a set of its own.
    pub fn reset(&mut self, rows: usize) {
        self.parent.clear();
        self.parent.extend(0..rows as u32);
        self.set_of_root.clear();
        self.set_of_root.resize(rows, u32::MAX);
        self.count = 0;
    }

    /// Joins the sets of two rows, before sets are numbered.
    pub fn join(&mut self, a: usize, b: usize) {
        let (root_a, root_b) = (self.root(a), self.root(b));
        self.parent[root_a.max(root_b)] = root_a.min(root_b) as u32;
    }

    /// Index of a row's set, in the order of the calls.
    pub fn set_of(&mut self, row: usize) -> u32 {
        let root = self.root(row);
        if self.set_of_root[root] == u32::MAX {
            self.set_of_root[root] = self.count;
            self.count += 1;
        }
        self.set_of_root[root]
    }

    /// Bytes that it has from the allocator.
    pub fn bytes(&self) -> usize {
        (self.parent.capacity() + self.set_of_root.capacity()) * size_of::<u32>()
    }

    /// Index of a row's set, if it has one.
    pub fn known_set_of(&mut self, row: usize) -> Option<u32> {
        let root = self.root(row);
        Some(self.set_of_root[root]).filter(|set| *set != u32::MAX)
    }

    /// Root of a row's tree, with path halving.
    fn root(&mut self, row: usize) -> usize {
        let mut row = row as u32;
        while self.parent[row as usize] != row {
            let parent = self.parent[row as usize];
            self.parent[row as usize] = self.parent[parent as usize];
            row = parent;
        }
        row as usize
    }
}
