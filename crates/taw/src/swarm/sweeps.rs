//! Balls that go further in a step than skins reach: which others they may meet on their paths.
//!
//! Two spheres on straight paths meet where the segment between their centers, as it moves, comes as
//! near to the origin as both radii: the closed form of Ericson, 2005, "Real-Time Collision
//! Detection", 5.5.5. What all balls have in common, gravity, is left out of it.

use super::bit_set::BitSet;
use super::grid::Grid;
use super::simd::Row;

/// Part of its path by which a ball may go further, since rounding and gravity take some.
const MARGIN: f32 = 1.01;
/// Bins across the second axis at most.
const BINS: f32 = 1024.0;

/// Paths of balls in a step.
#[derive(Clone, Copy)]
pub(super) struct Sweep<'a> {
    /// Center and radius.
    pub at: &'a [Row],
    pub velocity: &'a [Row],
    /// Remaining skin, in metres.
    pub skin_left: &'a [f32],
    /// Length of the step, in seconds.
    pub dt: f32,
    /// Skins reach so far, in metres: balls with a wider one are swift.
    pub reach: f32,
    /// Distance that balls come off their paths, in metres.
    pub slack: f32,
}

impl Sweep<'_> {
    /// Returns true if a ball goes further than skins reach.
    #[inline]
    pub fn is_swift(&self, row: u32) -> bool {
        self.skin_left[row as usize] > self.reach
    }

    /// Skin of a ball of this velocity that may be swift, in metres.
    pub fn skin_of_path(velocity: &Row, dt: f32) -> f32 {
        super::kernels::squared(*velocity).sqrt() * dt * MARGIN
    }

    /// Path of a swift ball, none for others, which stay within their skins.
    fn path(&self, row: u32) -> [f32; 3] {
        let [x, y, z, _] = self.velocity[row as usize];
        if self.is_swift(row) { [x, y, z].map(|speed| speed * self.dt * MARGIN) } else { [0.0; 3] }
    }

    /// Distance that a ball may be off its path, in metres.
    fn slack_of(&self, row: u32) -> f32 {
        if self.is_swift(row) { self.slack } else { self.skin_left[row as usize].max(0.0) }
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
    pub fn visit_path(&self, row: u32, grid: &Grid, more: f32, beside: &mut Vec<u32>) {
        beside.clear();
        let (at, path) = (self.at[row as usize], self.path(row));
        let length = dot(path, path).sqrt();
        for level in &grid.levels {
            let pieces = (length / level.width()).ceil().max(1.0);
            let far = 0.5 * length / pieces + at[3] + self.slack + more;
            // Where that is less work than to look at all.
            if pieces * 27.0 > self.at.len() as f32 {
                beside.clear();
                beside.extend(0..self.at.len() as u32);
                return;
            }
            for piece in 0..pieces as u32 {
                let part = (piece as f32 + 0.5) / pieces;
                let [x, y, z] = [0, 1, 2].map(|axis| at[axis] + path[axis] * part);
                grid.for_each_run(level, &[x, y, z, 0.0], far, |rows| beside.extend(rows));
            }
        }
        beside.sort_unstable();
        beside.dedup();
    }
}

fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Returns true if a point that begins there and goes along such a path comes as near to the origin.
fn comes_near(begin: [f32; 3], path: [f32; 3], reach: f32) -> bool {
    let square = dot(path, path);
    let time = if square > 0.0 { (-dot(begin, path) / square).clamp(0.0, 1.0) } else { 0.0 };
    let nearest = [0, 1, 2].map(|axis| begin[axis] + path[axis] * time);
    dot(nearest, nearest) < reach * reach
}

/// Scratch of the search.
#[derive(Clone, Debug, Default)]
pub(super) struct Crowd {
    paths: Vec<[f32; 3]>,
    /// Balls that leave the skin in the step.
    swift: BitSet,
    entries: Vec<Entry>,
}

impl Crowd {
    pub fn bytes(&self) -> usize {
        self.paths.capacity() * size_of::<[f32; 3]>()
            + self.swift.bytes()
            + self.entries.capacity() * size_of::<Entry>()
    }
}

/// Box about the path of a ball, in one bin.
#[derive(Clone, Copy, Debug)]
struct Entry {
    bin: u32,
    row: u32,
    /// Its lowest and highest coordinate along the first axis, in metres.
    low: f32,
    high: f32,
}

/// Search for pairs that meet beyond the reach of skins, where many balls are that fast: sort and
/// sweep along the longest side of the scene, in bins along the second.
pub(super) struct CrowdSweep<'a> {
    pub at: &'a [Row],
    pub velocity: &'a [Row],
    pub dt: f32,
    /// Remaining skin of each ball, in metres: two whose skins overlap are known already.
    pub skin_left: &'a [f32],
    /// Common skin, in metres.
    pub skin: f32,
    /// Distance that balls come off their paths, in metres.
    pub slack: f32,
    pub axes: [usize; 3],
}

impl CrowdSweep<'_> {
    /// Finds the pairs that may meet in the step and are not known, in order: at least one of them
    /// goes further than `skin`.
    pub fn find(&self, scratch: &mut Crowd, pairs: &mut Vec<[u32; 2]>) {
        pairs.clear();
        let goes_far = |velocity: &Row| Sweep::skin_of_path(velocity, self.dt) > self.skin;
        if !self.velocity.iter().any(goes_far) {
            return;
        }
        let Crowd { paths, swift, entries } = scratch;
        self.find_paths(paths, swift);
        self.fill_bins(paths, entries);
        for (i, a) in entries.iter().enumerate() {
            let reaches = |b: &&Entry| b.bin == a.bin && b.low <= a.high;
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
    fn find_paths(&self, paths: &mut Vec<[f32; 3]>, swift: &mut BitSet) {
        let count = self.at.len().max(1) as f64;
        let sum = |axis: usize| self.velocity.iter().map(|v| f64::from(v[axis])).sum::<f64>();
        let common = [0, 1, 2].map(|axis| (sum(axis) / count) as f32);
        swift.clear();
        paths.clear();
        for (row, velocity) in (0..).zip(self.velocity) {
            if Sweep::skin_of_path(velocity, self.dt) > self.skin {
                swift.insert(row);
            }
            paths.push([0, 1, 2].map(|axis| (velocity[axis] - common[axis]) * self.dt * MARGIN));
        }
    }

    /// Puts boxes about the paths into bins, in order.
    fn fill_bins(&self, paths: &[[f32; 3]], entries: &mut Vec<Entry>) {
        let extent = |row: usize, axis: usize| {
            let (at, path) = (&self.at[row], paths[row][axis]);
            let (x, reach) = (at[axis], at[3] + self.slack);
            [x + path.min(0.0) - reach, x + path.max(0.0) + reach]
        };
        let [first, second, _] = self.axes;
        let (mut low, mut high, mut sum) = (f32::MAX, f32::MIN, 0.0);
        for [from, to] in (0..paths.len()).map(|row| extent(row, second)) {
            (low, high, sum) = (low.min(from), high.max(to), sum + (to - from));
        }
        // Twice as wide as the boxes, on average.
        let width = (2.0 * sum / paths.len() as f32).max((high - low) / BINS);
        let bin = |x: f32| ((x - low) / width).clamp(0.0, BINS) as u32;
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

    fn meet(&self, paths: &[[f32; 3]], a: &Entry, b: &Entry) -> bool {
        let (a, b) = (a.row as usize, b.row as usize);
        let apart = [0, 1, 2].map(|axis| self.at[b][axis] - self.at[a][axis]);
        let by = [0, 1, 2].map(|axis| paths[b][axis] - paths[a][axis]);
        let radii = self.at[a][3] + self.at[b][3];
        let known = radii + self.skin_left[a].max(0.0) + self.skin_left[b].max(0.0);
        comes_near(apart, by, radii + 2.0 * self.slack) && dot(apart, apart) >= known * known
    }
}
