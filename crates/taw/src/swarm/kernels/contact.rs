//! Contacts of pairs in the full tier, eight at a time: restitution, warm start, solve and relax.
//! The constraint itself is in [`crate::constraint`].

use super::backing::borne_by_wall;
pub(in crate::swarm) use super::columns::SolverColumns;
use super::impacts::note_impacts;
use super::meeting::{PairMeeting, meeting};
use super::numbers::Numbers;
use super::params::{Pass, SolverParams};
use super::rolling::RollingInertia;
use super::{
    ALL, ContactImpulses, StruckContact, effective_mass, gather, inverse_mass,
    normal_and_separation, scatter, tipping,
};
use crate::constraint::{ContactImpulse, FrictionCone, Softness};
use crate::math::{Kernel, LANES, RealVector, Scalar, Simd, SimdLevel, Vec3Wide};
use crate::response::Impact;
use crate::swarm::batches::Batch;

/// The part of an overlap that goes in a substep: where two neighbours of a ball both push it on,
/// it goes no further than it should.
const PUSH: f64 = 0.5;
/// Largest distance of such a push, over the smaller radius. One that is farther turns the normals of
/// other contacts before they take back what pushed the balls apart, and so leaves speed behind.
const MAX_PUSH: f64 = 0.25;

/// Mark of a ball that presses another one in this step and that no wall bears: neither flies.
const TOUCHING: f64 = 0.5;

/// One pass over the pairs for their impulses.
///
/// `BACKED` if it is known who has a wall behind it, `OWN` if pairs have numbers of their own, and then
/// `LOCKED` if some have locked axes: each of the six is compiled alone.
struct Solve<'a, S, const BACKED: bool, const OWN: bool, const LOCKED: bool> {
    pub pass: Pass<S>,
    pub columns: SolverColumns<'a, S>,
    pub batches: &'a [Batch],
    pub impulses: &'a mut ContactImpulses<S>,
    pub friction: S,
}

/// Goes over the pairs of some batches.
pub(in crate::swarm) fn solve<S: Scalar>(
    simd_level: SimdLevel,
    pass: Pass<S>,
    columns: SolverColumns<S>,
    batches: &[Batch],
    impulses: &mut ContactImpulses<S>,
    friction: S,
) {
    macro_rules! run {
        ($backed:literal, $own:literal, $locked:literal) => {
            simd_level.run(Solve::<S, $backed, $own, $locked> {
                pass,
                columns,
                batches,
                impulses,
                friction,
            })
        };
    }
    let is_locked = columns.free_axes.len() > 0;
    match (columns.backed(), !impulses.numbers.is_empty(), is_locked) {
        (false, false, _) => run!(false, false, false),
        (false, true, false) => run!(false, true, false),
        (false, true, true) => run!(false, true, true),
        (true, false, _) => run!(true, false, false),
        (true, true, false) => run!(true, true, false),
        (true, true, true) => run!(true, true, true),
    }
}

impl<S: Scalar, const BACKED: bool, const OWN: bool, const LOCKED: bool> Kernel<S>
    for Solve<'_, S, BACKED, OWN, LOCKED>
{
    #[inline(always)]
    fn run<L: Simd<Scalar = S>>(self) {
        match self.pass {
            Pass::Restitution(params) => self.restitution::<L>(params),
            Pass::WarmStart(params) => self.warm_start::<L>(params),
            Pass::Solve(params) => self.solve::<L, true>(params),
            Pass::Relax(params) => self.solve::<L, false>(params),
        }
    }
}

impl<S: Scalar> SolverColumns<'_, S> {
    /// Applies an impulse to both balls of the pairs, with these factors of inertia.
    #[inline(always)]
    fn apply_impulse<L: Simd<Scalar = S>, const BACKED: bool, const LOCKED: bool>(
        &self,
        batch: &Batch,
        [a, b]: [[L; 4]; 2],
        [spin_a, spin_b]: [[L; 4]; 2],
        normal: Vec3Wide<L>,
        change: ContactImpulse<L, Vec3Wide<L>>,
        [factor_a, factor_b]: [L; 2],
    ) {
        let (mass_a, mass_b) = (inverse_mass(&a), inverse_mass(&b));
        let impulse = change.along(normal);
        // The column holds radius times spin.
        let turn = normal.cross(change.tangent);
        let spin = [
            (Vec3Wide::of(&spin_a) - turn * (factor_a * mass_a)).with(spin_a[3]),
            (Vec3Wide::of(&spin_b) - turn * (factor_b * mass_b)).with(spin_b[3]),
        ];
        scatter(self.spin, batch, spin);
        let none = Vec3Wide([L::constant(0.0); 3]);
        let [mut by_a, mut by_b] = [none - impulse, impulse];
        if BACKED {
            let [back_a, back_b] = gather::<L>(self.backing, batch);
            let [speed_a, speed_b] = self.backing_speeds(batch);
            let (borne_a, borne_b);
            (by_a, borne_a) = borne_by_wall(by_a, &a, &back_a, speed_a);
            (by_b, borne_b) = borne_by_wall(by_b, &b, &back_b, speed_b);
            scatter(self.backing, batch, [borne_a, borne_b]);
        }
        if LOCKED {
            [by_a, by_b] = self.free_parts(batch, [by_a, by_b]);
        }
        let velocity = [
            (Vec3Wide::of(&a) + by_a * mass_a).with(a[3]),
            (Vec3Wide::of(&b) + by_b * mass_b).with(b[3]),
        ];
        scatter(self.velocity, batch, velocity);
    }

    /// Counts how far the balls of the pairs went.
    #[inline(always)]
    fn spend<L: Simd<Scalar = S>>(&self, batch: &Batch, displacements: [Vec3Wide<L>; 2]) {
        let mut lengths = [[S::zero(); LANES]; 2];
        for (lengths, displacement) in lengths.iter_mut().zip(displacements) {
            displacement.dot(displacement).sqrt().store(lengths);
        }
        for lane in 0..batch.count as usize {
            for (row, lengths) in batch.pair(lane).into_iter().zip(&lengths) {
                // SAFETY: as in `scatter`.
                unsafe { *self.skin_left.row(row as usize) -= lengths[lane] };
            }
        }
    }

    /// Lets those pairs bounce that meet. Says whether any does.
    #[inline(always)]
    fn apply_restitution<L: Simd<Scalar = S>, const OWN: bool, const LOCKED: bool>(
        &self,
        batch: &Batch,
        params: &SolverParams<S>,
        numbers: &Numbers<L>,
        ([at_a, at_b], [a, b]): ([[L; 4]; 2], [[L; 4]; 2]),
        impacts: &mut Vec<Impact<S>>,
    ) -> bool {
        let zero = L::constant(0.0);
        let PairMeeting { normal, approach_speed, time } =
            meeting(params, [&at_a, &at_b], [&a, &b]);
        let tipping = tipping::tip(batch, params, normal, approach_speed);
        // What does not bounce is stopped by its contact.
        let approach_speed = if OWN {
            numbers.restitution.select_gt(zero, approach_speed, zero)
        } else {
            approach_speed
        };
        let bounces = approach_speed.gt_mask(zero) != 0;
        if !bounces && tipping.is_none() {
            return false;
        }
        let point = Vec3Wide::of(&at_a) + Vec3Wide::of(&a) * time + normal * at_a[3];
        let [pushed_a, pushed_b] = self.pushed::<L, LOCKED>(batch, &[a, b], normal);
        let mass = effective_mass(&pushed_a, &pushed_b);
        let (spins, factors) = (self.spins(batch), numbers.inertia_factors);
        let (one, none) = (L::constant(1.0), Vec3Wide([zero; 3]));
        let restitution = tipping.map_or(numbers.restitution, |tipping| {
            tipping::restitution(tipping, numbers.restitution)
        });
        let whole =
            ContactImpulse { normal: mass * approach_speed * (one + restitution), tangent: none };
        let (mut ends, mut left) = ([a, b], whole.normal);
        if LOCKED {
            // Along a lock it changes the slip too: both at once would add energy.
            self.apply_impulse::<L, false, true>(batch, ends, spins, normal, whole, factors);
            (ends, left) = (gather::<L>(self.velocity, batch), zero);
        }
        let relative = Vec3Wide::of(&ends[1]) - Vec3Wide::of(&ends[0]);
        let slip = slip(relative, normal, &spins);
        let stopping = slip * (zero - numbers.tangent_mass::<OWN>(mass, [&a, &b]));
        let tangent = stopping * (one + numbers.tangential_restitution);
        let mut impulse =
            FrictionCone::new(numbers.friction).clamp(ContactImpulse { tangent, ..whole });
        if let Some(tipping) = tipping {
            impulse.tangent = impulse.tangent + tipping * mass;
        }
        if params.notes_impacts {
            let vectors = [normal, point, slip, impulse.along(normal)];
            note_impacts(impacts, batch, approach_speed, vectors);
        }
        let rest = ContactImpulse { normal: left, ..impulse };
        self.apply_impulse::<L, false, LOCKED>(batch, ends, spins, normal, rest, factors);
        bounces
    }

    /// Moves apart what overlaps. That changes no velocity: overlap is not energy. Returns true if any pair
    /// is jammed: it overlaps, and its contact had to take back more speed than [`SolverParams::jam_speed`].
    #[inline(always)]
    fn push_apart<L: Simd<Scalar = S>>(
        &self,
        batch: &Batch,
        [at_a, at_b]: [[L; 4]; 2],
        [a, b]: [[L; 4]; 2],
        (normal, separation): (Vec3Wide<L>, L),
        params: &SolverParams<S>,
        (grounded, change): (L, L),
    ) -> bool {
        let zero = L::constant(0.0);
        let smaller = at_a[3] + at_b[3] - at_a[3].max(at_b[3]);
        let overlap = zero - separation - smaller * L::splat(S::from_f64(2.0) * params.slop);
        if overlap.gt_mask(zero) == 0 {
            return false;
        }
        let [free_a, free_b] = [inverse_mass(&a), inverse_mass(&b)];
        let taken_back = zero - change * (free_a + free_b);
        let stirred = taken_back.select_gt(L::splat(params.jam_speed), overlap, zero);
        let jammed = stirred.gt_mask(zero) != 0;
        if !params.moves_apart {
            return jammed;
        }
        // What flies keeps its center of mass. What a wall bears goes half each, whatever they
        // weigh: a light ball that a heavy one presses on something has nowhere to go. What sleeps
        // stays.
        let most = smaller * L::constant(MAX_PUSH);
        let push = overlap.max(zero) * L::constant(PUSH);
        let (one, push) = (L::constant(1.0), most.select_gt(push, push, most));
        let borne = grounded.select_gt(L::constant(TOUCHING), one, zero);
        let a = free_a.select_gt(zero, borne.select_gt(zero, one, free_a), zero);
        let b = free_b.select_gt(zero, borne.select_gt(zero, one, free_b), zero);
        let by = (a + b).select_gt(zero, push / (a + b), zero);
        let displacements = [normal * (by * a), normal * (by * b)];
        let places = [
            (Vec3Wide::of(&at_a) - displacements[0]).with(at_a[3]),
            (Vec3Wide::of(&at_b) + displacements[1]).with(at_b[3]),
        ];
        scatter(self.at, batch, places);
        self.spend(batch, displacements);
        jammed
    }

    /// The spins of a batch.
    #[inline(always)]
    pub(super) fn spins<L: Simd<Scalar = S>>(&self, batch: &Batch) -> [[L; 4]; 2] {
        gather(self.spin, batch)
    }
}

impl<S: Scalar, const BACKED: bool, const OWN: bool, const LOCKED: bool>
    Solve<'_, S, BACKED, OWN, LOCKED>
{
    #[inline(always)]
    fn restitution<L: Simd<Scalar = S>>(self, params: SolverParams<S>) {
        let Self { columns, batches, impulses, friction, .. } = self;
        if !OWN && params.restitution == S::zero() {
            return; // contacts stop what meets
        }
        for (i, batch) in awake(batches) {
            let at = gather::<L>(columns.at, batch);
            let velocity = gather::<L>(columns.velocity, batch);
            let numbers =
                Numbers::<L>::load::<OWN>(&impulses.numbers, i, friction, params.restitution);
            let (rows, impacts) = ((at, velocity), &mut impulses.impacts);
            impulses.bounced |= columns
                .apply_restitution::<L, OWN, LOCKED>(batch, &params, &numbers, rows, impacts);
        }
    }

    #[inline(always)]
    fn warm_start<L: Simd<Scalar = S>>(self, params: SolverParams<S>) {
        let Self { columns, batches, impulses, friction, .. } = self;
        let ContactImpulses { normal_impulse, tangent_impulse, torque, numbers: own, .. } =
            impulses;
        for (i, batch) in awake(batches) {
            let [a, b] = gather::<L>(columns.at, batch);
            let (normal, _) = normal_and_separation(&a, &b, ALL, |lane| batch.pair(lane));
            // It was across the normal of the last substep.
            let mut impulse = load::<L>(&normal_impulse[i], &tangent_impulse[i]);
            impulse.tangent = impulse.tangent.reject_from(normal);
            let (velocity, spin) = (gather::<L>(columns.velocity, batch), columns.spins(batch));
            if BACKED {
                let [back_a, back_b] = gather::<L>(columns.backing, batch);
                let (zero, one) = (L::constant(0.0), L::constant(1.0));
                let lost = zero.select_gt(back_a[3], one, zero);
                let kept = zero.select_gt(back_b[3], zero, one - lost);
                // Nor does it bear as much once it presses the ball along the wall: it parts them
                // no faster than an overlap is pushed out.
                let [a, b] = &columns.pushed::<L, LOCKED>(batch, &velocity, normal);
                let (alone, load) =
                    (effective_mass(a, b), columns.backing_of(batch, [a, b], normal).load);
                let most = load * L::splat(params.softness.max_push_speed);
                let over = (impulse.normal - most).max(zero);
                impulse.normal = (impulse.normal - load.select_gt(alone, over, zero)) * kept;
                impulse.normal.store(&mut normal_impulse[i]);
                impulse.tangent = impulse.tangent * kept;
            }
            impulse.tangent.store(&mut tangent_impulse[i]);
            let numbers = Numbers::<L>::load::<OWN>(own, i, friction, params.restitution);
            let factors = numbers.inertia_factors;
            columns.apply_impulse::<L, BACKED, LOCKED>(
                batch, velocity, spin, normal, impulse, factors,
            );
            if OWN {
                let [a, b] = gather::<L>(columns.at, batch);
                let inertia = RollingInertia::new([&a, &b], &velocity, factors);
                columns.apply_angular_impulse(batch, &inertia, Vec3Wide::load(&torque[i]));
            }
        }
    }

    #[inline(always)]
    fn solve<L: Simd<Scalar = S>, const FIRST: bool>(self, params: SolverParams<S>) {
        let Self { columns, batches, impulses, friction, .. } = self;
        let ContactImpulses { normal_impulse, tangent_impulse, torque, .. } = impulses;
        let (own, struck, jammed) = (&impulses.numbers, &mut impulses.struck, &mut impulses.jammed);
        let zero = L::constant(0.0);
        for (i, batch) in awake(batches) {
            let numbers = Numbers::<L>::load::<OWN>(own, i, friction, params.restitution);
            let at = gather::<L>(columns.at, batch);
            let (normal, separation) =
                normal_and_separation(&at[0], &at[1], ALL, |lane| batch.pair(lane));
            let mut impulse = load::<L>(&normal_impulse[i], &tangent_impulse[i]);
            let [a, b] = gather::<L>(columns.velocity, batch);
            let relative = Vec3Wide::of(&b) - Vec3Wide::of(&a);
            let parting = relative.dot(normal);
            let velocity = [&a, &b];
            let (places, before) = ([&at[0], &at[1]], impulse.normal);
            let gap = [separation, parting];
            let fresh = numbers.fresh::<FIRST>(&params, places, velocity, before, gap);
            let mut spins: [[L; 4]; 2] = columns.spins(batch);
            let grounded = spins[0][3].max(spins[1][3]);
            if BACKED {
                StruckContact::note(struck, &params, parting, (i, &normal_impulse[i]));
            }
            let [pushed_a, pushed_b] = columns.pushed::<L, LOCKED>(batch, &[a, b], normal);
            let alone = effective_mass(&pushed_a, &pushed_b);
            let (target, softness) = target::<S, L, FIRST>(&params, separation, grounded);
            let slower = parting - target;
            let excess = if BACKED {
                let pushed = [&pushed_a, &pushed_b];
                columns.backing_of(batch, pushed, normal).impulse(alone, slower)
            } else {
                alone * slower
            };
            let wanted = ContactImpulse {
                normal: fresh.select_gt(zero, zero, zero - excess),
                tangent: slip(relative, normal, &spins)
                    * (zero - numbers.tangent_mass::<OWN>(alone, velocity)),
            };
            let change = impulse.solve(wanted, softness, &FrictionCone::new(numbers.friction));
            impulse.normal.store(&mut normal_impulse[i]);
            impulse.tangent.store(&mut tangent_impulse[i]);
            let (struck_by, speeds) = ((before, change), (parting, alone));
            let change = tipping::lean(batch, &params, normal, struck_by, speeds);
            for spin in &mut spins {
                spin[3] =
                    impulse.normal.select_gt(zero, grounded.max(L::constant(TOUCHING)), spin[3]);
            }
            let (rows, factors) = ([a, b], numbers.inertia_factors);
            columns.apply_impulse::<L, BACKED, LOCKED>(batch, rows, spins, normal, change, factors);
            if OWN {
                let (inertia, load) = (RollingInertia::new(places, &rows, factors), impulse.normal);
                columns.solve_rolling(batch, &inertia, normal, load, &own[i], &mut torque[i]);
            }
            if !FIRST {
                let (contact, mark) = ((normal, separation), (grounded, change.normal));
                *jammed |= columns.push_apart(batch, at, rows, contact, &params, mark);
            }
        }
    }
}

/// Target velocity of pairs along their normal, and the softness of the first solve.
#[inline(always)]
fn target<S: Scalar, L: Simd<Scalar = S>, const FIRST: bool>(
    params: &SolverParams<S>,
    separation: L,
    grounded: L,
) -> (L, Option<Softness<L>>) {
    let per_second = L::splat(S::one() / params.time);
    let gap = separation.max(L::constant(0.0));
    if !FIRST {
        return (L::constant(0.0) - gap * per_second, None);
    }
    // What nothing bears is moved apart without speed.
    let loaded = grounded.select_gt(L::constant(TOUCHING), separation, gap);
    let (target, softness) = params.softness.at(loaded, per_second);
    (target, Some(softness))
}

/// The accumulated impulses of a batch.
#[inline(always)]
fn load<L: Simd>(
    normal: &[L::Scalar; LANES],
    tangent: &[[L::Scalar; LANES]; 3],
) -> ContactImpulse<L, Vec3Wide<L>> {
    ContactImpulse { normal: L::load(normal), tangent: Vec3Wide::load(tangent) }
}

/// Velocity at which the surfaces of two balls slide over each other.
#[inline(always)]
fn slip<L: Simd>(relative: Vec3Wide<L>, normal: Vec3Wide<L>, [a, b]: &[[L; 4]; 2]) -> Vec3Wide<L> {
    let spin = Vec3Wide::of(a) + Vec3Wide::of(b);
    relative.reject_from(normal) - spin.cross(normal)
}

/// Batches with a ball that is awake, with their numbers.
#[inline(always)]
fn awake(batches: &[Batch]) -> impl Iterator<Item = (usize, &Batch)> {
    batches.iter().enumerate().filter(|(_, batch)| !batch.is_idle)
}
