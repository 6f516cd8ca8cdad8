//! The impulse method, which [`Response::Impulse`](super::Response::Impulse) is, and which holds
//! heaps for [`Response::EventDriven`](super::Response::EventDriven).

mod gain;
mod islands;
mod place;
mod prepare;
mod solve;

use cgmath::{InnerSpace, Zero};

use crate::contact::{Contact, Contacts};
use crate::math::{
    Mat3, Point3, Scalar, Vec3, any_direction, cast_vector, direction_and_length, is_finite,
};
use crate::response::{BallSpin, Columns, Material, Mobility, Push, Work};
use gain::{Ledger, Rebound};
pub(super) use islands::Groups;
use islands::{DIRECTIONS, Islands};
use prepare::prepare;
use solve::solve;

/// What the solver is told, besides columns and contacts.
pub(crate) struct Around<'a, S, W, M, F> {
    pub walls: &'a W,
    /// Gives the material of a marble, by row.
    pub material: M,
    /// How far the position of a row follows a change of its velocity in this substep, in
    /// substeps.
    pub follow: F,
    pub start: Start<'a, S>,
    pub settings: &'a Settings<S>,
}

/// Where marbles were before the substep, and how they moved. Empty where nobody knows.
#[derive(Clone, Copy)]
pub(crate) struct Start<'a, S> {
    pub position: &'a [Point3<S>],
    /// Before forces changed it, in m/s.
    pub velocity: &'a [Vec3<S>],
    /// For rows that were stopped within the substep, the part of a change of velocity that their
    /// positions still follow, per substep; empty if none was.
    pub stands: &'a [Option<Mat3<S>>],
}

pub(crate) struct Settings<S> {
    /// The most sweeps over all contacts.
    pub iterations: u32,
    /// The length of the substep, in seconds; zero for a collision that takes no time.
    pub dt: S,
    /// Slower than this, in m/s, nothing bounces: what gravity does in two substeps.
    pub bounce_speed: S,
    /// Sweeps end where the last one changed no velocity by more than this, in m/s.
    pub enough: S,
    /// The overlap that may stay, in metres, so that what rests keeps touching.
    pub slop: S,
    /// The same as a part of the smaller radius, at most.
    pub largest_slop: S,
}

/// The first thing of a contact, by row.
#[derive(Clone, Copy, Debug)]
pub(super) enum First {
    /// And a part of it.
    Wall(u32, u32),
    Marble(u32),
}

impl First {
    /// All contacts, those with walls first.
    pub(super) fn of_each<S>(contacts: &Contacts<S>) -> impl Iterator<Item = (Self, &Contact<S>)> {
        let wm = contacts.wm.iter().map(|c| (Self::Wall(c.a, c.part), c));
        wm.chain(contacts.mm.iter().map(|c| (Self::Marble(c.a), c)))
    }

    pub(super) fn marble(self) -> Option<usize> {
        match self {
            Self::Wall(..) => None,
            Self::Marble(row) => Some(row as usize),
        }
    }
}

/// What the method only scribbles on.
#[derive(Clone, Debug, Default)]
pub(crate) struct Scratch<S> {
    before: Vec<Vec3<S>>,
    constraints: Vec<Constraint<S>>,
    islands: Islands<S>,
    ledgers: Vec<Ledger<S>>,
    rebounds: Vec<Rebound<S>>,
    gaps: Vec<S>,
}

impl<S: Scalar> Scratch<S> {
    /// By how much a velocity still changed in the last sweep, at most, in m/s.
    pub fn residual(&self) -> S {
        self.islands.residual()
    }

    /// Number of times that a contact was solved, over all sweeps.
    pub fn solved(&self) -> u64 {
        self.islands.solved
    }

    /// Gives the energy that each wall, and each marble of infinite mass, brought to a row by how
    /// it moves, in joules.
    pub fn for_each_carried(
        &self,
        velocity: &[Vec3<S>],
        inverse_mass: &[S],
        mut give: impl FnMut(usize, S),
    ) {
        for c in &self.constraints {
            let impulse = c.impulse() / c.mobility.normal;
            match c.a {
                First::Wall(..) => give(c.b, impulse.dot(c.surface)),
                First::Marble(a) => {
                    let (a, b) = (a as usize, c.b);
                    for (one, other, impulse) in [(a, b, impulse), (b, a, -impulse)] {
                        if inverse_mass[one] == S::zero() {
                            give(other, impulse.dot(velocity[one]));
                        }
                    }
                }
            }
        }
    }

    /// Counts what the contacts of the last substep did. `velocity` and `spin` are those at its
    /// beginning: what rests has none there, and then no contact works on it. What bounces does
    /// so at one moment, when the forces of the substep have done their part.
    pub fn count(
        &self,
        marbles: &mut Columns<S>,
        velocity: &mut [Vec3<S>],
        spin: &mut [Vec3<S>],
        work: &mut Work,
    ) {
        if velocity.len() != marbles.velocity.len() || spin.len() < marbles.spin.len() {
            return; // the first step with an account of it
        }
        let spins = marbles.spin.len();
        let motions = |marbles: &Columns<S>| -> Vec<_> {
            let motion = |c: &Constraint<S>| marbles.motion(c);
            self.constraints.iter().map(motion).collect()
        };
        let after = motions(marbles);
        marbles.velocity.swap_with_slice(velocity);
        marbles.spin.swap_with_slice(&mut spin[..spins]);
        let before = motions(marbles);
        marbles.velocity.swap_with_slice(velocity);
        marbles.spin.swap_with_slice(&mut spin[..spins]);
        for ((c, after), before) in self.constraints.iter().zip(after).zip(before) {
            let closing = if c.bounces { cast_vector(c.begin) } else { before[0] };
            let first = match c.a {
                First::Wall(..) => Some(cast_vector(c.surface)),
                First::Marble(a) => marbles.fixed(a as usize),
            };
            work.push(Push {
                impulse: cast_vector::<S, f64>(c.impulse()) / c.mobility.normal.as_f64(),
                normal: cast_vector(c.normal),
                mean: (closing + after[0]) * 0.5,
                fixed: [first, marbles.fixed(c.b)],
            });
            work.twist(cast_vector(c.twist()), before[1], after[1]);
            work.collisions += u32::from(c.bounces && c.pressure > S::zero());
        }
    }
}

/// A contact while it is solved.
#[derive(Clone, Copy, Debug)]
pub(super) struct Constraint<S> {
    a: First,
    b: usize,
    /// How far along the axis of each it is touched.
    along: [S; 2],
    /// Which island it is of.
    island: u32,
    /// From a to b.
    normal: Vec3<S>,
    /// The velocity of the wall's surface, in m/s; zero between marbles.
    surface: Vec3<S>,
    mobility: Mobility<S>,
    restitution: S,
    /// How friction is bounded: by this part of the pressure, and by so much, in m/s.
    friction: S,
    bound: S,
    /// The relative velocity of the two points before, in m/s, and how they turn against each
    /// other, in rad/s.
    begin: Vec3<S>,
    begin_turning: Vec3<S>,
    bounces: bool,
    /// The time since it bounced, in seconds, for which positions follow; none if that is for
    /// as long as the integrator says.
    since: Option<S>,
    /// The relative velocity that forces have given since the bounce, counted as the integrator
    /// counts, in m/s.
    lag: Vec3<S>,
    /// The relative velocity of the two points that is asked for: along the normal at
    /// least this, across it this if friction suffices.
    rebound: S,
    slide: Vec3<S>,
    /// The impulse that was applied so far, times the mobility along the normal: in
    /// m/s, which a pebble and a boulder have in common.
    pressure: S,
    grip: Vec3<S>,
    /// The least that the pressure may be.
    least: S,
    /// Directions of the search, as impulses: the last sweep and the ways before; the relative velocity
    /// that each gives, in m/s; and the change of velocity asked for where the search began, in m/s.
    ways: [Vec3<S>; DIRECTIONS],
    given: [Vec3<S>; DIRECTIONS],
    wanted: Vec3<S>,
    resistance: Option<Resistance<S>>,
}

/// What resists rolling and spinning in a contact.
#[derive(Clone, Copy, Debug)]
struct Resistance<S> {
    /// The largest torque over the normal force, about the touching plane and about the
    /// normal, in metres.
    rolling: S,
    spinning: S,
    /// The change of the relative spin per angular impulse, in 1/(kg m²).
    give: S,
    /// The angular impulse that was applied so far, in kg m²/s.
    twist: Vec3<S>,
}

/// Names a contact: walls first, then by rows.
pub(super) type Key = (bool, usize, usize, u32, [i8; 2]);

/// What a contact needed in the last substep, which is a good guess for this one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Warm<S> {
    key: Key,
    pressure: S,
    grip: Vec3<S>,
    twist: Vec3<S>,
}

/// The name of a contact.
pub(super) fn key_of<S: Scalar>(a: First, b: usize, along: [S; 2]) -> Key {
    let zero = S::zero();
    // Which ends of capsules; one of them is often touched twice.
    let side = along.map(|along| if along > zero { 2 } else { i8::from(along < zero) });
    match a {
        First::Wall(wall, part) => (false, wall as usize, b, part, side),
        First::Marble(a) => (true, a as usize, b, 0, side),
    }
}

impl<S: Scalar> Warm<S> {
    /// Warm start of a contact without friction, from its normal impulse as a change of speed, in m/s.
    pub(super) fn of_pressure(key: Key, pressure: S) -> Self {
        Self { key, pressure, grip: Vec3::zero(), twist: Vec3::zero() }
    }

    pub(super) fn key(&self) -> Key {
        self.key
    }

    pub(super) fn pressure(&self) -> S {
        self.pressure
    }
}

impl<S> Warm<S> {
    /// Calls its marbles by other names. False if one of them has none.
    pub fn rename(&mut self, name: impl Fn(usize) -> Option<usize>) -> bool {
        let (two_marbles, a, b, part, side) = self.key;
        let a = if two_marbles { name(a) } else { Some(a) };
        let (Some(a), Some(b)) = (a, name(b)) else { return false };
        self.key = (two_marbles, a, b, part, side);
        true
    }
}

impl<S: Scalar> Constraint<S> {
    fn key(&self) -> Key {
        key_of(self.a, self.b, self.along)
    }

    /// All that it applied, times the mobility along the normal, in m/s.
    fn impulse(&self) -> Vec3<S> {
        self.normal * self.pressure + self.grip
    }

    /// The angular impulse that it applied besides, in kg m²/s.
    fn twist(&self) -> Vec3<S> {
        self.resistance.map_or_else(Vec3::zero, |resistance| resistance.twist)
    }
}

/// [`Response::Impulse`](super::Response::Impulse): sequential impulses (Catto,
/// *Iterative dynamics with temporal coherence*, 2005) with the friction of a cone,
/// not of a pyramid, bounded by the accumulated normal impulse, restitution included.
///
/// The contacts' rows exist. Rows that end up infinite or NaN lose their velocity and are
/// added to `stopped`.
pub(crate) fn impulse<S: Scalar>(
    marbles: &mut Columns<S>,
    contacts: &mut Contacts<S>,
    around: &Around<S, impl Walls<S>, impl Fn(usize) -> Material<S>, impl Fn(usize) -> S>,
    scratch: &mut Scratch<S>,
    warm: &mut Vec<Warm<S>>,
    stopped: &mut Vec<u32>,
) {
    contacts.sort();
    let settings = around.settings;
    let Scratch { before, constraints, islands, ledgers, rebounds, gaps } = scratch;
    before.clear();
    before.extend_from_slice(marbles.velocity);
    prepare(marbles, contacts, around, constraints, islands);
    marbles.warm_start(constraints, warm);
    marbles.take_back(constraints, islands, ledgers);
    solve(marbles, constraints, islands, settings);
    marbles.gain_nothing(constraints, islands, ledgers, rebounds, settings);
    marbles.follow(before, constraints, around);
    marbles.push_apart(constraints, around, gaps);
    remember(constraints, warm);
    marbles.stop_what_overflowed(constraints, stopped);
}

/// Keeps what the contacts bore for the next substep.
fn remember<S: Scalar>(constraints: &[Constraint<S>], warm: &mut Vec<Warm<S>>) {
    warm.clear();
    warm.extend(constraints.iter().map(|c| Warm {
        key: c.key(),
        pressure: c.pressure,
        grip: c.grip,
        twist: c.twist(),
    }));
    warm.sort_unstable_by_key(|warm| warm.key);
}

/// What the solver asks of walls, by row.
pub(crate) trait Walls<S> {
    /// The normal of a part of the wall, and how far a point is in front of it.
    fn normal_and_distance(&self, wall: usize, part: u32, point: Point3<S>) -> (Vec3<S>, S);
    /// The same when the step began, for walls that were elsewhere then.
    fn normal_and_distance_before(&self, wall: usize, part: u32, point: Point3<S>) -> (Vec3<S>, S) {
        self.normal_and_distance(wall, part, point)
    }
    /// How its surface moves at a point, in m/s.
    fn surface_velocity(&self, wall: usize, point: Point3<S>) -> Vec3<S>;
    /// Its own material, if it has one.
    fn material(&self, wall: usize) -> Option<Material<S>>;
}

/// Walls as they were when the step began.
struct Before<'a, W>(&'a W);

impl<S, W: Walls<S>> Walls<S> for Before<'_, W> {
    fn normal_and_distance(&self, wall: usize, part: u32, point: Point3<S>) -> (Vec3<S>, S) {
        self.0.normal_and_distance_before(wall, part, point)
    }

    fn surface_velocity(&self, wall: usize, point: Point3<S>) -> Vec3<S> {
        self.0.surface_velocity(wall, point)
    }

    fn material(&self, wall: usize) -> Option<Material<S>> {
        self.0.material(wall)
    }
}

impl<S: Scalar> Columns<'_, S> {
    /// The unit vector from the first to the second of a contact, and how far their
    /// surfaces are apart (negative for an overlap). Coincident centers part any way, each pair
    /// its own.
    /// None where the column of positions is empty, or for a gap that is not finite.
    pub(super) fn normal_and_gap(
        &self,
        position: &[Point3<S>],
        a: First,
        b: usize,
        along: [S; 2],
        walls: &impl Walls<S>,
    ) -> Option<(Vec3<S>, S)> {
        let second = *position.get(b)? + self.offset(b, along[1]);
        let (normal, distance) = match a {
            First::Wall(wall, part) => walls.normal_and_distance(wall as usize, part, second),
            First::Marble(a) => {
                let a = a as usize;
                let first = *position.get(a)? + self.offset(a, along[0]);
                let apart = direction_and_length(self.period.nearest(second - first));
                let (normal, distance) =
                    apart.unwrap_or_else(|| (any_direction(a as u32, b as u32), S::zero()));
                (normal, distance - self.radius[a])
            }
        };
        let gap = distance - self.radius[b];
        gap.is_finite().then_some((normal, gap))
    }

    /// How easily the two of a contact give way.
    fn mobility_of_both(&self, a: First, b: usize, along: [S; 2], normal: Vec3<S>) -> Mobility<S> {
        if self.rods.is_empty() {
            let first = a.marble().map_or((S::zero(), BallSpin::Ignored), |a| {
                (self.inverse_mass[a], self.ball_spin(a))
            });
            return Mobility::of([first, (self.inverse_mass[b], self.ball_spin(b))]);
        }
        let second = self.mobility(b, along[1], normal);
        a.marble().map_or(second, |a| second.and(self.mobility(a, along[0], -normal)))
    }

    /// The velocity of the second's touching point relative to the first's, in m/s.
    pub(super) fn closing(
        &self,
        a: First,
        b: usize,
        along: [S; 2],
        normal: Vec3<S>,
        surface: Vec3<S>,
    ) -> Vec3<S> {
        let mut velocity = self.velocity[b] - surface;
        let mut rim = self.rim(b);
        if let Some(a) = a.marble() {
            velocity -= self.velocity[a];
            rim += self.rim(a);
        }
        if !self.rods.is_empty() {
            velocity += self.swing(b, along[1]);
            if let Some(a) = a.marble() {
                velocity -= self.swing(a, along[0]);
            }
        }
        velocity + normal.cross(rim)
    }

    /// How the second of a contact moves and turns against the first, in m/s and rad/s.
    fn motion(&self, c: &Constraint<S>) -> [Vec3<f64>; 2] {
        let first = c.a.marble().map_or_else(Vec3::zero, |a| self.felt_spin(a));
        let closing = self.closing(c.a, c.b, c.along, c.normal, c.surface);
        [cast_vector(closing), cast_vector(self.felt_spin(c.b) - first)]
    }

    /// The velocity of what nothing can move.
    pub(super) fn fixed(&self, row: usize) -> Option<Vec3<f64>> {
        let fixed = self.inverse_mass[row] == S::zero();
        fixed.then(|| cast_vector(self.velocity[row]))
    }

    /// What resists rolling and spinning between two, or a wall and one, if anything does.
    fn resistance(&self, a: First, b: usize, material: Material<S>) -> Option<Resistance<S>> {
        let Material { rolling_resistance, spinning_resistance, .. } = material;
        let none = rolling_resistance == S::zero() && spinning_resistance == S::zero();
        if none {
            return None;
        }
        let give = |row: usize| self.inverse_inertia(row);
        let (radius, give) = match a {
            First::Wall(..) => (self.radius[b], give(b)),
            First::Marble(a) => {
                let a = a as usize;
                let (r, s) = (self.radius[a], self.radius[b]);
                (r * s / (r + s), give(a) + give(b))
            }
        };
        (give > S::zero()).then(|| Resistance {
            rolling: rolling_resistance * radius,
            spinning: spinning_resistance * radius,
            give,
            twist: Vec3::zero(),
        })
    }

    /// Takes the velocity of what became infinite or NaN, and names it.
    fn stop_what_overflowed(&mut self, constraints: &[Constraint<S>], stopped: &mut Vec<u32>) {
        for row in constraints.iter().flat_map(|c| [Some(c.b), c.a.marble()]).flatten() {
            if !is_finite(self.velocity[row]) {
                self.velocity[row] = Vec3::zero();
                stopped.push(row as u32);
            }
        }
    }

    /// Begins with what the contacts bore in the last substep. What bounces had nothing to
    /// bear before.
    fn warm_start(&mut self, constraints: &mut [Constraint<S>], warm: &[Warm<S>]) {
        for c in constraints.iter_mut().filter(|c| !c.bounces) {
            let Ok(at) = warm.binary_search_by_key(&c.key(), |warm| warm.key) else { continue };
            let Warm { pressure, grip, twist, .. } = warm[at];
            c.pressure = pressure;
            c.grip = grip - c.normal * grip.dot(c.normal);
            self.hit_both(c, c.impulse());
            if let Some(resistance) = &mut c.resistance {
                resistance.twist = twist;
                self.twist_both(c, twist);
            }
        }
    }

    /// Applies an angular impulse to the second of a contact, its opposite to the first.
    fn twist_both(&mut self, c: &Constraint<S>, twist: Vec3<S>) {
        self.twist(c.b, twist);
        if let Some(a) = c.a.marble() {
            self.twist(a, -twist);
        }
    }

    /// Applies an impulse to the second of a contact, and its opposite to the first;
    /// `change` is the impulse times the mobility along the normal.
    fn hit_both(&mut self, c: &Constraint<S>, change: Vec3<S>) {
        // The impulse itself, of a pebble, may be too small for the scalar.
        let part = |row: usize| self.inverse_mass[row] / c.mobility.normal;
        let second = change * part(c.b);
        if let Some(a) = c.a.marble() {
            let first = -change * part(a);
            self.hit(a, first, -c.normal, c.along[0]);
        }
        self.hit(c.b, second, c.normal, c.along[1]);
    }
}
