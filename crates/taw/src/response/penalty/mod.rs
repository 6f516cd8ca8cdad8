//! Forces that grow with the overlap.
//!
//! All forces of a substep are those of one moment: of the places where a step that ends in a
//! kick would have the marbles, which for every integrator makes it symplectic. So a marble
//! that lies has no velocity, and the oscillation of contacts is stable as long as their
//! stiffness and damping are below what [`share`] sees to (multiply the equation of motion by
//! the mean velocity, and what is left is a sum of squares that only dashpots change).

mod law;
mod share;
#[cfg(test)]
mod tests;

pub use law::ContactLaw;

use cgmath::{InnerSpace, Zero};

use crate::contact::Contacts;
use crate::math::{Scalar, Vec3, cast_vector, direction_and_length, is_finite};
use crate::response::impact::at_most;
use crate::response::impulse::First;
use crate::response::material::Compliance;
use crate::response::{Columns, Material, Mobility, Push, Walls, Work};
use law::Springs;
use share::Load;

/// What a contact remembers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Shear<S> {
    key: Key,
    /// How far its two points were displaced against each other across the normal while they
    /// held, in metres, and how stiff that was, in N/m.
    stretch: Vec3<S>,
    across: S,
    /// What its spring took and has not given back, in joules.
    stored: S,
    /// How fast its two points parted along the normal at the end of the substep, in m/s.
    parting: S,
}

impl<S> Shear<S> {
    /// The rows of its marbles.
    pub fn rows(&self) -> [Option<usize>; 2] {
        let (two_marbles, a, b, ..) = self.key;
        [two_marbles.then_some(a as usize), Some(b as usize)]
    }
}

/// Names a contact: whether of two marbles, who, which part of a wall, which ends of capsules.
type Key = (bool, u32, u32, u32, [i8; 2]);

/// What a substep of [`penalty`] goes by.
pub(crate) struct Setting<S, M, F> {
    pub law: ContactLaw,
    /// In seconds.
    pub dt: S,
    /// The material of a row.
    pub material: M,
    /// How far a change of a row's velocity has moved it, as a part of change times step.
    pub follow: F,
}

/// One touch: who, where, and how the two give way.
struct Touch<S> {
    key: Key,
    /// None for a wall.
    a: Option<usize>,
    b: usize,
    /// How far along the axis of each.
    along: [S; 2],
    /// From a to b.
    normal: Vec3<S>,
    overlap: S,
    /// Of b's point relative to a's, and of the wall's surface, in m/s.
    closing: Vec3<S>,
    surface: Vec3<S>,
    /// How easily each gives way, a first.
    gives: [Mobility<S>; 2],
    is_of_rods: bool,
    /// The sum of the curvatures, in 1/m.
    curvature: S,
    material: Material<S>,
    /// How much the surfaces give way together.
    compliance: Compliance<S>,
}

/// A touch with what it does in this substep.
struct Pushing<S> {
    touch: Touch<S>,
    springs: Springs<S>,
    /// Half of what the dashpots take of the velocity in a substep, along and across.
    drags: [S; 2],
    memory: Shear<S>,
    /// What is left of its forces, as a part, when all contacts share their marbles.
    share: S,
    /// How easily the two give way along the normal if all contacts push as much, in 1/kg.
    shared_give: S,
    /// Of the spring and of all, along the normal, and all, in N s.
    sprung: S,
    pressure: S,
    impulse: Vec3<S>,
    twist: Vec3<S>,
}

/// [`Response::Penalty`](super::Response::Penalty): forces that grow with the overlap change
/// velocities, and where these have moved marbles already, their places. `shear` is what
/// contacts remember.
///
/// The contacts' rows exist. Rows that end up infinite or NaN lose their velocity and are
/// added to `stopped`.
pub(crate) fn penalty<S: Scalar>(
    setting: &Setting<S, impl Fn(usize) -> Material<S>, impl Fn(usize) -> S>,
    marbles: &mut Columns<S>,
    contacts: &mut Contacts<S>,
    walls: &impl Walls<S>,
    shear: &mut Vec<Shear<S>>,
    stopped: &mut Vec<u32>,
    mut work: Option<&mut Work>,
) {
    contacts.sort();
    let before = std::mem::take(shear);
    let mut pushing = Vec::with_capacity(contacts.len());
    let wm = contacts.wm.iter().map(|c| ((false, c.a, c.b, c.part), c.along));
    let mm = contacts.mm.iter().map(|c| ((true, c.a, c.b, 0), c.along));
    for (key, along) in wm.chain(mm) {
        if let Some(touch) = touch(setting, marbles, walls, key, along) {
            pushing.push(Pushing::new(setting, touch, &before));
        }
    }
    share_out(marbles, &mut pushing, setting.dt);
    let start: Vec<_> = pushing.iter().map(|p| p.touch.velocities(marbles)).collect();
    // All forces are those of the same moment, whatever the order.
    for pushing in &mut pushing {
        pushing.decide(setting.dt);
    }
    for pushing in &pushing {
        pushing.apply(marbles, work.as_deref_mut());
    }
    follow(setting, marbles, &pushing, &start);
    if let Some(work) = work.as_deref_mut() {
        for Pushing { touch, impulse, .. } in &pushing {
            touch.count(marbles, *impulse, work);
        }
    }
    let partings: Vec<_> = pushing.iter().map(|p| p.touch.parting(marbles)).collect();
    let ending: Vec<_> = pushing
        .iter()
        .zip(&partings)
        .map(|(pushing, parting)| pushing.ends(setting, marbles, *parting))
        .collect();
    for ((pushing, parting), ends) in pushing.iter_mut().zip(partings).zip(ending) {
        let Some(memory) = pushing.remember(parting) else { continue };
        if ends {
            pushing.memory = memory;
            pushing.push_off(setting, marbles, parting, work.as_deref_mut());
        } else {
            shear.push(memory);
        }
    }
    shear.sort_unstable_by_key(|shear| shear.key);
    for contact in contacts.wm.iter().chain(&contacts.mm) {
        stop_if_infinite(marbles, contact.b, stopped);
    }
    contacts.mm.iter().for_each(|contact| stop_if_infinite(marbles, contact.a, stopped));
}

fn stop_if_infinite<S: Scalar>(marbles: &mut Columns<S>, row: u32, stopped: &mut Vec<u32>) {
    let row_in = row as usize;
    let spin = marbles.spin.get(row_in).copied().unwrap_or_else(Vec3::zero);
    if is_finite(marbles.velocity[row_in]) && is_finite(spin) {
        return;
    }
    marbles.velocity[row_in] = Vec3::zero();
    if let Some(spin) = marbles.spin.get_mut(row_in) {
        *spin = Vec3::zero();
    }
    stopped.push(row);
}

/// Moves marbles on by what forces have changed since their velocities moved them. Those of
/// `start` are from before.
fn follow<S: Scalar>(
    setting: &Setting<S, impl Fn(usize) -> Material<S>, impl Fn(usize) -> S>,
    marbles: &mut Columns<S>,
    pushing: &[Pushing<S>],
    start: &[[Vec3<S>; 2]],
) {
    let mut done = vec![false; marbles.velocity.len()];
    for (Pushing { touch, .. }, start) in pushing.iter().zip(start) {
        for (row, start) in [touch.a, Some(touch.b)].into_iter().zip(start) {
            let Some(row) = row.filter(|row| !std::mem::replace(&mut done[*row], true)) else {
                continue;
            };
            let way = (marbles.velocity[row] - *start) * (setting.follow)(row) * setting.dt;
            if is_finite(way) {
                marbles.position[row] += way;
            }
        }
    }
}

/// Sees how much of a marble each of its contacts may have.
fn share_out<S: Scalar>(marbles: &Columns<S>, pushing: &mut [Pushing<S>], dt: S) {
    let mut loads = vec![Load::none(S::zero()); marbles.velocity.len()];
    for Pushing { touch, springs, drags, .. } in pushing.iter() {
        let load = Load::of(touch, springs, dt, *drags);
        touch.a.into_iter().chain([touch.b]).for_each(|row| loads[row].add(&load));
    }
    for pushing in pushing {
        let touch = &pushing.touch;
        let alone = touch.give();
        let of = |row: Option<usize>| row.map_or(Load::none(S::zero()), |row| loads[row]);
        let [a, b] = [of(touch.a), of(Some(touch.b))];
        let [first, second] = touch.gives;
        let split = first.times(a.parts()).and(second.times(b.parts()));
        let part = |alone: S, split: S| alone / split;
        pushing.share = part(alone.normal, split.normal).min(part(alone.tangent, split.tangent));
        pushing.shared_give = first.normal * a.count + second.normal * b.count;
        pushing.twist = touch.resistance(marbles, [a.count, b.count]);
    }
}

fn touch<S: Scalar>(
    setting: &Setting<S, impl Fn(usize) -> Material<S>, impl Fn(usize) -> S>,
    marbles: &Columns<S>,
    walls: &impl Walls<S>,
    (two_marbles, a, b, part): (bool, u32, u32, u32),
    along: [S; 2],
) -> Option<Touch<S>> {
    // Which ends of capsules.
    let side = along.map(|x| if x > S::zero() { 2 } else { i8::from(x < S::zero()) });
    let key = (two_marbles, a, b, part, side);
    let (a, b) = (a as usize, b as usize);
    let place = |row: usize, along: S| marbles.position[row] + marbles.offset(row, along);
    // How far it has been moved since the step's own kick would have found it; see this module's
    // head. Along the normal of now: that is the one that knows which touches are seams.
    let moved = |row: usize| marbles.velocity[row] * (setting.dt * (setting.follow)(row));
    let mut way = moved(b);
    let own = (setting.material)(b);
    let mut closing = marbles.velocity[b] + marbles.swing(b, along[1]);
    let mut rim = marbles.rim(b);
    let center = place(b, along[1]);
    let mut curvature = S::one() / marbles.radius[b];
    let mut compliance = own.elasticity.compliance();
    let mut surface = Vec3::zero();
    let (normal, distance, both);
    if two_marbles {
        let other = (setting.material)(a);
        way -= moved(a);
        let apart = marbles.period.nearest(center - place(a, along[0]));
        let apart = direction_and_length(apart);
        let (direction, centers) = apart.unwrap_or((Vec3::unit_x(), S::zero()));
        (normal, distance) = (direction, centers - marbles.radius[a]);
        closing -= marbles.velocity[a] + marbles.swing(a, along[0]);
        rim += marbles.rim(a);
        curvature += S::one() / marbles.radius[a];
        compliance = compliance.and(other.elasticity.compliance());
        both = own.against(other);
    } else {
        (normal, distance) = walls.normal_and_distance(a, part, center);
        surface = walls.surface_velocity(a, center - normal * marbles.radius[b]);
        closing -= surface;
        let its = walls.material(a);
        both = its.map_or(own, |its| own.against(its));
        // A wall without a material of its own is rigid.
        if let Some(its) = its {
            compliance = compliance.and(its.elasticity.compliance());
        }
    }
    let none = Mobility { normal: S::zero(), tangent: S::zero() };
    let first = if two_marbles { marbles.mobility(a, along[0], -normal) } else { none };
    let touch = Touch {
        key,
        a: two_marbles.then_some(a),
        b,
        along,
        normal,
        overlap: marbles.radius[b] - distance + way.dot(normal),
        closing: closing + normal.cross(rim),
        surface,
        gives: [first, marbles.mobility(b, along[1], normal)],
        is_of_rods: marbles.rod(b).is_some() || two_marbles && marbles.rod(a).is_some(),
        curvature,
        material: both,
        compliance,
    };
    let touches = marbles.radius[b] > distance && touch.overlap > S::zero();
    let touches = touches && touch.overlap.is_finite();
    (touches && touch.give().normal > S::zero() && is_finite(touch.closing)).then_some(touch)
}

impl<S: Scalar> Touch<S> {
    fn give(&self) -> Mobility<S> {
        self.gives[0].and(self.gives[1])
    }

    fn velocities(&self, marbles: &Columns<S>) -> [Vec3<S>; 2] {
        [self.a.map_or_else(Vec3::zero, |a| marbles.velocity[a]), marbles.velocity[self.b]]
    }

    /// How its two points move against each other now, in m/s.
    fn closing(&self, marbles: &Columns<S>) -> Vec3<S> {
        let first = self.a.map_or(First::Wall(0, 0), |a| First::Marble(a as u32));
        marbles.closing(first, self.b, self.along, self.normal, self.surface)
    }

    fn parting(&self, marbles: &Columns<S>) -> S {
        self.closing(marbles).dot(self.normal)
    }

    /// Counts what an impulse did, after all have.
    fn count(&self, marbles: &Columns<S>, impulse: Vec3<S>, work: &mut Work) {
        let mean = cast_vector::<S, f64>(self.closing + self.closing(marbles)) * 0.5;
        self.count_as(marbles, impulse, mean, work);
        work.collisions += 1;
    }

    fn count_as(&self, marbles: &Columns<S>, impulse: Vec3<S>, mean: Vec3<f64>, work: &mut Work) {
        let surface = Some(cast_vector(self.surface));
        let fixed = [self.a.map_or(surface, |a| marbles.fixed(a)), marbles.fixed(self.b)];
        let (impulse, normal) = (cast_vector(impulse), cast_vector(self.normal));
        work.push(Push { impulse, normal, mean, fixed });
    }

    fn hit(&self, marbles: &mut Columns<S>, impulse: Vec3<S>) {
        let [first, second] = self.along;
        for (row, impulse, normal, along) in
            [(Some(self.b), impulse, self.normal, second), (self.a, -impulse, -self.normal, first)]
        {
            let Some(row) = row else { continue };
            marbles.hit(row, impulse * marbles.inverse_mass[row], normal, along);
        }
    }

    /// The angular impulse that would end that the two turn against each other, in kg m²/s, if
    /// each is shared by so many contacts; nothing where nothing resists.
    fn resistance(&self, marbles: &Columns<S>, counts: [S; 2]) -> Vec3<S> {
        let Material { rolling_resistance, spinning_resistance, .. } = self.material;
        if rolling_resistance == S::zero() && spinning_resistance == S::zero() {
            return Vec3::zero();
        }
        let mut give = marbles.inverse_inertia(self.b) * counts[1];
        if let Some(a) = self.a {
            give += marbles.inverse_inertia(a) * counts[0];
        }
        if give > S::zero() { self.turning(marbles) / give } else { Vec3::zero() }
    }

    /// How the second turns against the first, in rad/s.
    fn turning(&self, marbles: &Columns<S>) -> Vec3<S> {
        let first = self.a.map_or_else(Vec3::zero, |a| marbles.felt_spin(a));
        marbles.felt_spin(self.b) - first
    }
}

impl<S: Scalar> Pushing<S> {
    fn new(
        setting: &Setting<S, impl Fn(usize) -> Material<S>, impl Fn(usize) -> S>,
        touch: Touch<S>,
        before: &[Shear<S>],
    ) -> Self {
        let dt = setting.dt;
        let parting = touch.closing.dot(touch.normal);
        let held = before.binary_search_by_key(&touch.key, |shear| shear.key);
        let memory = held.map(|at| before[at]);
        let mut springs = setting.law.springs(&touch, touch.overlap, dt);
        let mut since = S::one();
        if memory.is_err() && parting < S::zero() {
            // It came into touch after the last kick; that and half of the time until the next
            // is how long it has been damped, at half of the overlap of then.
            let substep = -parting * dt;
            since = S::constant(0.5) + (touch.overlap / substep).min(S::one());
            let middle = setting.law.springs(&touch, since * substep * S::constant(0.5), dt);
            (springs.damping, springs.across_damping) = (middle.damping, middle.across_damping);
        }
        // A half of the step by the velocity before, a half by that after; a dashpot stops,
        // and turns nothing back.
        let half = S::constant(0.5) * dt;
        let give = touch.give();
        let drags = [
            springs.damping * give.normal * half * since,
            springs.across_damping * give.tangent * half * since,
        ]
        .map(|drag| drag.min(S::one()));
        let memory = memory.unwrap_or(Shear {
            key: touch.key,
            stretch: Vec3::zero(),
            across: S::zero(),
            stored: S::zero(),
            parting,
        });
        let (zero, none) = (S::zero(), Vec3::zero());
        Self {
            touch,
            springs,
            drags,
            memory,
            share: S::one(),
            shared_give: zero,
            sprung: zero,
            pressure: zero,
            impulse: none,
            twist: none,
        }
    }

    /// Sees what it pushes in a substep of `dt` seconds.
    fn decide(&mut self, dt: S) {
        let Touch { normal, closing, material, curvature, .. } = self.touch;
        let parting = closing.dot(normal);
        [self.sprung, self.pressure] = self.along_normal(self.springs.push, parting, dt);
        let sliding = closing - normal * parting;
        let limit = material.friction * self.pressure;
        // The plane of touch has turned since; the stretch turns along.
        let held = self.memory.stretch;
        let mut stretch = held - normal * held.dot(normal);
        let across = self.springs.across * self.share;
        if across > self.memory.across && self.memory.across > S::zero() {
            // A spring that gets stiffer keeps its force, or it would give more than it took.
            stretch *= self.memory.across / across;
        }
        stretch += sliding * dt;
        let drag = self.drags[1];
        let hold = across * dt / (S::one() + drag);
        if hold > S::zero() {
            // The spring stretches no further than friction holds.
            stretch = at_most(stretch, limit / hold);
        }
        let dashpot = S::constant(2.0) * drag * self.share / self.touch.give().tangent;
        let grip = at_most(-(stretch * hold + sliding * (dashpot / (S::one() + drag))), limit);
        self.memory.stretch = if is_finite(stretch) { stretch } else { Vec3::zero() };
        self.memory.across = across;
        self.impulse = normal * self.pressure + grip;
        let (roll, lever) = (self.twist, self.pressure / curvature);
        let about = normal * roll.dot(normal);
        self.twist = at_most(roll - about, material.rolling_resistance * lever)
            + at_most(about, material.spinning_resistance * lever);
    }

    /// What spring and dashpot push in a substep, of that the spring, and both; in N s.
    fn along_normal(&self, push: S, parting: S, dt: S) -> [S; 2] {
        let [drag, _] = self.drags;
        let part = self.share / (S::one() + drag);
        let dashpot = S::constant(2.0) * drag / self.touch.give().normal;
        let dashed = -dashpot * parting * part;
        let slowed = parting + self.shared_give * dashed.max(S::zero());
        let sprung = (push * dt * part).min(self.most(slowed));
        [sprung, (sprung + dashed).max(S::zero())]
    }

    /// How much the spring may push: no more than it has taken, whatever made it as stiff or
    /// as deep as it is; an overlap that it did not stop itself parts slowly.
    fn most(&self, parting: S) -> S {
        let give = self.shared_give;
        let mean = (self.memory.parting + parting) * S::constant(0.5);
        let stored = self.memory.stored.max(S::zero());
        let taken = (mean * mean + give * stored * S::constant(2.0)).sqrt() - mean;
        taken.max(self.slow() - parting).max(S::zero()) / give
    }

    /// How fast an overlap parts that no approach made: a radius in a second, in m/s.
    fn slow(&self) -> S {
        self.touch.curvature.recip()
    }

    fn apply(&self, marbles: &mut Columns<S>, work: Option<&mut Work>) {
        self.touch.hit(marbles, self.impulse);
        if self.twist.is_zero() {
            return;
        }
        let before = self.touch.turning(marbles);
        marbles.twist(self.touch.b, -self.twist);
        if let Some(a) = self.touch.a {
            marbles.twist(a, self.twist);
        }
        if let Some(work) = work {
            let after = self.touch.turning(marbles);
            work.twist(cast_vector(-self.twist), cast_vector(before), cast_vector(after));
        }
    }

    /// The overlap of the next kick, in metres.
    fn next_overlap(&self, dt: S, parting: S) -> S {
        self.touch.overlap - parting * dt
    }

    /// Whether the next substep will not find it in touch, though there it has something left
    /// to push.
    fn ends(
        &self,
        setting: &Setting<S, impl Fn(usize) -> Material<S>, impl Fn(usize) -> S>,
        marbles: &Columns<S>,
        parting: S,
    ) -> bool {
        let ahead = |row: usize| marbles.velocity[row] * (setting.follow)(row);
        let first = self.touch.a.map_or_else(Vec3::zero, ahead);
        let way = (ahead(self.touch.b) - first).dot(self.touch.normal) * setting.dt;
        let next = self.next_overlap(setting.dt, parting);
        next > S::zero() && next - way <= S::zero()
    }

    /// Gives the last push of a contact that ends.
    fn push_off(
        &self,
        setting: &Setting<S, impl Fn(usize) -> Material<S>, impl Fn(usize) -> S>,
        marbles: &mut Columns<S>,
        parting: S,
        work: Option<&mut Work>,
    ) {
        let part = self.next_overlap(setting.dt, parting) / self.touch.overlap;
        let push = self.springs.push * part;
        let [_, pressure] = self.along_normal(push, parting, setting.dt);
        let impulse = self.touch.normal * pressure;
        let before = self.touch.closing(marbles);
        self.touch.hit(marbles, impulse);
        if let Some(work) = work {
            let mean = cast_vector::<S, f64>(before + self.touch.closing(marbles)) * 0.5;
            self.touch.count_as(marbles, impulse, mean, work);
        }
    }

    /// What it knows in the next substep, if that is a number.
    fn remember(&self, parting: S) -> Option<Shear<S>> {
        let mean = (self.memory.parting + parting) * S::constant(0.5);
        let stored = (self.memory.stored - self.sprung * mean).max(S::zero());
        let memory = Shear { stored, parting, ..self.memory };
        let known = memory.stored.is_finite() && memory.parting.is_finite();
        (known && memory.across.is_finite()).then_some(memory)
    }
}
