//! Lower bound of the number of pairs that overlap, counted without a search for them.

use super::CollisionLayers;

/// Ball that is counted.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CrowdBall {
    /// Center and radius, in metres.
    pub center: [f64; 3],
    pub radius: f64,
    pub layers: CollisionLayers,
}

/// Count of the pairs that overlap for certain: of radii within a factor of two, in a cell in which
/// all such overlap.
#[derive(Clone, Debug, Default)]
pub(crate) struct Crowding {
    /// Number of balls of all cells with this hash.
    counts: Vec<u32>,
    cells: Vec<CrowdCell>,
}

/// Cell in which all balls of a size overlap.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct CrowdCell {
    /// Exponent of the radii: from 2^size to twice that.
    size: i16,
    /// Cell along each axis.
    cell: [i64; 3],
    /// Memberships and filters.
    layers: [u32; 2],
}

/// Balls for each count: where they are spread, hashes make four pairs of each ball, far less than are
/// too many, and the table takes half a byte for it.
const BALLS_PER_COUNT: usize = 8;

/// Number of pairs among `count` items, n (n − 1) / 2.
pub(crate) fn pairs_among(count: usize) -> u64 {
    let count = count as u64;
    count.saturating_mul(count.saturating_sub(1)) / 2
}

impl Crowding {
    /// Returns the number of pairs that overlap for certain, if that is more than `most`. The iterator
    /// names each ball once.
    pub fn pairs_beyond(
        &mut self,
        most: u64,
        balls: impl Iterator<Item = CrowdBall> + Clone,
    ) -> Option<u64> {
        // Balls of a cell have a hash in common, so no fewer pairs than overlap for certain have. That
        // needs no order, and in all but crowds it is the answer.
        let cells = balls.filter_map(CrowdCell::of);
        let size = (cells.clone().count() / BALLS_PER_COUNT).next_power_of_two().max(2);
        self.counts.clear();
        self.counts.resize(size, 0);
        for cell in cells.clone() {
            self.counts[cell.hash(size)] += 1;
        }
        let sum = |counts: &mut dyn Iterator<Item = usize>| {
            counts.fold(0_u64, |sum, count| sum.saturating_add(pairs_among(count)))
        };
        if sum(&mut self.counts.iter().map(|count| *count as usize)) <= most {
            return None;
        }
        self.cells.clear();
        self.cells.extend(cells);
        self.cells.sort_unstable();
        let pairs = sum(&mut self.cells.chunk_by(|a, b| a == b).map(<[_]>::len));
        (pairs > most).then_some(pairs)
    }
}

impl CrowdCell {
    /// Cell of a ball that collides with such as itself, if numbers have a place for it.
    fn of(ball: CrowdBall) -> Option<Self> {
        /// Integers up to here are exact.
        const EXACT: f64 = (1_u64 << 53) as f64;
        let CrowdBall { center, radius, layers } = ball;
        if !layers.interacts_with(layers) {
            return None;
        }
        let size = radius.log2().floor();
        // The diagonal of a cube of side 1 is less than 2.
        let side = size.exp2();
        let cell = center.map(|at| (at / side).floor());
        cell.iter().all(|at| at.abs() < EXACT).then(|| Self {
            size: size as i16,
            cell: cell.map(|at| at as i64),
            layers: [layers.memberships, layers.filters],
        })
    }

    /// Hash of the cell: a place in a table of this size, a power of two of at least two.
    fn hash(&self, size: usize) -> usize {
        /// Odd, with a random sequence of bits: 2^64 over the golden ratio (Knuth, 1998, *The Art of
        /// Computer Programming*, volume 3, section 6.4).
        const FACTOR: u64 = 0x9e37_79b9_7f4a_7c15;
        let [x, y, z] = self.cell.map(|at| at as u64);
        let layers = self.layers.map(u64::from);
        let mix = |hash: u64, part: u64| (hash.rotate_left(29) ^ part).wrapping_mul(FACTOR);
        let hash = [y, z, layers[0], layers[1], self.size as u64].into_iter().fold(x, mix);
        (hash >> (u64::BITS - size.trailing_zeros())) as usize
    }
}
