//! A ball on a surface that bends or turns under it: a sphere, an edge, a tilting board.
//!
//! The center moves over the surface that is a radius away from the wall's. With `n` the
//! normal where the ball is, `w` the velocity of the wall there, and `v` that of the ball
//! relative to it, touching on means `n · v = 0` all the time; so the acceleration along the
//! normal is known, and with it the pressure: on a sphere, `N = g cos θ − v² / (R + r)`. The
//! rest is as on a plane, see [`support`](super::support). Integrated in short steps (Kutta
//! 1901), which end where the pressure does.

use std::cell::Cell;

use cgmath::{InnerSpace, Zero};

use super::{Ball, Wall};
use crate::math::{Point3, Vec3, direction_and_length};
use crate::response::{BallSpin, Material};
use crate::shape::PointProjection;

/// By what angle the normal may turn in one step, in radians: what a step leaves out is of
/// its fifth power.
const BEND: f64 = 0.02;
/// A step is not shorter than this part of a substep.
const SHORTEST: f64 = 1.0 / 4096.0;
/// After so many steps in one substep a ball takes longer ones, twice as long each time that it
/// took [`PATIENCE`] more, so that it comes to the end. So many go over 2.5 radians, and over
/// more borders of faces than one substep has for what it should show.
const MOST_STEPS: u32 = 128;
/// Thus 12 times as many steps more end every substep.
const PATIENCE: u32 = 8;
/// Over a way shorter than this part of the radius a ball is where it was: its direction is
/// rounding, and nothing bends otherwise.
const NO_WAY: f64 = 1e-9;
/// Distance beside a point, over the radius, at which the normal is looked at again, to see how it
/// turns.
/// The rounding of one over the other is a hundred billionth.
const BESIDE: f64 = 1e-5;
/// Another face, edge or corner bends by so much more or less, over a radius.
const CORNER: f64 = 0.1;
/// Number of halvings of a time to find the moment when something ends.
const HALVINGS: u32 = 24;
/// Flat is a surface that turns by less than this over a radius: that is rounding.
const FLAT: f64 = 1e-9;

/// Surface below a ball, and how it is pulled there.
pub(super) struct Ground<'a> {
    pub walls: &'a [Wall],
    /// The walls that it may be on before the step is over.
    pub near: &'a [u32],
    pub pull: Vec3<f64>,
    pub radius: f64,
    pub spins: BallSpin,
    pub material: Material<f64>,
    /// No step is shorter, in seconds.
    pub shortest: f64,
    /// Cost so far, in looks.
    pub looks: Cell<u64>,
}

/// Where a ball is and how it moves.
#[derive(Clone, Copy, Debug)]
pub(super) struct State {
    pub time: f64,
    pub position: Point3<f64>,
    pub velocity: Vec3<f64>,
    pub spin: Vec3<f64>,
}

impl State {
    pub fn of(ball: &Ball) -> Self {
        let Ball { position, velocity, spin, path, .. } = *ball;
        Self { time: path.begin, position, velocity, spin }
    }

    fn after(self, rate: Rate, dt: f64) -> Self {
        Self {
            time: self.time + dt,
            position: self.position + rate.velocity * dt,
            velocity: self.velocity + rate.acceleration * dt,
            spin: self.spin + rate.spin * dt,
        }
    }
}

#[derive(Clone, Copy, Debug)]
struct Rate {
    velocity: Vec3<f64>,
    acceleration: Vec3<f64>,
    spin: Vec3<f64>,
}

/// Motion of the touching point.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Regime {
    Slides,
    Rolls,
    Rests,
}

/// Touch of a ball and what it lies on.
#[derive(Clone, Copy, Debug)]
pub(super) struct Touch {
    pub wall: usize,
    pub normal: Vec3<f64>,
    /// The normal force over the mass that keeps it touching, in m/s²; below zero, it leaves.
    pub pressure: f64,
    /// The velocity of the touching point along the surface, in m/s.
    pub slip: Vec3<f64>,
    /// Rate of change of the normal, in 1/s.
    pub bend: Vec3<f64>,
    /// Rate of change of the surface's velocity under the touching point, in m/s².
    surface_rate: Vec3<f64>,
    material: Material<f64>,
}

/// Where a step ends.
#[derive(Clone, Copy, Debug)]
pub(super) struct Step {
    pub end: State,
    /// True if it ends because the ball comes off.
    pub leaves: bool,
}

impl Ground<'_> {
    /// The wall that a ball there would be on: the nearest, and of several the first.
    fn nearest(&self, at: Point3<f64>, time: f64) -> (usize, PointProjection<f64>) {
        self.looks.set(self.looks.get() + super::PART_LOOKS * self.near.len() as u64);
        let nowhere = PointProjection { point: at, normal: Vec3::zero(), distance: f64::INFINITY };
        self.near.iter().fold((usize::MAX, nowhere), |best, wall| {
            let wall = *wall as usize;
            if self.walls[wall].at_least(at, time) > best.1.distance {
                return best;
            }
            let next = (wall, self.walls[wall].nearest(at, time));
            let nearer = (next.1.distance, next.0) < (best.1.distance, best.0);
            if nearer { next } else { best }
        })
    }

    /// Rate of change of the normal for a point that goes over the wall, in 1/s.
    fn turning(&self, at: Point3<f64>, time: f64, normal: Vec3<f64>, over: Vec3<f64>) -> Vec3<f64> {
        let Some((along, speed)) = direction_and_length(over) else { return Vec3::zero() };
        let beside = BESIDE * self.radius;
        let there = self.nearest(at + along * beside, time).1.normal - normal;
        let there = there - normal * there.dot(normal);
        if there.magnitude() * self.radius <= FLAT * beside {
            return Vec3::zero();
        }
        there * (speed / beside)
    }

    /// Tests if the surface is flat around a point, and does not turn but about its normal.
    pub fn is_flat(&self, state: &State) -> bool {
        let (wall, PointProjection { normal, .. }) = self.nearest(state.position, state.time);
        let Some(wall) = self.walls.get(wall) else { return false };
        if wall.going(0.0).is_some_and(|(motion, _)| {
            motion.angular_velocity.cross(normal).magnitude()
                > 1e-12 * motion.angular_velocity.magnitude()
        }) {
            return false;
        }
        let (x, y) = across(normal);
        let bends = |way| !self.turning(state.position, state.time, normal, way).is_zero();
        self.near.len() == 1 && matches!(wall.form, super::Form::Plane { .. })
            || ![x, -x, y, -y].into_iter().any(bends)
    }

    /// Tests if the normal at a place is this one.
    pub fn has_normal(&self, at: Point3<f64>, time: f64, normal: Vec3<f64>) -> bool {
        (self.nearest(at, time).1.normal - normal).magnitude() <= FLAT
    }

    /// Touch of a ball and what it is nearest to.
    pub fn touch(&self, state: &State) -> Option<Touch> {
        let State { time, position, velocity, spin } = *state;
        let (number, PointProjection { normal, .. }) = self.nearest(position, time);
        let wall = self.walls.get(number)?;
        let over = velocity - wall.way(position, time);
        let along = |x: Vec3<f64>| x - normal * x.dot(normal);
        let curve = self.turning(position, time, normal, along(over));
        let (mut needed, mut bend) = (-curve.dot(over), curve);
        let point = position - normal * self.radius;
        let mut surface_rate = Vec3::zero();
        if let Some((motion, _)) = wall.going(time) {
            let turning = motion.angular_velocity;
            bend += turning.cross(normal);
            needed += normal.dot(turning.cross(velocity - motion.velocity + over));
            surface_rate = turning.cross(velocity - bend * self.radius - motion.velocity);
        } else if let Some(motion) = wall.motion {
            let full = motion.velocity_at(point);
            surface_rate = motion.angular_velocity.cross(velocity - bend * self.radius);
            surface_rate -= bend * full.dot(normal);
        }
        let mut slip = along(velocity - wall.surface_velocity(normal, point, time));
        if self.spins == BallSpin::Free {
            slip += normal.cross(spin) * self.radius;
        }
        // A difference of speeds has the rounding of the speeds.
        let speeds = velocity.magnitude() + spin.magnitude() * self.radius;
        if slip.magnitude() <= 1e-14 * speeds {
            slip = Vec3::zero();
        }
        Some(Touch {
            wall: number,
            normal,
            pressure: needed - self.pull.dot(normal),
            slip,
            bend,
            surface_rate: along(surface_rate),
            material: wall.against(self.material),
        })
    }

    /// Resistance to rolling, as a change of the touching point's velocity by the spin.
    fn resistance(&self, touch: &Touch, spin: Vec3<f64>) -> Vec3<f64> {
        if self.spins == BallSpin::Ignored || touch.material.rolling_resistance == 0.0 {
            return Vec3::zero();
        }
        let rolls = touch.normal.cross(spin) * self.radius;
        let pull = self.pull - touch.normal * self.pull.dot(touch.normal);
        direction_and_length(rolls)
            .or_else(|| direction_and_length(touch.surface_rate - pull))
            .map_or_else(Vec3::zero, |(against, _)| {
                against * (-2.5 * touch.material.rolling_resistance * touch.pressure)
            })
    }

    /// By how much a friction of one changes the touching point's velocity.
    fn give(&self) -> f64 {
        1.0 + self.spins.of_solid_ball::<f64>()
    }

    /// The friction that keeps the slip what it is, over the mass.
    fn holding(&self, touch: &Touch, spin: Vec3<f64>) -> Vec3<f64> {
        let normal = touch.normal;
        let along = |x: Vec3<f64>| x - normal * x.dot(normal);
        let mut needed = touch.surface_rate - along(self.pull);
        if self.spins == BallSpin::Free {
            needed -= along(touch.bend.cross(spin)) * self.radius;
            needed -= self.resistance(touch, spin);
        }
        needed / self.give()
    }

    fn regime(&self, touch: &Touch, spin: Vec3<f64>) -> Regime {
        let limit = touch.material.friction * touch.pressure;
        if !touch.slip.is_zero() {
            return Regime::Slides;
        }
        let pull = self.pull - touch.normal * self.pull.dot(touch.normal);
        let holds = touch.material.rolling_resistance * touch.pressure;
        let rests = touch.normal.cross(spin).is_zero() || self.spins == BallSpin::Ignored;
        let needed = (touch.surface_rate - pull).magnitude();
        if rests && needed <= holds.min(limit) {
            Regime::Rests
        } else if self.holding(touch, spin).magnitude() <= limit {
            Regime::Rolls
        } else {
            Regime::Slides
        }
    }

    fn rate(&self, state: &State, regime: Regime) -> Option<Rate> {
        let touch = self.touch(state)?;
        let limit = touch.material.friction * touch.pressure.max(0.0);
        let normal = touch.normal;
        let pull = self.pull - normal * self.pull.dot(normal);
        let friction = match regime {
            Regime::Rests => touch.surface_rate - pull,
            Regime::Rolls => self.holding(&touch, state.spin),
            Regime::Slides => {
                let holding = || direction_and_length(self.holding(&touch, state.spin));
                direction_and_length(-touch.slip)
                    .or_else(holding)
                    .map_or_else(Vec3::zero, |(against, _)| against * limit)
            }
        };
        let mut spin = Vec3::zero();
        if self.spins == BallSpin::Free && regime != Regime::Rests {
            let rim = friction * 2.5 + self.resistance(&touch, state.spin);
            spin = rim.cross(normal) / self.radius;
            let about = state.spin.dot(normal);
            let slowing = touch.material.spinning_resistance * touch.pressure.max(0.0);
            if slowing > 0.0 && about != 0.0 {
                spin -= normal * (2.5 * slowing / self.radius * about.signum());
            }
        }
        let acceleration = self.pull + normal * touch.pressure + friction;
        Some(Rate { velocity: state.velocity, acceleration, spin })
    }

    /// Takes a slip that is hardly one, and puts the ball where it touches.
    pub fn settled(&self, mut state: State) -> Option<State> {
        let touch = self.touch(&state)?;
        let grip = self.give() * touch.material.friction * touch.pressure.max(0.0);
        // What friction takes in less than a shortest step: a step more would turn it around.
        if touch.slip.magnitude() <= 2.0 * self.shortest * grip {
            let part = touch.slip / self.give();
            state.velocity -= part;
            if self.spins == BallSpin::Free {
                state.spin -= part.cross(touch.normal) * (2.5 / self.radius);
            }
        }
        Some(state)
    }

    /// Goes on from where a ball touches, for `left` seconds at most.
    pub fn step(&self, start: &State, left: f64) -> Option<Step> {
        let touch = self.touch(start)?;
        if touch.pressure <= 0.0 {
            return None;
        }
        let regime = self.regime(&touch, start.spin);
        let rate = self.rate(start, regime)?;
        let shortest = self.shortest.min(left);
        let mut length = self.longest(start, &touch, rate).clamp(shortest, left);
        if regime == Regime::Slides && !touch.slip.is_zero() && touch.material.friction > 0.0 {
            length = length.min(self.until_it_grips(start, &touch, rate).max(shortest));
        }
        let end = |length: f64| self.kutta(start, length, regime);
        let mut state = end(length)?;
        // A step ends where one face, edge or corner does, for the next one bends otherwise.
        if length > shortest && !self.bends_alike(start, &state, &touch) {
            let alike =
                |length: f64| end(length).is_some_and(|end| self.bends_alike(start, &end, &touch));
            length = halve(length, alike)[1].max(shortest);
            state = end(length)?;
        }
        let presses = |end: &State| self.touch(end).is_some_and(|touch| touch.pressure > 0.0);
        let leaves = !presses(&state);
        if leaves {
            // Just after, so that nothing presses it there any more.
            length = halve(length, |length| end(length).is_some_and(|end| presses(&end)))[1];
            state = end(length)?;
        }
        Some(Step { end: State { time: start.time + length, ..state }, leaves })
    }

    /// Tests if a ball that went from one place to another is still on the same face, edge or
    /// corner: it bends there as here, along the way between.
    fn bends_alike(&self, start: &State, end: &State, touch: &Touch) -> bool {
        let Some(wall) = self.walls.get(touch.wall) else { return true };
        let dt = end.time - start.time;
        let over = |at: &State| at.velocity - wall.way(at.position, at.time);
        let way = end.position - start.position - wall.way(start.position, start.time) * dt;
        let far = way.magnitude();
        if far <= NO_WAY * self.radius {
            return true;
        }
        // From rest it goes where it comes to.
        let begins = over(start);
        let begins = if begins.magnitude() * dt < 1e-3 * far { way } else { begins };
        let bends = self.curvature(end, -over(end)) - self.curvature(start, begins);
        bends.abs() * self.radius <= CORNER
    }

    /// Curvature of the surface from where a ball is that way, in 1/m.
    fn curvature(&self, state: &State, way: Vec3<f64>) -> f64 {
        let normal = self.nearest(state.position, state.time).1.normal;
        let way = way - normal * way.dot(normal);
        let Some((way, _)) = direction_and_length(way) else { return 0.0 };
        self.turning(state.position, state.time, normal, way).magnitude()
    }

    /// Longest step in which the normal turns by little.
    fn longest(&self, start: &State, touch: &Touch, rate: Rate) -> f64 {
        let (x, y) = across(touch.normal);
        let ways = [x, -x, y, -y];
        let at = |way| self.turning(start.position, start.time, touch.normal, way).magnitude();
        let curved = ways.into_iter().map(at).fold(0.0, f64::max);
        let wall = &self.walls[touch.wall];
        let speed = (start.velocity - wall.way(start.position, start.time)).magnitude();
        let mut longest =
            (BEND / (curved * speed)).min((BEND / (curved * rate.acceleration.magnitude())).sqrt());
        if let Some((motion, _)) = wall.going(0.0) {
            longest = longest.min(BEND / motion.angular_velocity.magnitude());
        }
        // What looks flat may bend farther on.
        longest.min(super::LOOK * self.radius / speed)
    }

    /// When a slip is over, or a part of what is left of one that bends.
    fn until_it_grips(&self, start: &State, touch: &Touch, rate: Rate) -> f64 {
        let soon = 1e-6 * self.radius / (1.0 + start.velocity.magnitude());
        let later = self.touch(&start.after(rate, soon));
        let Some(later) = later else { return f64::INFINITY };
        let change = (later.slip - touch.slip) / soon;
        let (slip, closing) = (touch.slip.magnitude(), -change.dot(touch.slip));
        if closing <= 0.0 {
            return f64::INFINITY;
        }
        let end = slip * slip / closing;
        if closing > 0.999 * slip * change.magnitude() { end } else { 0.25 * end }
    }

    fn kutta(&self, start: &State, dt: f64, regime: Regime) -> Option<State> {
        let k1 = self.rate(start, regime)?;
        let k2 = self.rate(&start.after(k1, 0.5 * dt), regime)?;
        let k3 = self.rate(&start.after(k2, 0.5 * dt), regime)?;
        let k4 = self.rate(&start.after(k3, dt), regime)?;
        let mean = |of: fn(Rate) -> Vec3<f64>| (of(k1) + (of(k2) + of(k3)) * 2.0 + of(k4)) / 6.0;
        let mean = Rate {
            velocity: mean(|k| k.velocity),
            acceleration: mean(|k| k.acceleration),
            spin: mean(|k| k.spin),
        };
        let mut end = start.after(mean, dt);
        // What is left out goes, lest it add up.
        let (wall, PointProjection { normal, distance, .. }) = self.nearest(end.position, end.time);
        end.position += normal * (self.radius - distance);
        let way = self.walls.get(wall)?.way(end.position, end.time);
        end.velocity += normal * (way - end.velocity).dot(normal);
        Some(end)
    }
}

/// The shortest step of a ball that took so many in this substep, in seconds.
pub(super) fn shortest_step(steps: u32, dt: f64) -> f64 {
    let longer = steps.saturating_sub(MOST_STEPS) / PATIENCE;
    (SHORTEST * dt * f64::from(1_u32 << longer.min(12))).min(dt)
}

/// The last time before a condition ends, which holds at zero and not at `hi`, and the first
/// after it.
fn halve(mut hi: f64, holds: impl Fn(f64) -> bool) -> [f64; 2] {
    let mut lo = 0.0;
    for _ in 0..HALVINGS {
        let middle = 0.5 * (lo + hi);
        if holds(middle) { lo = middle } else { hi = middle }
    }
    [lo, hi]
}

/// Two unit vectors across one, and across each other.
fn across(normal: Vec3<f64>) -> (Vec3<f64>, Vec3<f64>) {
    let x = crate::shape::any_perpendicular(normal);
    (x, normal.cross(x))
}
