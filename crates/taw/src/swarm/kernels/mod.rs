//! Work of a step on rows and on pairs, eight at a time.

use super::batches::Batch;
use super::impulse_cache::{reserve_slack, shrink_slack};
use super::surfaces::{PairNumbers, SurfaceOf};
use crate::math::{LANES, Row, Scalar, Simd, Vec3Wide};
use crate::response::Impact;
use crate::workers::DisjointSlice;

mod backing;
mod columns;
mod contact;
mod displace;
mod impacts;
mod integrate;
mod locks;
mod meeting;
mod near;
mod numbers;
mod params;
mod rolling;
mod sinking;
mod tipping;

pub(super) use backing::LOST;
pub(super) use contact::{SolverColumns, solve};
pub(super) use displace::{Displace, DisplaceFromPlanes, DisplaceNeighbours};
pub(super) use integrate::{
    IntegratePositions, MAX_MAGNITUDE, Predict, UpdateVelocities, largest, squared,
};
pub(crate) use near::NearLimits;
pub(super) use near::NearPairs;
pub(super) use params::{GROUNDED, Pass, SolverParams, WALL_SLOP};
pub(super) use sinking::{FindSinking, Sinking};

/// Accumulated impulses of batches of pairs, batch by batch; none in the lab's tier.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct ContactImpulses<S> {
    /// Normal impulses, in N s.
    pub normal_impulse: Vec<[S; LANES]>,
    /// Tangent impulses (friction), in N s.
    pub tangent_impulse: Vec<[[S; LANES]; 3]>,
    /// Angular impulses against rolling and spinning, in N m s, and the numbers of each pair: both
    /// only where surfaces differ or resist.
    pub torque: Vec<[[S; LANES]; 3]>,
    pub numbers: Vec<PairNumbers<S>>,
    /// Set if any of them bounced in the last round.
    pub bounced: bool,
    /// Set if any of them is jammed: see [`Swarm::relax`](super::Swarm::relax).
    pub jammed: bool,
    /// Impacts of the last round, if they are noted: of rows.
    pub impacts: Vec<Impact<S>>,
    /// Those that were struck, or solved in a cluster, in this substep.
    pub struck: Vec<StruckContact<S>>,
}

/// Contact whose balls came together fast in a substep: faster than gravity makes balls at rest in two
/// steps, so only where there is gravity; or that was
/// [unconverged](super::Swarm::solve_unconverged).
///
/// The impulse that stops them is no load: applied again in the next substep, it would throw them
/// apart. Of balls that weigh about as much, contacts take it back; a light one between heavy ones
/// takes back only what moves itself.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct StruckContact<S> {
    batch: u32,
    lane: u32,
    /// Normal impulse before, in N s.
    load: S,
}

impl<S: Scalar> StruckContact<S> {
    /// Contact of a batch and lane, with its normal impulse before.
    pub fn new([batch, lane]: [u32; 2], load: S) -> Self {
        Self { batch, lane, load }
    }

    /// Notes the pairs of a batch that come together fast, and their normal impulses before.
    #[inline(always)]
    fn note<L: Simd<Scalar = S>>(
        struck: &mut Vec<Self>,
        params: &SolverParams<S>,
        parting: L,
        (batch, load): (usize, &[S; LANES]),
    ) {
        let threshold = params.restitution_threshold;
        let fast = (L::constant(0.0) - parting).gt_mask(L::splat(threshold));
        if fast != 0 && threshold > S::zero() {
            Self::add(struck, batch, fast, load);
        }
    }

    /// Adds lanes of a batch, as bits, and their normal impulses.
    #[cold]
    fn add(struck: &mut Vec<Self>, batch: usize, lanes: u32, load: &[S; LANES]) {
        let lanes = load.iter().zip(0..).filter(|(_, lane)| lanes & 1 << lane != 0);
        struck.extend(lanes.map(|(load, lane)| Self { batch: batch as u32, lane, load: *load }));
    }
}

impl<S: Scalar> ContactImpulses<S> {
    pub fn bytes(&self) -> usize {
        self.normal_impulse.capacity() * size_of::<[S; LANES]>()
            + (self.tangent_impulse.capacity() + self.torque.capacity())
                * size_of::<[[S; LANES]; 3]>()
            + self.numbers.capacity() * size_of::<PairNumbers<S>>()
            + self.struck.capacity() * size_of::<StruckContact<S>>()
            + self.impacts.capacity() * size_of::<Impact<S>>()
    }

    /// Forgets impulses that are no finite numbers.
    pub fn forget_non_finite(&mut self) {
        let all = self.normal_impulse.as_flattened_mut().iter_mut();
        let all = all.chain(self.tangent_impulse.as_flattened_mut().as_flattened_mut());
        let all = all.chain(self.torque.as_flattened_mut().as_flattened_mut());
        all.filter(|x| !x.is_finite()).for_each(|x| *x = S::zero());
        self.struck.retain(|struck| struck.load.is_finite());
        self.impacts.retain(|impact| impact.approach_speed.is_finite());
    }

    /// Forgets the impulses that stopped balls, but not the loads.
    pub fn forget_impacts(&mut self) {
        for StruckContact { batch, lane, load } in self.struck.drain(..) {
            let (batch, lane) = (batch as usize, lane as usize);
            let normal_impulse = &mut self.normal_impulse[batch][lane];
            if load < *normal_impulse {
                for axis in &mut self.tangent_impulse[batch] {
                    axis[lane] *= load / *normal_impulse;
                }
                *normal_impulse = load;
            }
        }
    }

    /// As many as there are batches, and none bears anything.
    pub fn reset(&mut self, batches: usize) {
        fn reset<T: Clone>(column: &mut Vec<T>, batches: usize, none: T) {
            column.clear();
            reserve_slack(column, batches);
            column.resize(batches, none);
            shrink_slack(column);
        }
        self.struck.clear();
        reset(&mut self.normal_impulse, batches, [S::zero(); LANES]);
        reset(&mut self.tangent_impulse, batches, [[S::zero(); LANES]; 3]);
    }

    /// Sets the numbers of each pair, where they have some.
    pub fn set_numbers(&mut self, batches: &[Batch], surfaces: SurfaceOf<S>) {
        surfaces.of_pairs(batches, &mut self.numbers);
        self.torque.clear();
        self.torque.resize(self.numbers.len(), [[S::zero(); LANES]; 3]);
    }
}

/// All lanes, as bits.
const ALL: u32 = (1 << LANES) - 1;

/// The normal from the first to the second ball, and the separation between them. Only those of the
/// named lanes, as bits, are pairs of two balls.
#[inline(always)]
fn normal_and_separation<S: Scalar, L: Simd<Scalar = S>>(
    a: &[L; 4],
    b: &[L; 4],
    lanes: u32,
    pair: impl Fn(usize) -> [u32; 2],
) -> (Vec3Wide<L>, L) {
    let (zero, one) = (L::constant(0.0), L::constant(1.0));
    let least = L::splat(S::min_positive_value());
    let displacement = Vec3Wide::of(b) - Vec3Wide::of(a);
    let squared = displacement.dot(displacement);
    let distance = squared.sqrt();
    // Root and quotient do not wait for each other.
    let inverse = squared.select_gt(least, distance * (one / squared), zero);
    let mut normal = displacement * inverse;
    if least.gt_mask(squared) & lanes != 0 {
        // Where the centers coincide, any direction is as good as another; with the same for all,
        // those at one point would come into a line.
        let mut any = [[S::zero(); LANES]; 3];
        for lane in 0..LANES {
            let direction = direction(pair(lane));
            for (axis, x) in any.iter_mut().zip(direction) {
                axis[lane] = x;
            }
        }
        let (Vec3Wide([x, y, z]), Vec3Wide([u, v, w])) = (normal, Vec3Wide::load(&any));
        // (Not by `map`, which is compiled without the instructions of its caller.)
        normal = Vec3Wide([
            squared.select_gt(least, x, u),
            squared.select_gt(least, y, v),
            squared.select_gt(least, z, w),
        ]);
    }
    (normal, distance - (a[3] + b[3]))
}

/// A direction for each pair of rows, spread over the sphere.
#[cold]
fn direction<S: Scalar>([a, b]: [u32; 2]) -> [S; 3] {
    let mixed = (a ^ b.rotate_left(16)).wrapping_mul(0x9e37_79b1);
    let mixed = (mixed ^ mixed >> 15).wrapping_mul(0x85eb_ca77);
    let part =
        |shift: u32| (S::from_f64(f64::from(mixed >> shift & 0x3ff) - 511.5)) / S::from_f64(511.5);
    let [x, y, z] = [part(0), part(11), part(22)];
    // No part is zero.
    let length = (x * x + y * y + z * z).sqrt();
    [x / length, y / length, z / length]
}

/// The rows of a column that the pairs of a batch are about.
#[inline(always)]
fn gather<L: Simd>(column: DisjointSlice<Row<L::Scalar>>, batch: &Batch) -> [[L; 4]; 2] {
    // SAFETY: no other thread has these rows (see `Chunk`).
    unsafe { gather_from(column.row(0), batch) }
}

/// The rows of a column that the pairs of a batch are about.
///
/// # Safety
/// They exist, and no other thread writes them.
#[inline(always)]
unsafe fn gather_from<L: Simd>(column: *const Row<L::Scalar>, batch: &Batch) -> [[L; 4]; 2] {
    let a = column.wrapping_add(batch.first[0] as usize);
    let b = column.wrapping_add(batch.first[1] as usize);
    // SAFETY: as the caller promises.
    unsafe { [L::gather(a, &batch.a), L::gather(b, &batch.b)] }
}

/// Writes back what was gathered.
#[inline(always)]
fn scatter<L: Simd>(
    column: DisjointSlice<Row<L::Scalar>>,
    batch: &Batch,
    [of_a, of_b]: [[L; 4]; 2],
) {
    let a = column.row(batch.first[0] as usize);
    let b = column.row(batch.first[1] as usize);
    let count = batch.count as usize;
    // SAFETY: as in `gather`, and no row is twice in a batch.
    unsafe {
        L::scatter(a, &batch.a, count, of_a);
        L::scatter(b, &batch.b, count, of_b);
    }
}

/// The inverse mass of awake balls: those of balls asleep have a minus sign.
#[inline(always)]
fn inverse_mass<L: Simd>(velocity: &[L; 4]) -> L {
    velocity[3].max(L::constant(0.0))
}

/// Effective mass of both along their normal; zero if both are asleep.
#[inline(always)]
fn effective_mass<L: Simd>(a: &[L; 4], b: &[L; 4]) -> L {
    let sum = inverse_mass(a) + inverse_mass(b);
    let zero = L::constant(0.0);
    sum.select_gt(zero, L::constant(1.0) / sum, zero)
}
