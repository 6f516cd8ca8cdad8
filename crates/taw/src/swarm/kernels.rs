//! What a step does to rows and to pairs, eight at a time.

use super::lanes::{Kernel, LANES, Lanes, Row};
use super::memory::{fit, make_room};
use super::pairs::{Batch, Fans};
use super::team::Shared;
use super::walls::HalfSpace;

/// What batches of pairs bear, batch by batch; nothing in the lab's tier.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Pushes {
    /// The impulses along the normals, in N s.
    pub pressure: Vec<[f32; LANES]>,
    /// Those across them.
    pub grip: Vec<[[f32; LANES]; 3]>,
    /// Whether any of them bounced in the last round.
    pub bounced: bool,
}

impl Pushes {
    pub fn bytes(&self) -> usize {
        self.pressure.capacity() * size_of::<[f32; LANES]>()
            + self.grip.capacity() * size_of::<[[f32; LANES]; 3]>()
    }

    /// As many as there are batches, and none bears anything.
    pub fn reset(&mut self, batches: usize) {
        fn reset<T: Clone>(column: &mut Vec<T>, batches: usize, none: T) {
            column.clear();
            make_room(column, batches);
            column.resize(batches, none);
            fit(column);
        }
        reset(&mut self.pressure, batches, [0.0; LANES]);
        reset(&mut self.grip, batches, [[0.0; LANES]; 3]);
    }
}

/// Three coordinates on eight lanes.
#[derive(Clone, Copy)]
struct V<L>([L; 3]);

impl<L: Lanes> V<L> {
    #[inline(always)]
    fn of(row: &[L; 4]) -> Self {
        Self([row[0], row[1], row[2]])
    }

    #[inline(always)]
    fn load(from: &[[f32; LANES]; 3]) -> Self {
        Self([L::load(&from[0]), L::load(&from[1]), L::load(&from[2])])
    }

    #[inline(always)]
    fn store(self, to: &mut [[f32; LANES]; 3]) {
        let Self([x, y, z]) = self;
        x.store(&mut to[0]);
        y.store(&mut to[1]);
        z.store(&mut to[2]);
    }

    #[inline(always)]
    fn plus(self, other: Self) -> Self {
        let (Self([a, b, c]), Self([x, y, z])) = (self, other);
        Self([a + x, b + y, c + z])
    }

    #[inline(always)]
    fn minus(self, other: Self) -> Self {
        let (Self([a, b, c]), Self([x, y, z])) = (self, other);
        Self([a - x, b - y, c - z])
    }

    #[inline(always)]
    fn times(self, by: L) -> Self {
        let Self([x, y, z]) = self;
        Self([x * by, y * by, z * by])
    }

    #[inline(always)]
    fn dot(self, other: Self) -> L {
        let (Self([a, b, c]), Self([x, y, z])) = (self, other);
        a * x + b * y + c * z
    }

    #[inline(always)]
    fn cross(self, other: Self) -> Self {
        let (Self([a, b, c]), Self([x, y, z])) = (self, other);
        Self([b * z - c * y, c * x - a * z, a * y - b * x])
    }

    #[inline(always)]
    fn with(self, w: L) -> [L; 4] {
        let Self([x, y, z]) = self;
        [x, y, z, w]
    }
}

/// The normal from the first to the second ball, and the gap between them.
#[inline(always)]
fn normal_and_gap<L: Lanes>(a: &[L; 4], b: &[L; 4], pair: impl Fn(usize) -> [u32; 2]) -> (V<L>, L) {
    let (zero, one) = (L::splat(0.0), L::splat(1.0));
    let least = L::splat(f32::MIN_POSITIVE);
    let way = V::of(b).minus(V::of(a));
    let squared = way.dot(way);
    let distance = squared.sqrt();
    // Root and quotient do not wait for each other.
    let inverse = squared.pick_above(least, distance * (one / squared), zero);
    let mut normal = way.times(inverse);
    if least.above(squared) != 0 {
        // Where the centers coincide, any direction is as good as another; with the same for all,
        // those at one point would come into a line.
        let mut any = [[0.0; LANES]; 3];
        for lane in 0..LANES {
            let direction = direction(pair(lane));
            for (axis, x) in any.iter_mut().zip(direction) {
                axis[lane] = x;
            }
        }
        let (V([x, y, z]), V([u, v, w])) = (normal, V::load(&any));
        let pick = [(x, u), (y, v), (z, w)];
        normal = V(pick.map(|(x, any)| squared.pick_above(least, x, any)));
    }
    (normal, distance - (a[3] + b[3]))
}

/// A direction for each pair of rows, spread over the sphere.
#[cold]
fn direction([a, b]: [u32; 2]) -> [f32; 3] {
    let mixed = (a ^ b.rotate_left(16)).wrapping_mul(0x9e37_79b1);
    let mixed = (mixed ^ mixed >> 15).wrapping_mul(0x85eb_ca77);
    let part = |shift: u32| ((mixed >> shift & 0x3ff) as f32 - 511.5) / 511.5;
    let [x, y, z] = [part(0), part(11), part(22)];
    // No part is zero.
    let length = (x * x + y * y + z * z).sqrt();
    [x / length, y / length, z / length]
}

/// The rows of a column that the pairs of a batch are about.
#[inline(always)]
fn gather<L: Lanes>(column: Shared<Row>, batch: &Batch) -> [[L; 4]; 2] {
    let a = column.row(batch.first[0] as usize);
    let b = column.row(batch.first[1] as usize);
    // SAFETY: no other thread has these rows (see `Slab`).
    unsafe { [L::gather(a, &batch.a), L::gather(b, &batch.b)] }
}

/// Writes back what was gathered.
#[inline(always)]
fn scatter<L: Lanes>(column: Shared<Row>, batch: &Batch, [of_a, of_b]: [[L; 4]; 2]) {
    let a = column.row(batch.first[0] as usize);
    let b = column.row(batch.first[1] as usize);
    let count = batch.count as usize;
    // SAFETY: as in `gather`, and no row is twice in a batch.
    unsafe {
        L::scatter(a, &batch.a, count, of_a);
        L::scatter(b, &batch.b, count, of_b);
    }
}

/// Pushes overlapping balls apart, half each.
pub(super) struct Displace<'a> {
    pub at: Shared<'a, Row>,
    pub batches: &'a [Batch],
}

impl Kernel for Displace<'_> {
    #[inline(always)]
    fn run<L: Lanes>(self) {
        for batch in self.batches {
            let [a, b] = gather::<L>(self.at, batch);
            let (normal, overlap) = normal_and_overlap(&a, &b, |lane| batch.pair(lane));
            let by = normal.times(overlap * L::splat(0.5));
            let moved = [V::of(&a).minus(by).with(a[3]), V::of(&b).plus(by).with(b[3])];
            scatter(self.at, batch, moved);
        }
    }
}

/// The normal from the first to the second ball, and how far they overlap.
#[inline(always)]
fn normal_and_overlap<L: Lanes>(
    a: &[L; 4],
    b: &[L; 4],
    pair: impl Fn(usize) -> [u32; 2],
) -> (V<L>, L) {
    let (normal, gap) = normal_and_gap(a, b, pair);
    let zero = L::splat(0.0);
    (normal, (zero - gap).max(zero))
}

/// The same for fans: each ball and up to eight others at a time.
pub(super) struct DisplaceFans<'a> {
    pub at: Shared<'a, Row>,
    pub fans: Fans<'a>,
}

/// Which part of an overlap each of two balls moves, by how many overlap the first one: where
/// these are moved together, they would move too far.
const PART: [f32; LANES + 1] = [0.5, 0.5, 0.42, 0.38, 0.36, 0.36, 0.36, 0.36, 0.36];

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

impl Kernel for DisplaceFans<'_> {
    #[inline(always)]
    fn run<L: Lanes>(self) {
        let Fans { first, rows, list: mut rest } = self.fans;
        for row in first..first + rows {
            let mut left = usize::from(rest[0]);
            rest = &rest[1..];
            if left == 0 {
                continue;
            }
            let ball = self.at.row(row as usize);
            // SAFETY: no other thread has this row and those of its fan (see `Slab`).
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
                // SAFETY: as above; no row but its own is twice in a fan.
                unsafe {
                    let b = L::gather(ball, &after);
                    let pair = |lane: usize| [row, row + u32::from(after[lane])];
                    let (normal, overlap) = normal_and_overlap(&a, &b, pair);
                    let overlap = overlap.first(count);
                    let hits = overlap.above(L::splat(0.0)).count_ones();
                    let by = normal.times(overlap * L::splat(PART[hits as usize]));
                    L::scatter(ball, &after, LANES, V::of(&b).plus(by).with(b[3]));
                    let V([x, y, z]) = by;
                    own = [own[0] - x.sum(), own[1] - y.sum(), own[2] - z.sum(), own[3]];
                }
                (left, rest) = (left - count, &rest[count..]);
            }
            // SAFETY: as above.
            unsafe { *ball = own };
        }
    }
}

/// Pushes balls out of half-spaces.
pub(super) struct DisplaceFromPlanes<'a> {
    pub at: &'a mut [Row],
    pub planes: &'a [HalfSpace],
}

impl Kernel for DisplaceFromPlanes<'_> {
    #[inline(always)]
    fn run<L: Lanes>(self) {
        let zero = L::splat(0.0);
        for rows in self.at.chunks_mut(LANES) {
            let (base, count) = (rows.as_mut_ptr(), rows.len());
            let places = [0, 1, 2, 3, 4, 5, 6, 7].map(|place: u16| place.min(count as u16 - 1));
            // SAFETY: these rows are here, and each is named once among the first ones.
            unsafe {
                let [mut x, mut y, mut z, radius] = L::gather(base, &places);
                let mut out = 0;
                for HalfSpace { normal, offset, .. } in self.planes {
                    let (nx, ny, nz) = (L::splat(normal.x), L::splat(normal.y), L::splat(normal.z));
                    let gap = nx * x + ny * y + nz * z - L::splat(*offset) - radius;
                    out |= zero.above(gap);
                    let by = (zero - gap).max(zero);
                    (x, y, z) = (x + nx * by, y + ny * by, z + nz * by);
                }
                if out != 0 {
                    L::scatter(base, &places, count, [x, y, z, radius]);
                }
            }
        }
    }
}

/// The inverse mass of awake balls: those of balls asleep have a minus sign.
#[inline(always)]
fn mobility<L: Lanes>(velocity: &[L; 4]) -> L {
    velocity[3].max(L::splat(0.0))
}

/// What both weigh together along their normal; nothing if both are asleep.
#[inline(always)]
fn mass<L: Lanes>(a: &[L; 4], b: &[L; 4]) -> L {
    let sum = mobility(a) + mobility(b);
    let zero = L::splat(0.0);
    sum.pick_above(zero, L::splat(1.0) / sum, zero)
}

/// How what lies on others is borne: its overlap makes it part a little, which the pass after that
/// takes back, though not what contacts have learned to bear. What they give back is what damps it:
/// impulses that are applied again and corrected once a substep swing for a long time, and what
/// pushes overlap out meanwhile makes them swing more (Catto, `Solver2D`, 2024: soft contacts).
#[derive(Clone, Copy, Debug)]
pub(super) struct Soft {
    /// The part of an overlap that is to go per second.
    pub rate: f32,
    /// How fast it goes at most, in m/s.
    pub fastest: f32,
    /// The part of the impulse that a hard contact would need, and how much of what it has borne
    /// so far it gives back.
    pub mass: f32,
    pub back: f32,
    /// So much of twice the smaller radius two balls may overlap before they are moved apart.
    pub slop: f32,
}

/// So much of its radius a ball may be in a wall: more than what bears a heap gets.
pub(super) const WALL_SLOP: f32 = 0.1;
/// The part of an overlap that goes in a substep: where two neighbours of a ball both push it on,
/// it goes no further than it should.
const PUSH: f32 = 0.5;

/// How a ball is marked that a wall bears in this step, be it through others; one less in the next
/// one, and after that not at all.
pub(super) const GROUNDED: f32 = 2.0;

/// The columns that several threads work on.
#[derive(Clone, Copy)]
pub(super) struct Columns<'a> {
    /// Center and radius.
    pub at: Shared<'a, Row>,
    /// Velocity and inverse mass.
    pub velocity: Shared<'a, Row>,
    /// Radius times spin, and nothing.
    pub spin: Shared<'a, Row>,
    /// How far each ball may still go, in metres.
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
pub(super) const LOST: f32 = -1.0;

/// How the walls behind two balls make their pair heavier.
struct Behind<L> {
    /// What both weigh together along their normal, in kilograms, as long as the walls bear.
    load: L,
    /// How fast they leave the walls along it, in m/s: until then, they weigh as they are.
    leaving: L,
    /// Whether a wall bears.
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
    /// Whether it is known who has a wall behind it.
    pub fn backed(&self) -> bool {
        self.backing.len() > 0
    }
}

/// One pass over the pairs for their impulses.
pub(super) struct Solve<'a> {
    pub pass: Pass,
    pub columns: Columns<'a>,
    pub batches: &'a [Batch],
    pub pushes: &'a mut Pushes,
    pub friction: f32,
}

/// What a pass does.
#[derive(Clone, Copy, Debug)]
pub(super) enum Pass {
    /// Lets bounce what meets in a substep and comes together fast enough.
    Impact(Impact),
    /// Applies the impulses of the last substep again.
    Begin(Impact),
    /// Lets nothing come nearer than the gap within a substep.
    Solve(Impact),
    /// The same once more, after the balls moved, and moves what overlaps apart. What bears nothing
    /// and comes fast is left for the next bounce.
    Relax(Impact),
}

/// What bounces, and how.
///
/// Bounces come before gravity and contacts, one pair after another, each by the velocities that
/// the ones before it left: an impulse of at most twice what stops a pair adds no energy to it, so
/// none of them does, in whatever order and however many meet at once (Guendelman, Bridson and
/// Fedkiw, 2003, "Nonconvex rigid bodies with stacking"). What contacts remember is
/// left out of it: a bounce comes once.
#[derive(Clone, Copy, Debug)]
pub(super) struct Impact {
    /// What comes together more slowly is a contact, in m/s.
    pub speed: f32,
    /// The part of the speed that balls have afterwards.
    pub restitution: f32,
    /// How long a substep is, in seconds.
    pub time: f32,
    /// In m/s².
    pub gravity: Row,
    /// How contacts bear what lies on them.
    pub soft: Soft,
}

impl Kernel for Solve<'_> {
    #[inline(always)]
    fn run<L: Lanes>(self) {
        let backed = self.columns.backed();
        match self.pass {
            Pass::Impact(impact) => self.impact::<L>(impact),
            Pass::Begin(impact) if backed => self.begin::<L, true>(impact),
            Pass::Begin(impact) => self.begin::<L, false>(impact),
            Pass::Solve(impact) if backed => self.solve::<L, true, true>(impact),
            Pass::Solve(impact) => self.solve::<L, false, true>(impact),
            Pass::Relax(impact) if backed => self.solve::<L, true, false>(impact),
            Pass::Relax(impact) => self.solve::<L, false, false>(impact),
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
    ) {
        let (mass_a, mass_b) = (mobility(&a), mobility(&b));
        let impulse = normal.times(along).plus(across);
        // A solid ball: mass times radius squared is 2.5 times the moment of inertia. The column
        // holds radius times spin.
        let turn = normal.cross(across).times(L::splat(2.5));
        let spin = [
            V::of(&spin_a).minus(turn.times(mass_a)).with(spin_a[3]),
            V::of(&spin_b).minus(turn.times(mass_b)).with(spin_b[3]),
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
    fn bounce<L: Lanes>(
        &self,
        batch: &Batch,
        impact: &Impact,
        friction: f32,
        [at_a, at_b]: [[L; 4]; 2],
        [a, b]: [[L; 4]; 2],
    ) -> bool {
        let zero = L::splat(0.0);
        let (normal, closing) = meeting(impact, [&at_a, &at_b], [&a, &b]);
        if closing.above(zero) == 0 {
            return false;
        }
        let relative = V::of(&b).minus(V::of(&a));
        let mass = mass(&a, &b);
        let along = mass * closing * L::splat(1.0 + impact.restitution);
        let spins = self.spins(batch);
        let sliding = sliding(relative, normal, &spins);
        let across = held(sliding.times(L::splat(-2.0 / 7.0) * mass), L::splat(friction) * along);
        self.hit::<L, false>(batch, [a, b], spins, normal, along, across);
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
        let [a, b] = [a, b].map(|ball| {
            let free = mobility(&ball);
            free.pick_above(zero, grounded.pick_above(zero, one, free), zero)
        });
        let by = (a + b).pick_above(zero, push / (a + b), zero);
        let ways = [normal.times(by * a), normal.times(by * b)];
        let places =
            [V::of(&at_a).minus(ways[0]).with(at_a[3]), V::of(&at_b).plus(ways[1]).with(at_b[3])];
        scatter(self.at, batch, places);
        self.spend(batch, ways);
    }

    /// The spins of a batch.
    #[inline(always)]
    fn spins<L: Lanes>(&self, batch: &Batch) -> [[L; 4]; 2] {
        gather(self.spin, batch)
    }
}

impl Solve<'_> {
    #[inline(always)]
    fn impact<L: Lanes>(self, impact: Impact) {
        let Self { columns, batches, pushes, friction, .. } = self;
        if impact.restitution == 0.0 {
            return; // contacts stop what meets
        }
        for batch in batches {
            let at = gather::<L>(columns.at, batch);
            let velocity = gather::<L>(columns.velocity, batch);
            pushes.bounced |= columns.bounce(batch, &impact, friction, at, velocity);
        }
    }

    #[inline(always)]
    fn begin<L: Lanes, const BACKED: bool>(self, impact: Impact) {
        let Self { columns, batches, pushes, .. } = self;
        let Pushes { pressure, grip, .. } = pushes;
        for (i, batch) in batches.iter().enumerate() {
            let [a, b] = gather::<L>(columns.at, batch);
            let (normal, _) = normal_and_gap(&a, &b, |lane| batch.pair(lane));
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
            columns.hit::<L, BACKED>(batch, velocity, spin, normal, along, across);
        }
    }

    #[inline(always)]
    fn solve<L: Lanes, const BACKED: bool, const FIRST: bool>(self, impact: Impact) {
        let Self { columns, batches, pushes, friction, .. } = self;
        let Pushes { pressure, grip, .. } = pushes;
        // Where nothing bounces, all is a contact.
        let speed = if impact.restitution > 0.0 { impact.speed } else { f32::MAX };
        let (zero, one, soft) = (L::splat(0.0), L::splat(1.0), impact.soft);
        let (speed, per_second) = (L::splat(speed), L::splat(1.0 / impact.time));
        for (i, batch) in batches.iter().enumerate() {
            let at = gather::<L>(columns.at, batch);
            let (normal, gap) = normal_and_gap(&at[0], &at[1], |lane| batch.pair(lane));
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
                spin[3] = after.pick_above(zero, grounded, spin[3]);
            }
            let sliding = sliding(relative, normal, &spins);
            let old = V::<L>::load(&grip[i]);
            let wish = old.minus(sliding.times(alone * L::splat(2.0 / 7.0)));
            let held = held(wish, L::splat(friction) * after);
            held.store(&mut grip[i]);
            let across = held.minus(old);
            columns.hit::<L, BACKED>(batch, [a, b], spins, normal, after - before, across);
            if !FIRST {
                columns.part(batch, at, [a, b], normal, gap, soft.slop, grounded);
            }
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
    let then = way.plus(relative.times(time));
    let length = then.dot(then).sqrt();
    let inverse = length.pick_above(zero, one / length, zero);
    let normal = then.times(inverse);
    let closing = zero - relative.dot(normal);
    let closing = closing.pick_above(L::splat(impact.speed), closing, zero);
    let closing = square.pick_above(zero, closing, zero);
    (normal, L::splat(impact.time).pick_above(time, closing, zero))
}

/// How fast the surfaces of two balls slide over each other.
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

/// Faster than this, in m/s, or further out, in metres, a ball is no longer a ball: squares of
/// such numbers and of sums of them are still finite.
const MOST: f32 = 1e15;

/// Changes velocities, and moves on what has them.
pub(super) struct Drift<'a> {
    pub at: &'a mut [Row],
    pub velocity: &'a mut [Row],
    pub budget: &'a mut [f32],
    /// In m/s, and zero.
    pub change: Row,
    /// In seconds, thrice, and zero.
    pub time: Row,
    /// Whether a budget becomes less than this.
    pub least: f32,
    pub overrun: &'a mut bool,
    /// The rows that were stopped because of where they would have gone.
    pub stopped: &'a mut Vec<u32>,
    pub first: u32,
}

impl Kernel for Drift<'_> {
    #[inline(always)]
    fn run<L: Lanes>(self) {
        let rows = self.at.iter_mut().zip(self.velocity).zip(self.budget);
        for (row, ((at, velocity), budget)) in rows.enumerate() {
            let new = sum(*velocity, self.change);
            let way = product(new, self.time);
            let place = sum(*at, way);
            let ok = largest(new) < MOST && largest(place) < MOST;
            if ok {
                (*velocity, *at) = (new, place);
                *budget -= squared(way).sqrt();
                *self.overrun |= *budget < self.least;
            } else {
                *velocity = [0.0, 0.0, 0.0, velocity[3]];
                self.stopped.push(self.first + row as u32);
            }
        }
    }
}

#[inline(always)]
fn sum(a: Row, b: Row) -> Row {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2], a[3] + b[3]]
}

#[inline(always)]
fn product(a: Row, b: Row) -> Row {
    [a[0] * b[0], a[1] * b[1], a[2] * b[2], a[3] * b[3]]
}

/// Of the three coordinates.
#[inline(always)]
pub(super) fn squared(a: Row) -> f32 {
    a[0] * a[0] + a[1] * a[1] + a[2] * a[2]
}

/// Of the three coordinates; NaN if one of them is.
#[inline(always)]
fn largest(a: Row) -> f32 {
    a[0].abs() + a[1].abs() + a[2].abs()
}

/// The first part of a step in the lab's tier: balls move on, and their velocities make room for
/// the places where they were.
pub(super) struct Predict<'a> {
    pub at: &'a mut [Row],
    pub velocity: &'a mut [Row],
    /// How far each goes.
    pub way: &'a mut [f32],
    pub change: Row,
    pub time: Row,
    pub stopped: &'a mut Vec<u32>,
    pub first: u32,
}

impl Kernel for Predict<'_> {
    #[inline(always)]
    fn run<L: Lanes>(self) {
        let rows = self.at.iter_mut().zip(self.velocity).zip(self.way);
        for (row, ((at, velocity), length)) in rows.enumerate() {
            let new = sum(*velocity, self.change);
            let way = product(new, self.time);
            let place = sum(*at, way);
            let ok = largest(new) < MOST && largest(place) < MOST;
            let before = [at[0], at[1], at[2], velocity[3]];
            if ok {
                *at = place;
                *length = squared(way).sqrt();
            } else {
                *length = 0.0;
                self.stopped.push(self.first + row as u32);
            }
            *velocity = before;
        }
    }
}

/// The last part of it: velocities are what places became, though no ball is faster than it was
/// before others pushed it. (What is pushed out of a deep overlap would fly off otherwise.)
pub(super) struct Follow<'a> {
    pub at: &'a [Row],
    pub velocity: &'a mut [Row],
    pub way: &'a [f32],
    pub budget: &'a mut [f32],
    pub per_second: Row,
}

impl Kernel for Follow<'_> {
    #[inline(always)]
    fn run<L: Lanes>(self) {
        let rows = self.at.iter().zip(self.velocity).zip(self.way).zip(self.budget);
        for (((at, velocity), expected), budget) in rows {
            let way = [at[0] - velocity[0], at[1] - velocity[1], at[2] - velocity[2], 0.0];
            let length = squared(way).sqrt();
            *budget -= length;
            let part = if length > *expected { *expected / length } else { 1.0 };
            let new = product(way, self.per_second);
            *velocity = [new[0] * part, new[1] * part, new[2] * part, velocity[3]];
        }
    }
}
