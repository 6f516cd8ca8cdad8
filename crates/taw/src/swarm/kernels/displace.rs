//! Overlap moved apart in the lab's tier.

use super::{ALL, gather, normal_and_separation, scatter};
use crate::math::{Kernel, LANES, Row, Scalar, Simd, Vec3Wide};
use crate::swarm::batches::Batch;
use crate::swarm::neighbours::NeighbourLists;
use crate::swarm::walls::HalfSpace;
use crate::workers::DisjointSlice;

/// Moves overlapping balls apart, half each.
pub(in crate::swarm) struct Displace<'a, S> {
    pub at: DisjointSlice<'a, Row<S>>,
    pub batches: &'a [Batch],
}

impl<S: Scalar> Kernel<S> for Displace<'_, S> {
    #[inline(always)]
    fn run<L: Simd<Scalar = S>>(self) {
        for batch in self.batches {
            let [a, b] = gather::<L>(self.at, batch);
            let (normal, overlap) = normal_and_overlap(&a, &b, ALL, |lane| batch.pair(lane));
            let by = normal * (overlap * L::constant(0.5));
            let moved = [(Vec3Wide::of(&a) - by).with(a[3]), (Vec3Wide::of(&b) + by).with(b[3])];
            scatter(self.at, batch, moved);
        }
    }
}

/// The normal from the first to the second ball, and how far they overlap.
#[inline(always)]
fn normal_and_overlap<L: Simd>(
    a: &[L; 4],
    b: &[L; 4],
    lanes: u32,
    pair: impl Fn(usize) -> [u32; 2],
) -> (Vec3Wide<L>, L) {
    let (normal, separation) = normal_and_separation(a, b, lanes, pair);
    let zero = L::constant(0.0);
    (normal, (zero - separation).max(zero))
}

/// Moves overlapping balls of neighbour lists apart: each ball and up to eight others at a time.
pub(in crate::swarm) struct DisplaceNeighbours<'a, S> {
    pub at: DisjointSlice<'a, Row<S>>,
    pub lists: NeighbourLists<'a>,
}

/// Which part of an overlap each of two balls moves, by how many overlap the first one: where
/// these are moved together, they would move too far.
const PART: [f64; LANES + 1] = [0.5, 0.5, 0.42, 0.38, 0.36, 0.36, 0.36, 0.36, 0.36];

/// All bits of the first places, by how many these are.
static FIRST: [[u16; LANES]; LANES + 1] = {
    let mut masks = [[0; LANES]; LANES + 1];
    let mut count = 0;
    while count <= LANES {
        let mut place = 0;
        while place < count {
            masks[count][place] = u16::MAX;
            place += 1;
        }
        count += 1;
    }
    masks
};

impl<S: Scalar> Kernel<S> for DisplaceNeighbours<'_, S> {
    #[inline(always)]
    fn run<L: Simd<Scalar = S>>(self) {
        let NeighbourLists { first, rows, list: mut rest } = self.lists;
        for row in first..first + rows {
            let mut left = usize::from(rest[0]);
            rest = &rest[1..];
            if left == 0 {
                continue;
            }
            let ball = self.at.row(row as usize);
            // SAFETY: no other thread has this row and those of its neighbour list (see `Chunk`).
            let mut own = unsafe { *ball };
            while left > 0 {
                let count = left.min(LANES);
                let mut end = [0; LANES];
                let eight = rest.first_chunk().unwrap_or_else(|| {
                    end[..count].copy_from_slice(&rest[..count]);
                    &end
                });
                // The places that are left over name the ball itself: what is written there is
                // written over below.
                let mut after = FIRST[count];
                for (after, other) in after.iter_mut().zip(eight) {
                    *after &= other;
                }
                let a = [L::splat(own[0]), L::splat(own[1]), L::splat(own[2]), L::splat(own[3])];
                // SAFETY: as above; no row but its own is twice in a neighbour list.
                unsafe {
                    let b = L::gather(ball, &after);
                    let pair = |lane: usize| [row, row + u32::from(after[lane])];
                    let (normal, overlap) = normal_and_overlap(&a, &b, (1 << count) - 1, pair);
                    let overlap = overlap.mask_first(count);
                    let hits = overlap.gt_mask(L::constant(0.0)).count_ones();
                    let by = normal * (overlap * L::constant(PART[hits as usize]));
                    L::scatter(ball, &after, LANES, (Vec3Wide::of(&b) + by).with(b[3]));
                    let Vec3Wide([x, y, z]) = by;
                    own = [own[0] - x.sum(), own[1] - y.sum(), own[2] - z.sum(), own[3]];
                }
                (left, rest) = (left - count, &rest[count..]);
            }
            // SAFETY: as above.
            unsafe { *ball = own };
        }
    }
}

/// Moves balls out of half-spaces.
pub(in crate::swarm) struct DisplaceFromPlanes<'a, S> {
    pub at: &'a mut [Row<S>],
    pub planes: &'a [HalfSpace<S>],
}

impl<S: Scalar> Kernel<S> for DisplaceFromPlanes<'_, S> {
    #[inline(always)]
    fn run<L: Simd<Scalar = S>>(self) {
        let zero = L::constant(0.0);
        for rows in self.at.chunks_mut(LANES) {
            let (base, count) = (rows.as_mut_ptr(), rows.len());
            let places = [0, 1, 2, 3, 4, 5, 6, 7].map(|place: u16| place.min(count as u16 - 1));
            // SAFETY: these rows are here, and each is named once among the first ones.
            unsafe {
                let [mut x, mut y, mut z, radius] = L::gather(base, &places);
                let mut out = 0;
                for HalfSpace { normal, offset, .. } in self.planes {
                    let (nx, ny, nz) = (L::splat(normal.x), L::splat(normal.y), L::splat(normal.z));
                    let separation = nx * x + ny * y + nz * z - L::splat(*offset) - radius;
                    out |= zero.gt_mask(separation);
                    let by = (zero - separation).max(zero);
                    (x, y, z) = (x + nx * by, y + ny * by, z + nz * by);
                }
                if out != 0 {
                    L::scatter(base, &places, count, [x, y, z, radius]);
                }
            }
        }
    }
}
