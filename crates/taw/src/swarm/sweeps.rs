//! Balls that go further in a step than skins reach: which others they may meet on their paths.
//!
//! Two spheres on straight paths meet where the segment between their centers, as it moves, comes as
//! near to the origin as both radii: the closed form of Ericson, 2005, "Real-Time Collision
//! Detection", 5.5.5. What all balls have in common, gravity, is left out of it.

use super::bit_set::BitSet;
use super::grid::SortedGrid;
use super::rows::dot;
use crate::math::{Row, Scalar};

/// Part of its path by which a ball may go further, since rounding and gravity take some.
const MARGIN: f64 = 1.01;
/// Bins across the second axis at most.
const BINS: f64 = 1024.0;

/// Paths of balls in a step.
#[derive(Clone, Copy)]
pub(super) struct BallPaths<'a, S> {
    /// Center and radius.
    pub at: &'a [Row<S>],
    pub velocity: &'a [Row<S>],
    /// Remaining skin, in metres.
    pub skin_left: &'a [S],
    /// Length of the step, in seconds.
    pub dt: S,
    /// Skins reach so far, in metres: balls with a wider one are swift.
    pub reach: S,
    /// Distance that balls come off their paths, in metres.
    pub slack: S,
}

impl<S: Scalar> BallPaths<'_, S> {
    /// Returns true if a ball goes further than skins reach.
    #[inline]
    pub fn is_swift(&self, row: u32) -> bool {
        self.skin_left[row as usize] > self.reach
    }

    /// Skin of a ball of this velocity that may be swift, in metres.
    pub fn skin_of_path(velocity: &Row<S>, dt: S) -> S {
        super::kernels::squared(*velocity).sqrt() * dt * S::from_f64(MARGIN)
    }

    /// Path of a swift ball, none for others, which stay within their skins.
    fn path(&self, row: u32) -> [S; 3] {
        let [x, y, z, _] = self.velocity[row as usize];
        if self.is_swift(row) {
            [x, y, z].map(|speed| speed * self.dt * S::from_f64(MARGIN))
        } else {
            [S::zero(); 3]
        }
    }

    /// Distance that a ball may be off its path, in metres.
    fn slack_of(&self, row: u32) -> S {
        if self.is_swift(row) { self.slack } else { self.skin_left[row as usize].max(S::zero()) }
    }

    /// Returns true if two balls may meet on their paths.
    pub fn meet(&self, a: u32, b: u32) -> bool {
        let (from, to) = (&self.at[a as usize], &self.at[b as usize]);
        let reach = from[3] + to[3] + self.slack_of(a) + self.slack_of(b);
        let (by_a, by_b) = (self.path(a), self.path(b));
        let apart = [0, 1, 2].map(|axis| to[axis] - from[axis]);
        comes_near(apart, [0, 1, 2].map(|axis| by_b[axis] - by_a[axis]), reach)
    }

    /// Lists balls along the path of a swift one, each once and in order: all that are within `more`
    /// metres of what it touches.
    pub fn visit_path(&self, row: u32, grid: &SortedGrid<S>, more: S, beside: &mut Vec<u32>) {
        beside.clear();
        let (at, path) = (self.at[row as usize], self.path(row));
        let length = dot(&path, &path).sqrt();
        for level in &grid.levels {
            let pieces = (length / level.width()).ceil().max(S::one());
            let far = S::from_f64(0.5) * length / pieces + at[3] + self.slack + more;
            // Where that is less work than to look at all.
            if pieces * S::from_f64(27.0) > S::from_f64(self.at.len() as f64) {
                beside.clear();
                beside.extend(0..self.at.len() as u32);
                return;
            }
            for piece in 0..pieces.floor_to_u32() {
                let part = (S::from_f64(f64::from(piece)) + S::from_f64(0.5)) / pieces;
                let [x, y, z] = [0, 1, 2].map(|axis| at[axis] + path[axis] * part);
                grid.for_each_run(level, &[x, y, z, S::zero()], far, |rows| beside.extend(rows));
            }
        }
        beside.sort_unstable();
        beside.dedup();
    }
}

/// Returns true if a point that begins there and goes along such a path comes as near to the origin.
fn comes_near<S: Scalar>(begin: [S; 3], path: [S; 3], reach: S) -> bool {
    let square = dot(&path, &path);
    let time = if square > S::zero() {
        (-dot(&begin, &path) / square).clamp(S::zero(), S::one())
    } else {
        S::zero()
    };
    let nearest = [0, 1, 2].map(|axis| begin[axis] + path[axis] * time);
    dot(&nearest, &nearest) < reach * reach
}

/// Scratch of the search.
#[derive(Clone, Debug, Default)]
pub(super) struct Crowd<S> {
    paths: Vec<[S; 3]>,
    /// Balls that leave the skin in the step.
    swift: BitSet,
    entries: Vec<Entry<S>>,
}

impl<S: Scalar> Crowd<S> {
    pub fn bytes(&self) -> usize {
        self.paths.capacity() * size_of::<[S; 3]>()
            + self.swift.bytes()
            + self.entries.capacity() * size_of::<Entry<S>>()
    }
}

/// Box about the path of a ball, in one bin.
#[derive(Clone, Copy, Debug)]
struct Entry<S> {
    bin: u32,
    row: u32,
    /// Its lowest and highest coordinate along the first axis, in metres.
    low: S,
    high: S,
}

/// Search for pairs that meet beyond the reach of skins, where many balls are that fast: sort and
/// sweep along the longest side of the scene, in bins along the second.
pub(super) struct CrowdSweep<'a, S> {
    pub at: &'a [Row<S>],
    pub velocity: &'a [Row<S>],
    pub dt: S,
    /// Remaining skin of each ball, in metres: two whose skins overlap are known already.
    pub skin_left: &'a [S],
    /// Common skin, in metres.
    pub skin: S,
    /// Distance that balls come off their paths, in metres.
    pub slack: S,
    pub axes: [usize; 3],
}

impl<S: Scalar> CrowdSweep<'_, S> {
    /// Finds the pairs that may meet in the step and are not known, in order: at least one of them
    /// goes further than `skin`.
    pub fn find(&self, scratch: &mut Crowd<S>, pairs: &mut Vec<[u32; 2]>) {
        pairs.clear();
        let goes_far = |velocity: &Row<S>| BallPaths::skin_of_path(velocity, self.dt) > self.skin;
        if !self.velocity.iter().any(goes_far) {
            return;
        }
        let Crowd { paths, swift, entries } = scratch;
        self.find_paths(paths, swift);
        self.fill_bins(paths, entries);
        for (i, a) in entries.iter().enumerate() {
            let reaches = |b: &&Entry<S>| b.bin == a.bin && b.low <= a.high;
            for b in entries[i + 1..].iter().take_while(reaches) {
                if (swift.contains(a.row) || swift.contains(b.row)) && self.meet(paths, a, b) {
                    pairs.push([a.row.min(b.row), a.row.max(b.row)]);
                }
            }
        }
        pairs.sort_unstable();
        pairs.dedup();
    }

    /// Finds the path of each ball, less what all have in common, since that brings none together;
    /// and which balls leave the skin.
    fn find_paths(&self, paths: &mut Vec<[S; 3]>, swift: &mut BitSet) {
        let count = self.at.len().max(1) as f64;
        let sum = |axis: usize| self.velocity.iter().map(|v| v[axis].as_f64()).sum::<f64>();
        let common = [0, 1, 2].map(|axis| S::from_f64(sum(axis) / count));
        swift.clear();
        paths.clear();
        for (row, velocity) in (0..).zip(self.velocity) {
            if BallPaths::skin_of_path(velocity, self.dt) > self.skin {
                swift.insert(row);
            }
            paths.push(
                [0, 1, 2]
                    .map(|axis| (velocity[axis] - common[axis]) * self.dt * S::from_f64(MARGIN)),
            );
        }
    }

    /// Puts boxes about the paths into bins, in order.
    fn fill_bins(&self, paths: &[[S; 3]], entries: &mut Vec<Entry<S>>) {
        let extent = |row: usize, axis: usize| {
            let (at, path) = (&self.at[row], paths[row][axis]);
            let (x, reach) = (at[axis], at[3] + self.slack);
            [x + path.min(S::zero()) - reach, x + path.max(S::zero()) + reach]
        };
        let [first, second, _] = self.axes;
        let (mut low, mut high, mut sum) = (S::max_value(), S::min_value(), S::zero());
        for [from, to] in (0..paths.len()).map(|row| extent(row, second)) {
            (low, high, sum) = (low.min(from), high.max(to), sum + (to - from));
        }
        // Twice as wide as the boxes, on average.
        let width = (S::from_f64(2.0) * sum / S::from_f64(paths.len() as f64))
            .max((high - low) / S::from_f64(BINS));
        let bin = |x: S| ((x - low) / width).clamp(S::zero(), S::from_f64(BINS)).floor_to_u32();
        entries.clear();
        for row in 0..paths.len() {
            let [from, to] = extent(row, second).map(bin);
            let [low, high] = extent(row, first);
            entries.extend((from..=to).map(|bin| Entry { bin, row: row as u32, low, high }));
        }
        entries.sort_unstable_by(|a, b| {
            a.bin.cmp(&b.bin).then(a.low.total_cmp(&b.low)).then(a.row.cmp(&b.row))
        });
    }

    fn meet(&self, paths: &[[S; 3]], a: &Entry<S>, b: &Entry<S>) -> bool {
        let (a, b) = (a.row as usize, b.row as usize);
        let apart = [0, 1, 2].map(|axis| self.at[b][axis] - self.at[a][axis]);
        let by = [0, 1, 2].map(|axis| paths[b][axis] - paths[a][axis]);
        let radii = self.at[a][3] + self.at[b][3];
        let known = radii + self.skin_left[a].max(S::zero()) + self.skin_left[b].max(S::zero());
        comes_near(apart, by, radii + S::from_f64(2.0) * self.slack)
            && dot(&apart, &apart) >= known * known
    }
}
