//! Bounces and contacts of pairs in the full tier.

use super::{ALL, Pushes, V, gather, mass, mobility, normal_and_gap, scatter};
use crate::swarm::batches::Batch;
use crate::swarm::lanes::{Instructions, Kernel, LANES, Lanes, Row};
use crate::swarm::surfaces::{PairNumbers, SOLID_BALL};
use crate::swarm::team::Shared;

/// Stiffness by which contacts bear what lies on them: overlap makes it part a little, which the
/// pass after that takes back, though not what contacts have learned to bear. What they give back
/// is what damps it: impulses that are applied again and corrected once a substep swing for a long
/// time, and what pushes overlap out meanwhile makes them swing more (Catto, `Solver2D`, 2024: soft
/// contacts).
#[derive(Clone, Copy, Debug)]
pub(in crate::swarm) struct Soft {
    /// The part of an overlap that is to go per second.
    pub rate: f32,
    /// Speed of that at most, in m/s.
    pub fastest: f32,
    /// The part of the impulse that a hard contact would need, and how much of what it has borne
    /// so far it gives back.
    pub mass: f32,
    pub back: f32,
    /// So much of twice the smaller radius two balls may overlap before they are moved apart.
    pub slop: f32,
}

/// So much of its radius a ball may be in a wall: more than what bears a heap gets.
pub(in crate::swarm) const WALL_SLOP: f32 = 0.1;
/// The part of an overlap that goes in a substep: where two neighbours of a ball both push it on,
/// it goes no further than it should.
const PUSH: f32 = 0.5;

/// Mark of a ball that a wall bears in this step, be it through others; one less in the next
/// one, and after that not at all.
pub(in crate::swarm) const GROUNDED: f32 = 2.0;
/// Mark of a ball that presses another one in this step and that no wall bears: neither flies.
const TOUCHING: f32 = 0.5;

/// The columns that several threads work on.
#[derive(Clone, Copy)]
pub(in crate::swarm) struct Columns<'a> {
    /// Center and radius.
    pub at: Shared<'a, Row>,
    /// Velocity and inverse mass.
    pub velocity: Shared<'a, Row>,
    /// Radius times spin, and nothing.
    pub spin: Shared<'a, Row>,
    /// Way that each ball may still go, in metres.
    pub budget: Shared<'a, f32>,
    /// The normal of the wall behind each ball, and the impulse that it bears for those who press
    /// the ball on it, in N s; empty where all weigh about as much.
    ///
    /// A light ball that a heavy one presses on a wall takes a thousandth of its momentum at a
    /// time, if the wall takes it after that. So the wall takes it at once, as if pair and wall
    /// were solved together: the ball is moved only by what goes along the wall, and weighs as much
    /// more along the normal of the pair (the Schur complement of the wall's contact).
    pub backing: Shared<'a, Row>,
}

/// In place of that impulse: the ball has left the wall behind it. What pairs bore with it is more
/// than they bear without.
pub(in crate::swarm) const LOST: f32 = -1.0;

/// Mass that the walls behind two balls add to their pair.
struct Behind<L> {
    /// Effective mass of both along their normal, in kilograms, as long as the walls bear.
    load: L,
    /// Speed at which they leave the walls along it, in m/s: until then, they weigh as they are.
    leaving: L,
    /// Above zero if a wall bears.
    bears: L,
}

impl<L: Lanes> Behind<L> {
    /// The impulse that makes a pair of this mass part by so many m/s more slowly, less than zero
    /// for faster.
    #[inline(always)]
    fn impulse(&self, alone: L, slower: L) -> L {
        let zero = L::splat(0.0);
        let plain = alone * slower;
        let at_wall = slower + self.leaving;
        let pressed = zero - (zero - self.load * at_wall).max(zero - plain);
        let released = self.bears.pick_above(zero, self.load * slower, plain);
        let apart = slower.pick_above(zero, released, plain);
        zero.pick_above(at_wall, pressed, apart)
    }
}

impl Columns<'_> {
    /// Says if it is known who has a wall behind it.
    pub fn backed(&self) -> bool {
        self.backing.len() > 0
    }
}

/// One pass over the pairs for their impulses.
///
/// `BACKED` if it is known who has a wall behind it, `OWN` if pairs have numbers of their own: each
/// of the four is compiled alone.
struct Solve<'a, const BACKED: bool, const OWN: bool> {
    pub pass: Pass,
    pub columns: Columns<'a>,
    pub batches: &'a [Batch],
    pub pushes: &'a mut Pushes,
    pub friction: f32,
}

/// Kind of a pass.
#[derive(Clone, Copy, Debug)]
pub(in crate::swarm) enum Pass {
    /// Lets bounce what meets in a substep and comes together fast enough.
    Impact(Impact),
    /// Applies the impulses of the last substep again.
    Begin(Impact),
    /// Lets nothing come nearer than the gap within a substep.
    Solve(Impact),
    /// Solves once more, after the balls moved, and moves what overlaps apart. What bears nothing
    /// and comes fast is left for the next bounce.
    Relax(Impact),
}

/// Limits and numbers of bounces.
///
/// Bounces come before gravity and contacts, one pair after another, each by the velocities that
/// the ones before it left: an impulse of at most twice what stops a pair adds no energy to it, so
/// none of them does, in whatever order and however many meet at once (Guendelman, Bridson and
/// Fedkiw, 2003, "Nonconvex rigid bodies with stacking"). What contacts remember is
/// left out of it: a bounce comes once.
#[derive(Clone, Copy, Debug)]
pub(in crate::swarm) struct Impact {
    /// Speed below which two that come together are a contact, in m/s.
    pub speed: f32,
    /// The part of the speed that balls have afterwards.
    pub restitution: f32,
    /// Length of a substep in seconds.
    pub time: f32,
    /// In m/s².
    pub gravity: Row,
    /// Stiffness of contacts.
    pub soft: Soft,
}

/// Goes over the pairs of some batches.
pub(in crate::swarm) fn solve(
    instructions: Instructions,
    pass: Pass,
    columns: Columns,
    batches: &[Batch],
    pushes: &mut Pushes,
    friction: f32,
) {
    macro_rules! run {
        ($backed:literal, $own:literal) => {
            instructions.run(Solve::<$backed, $own> { pass, columns, batches, pushes, friction })
        };
    }
    match (columns.backed(), !pushes.numbers.is_empty()) {
        (false, false) => run!(false, false),
        (false, true) => run!(false, true),
        (true, false) => run!(true, false),
        (true, true) => run!(true, true),
    }
}

impl<const BACKED: bool, const OWN: bool> Kernel for Solve<'_, BACKED, OWN> {
    #[inline(always)]
    fn run<L: Lanes>(self) {
        match self.pass {
            Pass::Impact(impact) => self.impact::<L>(impact),
            Pass::Begin(impact) => self.begin::<L>(impact),
            Pass::Solve(impact) => self.solve::<L, true>(impact),
            Pass::Relax(impact) => self.solve::<L, false>(impact),
        }
    }
}

/// Numbers of the surfaces of a batch.
#[derive(Clone, Copy)]
struct Numbers<L> {
    friction: L,
    restitution: L,
    /// Mass times radius squared over the moment of inertia of both.
    inertia_factors: [L; 2],
}

impl<L: Lanes> Numbers<L> {
    #[inline(always)]
    fn load<const OWN: bool>(
        own: &[PairNumbers],
        batch: usize,
        friction: f32,
        restitution: f32,
    ) -> Self {
        if OWN {
            let PairNumbers { friction, restitution, inertia_factors: [a, b], .. } = &own[batch];
            Self {
                friction: L::load(friction),
                restitution: L::load(restitution),
                inertia_factors: [L::load(a), L::load(b)],
            }
        } else {
            Self {
                friction: L::splat(friction),
                restitution: L::splat(restitution),
                inertia_factors: [L::splat(SOLID_BALL); 2],
            }
        }
    }

    /// Effective mass of the touched points across the normal. `alone` is that along it.
    #[inline(always)]
    fn tangent_mass<const OWN: bool>(&self, alone: L, [a, b]: [&[L; 4]; 2]) -> L {
        if OWN {
            let one = L::splat(1.0);
            let [of_a, of_b] = self.inertia_factors;
            let sum = mobility(a) * (one + of_a) + mobility(b) * (one + of_b);
            sum.pick_above(L::splat(0.0), one / sum, L::splat(0.0))
        } else {
            alone * L::splat(2.0 / 7.0)
        }
    }
}

impl Columns<'_> {
    /// Applies an impulse to both balls of the pairs; the second gets it as it is.
    #[inline(always)]
    fn hit<L: Lanes, const BACKED: bool>(
        &self,
        batch: &Batch,
        [a, b]: [[L; 4]; 2],
        [spin_a, spin_b]: [[L; 4]; 2],
        normal: V<L>,
        along: L,
        across: V<L>,
        [factor_a, factor_b]: [L; 2],
    ) {
        let (mass_a, mass_b) = (mobility(&a), mobility(&b));
        let impulse = normal.times(along).plus(across);
        // The column holds radius times spin.
        let turn = normal.cross(across);
        let spin = [
            V::of(&spin_a).minus(turn.times(factor_a * mass_a)).with(spin_a[3]),
            V::of(&spin_b).minus(turn.times(factor_b * mass_b)).with(spin_b[3]),
        ];
        scatter(self.spin, batch, spin);
        let none = V([L::splat(0.0); 3]);
        let [mut by_a, mut by_b] = [none.minus(impulse), impulse];
        if BACKED {
            let [back_a, back_b] = gather::<L>(self.backing, batch);
            let (borne_a, borne_b);
            (by_a, borne_a) = borne_by_wall(by_a, &a, &back_a);
            (by_b, borne_b) = borne_by_wall(by_b, &b, &back_b);
            scatter(self.backing, batch, [borne_a, borne_b]);
        }
        let velocity = [
            V::of(&a).plus(by_a.times(mass_a)).with(a[3]),
            V::of(&b).plus(by_b.times(mass_b)).with(b[3]),
        ];
        scatter(self.velocity, batch, velocity);
    }

    /// The walls behind two balls.
    #[inline(always)]
    fn behind<L: Lanes>(&self, batch: &Batch, [a, b]: [&[L; 4]; 2], normal: V<L>) -> Behind<L> {
        let (zero, one) = (L::splat(0.0), L::splat(1.0));
        let [back_a, back_b] = gather::<L>(self.backing, batch);
        // How far the pair's normal goes into the wall.
        let into_a = normal.dot(V::of(&back_a)).max(zero);
        let into_b = (zero - normal.dot(V::of(&back_b))).max(zero);
        let free = |into: L| (one - into * into).max(zero);
        let [of_a, of_b] = [mobility(a), mobility(b)];
        // Two that have a wall behind them each weigh no more than the heavier one.
        let heavier = of_a + of_b - of_a.max(of_b);
        let sum = (of_a * free(into_a) + of_b * free(into_b)).max(heavier);
        let away = |ball: &[L; 4], back: &[L; 4]| V::of(ball).dot(V::of(back)).max(zero);
        Behind {
            load: sum.pick_above(zero, one / sum, zero),
            leaving: away(a, &back_a) * into_a + away(b, &back_b) * into_b,
            bears: (back_a[3] * into_a).max(back_b[3] * into_b),
        }
    }

    /// Counts how far the balls of the pairs went.
    #[inline(always)]
    fn spend<L: Lanes>(&self, batch: &Batch, ways: [V<L>; 2]) {
        let mut lengths = [[0.0; LANES]; 2];
        for (lengths, way) in lengths.iter_mut().zip(ways) {
            way.dot(way).sqrt().store(lengths);
        }
        for lane in 0..batch.count as usize {
            for (row, lengths) in batch.pair(lane).into_iter().zip(&lengths) {
                // SAFETY: as in `scatter`.
                unsafe { *self.budget.row(row as usize) -= lengths[lane] };
            }
        }
    }

    /// Lets those pairs bounce that meet. Says whether any does.
    #[inline(always)]
    fn bounce<L: Lanes, const OWN: bool>(
        &self,
        batch: &Batch,
        impact: &Impact,
        numbers: &Numbers<L>,
        [at_a, at_b]: [[L; 4]; 2],
        [a, b]: [[L; 4]; 2],
    ) -> bool {
        let zero = L::splat(0.0);
        let (normal, closing) = meeting(impact, [&at_a, &at_b], [&a, &b]);
        // What does not bounce is stopped by its contact.
        let closing =
            if OWN { numbers.restitution.pick_above(zero, closing, zero) } else { closing };
        if closing.above(zero) == 0 {
            return false;
        }
        let relative = V::of(&b).minus(V::of(&a));
        let mass = mass(&a, &b);
        let along = mass * closing * (L::splat(1.0) + numbers.restitution);
        let spins = self.spins(batch);
        let sliding = sliding(relative, normal, &spins);
        let wish = sliding.times(zero - numbers.tangent_mass::<OWN>(mass, [&a, &b]));
        let across = held(wish, numbers.friction * along);
        self.hit::<L, false>(batch, [a, b], spins, normal, along, across, numbers.inertia_factors);
        true
    }

    /// Moves apart what overlaps. That changes no velocity: overlap is not energy.
    #[inline(always)]
    fn part<L: Lanes>(
        &self,
        batch: &Batch,
        [at_a, at_b]: [[L; 4]; 2],
        [a, b]: [[L; 4]; 2],
        normal: V<L>,
        gap: L,
        slop: f32,
        grounded: L,
    ) {
        let zero = L::splat(0.0);
        let smaller = at_a[3] + at_b[3] - at_a[3].max(at_b[3]);
        let overlap = zero - gap - smaller * L::splat(2.0 * slop);
        if overlap.above(zero) == 0 {
            return;
        }
        // What flies keeps its center of mass. What a wall bears goes half each, whatever they
        // weigh: a light ball that a heavy one presses on something has nowhere to go. What sleeps
        // stays.
        let (one, push) = (L::splat(1.0), overlap.max(zero) * L::splat(PUSH));
        let [free_a, free_b] = [mobility(&a), mobility(&b)];
        let borne = grounded.pick_above(L::splat(TOUCHING), one, zero);
        let a = free_a.pick_above(zero, borne.pick_above(zero, one, free_a), zero);
        let b = free_b.pick_above(zero, borne.pick_above(zero, one, free_b), zero);
        let by = (a + b).pick_above(zero, push / (a + b), zero);
        let ways = [normal.times(by * a), normal.times(by * b)];
        let places =
            [V::of(&at_a).minus(ways[0]).with(at_a[3]), V::of(&at_b).plus(ways[1]).with(at_b[3])];
        scatter(self.at, batch, places);
        self.spend(batch, ways);
    }

    /// Applies angular impulses about the centers of both; the second gets it as it is.
    #[inline(always)]
    fn twist<L: Lanes>(&self, batch: &Batch, inertia: &Inertia<L>, torque: V<L>) {
        let [a, b] = self.spins::<L>(batch);
        let [by_a, by_b] = inertia.surface_speed;
        let spins = [
            V::of(&a).minus(torque.times(by_a)).with(a[3]),
            V::of(&b).plus(torque.times(by_b)).with(b[3]),
        ];
        scatter(self.spin, batch, spins);
    }

    /// Slows how the two turn against each other, by a torque of at most the resistance times
    /// normal force times effective radius.
    #[inline(always)]
    fn resist<L: Lanes>(
        &self,
        batch: &Batch,
        inertia: &Inertia<L>,
        normal: V<L>,
        normal_impulse: L,
        numbers: &PairNumbers,
        torque: &mut [[f32; LANES]; 3],
    ) {
        let most = normal_impulse * inertia.radius;
        let rolling = L::load(&numbers.rolling_resistance) * most;
        let spinning = L::load(&numbers.spinning_resistance) * most;
        let before = V::<L>::load(torque);
        let (zero, [a, b]) = (L::splat(0.0), self.spins::<L>(batch));
        let [per_a, per_b] = inertia.per_radius;
        let turning = V::of(&b).times(per_b).minus(V::of(&a).times(per_a));
        let wish = before.minus(turning.times(inertia.mass));
        let about = normal.times(wish.dot(normal));
        let after =
            held(wish.minus(about), rolling.max(zero)).plus(held(about, spinning.max(zero)));
        after.store(torque);
        self.twist(batch, inertia, after.minus(before));
    }

    /// The spins of a batch.
    #[inline(always)]
    fn spins<L: Lanes>(&self, batch: &Batch) -> [[L; 4]; 2] {
        gather(self.spin, batch)
    }
}

impl<const BACKED: bool, const OWN: bool> Solve<'_, BACKED, OWN> {
    #[inline(always)]
    fn impact<L: Lanes>(self, impact: Impact) {
        let Self { columns, batches, pushes, friction, .. } = self;
        if !OWN && impact.restitution == 0.0 {
            return; // contacts stop what meets
        }
        for (i, batch) in batches.iter().enumerate() {
            let at = gather::<L>(columns.at, batch);
            let velocity = gather::<L>(columns.velocity, batch);
            let numbers =
                Numbers::<L>::load::<OWN>(&pushes.numbers, i, friction, impact.restitution);
            pushes.bounced |= columns.bounce::<L, OWN>(batch, &impact, &numbers, at, velocity);
        }
    }

    #[inline(always)]
    fn begin<L: Lanes>(self, impact: Impact) {
        let Self { columns, batches, pushes, friction, .. } = self;
        let Pushes { pressure, grip, torque, numbers: own, .. } = pushes;
        for (i, batch) in batches.iter().enumerate() {
            let [a, b] = gather::<L>(columns.at, batch);
            let (normal, _) = normal_and_gap(&a, &b, ALL, |lane| batch.pair(lane));
            // It was across the normal of the last substep.
            let across = V::load(&grip[i]);
            let across = across.minus(normal.times(across.dot(normal)));
            let mut along = L::load(&pressure[i]);
            let mut across = across;
            let (velocity, spin) = (gather::<L>(columns.velocity, batch), columns.spins(batch));
            if BACKED {
                let [back_a, back_b] = gather::<L>(columns.backing, batch);
                let (zero, one) = (L::splat(0.0), L::splat(1.0));
                let lost = zero.pick_above(back_a[3], one, zero);
                let kept = zero.pick_above(back_b[3], zero, one - lost);
                // Nor does it bear as much once it presses the ball along the wall: it parts them
                // no faster than an overlap is pushed out.
                let [a, b] = &velocity;
                let (alone, load) = (mass(a, b), columns.behind(batch, [a, b], normal).load);
                let most = load * L::splat(impact.soft.fastest);
                let over = (along - most).max(zero);
                along = (along - load.pick_above(alone, over, zero)) * kept;
                along.store(&mut pressure[i]);
                across = across.times(kept);
            }
            across.store(&mut grip[i]);
            let numbers = Numbers::<L>::load::<OWN>(own, i, friction, impact.restitution);
            let factors = numbers.inertia_factors;
            columns.hit::<L, BACKED>(batch, velocity, spin, normal, along, across, factors);
            if OWN {
                let [a, b] = gather::<L>(columns.at, batch);
                let inertia = Inertia::new([&a, &b], &velocity, factors);
                columns.twist(batch, &inertia, V::load(&torque[i]));
            }
        }
    }

    #[inline(always)]
    fn solve<L: Lanes, const FIRST: bool>(self, impact: Impact) {
        let Self { columns, batches, pushes, friction, .. } = self;
        let Pushes { pressure, grip, torque, numbers: own, .. } = pushes;
        let (zero, one, soft) = (L::splat(0.0), L::splat(1.0), impact.soft);
        let per_second = L::splat(1.0 / impact.time);
        for (i, batch) in batches.iter().enumerate() {
            let numbers = Numbers::<L>::load::<OWN>(own, i, friction, impact.restitution);
            // Where nothing bounces, all is a contact.
            let speed =
                numbers.restitution.pick_above(zero, L::splat(impact.speed), L::splat(f32::MAX));
            let at = gather::<L>(columns.at, batch);
            let (normal, gap) = normal_and_gap(&at[0], &at[1], ALL, |lane| batch.pair(lane));
            let before = L::load(&pressure[i]);
            let velocity = gather::<L>(columns.velocity, batch);
            // What bears nothing and comes fast is no contact yet.
            let closing = V::of(&velocity[0]).minus(V::of(&velocity[1])).dot(normal);
            let fast = closing.pick_above(speed, one, zero);
            let mut fresh = before.pick_above(zero, zero, fast);
            if FIRST && fresh.above(zero) != 0 {
                // What meets nevertheless is stopped: it may come so fast only because of impulses
                // that were applied again, and are taken back by the contacts that bear them.
                let (_, meets) = meeting(&impact, [&at[0], &at[1]], [&velocity[0], &velocity[1]]);
                fresh = meets.pick_above(zero, zero, fresh);
            }
            let [a, b] = velocity;
            let relative = V::of(&b).minus(V::of(&a));
            let parting = relative.dot(normal);
            let mut spins: [[L; 4]; 2] = columns.spins(batch);
            let alone = mass(&a, &b);
            // What so much slower parting takes.
            let impulse = |slower: L| {
                if BACKED {
                    columns.behind(batch, [&a, &b], normal).impulse(alone, slower)
                } else {
                    alone * slower
                }
            };
            let change = if FIRST {
                let pushed = (gap * L::splat(soft.rate)).max(L::splat(-soft.fastest));
                let wish = gap.pick_above(zero, gap * per_second, pushed);
                let part = gap.pick_above(zero, one, L::splat(soft.mass));
                let back = gap.pick_above(zero, zero, L::splat(soft.back));
                part * impulse(parting + wish) + before * back
            } else {
                impulse(parting + gap.max(zero) * per_second)
            };
            let after = (before - fresh.pick_above(zero, zero, change)).max(zero);
            after.store(&mut pressure[i]);
            let grounded = spins[0][3].max(spins[1][3]);
            for spin in &mut spins {
                spin[3] = after.pick_above(zero, grounded.max(L::splat(TOUCHING)), spin[3]);
            }
            let sliding = sliding(relative, normal, &spins);
            let old = V::<L>::load(&grip[i]);
            let wish = old.minus(sliding.times(numbers.tangent_mass::<OWN>(alone, [&a, &b])));
            let held = held(wish, numbers.friction * after);
            held.store(&mut grip[i]);
            let (along, across, factors) =
                (after - before, held.minus(old), numbers.inertia_factors);
            columns.hit::<L, BACKED>(batch, [a, b], spins, normal, along, across, factors);
            if OWN {
                let inertia = Inertia::new([&at[0], &at[1]], &[a, b], factors);
                columns.resist(batch, &inertia, normal, after, &own[i], &mut torque[i]);
            }
            if !FIRST {
                columns.part(batch, at, [a, b], normal, gap, soft.slop, grounded);
            }
        }
    }
}

/// Inertia of the balls of a batch against torques.
struct Inertia<L> {
    /// Change of radius times angular velocity by an angular impulse, in m/s per N m s.
    surface_speed: [L; 2],
    /// Reciprocals of the radii.
    per_radius: [L; 2],
    /// Moment of inertia against turning against each other, in kg m².
    mass: L,
    /// Effective radius, in metres.
    radius: L,
}

impl<L: Lanes> Inertia<L> {
    #[inline(always)]
    fn new([at_a, at_b]: [&[L; 4]; 2], [a, b]: &[[L; 4]; 2], [of_a, of_b]: [L; 2]) -> Self {
        let (zero, one) = (L::splat(0.0), L::splat(1.0));
        let [per_a, per_b] = [one / at_a[3], one / at_b[3]];
        let [by_a, by_b] = [of_a * mobility(a) * per_a, of_b * mobility(b) * per_b];
        let sum = by_a * per_a + by_b * per_b;
        Self {
            surface_speed: [by_a, by_b],
            per_radius: [per_a, per_b],
            mass: sum.pick_above(zero, one / sum, zero),
            radius: one / (per_a + per_b),
        }
    }
}

/// An impulse on a ball, and with it what the wall behind takes so that the ball does not come
/// nearer, or gives back of that; and the wall, with what it bears then.
#[inline(always)]
fn borne_by_wall<L: Lanes>(impulse: V<L>, ball: &[L; 4], back: &[L; 4]) -> (V<L>, [L; 4]) {
    let (zero, one) = (L::splat(0.0), L::splat(1.0));
    let (normal, free) = (V::of(back), mobility(ball));
    let some = free.pick_above(zero, normal.dot(normal), zero);
    let mass = free.pick_above(zero, one / free, zero);
    let before = back[3].max(zero);
    let away = V::of(ball).dot(normal) * mass + impulse.dot(normal);
    let borne = (before - away).max(zero) * some;
    (impulse.plus(normal.times(borne - before)), normal.with(borne))
}

/// Which pairs meet within a substep: the normal then, and how fast they come together, or zero for
/// those that do not meet or too slowly.
#[inline(always)]
fn meeting<L: Lanes>(
    impact: &Impact,
    [at_a, at_b]: [&[L; 4]; 2],
    [a, b]: [&[L; 4]; 2],
) -> (V<L>, L) {
    let (zero, one) = (L::splat(0.0), L::splat(1.0));
    let way = V::of(at_b).minus(V::of(at_a));
    let relative = V::of(b).minus(V::of(a));
    let reach = at_a[3] + at_b[3];
    let approach = zero - way.dot(relative);
    // Where a sphere as wide as both meets a point.
    let apart = (way.dot(way) - reach * reach).max(zero);
    let square = approach * approach - relative.dot(relative) * apart;
    let time = approach.pick_above(zero, apart / (approach + square.max(zero).sqrt()), zero);
    // Of what does not meet, any time will do: what hardly moves would take longer than a number is.
    let limit = L::splat(impact.time);
    let meets = limit.pick_above(time, one, zero);
    let time = limit.pick_above(time, time, zero);
    let then = way.plus(relative.times(time));
    let length = then.dot(then).sqrt();
    let inverse = length.pick_above(zero, one / length, zero);
    let normal = then.times(inverse);
    let closing = zero - relative.dot(normal);
    let closing = closing.pick_above(L::splat(impact.speed), closing, zero);
    let closing = square.pick_above(zero, closing, zero);
    (normal, meets.pick_above(zero, closing, zero))
}

/// Velocity at which the surfaces of two balls slide over each other.
#[inline(always)]
fn sliding<L: Lanes>(relative: V<L>, normal: V<L>, [a, b]: &[[L; 4]; 2]) -> V<L> {
    let spin = V::of(a).plus(V::of(b));
    relative.minus(normal.times(relative.dot(normal))).minus(spin.cross(normal))
}

/// The most of an impulse that friction bears.
#[inline(always)]
fn held<L: Lanes>(wish: V<L>, most: L) -> V<L> {
    let size = wish.dot(wish).sqrt();
    let part = most / size.max(L::splat(f32::MIN_POSITIVE));
    wish.times(size.pick_above(most, part, L::splat(1.0)))
}
