mod gain;
mod solve;

use cgmath::{InnerSpace, Zero};

use crate::contact::Contacts;
use crate::math::{
    Point3, Scalar, Vec3, cast_vector, direction_and_length, is_finite, is_finite_point,
};
use crate::response::{BallSpin, Columns, Material, Mobility, Push, Work};
use gain::{Ledger, Rebound};
use solve::{Islands, solve};

/// How often overlap that is left after the velocities are solved is pushed out.
const POSITION_SWEEPS: u32 = 3;

/// What the solver is told, besides columns and contacts.
pub(crate) struct Settings<S> {
    /// The most sweeps over all contacts.
    pub iterations: u32,
    /// The length of the substep, in seconds; zero for a collision that takes no time.
    pub dt: S,
    /// Slower than this, in m/s, nothing bounces: what gravity does in two substeps.
    pub bounce_speed: S,
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
    fn marble(self) -> Option<usize> {
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
}

impl<S: Scalar> Scratch<S> {
    /// By how much a velocity still changed in the last sweep, at most, in m/s.
    pub fn residual(&self) -> S {
        self.islands.residual()
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
    friction: S,
    /// The relative velocity of the two points before, in m/s.
    begin: Vec3<S>,
    bounces: bool,
    /// The relative velocity of the two points that is asked for: along the normal at
    /// least this, across it this if friction suffices.
    rebound: S,
    slide: Vec3<S>,
    /// The impulse that was applied so far, times the mobility along the normal: in
    /// m/s, which a pebble and a boulder have in common.
    pressure: S,
    grip: Vec3<S>,
    /// What the last sweep changed of them, and the way on which the solver searches.
    step: Vec3<S>,
    way: Vec3<S>,
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
type Key = (bool, usize, usize, u32, [i8; 2]);

/// What a contact needed in the last substep, which is a good guess for this one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Warm<S> {
    key: Key,
    pressure: S,
    grip: Vec3<S>,
    twist: Vec3<S>,
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
        let zero = S::zero();
        // Which ends of capsules; one of them is often touched twice.
        let side = self.along.map(|along| if along > zero { 2 } else { i8::from(along < zero) });
        match self.a {
            First::Wall(wall, part) => (false, wall as usize, self.b, part, side),
            First::Marble(a) => (true, a as usize, self.b, 0, side),
        }
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
/// `material` gives that of a marble, `follow` how far its position follows a change of
/// velocity in its step, `start` where they were before it (empty, if nobody knows).
/// The contacts' rows exist. Rows that end up infinite or NaN lose
/// their velocity and are added to `stopped`.
pub(crate) fn impulse<S: Scalar>(
    marbles: &mut Columns<S>,
    contacts: &mut Contacts<S>,
    walls: &impl Walls<S>,
    material: impl Fn(usize) -> Material<S>,
    follow: impl Fn(usize) -> S,
    start: &[Point3<S>],
    settings: &Settings<S>,
    scratch: &mut Scratch<S>,
    warm: &mut Vec<Warm<S>>,
    stopped: &mut Vec<u32>,
) {
    contacts.sort();
    let Scratch { before, constraints, islands, ledgers, rebounds } = scratch;
    constraints.clear();
    before.clear();
    before.extend_from_slice(marbles.velocity);
    let prepare = |a: First, b: usize, along: [S; 2]| {
        let (mut normal, mut gap) = marbles.normal_and_gap(marbles.position, a, b, along, walls)?;
        let earlier = &Before(walls);
        if let Some((earlier, overlap)) = marbles.normal_and_gap(start, a, b, along, earlier) {
            // What pushes along the mean normal of a step does no work, and neither does
            // an overlap that stays what it was.
            let mean = direction_and_length(normal + earlier);
            (normal, gap) = (mean.map_or(normal, |(mean, _)| mean), gap - overlap.min(S::zero()));
        }
        let own = material(b);
        let (surface, material) = match a {
            First::Wall(wall, _) => {
                let touch =
                    marbles.position[b] + marbles.offset(b, along[1]) - normal * marbles.radius[b];
                let wall = wall as usize;
                let material = walls.material(wall).map_or(own, |its| own.against(its));
                (walls.surface_velocity(wall, touch), material)
            }
            First::Marble(a) => (Vec3::zero(), own.against(material(a as usize))),
        };
        let mobility = marbles.mobility_of_both(a, b, along, normal);
        let closing = marbles.closing(a, b, along, normal, surface);
        let approach = -closing.dot(normal);
        // The positions have moved on already, and will follow what changes now. So
        // this speed is just enough to keep the gap from closing.
        let follow = match a {
            First::Wall(..) => follow(b),
            First::Marble(a) => (follow(a as usize) + follow(b)) * S::constant(0.5),
        } * settings.dt;
        let closed = if settings.dt == S::zero() {
            S::zero()
        } else if follow > S::zero() {
            -approach - gap / follow
        } else {
            -gap / settings.dt
        };
        let bounces = approach > settings.bounce_speed && closed > -approach;
        let (rebound, slide) = if bounces {
            let sliding = closing + normal * approach;
            (material.restitution * approach, sliding * -material.tangential_restitution)
        } else {
            (closed.min(S::zero()), Vec3::zero())
        };
        let mut constraint = Constraint {
            a,
            b,
            along,
            island: 0,
            normal,
            surface,
            mobility,
            friction: material.friction,
            begin: closing,
            bounces,
            rebound,
            slide,
            pressure: S::zero(),
            grip: Vec3::zero(),
            step: Vec3::zero(),
            way: Vec3::zero(),
            resistance: marbles.resistance(a, b, material),
        };
        // What bounces had nothing to bear before.
        let guess = warm.binary_search_by_key(&constraint.key(), |warm| warm.key);
        if let (Ok(at), false) = (guess, bounces) {
            let Warm { pressure, grip, twist, .. } = warm[at];
            constraint.pressure = pressure;
            constraint.grip = grip - normal * grip.dot(normal);
            if let Some(resistance) = &mut constraint.resistance {
                resistance.twist = twist;
            }
        }
        (mobility.normal > S::zero()).then_some(constraint)
    };
    let wm = contacts.wm.iter().map(|c| (First::Wall(c.a, c.part), c));
    let mm = contacts.mm.iter().map(|c| (First::Marble(c.a), c));
    constraints.extend(wm.chain(mm).filter_map(|(a, c)| prepare(a, c.b as usize, c.along)));

    for c in constraints.iter() {
        marbles.hit_both(c, c.impulse());
        if let Some(resistance) = c.resistance {
            marbles.twist_both(c, resistance.twist);
        }
    }
    solve(marbles, constraints, islands, settings);
    marbles.gain_nothing(constraints, islands, ledgers, rebounds, settings);
    for (row, before) in before.iter().enumerate() {
        let moved = (marbles.velocity[row] - before) * (follow(row) * settings.dt);
        let position = marbles.position[row] + moved;
        if is_finite_point(position) {
            marbles.position[row] = position;
        }
    }
    for _ in 0..POSITION_SWEEPS {
        for constraint in constraints.iter() {
            marbles.push_apart(constraint, walls, settings);
        }
    }
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
    /// surfaces are apart (negative for an overlap). Coincident centers part along +x.
    /// None where the column of positions is empty, or for a gap that is not finite.
    fn normal_and_gap(
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
                let apart = direction_and_length(second - first);
                let (normal, distance) = apart.unwrap_or((Vec3::unit_x(), S::zero()));
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

    /// Moves what overlaps too deep half of the way apart, the lighter one further.
    ///
    /// A little overlap stays: what rests then need not fall back in every substep.
    fn push_apart(&mut self, c: &Constraint<S>, walls: &impl Walls<S>, settings: &Settings<S>) {
        let Some((normal, gap)) = self.normal_and_gap(self.position, c.a, c.b, c.along, walls)
        else {
            return;
        };
        let smaller =
            c.a.marble().map_or(self.radius[c.b], |a| self.radius[a].min(self.radius[c.b]));
        let excess = -gap - settings.slop.min(smaller * settings.largest_slop);
        if excess <= S::zero() {
            return;
        }
        let push = normal * (excess * S::constant(0.5) / c.mobility.normal);
        for (row, by) in [(Some(c.b), push), (c.a.marble(), -push)] {
            let Some(row) = row else { continue };
            let position = self.position[row] + by * self.inverse_mass[row];
            if is_finite_point(position) {
                self.position[row] = position;
            }
        }
    }
}
