//! Observables of a world, computed independently of the world.

use taw::prelude::*;

/// A marble, or a ball of the swarm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Body {
    /// In metres.
    pub at: Vec3<f64>,
    /// In m/s.
    pub velocity: Vec3<f64>,
    /// In rad/s; zero if nothing feels it.
    pub angular_velocity: Vec3<f64>,
    /// In kilograms.
    pub mass: f64,
    /// In metres.
    pub radius: f64,
    /// Half of a capsule's line with its direction, in metres; zero for a ball.
    pub half: Vec3<f64>,
    /// Signed distance of its surface from the nearest wall, in metres; negative inside.
    pub wall_gap: f64,
    /// Largest velocity of a moving wall at its position, in m/s.
    pub carried: f64,
}

impl Body {
    /// Of translation, in joules.
    #[must_use]
    pub fn kinetic(&self) -> f64 {
        0.5 * self.mass * self.velocity.magnitude2()
    }

    /// Of rotation, in joules. A capsule is a cylinder with half a ball at each end.
    #[must_use]
    pub fn spin_energy(&self) -> f64 {
        let (r, h) = (self.radius, self.half.magnitude());
        if h == 0.0 {
            return 0.2 * self.mass * r * r * self.angular_velocity.magnitude2();
        }
        // Volumes without π: 2 h r² and 4/3 r³.
        let (cylinder, ends) = (2.0 * h * r * r, 4.0 / 3.0 * r.powi(3));
        let share = self.mass / (cylinder + ends);
        let along = share * (cylinder * 0.5 + ends * 0.4) * r * r;
        let across = share
            * (cylinder * (0.25 * r * r + h * h / 3.0)
                + ends * (0.4 * r * r + h * h + 0.75 * h * r));
        let about = self.angular_velocity.dot(self.half / h);
        0.5 * (along * about * about
            + across * (self.angular_velocity.magnitude2() - about * about))
    }

    /// The balls that stand for it: itself, or the two ends and the middle of a capsule.
    pub fn balls(&self) -> impl Iterator<Item = Vec3<f64>> + use<> {
        let (at, half) = (self.at, self.half);
        let count = if half == Vec3::new(0.0, 0.0, 0.0) { 1 } else { 3 };
        [0.0, -1.0, 1.0].into_iter().take(count).map(move |side| at + half * side)
    }

    /// The radius of the smallest ball around it, in metres.
    #[must_use]
    pub fn reach(&self) -> f64 {
        self.radius + self.half.magnitude()
    }

    /// Returns true if its state is finite.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        [self.at, self.velocity, self.angular_velocity].iter().all(|v| v.magnitude2().is_finite())
    }
}

/// A world at the end of a step.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Snapshot {
    /// Marbles in the order of the scene, then balls of the swarm.
    pub bodies: Vec<Body>,
    /// In m/s².
    pub gravity: [f64; 3],
    /// Work of moving walls by the energy audit of the step, in joules.
    pub walls_work: f64,
    /// Number of bodies stopped by the step.
    pub stopped: usize,
}

impl Snapshot {
    /// Of this world.
    #[must_use]
    pub fn of<S: Scalar>(world: &World<S>) -> Self {
        let gravity = world.gravity();
        let audit = world.energy_audit().unwrap_or_default();
        let mut bodies = marbles(world);
        bodies.extend(balls(world));
        let stopped = world.stopped().count() + world.swarm.stopped().count();
        let gravity = [gravity.x, gravity.y, gravity.z].map(S::as_f64);
        Self { bodies, gravity, walls_work: audit.walls + audit.walls_on_swarm, stopped }
    }

    /// In m/s².
    #[must_use]
    pub fn gravity(&self) -> Vec3<f64> {
        self.gravity.into()
    }

    /// Of translation and rotation, in joules.
    #[must_use]
    pub fn kinetic(&self) -> f64 {
        self.bodies.iter().map(|body| body.kinetic() + body.spin_energy()).sum()
    }

    /// In gravity, against the origin, in joules.
    #[must_use]
    pub fn potential(&self) -> f64 {
        let gravity = self.gravity();
        self.bodies.iter().map(|body| -body.mass * gravity.dot(body.at)).sum()
    }

    /// Penetration of two bodies in metres; if negative, a lower bound of their distance.
    #[must_use]
    pub fn depth(&self, a: usize, b: usize) -> f64 {
        let (a, b) = (&self.bodies[a], &self.bodies[b]);
        let bound = a.reach() + b.reach() - (a.at - b.at).magnitude();
        if bound <= 0.0 || (a.half.magnitude2() == 0.0 && b.half.magnitude2() == 0.0) {
            return bound;
        }
        let radii = a.radius + b.radius;
        let of = |x: Vec3<f64>| b.balls().map(move |y| radii - (x - y).magnitude());
        a.balls().flat_map(of).fold(f64::NEG_INFINITY, f64::max)
    }
}

fn marbles<S: Scalar>(world: &World<S>) -> Vec<Body> {
    let ids = (0..world.marbles.len()).filter_map(|row| world.marbles.id(row));
    let spins = world.model().rotation == Rotation::Dynamic;
    let exact = ids.filter_map(|id| world.marbles.get_high_precision(id).ok());
    let body = |marble: Marble<f64>| {
        let at = marble.position.to_vec();
        let half = marble.rotation * Vec3::unit_y() * marble.half_length;
        let mass = marble.mass.of_capsule(marble.radius, marble.half_length);
        let body = Body {
            at,
            velocity: marble.velocity,
            angular_velocity: if spins { marble.angular_velocity } else { Vec3::zero() },
            mass,
            radius: marble.radius,
            half,
            wall_gap: 0.0,
            carried: 0.0,
        };
        beside_walls(body, world)
    };
    exact.map(body).collect()
}

fn balls<S: Scalar>(world: &World<S>) -> Vec<Body> {
    let swarm = &world.swarm;
    let mut balls: Vec<(u32, Body)> = (0..swarm.len())
        .filter(|row| !swarm.is_marble(*row))
        .map(|row| {
            let [x, y, z, radius] = swarm.balls()[row].map(S::as_f64);
            let [vx, vy, vz, inverse_mass] = swarm.velocities()[row].map(S::as_f64);
            let [sx, sy, sz, _] =
                swarm.spin_velocities().get(row).map_or([0.0; 4], |rim| rim.map(S::as_f64));
            let body = Body {
                at: Vec3::new(x, y, z),
                velocity: Vec3::new(vx, vy, vz),
                angular_velocity: Vec3::new(sx, sy, sz) / radius,
                mass: inverse_mass.abs().recip(),
                radius,
                half: Vec3::zero(),
                wall_gap: 0.0,
                carried: 0.0,
            };
            (swarm.slots()[row], beside_walls(body, world))
        })
        .collect();
    balls.sort_by_key(|(slot, _)| *slot);
    balls.into_iter().map(|(_, body)| body).collect()
}

fn beside_walls<S: Scalar>(mut body: Body, world: &World<S>) -> Body {
    let point = |v: Vec3<f64>| Point3::new(S::from_f64(v.x), S::from_f64(v.y), S::from_f64(v.z));
    body.wall_gap = f64::INFINITY;
    if !body.is_finite() {
        return body;
    }
    for (row, shape) in world.walls.shapes().iter().enumerate() {
        for ball in body.balls() {
            let distance = shape.project_point(point(ball)).distance.as_f64();
            body.wall_gap = body.wall_gap.min(distance - body.radius);
        }
        let motion = world.walls.id(row).and_then(|id| world.walls.motion(id).ok().flatten());
        if let Some(motion) = motion {
            let velocity = motion.velocity_at(point(body.at));
            body.carried = body.carried.max(velocity.magnitude().as_f64());
        }
    }
    body
}
