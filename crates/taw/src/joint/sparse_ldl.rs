//! Sparse factorization `A = L D Lᵀ` of a symmetric matrix, row by row (Davis, *Algorithm 849: a concise sparse
//! Cholesky factorization package*, 2005).

/// Fraction of a diagonal entry below which its pivot is rounding: the row depends on others before it.
const DEPENDENT: f64 = 1e-10;
/// Parent of a root of the elimination tree.
const NONE: u32 = u32::MAX;

/// Entry of the upper triangle: its row and column, and where its value is.
#[derive(Clone, Copy, Debug)]
struct MatrixEntry {
    row: u32,
    value: u32,
}

/// Matrix of a fixed pattern, and its factors.
#[derive(Clone, Debug, Default)]
pub(super) struct SparseLdl {
    /// Row of the matrix at each place of the elimination, and the place of each row.
    order: Vec<u32>,
    place: Vec<u32>,
    /// Upper triangle by columns, in the order of elimination, without the diagonal.
    columns: Vec<Vec<MatrixEntry>>,
    /// Elimination tree, and the number of entries of each column of `L`.
    parent: Vec<u32>,
    begin: Vec<usize>,
    filled: Vec<usize>,
    rows: Vec<u32>,
    lower: Vec<f64>,
    pivots: Vec<f64>,
    /// Scratch buffers.
    sums: Vec<f64>,
    flags: Vec<u32>,
}

impl SparseLdl {
    /// Analyses a matrix by its order of elimination and the pairs of rows with an entry, each once.
    pub fn analyze(&mut self, order: Vec<u32>, pairs: &[[u32; 2]]) {
        let n = order.len();
        self.place = vec![0; n];
        for (place, row) in (0..).zip(&order) {
            self.place[*row as usize] = place;
        }
        self.order = order;
        self.columns = vec![Vec::new(); n];
        for (value, [a, b]) in (0..).zip(pairs) {
            let [a, b] = [self.place[*a as usize], self.place[*b as usize]];
            self.columns[a.max(b) as usize].push(MatrixEntry { row: a.min(b), value });
        }
        self.parent = vec![NONE; n];
        self.flags = vec![NONE; n];
        let mut counts = vec![0; n];
        for column in 0..n as u32 {
            self.flags[column as usize] = column;
            for entry in &self.columns[column as usize] {
                let mut row = entry.row as usize;
                while self.flags[row] != column {
                    if self.parent[row] == NONE {
                        self.parent[row] = column;
                    }
                    counts[row] += 1;
                    self.flags[row] = column;
                    row = self.parent[row] as usize;
                }
            }
        }
        self.begin.clear();
        let mut end = 0;
        for count in counts {
            self.begin.push(end);
            end += count;
        }
        (self.rows, self.lower) = (vec![0; end], vec![0.0; end]);
        (self.filled, self.pivots, self.sums) = (vec![0; n], vec![0.0; n], vec![0.0; n]);
    }

    /// Factorizes the matrix with this diagonal, by row, and these values of its pairs. A row that depends
    /// on others, up to rounding, counts as not there.
    pub fn factorize(&mut self, diagonal: &[f64], values: &[f64]) {
        self.flags.fill(NONE);
        self.filled.fill(0);
        let mut pattern = Vec::new();
        for column in 0..self.order.len() {
            pattern.clear();
            self.flags[column] = column as u32;
            for MatrixEntry { row, value } in &self.columns[column] {
                self.sums[*row as usize] += values[*value as usize];
                let mut row = *row;
                while self.flags[row as usize] != column as u32 {
                    pattern.push(row);
                    self.flags[row as usize] = column as u32;
                    row = self.parent[row as usize];
                }
            }
            // Parents come after their children.
            pattern.sort_unstable();
            let entry = diagonal[self.order[column] as usize];
            let mut pivot = entry;
            for row in pattern.iter().map(|row| *row as usize) {
                let sum = std::mem::take(&mut self.sums[row]);
                let (begin, end) = (self.begin[row], self.begin[row] + self.filled[row]);
                for (below, lower) in self.rows[begin..end].iter().zip(&self.lower[begin..end]) {
                    self.sums[*below as usize] -= lower * sum;
                }
                let lower = sum / self.pivots[row];
                pivot -= lower * sum;
                (self.rows[end], self.lower[end]) = (column as u32, lower);
                self.filled[row] += 1;
            }
            self.sums[column] = 0.0;
            let is_free = pivot > entry * DEPENDENT;
            self.pivots[column] = if is_free { pivot } else { f64::INFINITY };
        }
    }

    /// Solves `A x = b`, in place; `x` is zero for rows that depend on others.
    pub fn solve(&mut self, b: &mut [f64]) {
        let x = &mut self.sums;
        for (x, row) in x.iter_mut().zip(&self.order) {
            *x = b[*row as usize];
        }
        let n = self.order.len();
        let column = |at: usize| self.begin[at]..self.begin[at] + self.filled[at];
        for at in 0..n {
            for k in column(at) {
                x[self.rows[k] as usize] -= self.lower[k] * x[at];
            }
        }
        for at in (0..n).rev() {
            let mut sum = x[at] / self.pivots[at];
            for k in column(at) {
                sum -= self.lower[k] * x[self.rows[k] as usize];
            }
            x[at] = if self.pivots[at].is_finite() { sum } else { 0.0 };
        }
        for (x, row) in x.iter_mut().zip(&self.order) {
            b[*row as usize] = std::mem::take(x);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// `A = J Jᵀ + D` with a random sparse `J`: the residual of the solution is rounding.
        #[test]
        fn a_random_sparse_system_is_solved(
            links in prop::collection::vec((0_u32..12, 0_u32..12, -1.0_f64..1.0), 0..30),
            wanted in prop::collection::vec(-1.0_f64..1.0, 12),
            order in Just((0..12).collect::<Vec<u32>>()).prop_shuffle(),
        ) {
            let mut dense = [[0.0; 12]; 12];
            for (i, row) in dense.iter_mut().enumerate() {
                row[i] = 0.1;
            }
            for (a, b, x) in links.into_iter().filter(|(a, b, _)| a != b) {
                let (a, b) = (a as usize, b as usize);
                dense[a][a] += x.abs();
                dense[b][b] += x.abs();
                dense[a][b] += x;
                dense[b][a] += x;
            }
            let mut pairs = Vec::new();
            let mut values = Vec::new();
            for a in 0..12 {
                for b in (a + 1..12).filter(|b| dense[a as usize][*b as usize] != 0.0) {
                    pairs.push([a, b]);
                    values.push(dense[a as usize][b as usize]);
                }
            }
            let diagonal: Vec<_> = (0..12).map(|i| dense[i][i]).collect();
            let mut ldl = SparseLdl::default();
            ldl.analyze(order, &pairs);
            let mut x = wanted.clone();
            for _ in 0..2 {
                x.clone_from(&wanted);
                ldl.factorize(&diagonal, &values);
                ldl.solve(&mut x);
            }
            for (row, wanted) in dense.iter().zip(&wanted) {
                let sum: f64 = row.iter().zip(&x).map(|(a, x)| a * x).sum();
                prop_assert!((sum - wanted).abs() < 1e-9, "{sum} {wanted}");
            }
        }
    }

    #[test]
    fn a_row_that_repeats_another_one_bears_nothing() {
        let mut ldl = SparseLdl::default();
        ldl.analyze(vec![0, 1], &[[0, 1]]);
        ldl.factorize(&[2.0, 2.0], &[2.0]);
        let mut x = [3.0, 3.0];
        ldl.solve(&mut x);
        assert_eq!(x, [1.5, 0.0]);
    }
}
