//! From contacts to constraints: what each asks for.

use cgmath::{InnerSpace, Zero};

use super::islands::{DIRECTIONS, Island, Islands};
use super::{Around, Before, Constraint, First, Walls};
use crate::contact::Contacts;
use crate::math::{Mat3, Scalar, Vec3, direction_and_length};
use crate::response::{Columns, Material};

/// Finds what each contact asks for, those with walls first, and which are of one island.
pub(super) fn prepare<S: Scalar>(
    marbles: &Columns<S>,
    contacts: &Contacts<S>,
    around: &Around<S, impl Walls<S>, impl Fn(usize) -> Material<S>, impl Fn(usize) -> S>,
    constraints: &mut Vec<Constraint<S>>,
    islands: &mut Islands<S>,
) {
    constraints.clear();
    constraints.extend(
        First::of_each(contacts)
            .filter_map(|(a, c)| marbles.constraint(a, c.b as usize, c.along, around)),
    );
    islands.find(constraints, marbles.velocity.len(), around.settings.bounce_speed);
    if !constraints.iter().any(|c| c.bounces) {
        return;
    }
    for c in constraints.iter() {
        let island = islands.of_mut(c);
        island.bounces |= c.bounces;
        // What turns on its way follows for the whole substep, too.
        island.leans |= !c.bounces || c.along != [S::zero(); 2];
        if c.bounces {
            island.since = island.since.max(c.since.unwrap_or(island.since));
        }
    }
    for c in constraints.iter_mut().filter(|c| c.bounces) {
        marbles.bounce(c, islands.of(c), around);
    }
}

impl<S: Scalar> Columns<'_, S> {
    /// What a contact asks for that does not bounce, and whether it does.
    fn constraint(
        &self,
        a: First,
        b: usize,
        along: [S; 2],
        around: &Around<S, impl Walls<S>, impl Fn(usize) -> Material<S>, impl Fn(usize) -> S>,
    ) -> Option<Constraint<S>> {
        let (normal, gap) = self.touch(a, b, along, around)?;
        let material = around.material_of(a, b);
        let surface = match a {
            First::Wall(wall, _) => {
                let arm = self.offset(b, along[1]) - normal * self.radius[b];
                around.walls.surface_velocity(wall as usize, self.position[b] + arm)
            }
            First::Marble(_) => Vec3::zero(),
        };
        let mobility = self.mobility_of_both(a, b, along, normal);
        let closing = self.closing(a, b, along, normal, surface);
        let approach = -closing.dot(normal);
        // The positions have moved on already, and will follow what changes now. So
        // this speed is just enough to keep the gap from closing.
        let (follow, dt) = (around.follows(a, b), around.settings.dt);
        let fast = approach > around.settings.bounce_speed;
        let closed = if dt == S::zero() {
            S::zero()
        } else if follow > S::zero() {
            -approach - gap / follow
        } else if fast && gap > S::zero() {
            -approach - gap / dt // it will bounce in the next substep
        } else {
            -gap / dt
        };
        let zero = Vec3::zero();
        let mut constraint = Constraint {
            a,
            b,
            along,
            island: 0,
            normal,
            surface,
            mobility,
            restitution: material.restitution,
            friction: material.friction,
            bound: S::zero(),
            least: S::zero(),
            begin: closing,
            begin_turning: zero,
            bounces: fast && dt == S::zero(),
            since: None,
            lag: zero,
            rebound: closed.min(S::zero()),
            slide: zero,
            pressure: S::zero(),
            grip: zero,
            ways: [zero; DIRECTIONS],
            given: [zero; DIRECTIONS],
            wanted: zero,
            resistance: self.resistance(a, b, material),
        };
        constraint.begin_turning = self.turning(&constraint);
        let since = around.follows(a, b) - around.ahead(&constraint);
        constraint.lag = self.pull(&constraint, around) * since;
        // What was stopped on its way touches, whatever rounding says.
        let stands = around.stands(b) || a.marble().is_some_and(|a| around.stands(a));
        if fast && (gap < S::zero() || stands) && dt > S::zero() {
            let since = self.since(&constraint, gap, around);
            // Unless it is back on the ground before the substep ends.
            let pull = self.pull(&constraint, around);
            let speed = material.restitution * self.approach(&constraint, since, around);
            if speed + pull.dot(normal) * since * S::constant(0.5) >= S::zero() {
                (constraint.bounces, constraint.since) = (true, Some(since));
            }
        }
        (mobility.normal > S::zero()).then_some(constraint)
    }

    /// The normal of a contact, and how far the two are apart along it, at the end of the
    /// substep.
    fn touch(
        &self,
        a: First,
        b: usize,
        along: [S; 2],
        around: &Around<S, impl Walls<S>, impl Fn(usize) -> Material<S>, impl Fn(usize) -> S>,
    ) -> Option<(Vec3<S>, S)> {
        let (normal, gap) = self.normal_and_gap(self.position, a, b, along, around.walls)?;
        // What pushes along the mean normal of a step does no work, and neither does
        // an overlap that stays what it was.
        let before = &Before(around.walls);
        let start = self.normal_and_gap(around.start.position, a, b, along, before);
        if let (None, Some(met)) = (start, self.met(a, b, along, normal, around)) {
            return Some(met);
        }
        Some(start.map_or((normal, gap), |(earlier, overlap)| {
            let mean = direction_and_length(normal + earlier);
            (mean.map_or(normal, |(mean, _)| mean), gap - overlap.min(S::zero()))
        }))
    }

    /// The normal of two marbles where they met on their way through this substep, and how far
    /// they are past that now, if they come together too fast for their place now to tell.
    fn met(
        &self,
        a: First,
        b: usize,
        along: [S; 2],
        normal: Vec3<S>,
        around: &Around<S, impl Walls<S>, impl Fn(usize) -> Material<S>, impl Fn(usize) -> S>,
    ) -> Option<(Vec3<S>, S)> {
        let a = a.marble()?;
        let dt = around.settings.dt;
        let velocity = self.velocity[b] - self.velocity[a];
        let slow = around.settings.bounce_speed;
        // A capsule also turns on its way.
        let round = along == [S::zero(); 2];
        if around.start.velocity.is_empty() || velocity.magnitude2() <= slow * slow || !round {
            return None;
        }
        let apart = self.period.nearest(self.position[b] - self.position[a]);
        let reach = self.radius[a] + self.radius[b];
        // Back along the way: |apart − velocity t| = reach.
        let (slope, squared) = (apart.dot(velocity), velocity.magnitude2());
        let open = (apart.magnitude() - reach) * (apart.magnitude() + reach);
        let root = slope * slope - squared * open;
        if root < S::zero() {
            return None;
        }
        let since = (slope + root.sqrt()) / squared;
        let (there, distance) = direction_and_length(apart - velocity * since)?;
        let right = since > S::zero() && since <= dt && distance.is_finite();
        // What pushes one of them otherwise, or rounding, may say that they never came together.
        (right && there.dot(velocity) < S::zero() && there.dot(normal) > -S::one())
            .then(|| (there, there.dot(apart) - reach))
    }

    /// The time since two met that overlap now, in seconds.
    fn since(
        &self,
        c: &Constraint<S>,
        gap: S,
        around: &Around<S, impl Walls<S>, impl Fn(usize) -> Material<S>, impl Fn(usize) -> S>,
    ) -> S {
        let down = self.pull(c, around).dot(c.normal);
        // Under an even pull, positions lie on a parabola whose speed is that of the
        // integrator at another moment.
        let end = -c.begin.dot(c.normal) - down * around.ahead(c);
        let squared = (end * end - down * gap * S::constant(2.0)).max(S::zero());
        let since = gap * S::constant(-2.0) / (end + squared.sqrt());
        since.max(S::zero()).min(around.settings.dt)
    }

    /// The speed of approach this long ago, in m/s.
    fn approach(
        &self,
        c: &Constraint<S>,
        since: S,
        around: &Around<S, impl Walls<S>, impl Fn(usize) -> Material<S>, impl Fn(usize) -> S>,
    ) -> S {
        let lag = self.pull(c, around) * (since - around.ahead(c));
        (lag - c.begin).dot(c.normal).max(S::zero())
    }

    /// What a contact asks for that bounces: at the moment of its island's first bounce, with
    /// the speed of that moment, and positions follow from then on. So no height is won or
    /// lost by when in a substep a bounce falls due. What bounces among others that rest
    /// follows for the whole substep, as they do.
    fn bounce(
        &self,
        c: &mut Constraint<S>,
        island: &Island<S>,
        around: &Around<S, impl Walls<S>, impl Fn(usize) -> Material<S>, impl Fn(usize) -> S>,
    ) {
        let since = if island.leans { around.follows(c.a, c.b) } else { island.since };
        let lag = self.pull(c, around) * (since - around.ahead(c));
        let speed = c.restitution * self.approach(c, since, around);
        let before = c.begin - lag;
        let slip = before - c.normal * before.dot(c.normal);
        let after = lag - slip * around.material_of(c.a, c.b).tangential_restitution;
        c.since = c.since.map(|_| since);
        c.rebound = speed + after.dot(c.normal);
        (c.slide, c.lag) = (after - c.normal * after.dot(c.normal), lag);
    }

    /// How forces pull the second of a contact from the first in this substep, in m/s².
    fn pull(
        &self,
        c: &Constraint<S>,
        around: &Around<S, impl Walls<S>, impl Fn(usize) -> Material<S>, impl Fn(usize) -> S>,
    ) -> Vec3<S> {
        let first = c.a.marble().map_or_else(Vec3::zero, |a| self.acceleration(a, around));
        self.acceleration(c.b, around) - first
    }

    /// By forces in this substep, in m/s²; nothing where nobody knows.
    fn acceleration(
        &self,
        row: usize,
        around: &Around<S, impl Walls<S>, impl Fn(usize) -> Material<S>, impl Fn(usize) -> S>,
    ) -> Vec3<S> {
        let change = around.start.velocity.get(row).map(|before| self.velocity[row] - before);
        change
            .filter(|_| around.settings.dt > S::zero())
            .map_or_else(Vec3::zero, |change| change / around.settings.dt)
    }
}

impl<S, W, M, F> Around<'_, S, W, M, F>
where
    S: Scalar,
    W: Walls<S>,
    M: Fn(usize) -> Material<S>,
    F: Fn(usize) -> S,
{
    fn material_of(&self, a: First, b: usize) -> Material<S> {
        let own = (self.material)(b);
        match a {
            First::Wall(wall, _) => {
                self.walls.material(wall as usize).map_or(own, |its| own.against(its))
            }
            First::Marble(a) => own.against((self.material)(a as usize)),
        }
    }

    /// Whether a row was stopped within the substep.
    pub(in crate::response) fn stands(&self, row: usize) -> bool {
        self.stopped(row).is_some()
    }

    /// For a row that was stopped within the substep, the part of a change of velocity that its
    /// position still follows, per substep.
    fn stopped(&self, row: usize) -> Option<Mat3<S>> {
        self.start.stands.get(row).copied().flatten()
    }

    /// Way by which a position follows a change of velocity, in metres.
    pub(in crate::response) fn follow(&self, row: usize, change: Vec3<S>) -> Vec3<S> {
        let way = change * (self.follow)(row) * self.settings.dt;
        self.stopped(row).map_or(way, |along| along * way)
    }

    /// The time for which a position follows a change of velocity, in seconds.
    pub(in crate::response) fn follows_row(&self, row: usize) -> S {
        if self.stands(row) { S::zero() } else { (self.follow)(row) * self.settings.dt }
    }

    /// The time for which a gap follows a change of its speed, in seconds.
    pub(in crate::response) fn follows(&self, a: First, b: usize) -> S {
        mean(a, b, |row| self.follows_row(row))
    }

    /// By how much the velocities that the integrator keeps are ahead of those of the path, in
    /// seconds.
    fn ahead(&self, c: &Constraint<S>) -> S {
        let follow = mean(c.a, c.b, |row| (self.follow)(row));
        (follow - S::constant(0.5)) * self.settings.dt
    }
}

/// The mean over the marbles of a contact.
fn mean<S: Scalar>(a: First, b: usize, of: impl Fn(usize) -> S) -> S {
    a.marble().map_or_else(|| of(b), |a| (of(a) + of(b)) * S::constant(0.5))
}
