//! Contacts with walls, one at a time: few balls lie at a wall.

use cgmath::{EuclideanSpace, InnerSpace, Point3};

use super::kernels::{GROUNDED, Pass, SolverParams, WALL_SLOP};
use super::proxies::Proxy;
use super::surfaces::WallNumbers;
use super::walls::StaticGeometry;
use crate::broad::CollisionFilter;
use crate::constraint::{ContactImpulse, ContactSoftness, FrictionCone, solve_rolling};
use crate::math::{RealVector, Row, Scalar, Vec3};
use crate::response::Impact;

/// Contact constraint of a ball and a part of a wall.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct WallContact<S> {
    pub row: u32,
    pub wall: u32,
    pub part: u32,
    /// Of a half-space, or of any other shape.
    pub is_plane: bool,
    /// Set if the ball is a proxy, whom others move: the wall only bears what the swarm presses
    /// on it.
    pub bears_proxy: bool,
    /// The plane that the wall is like there: its normal, and how far along it the surface is, now
    /// and at the end of the step.
    pub normal: Vec3<S>,
    pub offset: S,
    pub offset_at_end: S,
    /// The velocity of the surface, in m/s.
    pub surface: Vec3<S>,
    pub numbers: WallNumbers<S>,
    /// Accumulated normal impulse for others that press on the ball, and impulse for the ball
    /// itself, in N s.
    pub borne_for_others: S,
    pub impulse: ContactImpulse<S>,
    /// Normal impulse before the wall was struck in this substep, in N s.
    pub load: Option<S>,
    /// Angular impulse against rolling and spinning, over the radius, in N s.
    pub torque: Vec3<S>,
}

/// Meeting of a ball and a wall within a substep.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bounce<S> {
    /// Distance that the ball has to go along the normal, in metres.
    pub separation: S,
    /// Speed at which it approaches now, and when it is there, in m/s.
    approach_speed: S,
    impact_speed: S,
}

/// Separation in radii, and in roundings of the coordinates, up to which a ball stands on a wall. A
/// larger one would hold balls in the air that come down beside others.
const TOUCHES: f64 = 1e-4;
const ROUNDINGS: f64 = 4.0;

pub(super) fn xyz<S: Scalar>(row: &Row<S>) -> Vec3<S> {
    Vec3::new(row[0], row[1], row[2])
}

pub(super) fn set<S: Scalar>(row: &mut Row<S>, to: Vec3<S>) {
    [row[0], row[1], row[2]] = to.into();
}

impl<S: Scalar> WallContact<S> {
    /// Inverse mass of the ball along the normal, over that of a free one; zero if locks bear the contact.
    pub fn share(&self) -> S {
        self.numbers.locked_axes.share(self.normal)
    }

    /// Way of the ball until it is nearer to the wall by so many metres.
    pub fn way_nearer(&self, by: S) -> Vec3<S> {
        self.numbers.locked_axes.escape(self.normal) * -by
    }

    pub fn separation(&self, at: &Row<S>) -> S {
        self.normal.dot(xyz(at)) - self.offset - at[3]
    }

    /// Puts the wall where it is so long before the end of the step, in seconds, and reads its velocity at the
    /// ball.
    pub fn set_time(&mut self, walls: &dyn StaticGeometry<S>, at: &Row<S>, before_end: S) {
        let point = Point3::from_vec(xyz(at) - self.normal * at[3]);
        self.surface = walls.surface_velocity(self.wall, point, self.normal);
        self.offset = self.offset_at_end;
        self.advance(-before_end);
    }

    /// The wall moves on for so long, in seconds; one that bears a proxy may give way to it.
    pub fn advance(&mut self, time: S) {
        self.offset += self.surface.dot(self.normal) * time;
    }

    /// Limits it to what the swarm presses on a proxy: the proxy's own motion into the wall and its
    /// depth there are left to the world's solver, as if the wall gave way. It follows no proxy that
    /// leaves it. The step goes on for so long, in seconds.
    pub fn bear(&mut self, proxy: &Proxy<S>, left: S) {
        self.bears_proxy = true;
        (self.numbers.friction, self.numbers.restitution) = (S::zero(), S::zero());
        let own = xyz(&proxy.velocity);
        let leaves = (own - self.surface).dot(self.normal).max(S::zero());
        self.surface = own - self.normal * leaves;
        self.offset = self.offset_at_end;
        let at_end = self.separation(&proxy.at).min(S::zero());
        self.advance(-left);
        let leaving = if leaves > S::zero() {
            self.separation(&proxy.from[0]).min(S::zero())
        } else {
            S::zero()
        };
        self.offset += at_end.min(leaving);
    }

    /// Normal impulse in the last substep, in N s; zero if the ball has left the wall.
    pub fn bears(&self, at: &Row<S>) -> S {
        let place = at[0].abs() + at[1].abs() + at[2].abs();
        let there = self.separation(at)
            <= at[3] * S::from_f64(TOUCHES) + place * (S::from_f64(ROUNDINGS) * S::epsilon());
        if there { self.impulse.normal + self.borne_for_others } else { S::zero() }
    }

    /// Takes over the impulses of an earlier contact of ball and wall.
    pub fn restore(&mut self, before: &Self) {
        (self.impulse, self.torque, self.load) = (before.impulse, before.torque, before.load);
        self.borne_for_others = before.borne_for_others;
    }

    /// Scales all its impulses.
    pub fn scale(&mut self, factor: S) {
        self.borne_for_others *= factor;
        self.impulse.normal *= factor;
        self.impulse.tangent *= factor;
        self.load = self.load.map(|load| load * factor);
        self.torque *= factor;
    }

    /// Notes what the wall bears before a ball of this velocity strikes it in a pass.
    pub fn note_impact(&mut self, pass: Pass<S>, velocity: &Row<S>) {
        let (Pass::Solve(params) | Pass::Relax(params)) = pass else { return };
        let approach_speed = -(xyz(velocity) - self.surface).dot(self.normal);
        let threshold = params.restitution_threshold;
        if threshold > S::zero() && approach_speed > threshold {
            self.load = Some(self.load.unwrap_or(S::max_value()).min(self.impulse.normal));
        }
    }

    /// Forgets the impulse that stopped the ball, but not the load: see
    /// [`StruckContact`](super::kernels::StruckContact).
    pub fn forget_impact(&mut self) {
        let Some(load) = self.load.take().filter(|load| *load < self.impulse.normal) else {
            return;
        };
        self.impulse.tangent *= load / self.impulse.normal;
        self.impulse.normal = load;
    }

    /// The impulse that the wall has borne for others, if it is the one behind the ball.
    pub fn share_of(&self, backing: &Row<S>) -> S {
        if xyz(backing) == self.normal { backing[3] } else { S::zero() }
    }

    /// Moves the ball out.
    pub fn displace(&self, at: &mut Row<S>) {
        let overlap = (-self.separation(at)).max(S::zero());
        set(at, xyz(at) - self.way_nearer(overlap));
    }

    /// Moves the ball out, except for the overlap that a contact bears. Returns the distance, in metres.
    pub fn keep_out(&self, at: &mut Row<S>) -> S {
        // All of it: a wall gives way to nobody.
        let overlap = (-self.separation(at) - at[3] * S::from_f64(WALL_SLOP)).max(S::zero());
        let push = self.way_nearer(-overlap);
        set(at, xyz(at) + push);
        if self.numbers.locked_axes.moves_freely() { overlap } else { push.magnitude() }
    }

    /// A pass as for the pairs of balls. Returns the bounce if there was one: then it moved the ball by its
    /// separation.
    pub fn solve(
        &mut self,
        pass: Pass<S>,
        at: &mut Row<S>,
        velocity: &mut Row<S>,
        spin: &mut Row<S>,
    ) -> Option<Bounce<S>> {
        if self.share() == S::zero() {
            return None;
        }
        match pass {
            Pass::Restitution(params) => {
                return self.apply_restitution(&params, at, velocity, spin);
            }
            Pass::WarmStart(_) => {
                // Those for whom the wall bore something may no longer press on the ball.
                let tangent = self.impulse.tangent.reject_from(self.normal);
                self.impulse = self.cone().clamp(ContactImpulse { tangent, ..self.impulse });
                self.apply_impulse(velocity, spin, self.impulse);
                let give = self.numbers.inertia_factor * velocity[3];
                let turn = self.numbers.locked_axes.free_rotation(self.torque * give);
                set(spin, xyz(spin) + turn);
            }
            Pass::Solve(params) => {
                self.push(params.time, Some(params.softness), at, velocity, spin);
            }
            Pass::Relax(params) => {
                let approach_speed = -(xyz(velocity) - self.surface).dot(self.normal);
                let overlaps = || self.separation(at) <= S::zero();
                // What comes fast and is not there yet keeps its speed until it is.
                if self.impulse.normal > S::zero()
                    || self.numbers.restitution == S::zero() && overlaps()
                    || approach_speed <= params.restitution_threshold
                {
                    self.push(params.time, None, at, velocity, spin);
                }
            }
        }
        None
    }

    /// Acceleration of the ball by gravity, in m/s².
    fn fall(&self, params: &SolverParams<S>) -> Vec3<S> {
        self.numbers.locked_axes.free_translation(xyz(&params.gravity))
    }

    /// Finds out if the ball meets the wall within a substep, fast enough to bounce.
    fn approach(
        &self,
        params: &SolverParams<S>,
        at: &Row<S>,
        velocity: &Row<S>,
    ) -> Option<Bounce<S>> {
        let speed = -(xyz(velocity) - self.surface).dot(self.normal);
        let separation = self.separation(at).max(S::zero());
        // Gravity works on the ball as far as it comes nearer. As far as the contact reaches, by the
        // velocity after gravity: one that only stops the ball would take its bounce.
        let gravity = -self.fall(params).dot(self.normal);
        let nearer = (speed + gravity * params.time) * params.time;
        if speed <= S::zero() || separation >= nearer {
            return None;
        }
        let square = speed * speed + S::from_f64(2.0) * gravity * separation;
        let impact_speed = square.max(S::zero()).sqrt();
        (impact_speed > params.restitution_threshold).then_some(Bounce {
            separation,
            approach_speed: speed,
            impact_speed,
        })
    }

    /// Puts the plane where the ball first touches the wall on its way in a substep, if it comes fast: by
    /// then, the point of a round wall or of an edge that is nearest to it is another one. So long before
    /// the end of the step the substep begins, in seconds. Returns that way.
    pub fn look_ahead(
        &mut self,
        walls: &dyn StaticGeometry<S>,
        params: &SolverParams<S>,
        (at, velocity, filter): (&Row<S>, &Row<S>, CollisionFilter),
        before_end: S,
    ) -> Option<(Vec3<S>, [S; 2])> {
        self.approach(params, at, velocity)?;
        let time = params.time;
        let displacement = xyz(velocity) * time + self.fall(params) * (time * time);
        let way = (displacement, [before_end, time]);
        if let Some((normal, distance)) =
            walls.plane_on_way([self.wall, self.part], at, filter, way)
        {
            self.normal = normal;
            self.offset_at_end = normal.dot(xyz(at)) - distance;
            self.set_time(walls, at, before_end);
        } else {
            // Beyond what the ball reaches.
            let beyond = displacement.magnitude() + at[3];
            self.offset_at_end -= beyond;
            self.offset -= beyond;
        }
        Some(way)
    }

    /// Finds out if the ball meets the wall within a substep, fast enough to bounce, and does.
    pub fn bounce(
        &self,
        params: &SolverParams<S>,
        at: &Row<S>,
        velocity: &Row<S>,
    ) -> Option<Bounce<S>> {
        let bounces = self.numbers.restitution > S::zero() && self.share() > S::zero();
        bounces.then(|| self.approach(params, at, velocity)).flatten()
    }

    /// Impact of such a bounce, of a ball with this center, velocity and spin before it, and this velocity
    /// after it.
    pub fn impact(
        &self,
        bounce: &Bounce<S>,
        [at, velocity, spin]: [&Row<S>; 3],
        after: &Row<S>,
    ) -> Impact<S> {
        let Bounce { separation, approach_speed, impact_speed } = *bounce;
        let time = separation / (S::from_f64(0.5) * (approach_speed + impact_speed));
        let along = xyz(velocity).reject_from(self.normal) * time;
        let to_wall = self.surface.dot(self.normal) * time - separation - at[3];
        let point = xyz(at) + along + self.normal * to_wall;
        Impact {
            a: self.wall,
            on_wall: true,
            b: self.row,
            part: self.part,
            normal: self.normal,
            point: Point3::from_vec(point),
            approach_speed: impact_speed,
            slip: self.slip(xyz(velocity) - self.surface, spin),
            impulse: (xyz(after) - xyz(velocity)) / velocity[3],
        }
    }

    /// Turns the ball back if it meets the wall, with the speed that it then has.
    fn apply_restitution(
        &self,
        params: &SolverParams<S>,
        at: &mut Row<S>,
        velocity: &mut Row<S>,
        spin: &mut Row<S>,
    ) -> Option<Bounce<S>> {
        let bounce = self.bounce(params, at, velocity)?;
        let Bounce { separation, approach_speed, impact_speed } = bounce;
        let normal = (approach_speed + impact_speed * self.numbers.restitution)
            / (velocity[3] * self.share());
        let mut left = normal;
        if !self.numbers.locked_axes.moves_freely() {
            // Along a lock it changes the slip too: both at once would add energy.
            self.apply_impulse(velocity, spin, ContactImpulse { normal, ..ContactImpulse::zero() });
            left = S::zero();
        }
        let relative = xyz(velocity) - self.surface;
        let stopping = self.slip(relative, spin) * (-self.tangent_mass() / velocity[3]);
        let tangent = stopping * (S::one() + self.numbers.tangential_restitution);
        let impulse = FrictionCone::new(self.numbers.friction);
        let impulse = impulse.clamp(ContactImpulse { normal, tangent });
        set(at, xyz(at) + self.way_nearer(separation));
        self.apply_impulse(velocity, spin, ContactImpulse { normal: left, ..impulse });
        Some(bounce)
    }

    /// Velocity at which the ball's surface slides over the wall's, in m/s.
    fn slip(&self, relative: Vec3<S>, spin: &Row<S>) -> Vec3<S> {
        relative.reject_from(self.normal) - xyz(spin).cross(self.normal)
    }

    /// Solves the contact: the ball approaches by no more than the separation within a substep of
    /// `time` seconds. Rigid without softness.
    fn push(
        &mut self,
        time: S,
        softness: Option<ContactSoftness<S>>,
        at: &Row<S>,
        velocity: &mut Row<S>,
        spin: &mut Row<S>,
    ) {
        let (separation, mass) = (self.separation(at), S::one() / velocity[3]);
        let relative = xyz(velocity) - self.surface;
        let (target, softness) = match softness {
            Some(softness) => {
                let (target, softness) = softness.at(separation, S::one() / time);
                (target, Some(softness))
            }
            None => (-separation.max(S::zero()) / time, None),
        };
        let wanted = ContactImpulse {
            normal: mass * (target - relative.dot(self.normal)) / self.share(),
            tangent: self.slip(relative, spin) * (-mass * self.tangent_mass()),
        };
        let change = self.impulse.solve(wanted, softness, &self.cone());
        if self.impulse.normal + self.borne_for_others > S::zero() {
            spin[3] = S::from_f64(GROUNDED);
        }
        self.apply_impulse(velocity, spin, change);
        self.solve_rolling(velocity, spin);
    }

    /// Limits of its impulse, with the friction of what it bears for others.
    fn cone(&self) -> FrictionCone<S> {
        FrictionCone {
            extra_friction: self.numbers.friction * self.borne_for_others,
            ..FrictionCone::new(self.numbers.friction)
        }
    }

    fn apply_impulse(&self, velocity: &mut Row<S>, spin: &mut Row<S>, impulse: ContactImpulse<S>) {
        let WallNumbers { inertia_factor, locked_axes, .. } = self.numbers;
        let inverse_mass = velocity[3];
        let change = impulse.along(self.normal) * inverse_mass;
        set(velocity, xyz(velocity) + locked_axes.free_translation(change));
        let turn = self.normal.cross(impulse.tangent) * (inertia_factor * inverse_mass);
        set(spin, xyz(spin) - locked_axes.free_rotation(turn));
    }

    /// Effective mass of the touched point along the wall, over the mass of the ball.
    fn tangent_mass(&self) -> S {
        S::one() / (S::one() + self.numbers.inertia_factor)
    }

    /// Slows rolling and spinning, by a torque of at most the resistance times normal force times
    /// radius.
    fn solve_rolling(&mut self, velocity: &Row<S>, spin: &mut Row<S>) {
        let WallNumbers { rolling_resistance, spinning_resistance, inertia_factor, .. } =
            self.numbers;
        let give = inertia_factor * velocity[3];
        if rolling_resistance + spinning_resistance == S::zero() || give == S::zero() {
            return;
        }
        let load = self.impulse.normal;
        let limits = [rolling_resistance * load, spinning_resistance * load];
        let change = solve_rolling(&mut self.torque, xyz(spin) / -give, self.normal, limits);
        set(spin, xyz(spin) + self.numbers.locked_axes.free_rotation(change * give));
    }
}
