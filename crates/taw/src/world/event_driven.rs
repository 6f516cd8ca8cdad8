//! Adapter between the columns and [`Response::EventDriven`](crate::response::Response), which
//! computes in `f64`.

use cgmath::InnerSpace;

use super::method::{Method, SleepUnit};
use super::walls::{SubShape, Walls};
use super::{Precision, World};
use crate::broad::Period;
use crate::contact::Contact;
use crate::math::{Point3, Scalar, Vec3, cast_point, cast_vector, is_finite};
use crate::motion::{Motion, Rotation, WallMotion};
use crate::response::event::{self, EventBall, EventSettings, Trajectory, Wall};
use crate::response::{BallRotation, EnergyLedger, Impact, Material};

/// Collisions in the order of time; the third verb moves marbles.
pub(super) struct EventDriven;

impl<S: Scalar> Method<S> for EventDriven {
    fn advance(&self, world: &mut World<S>, dt: S) {
        let context = world.settings.step_context(dt);
        world.marbles.mean_accelerations(context, &mut world.scratch.accelerations);
        if world.settings.model.rotation != Rotation::Dynamic {
            world.marbles.integrate_rotations(dt, world.settings.model.rotation, &[]);
        }
    }

    fn contact_distance(&self, world: &World<S>, dt: S) -> S {
        world.resting_contact_distance(dt)
    }

    fn generate_contacts(&self, world: &mut World<S>) {
        // Marbles are where the substep begins, so walls have to be there, too.
        world.walls.interpolate_to(world.scratch.rest_of_step + world.scratch.substep);
        world.list_contacts();
        world.walls.end_interpolation();
    }

    fn solve(&self, world: &mut World<S>, dt: S) {
        world.step_events(dt, world.scratch.rest_of_step);
    }

    fn interpolates_walls(&self) -> bool {
        false
    }

    fn sleep_unit(&self) -> SleepUnit {
        SleepUnit::World
    }
}

impl<S: Scalar> World<S> {
    /// Runs the event-driven solver for a substep of `dt` seconds. `rest` is the time of the step
    /// after it: walls reach their poses at the end of the step.
    fn step_events(&mut self, dt: S, rest: S) {
        self.read_balls();
        self.read_contacts();
        let events = &mut self.scratch.events;
        let source = &Source::new(&self.walls, [dt.as_f64(), rest.as_f64()]);
        let iterations = self.settings.model.iterations;
        let budget_fraction = (dt / (dt + rest)).as_f64();
        let dt = dt.as_f64();
        let gravity = cast_vector(self.settings.gravity);
        let cost = 0.into();
        let threads = self.swarm.model().all_threads();
        let settings =
            EventSettings { dt, iterations, threads, gravity, source, budget_fraction, cost };
        events.work = self.scratch.audit_state.is_some().then(EnergyLedger::default);
        events.impulse_cache = std::mem::take(&mut self.memory.event_impulses);
        let mut impacts = Vec::new();
        self.scratch.stopped.extend(events.run(&settings, &mut impacts));
        self.memory.event_impulses = std::mem::take(&mut events.impulse_cache);
        // Where numbers overflowed there is no speed to tell; those bodies are stopped.
        let is_known = |it: &Impact<f64>| it.approach_speed.is_finite() && is_finite(it.normal);
        self.impacts.extend(impacts.into_iter().filter(is_known).map(Impact::cast));
        if let (Some(audit_state), Some(work)) =
            (&mut self.scratch.audit_state, self.scratch.events.work)
        {
            audit_state.work = work;
        }
        self.write_back_balls();
        if rest <= S::zero() {
            self.scratch.events.spent = 0;
        }
    }

    /// Copies the marbles into the balls of the event-driven solver.
    fn read_balls(&mut self) {
        let exact = self.settings.model.precision == Precision::Compensated;
        let marbles = &self.marbles;
        let events = &mut self.scratch.events;
        events.period =
            Period { lengths: marbles.period.lengths.map(|length| length.map(S::as_f64)) };
        events.ignored.clone_from(&*marbles.ignored_rows);
        events.balls.clear();
        events.balls.extend((0..marbles.len()).map(|row| {
            let Motion { position, velocity } = marbles.motion_f64(row);
            let largest = position.x.abs().max(position.y.abs()).max(position.z.abs());
            let digit = if exact { f64::EPSILON } else { S::epsilon().as_f64() };
            let radius = marbles.radius()[row].as_f64();
            EventBall {
                position,
                velocity,
                spin: marbles.angular_velocity_f64(row),
                external_acceleration: self
                    .scratch
                    .accelerations
                    .get(row)
                    .copied()
                    .unwrap_or(Vec3::new(0.0, 0.0, 0.0)),
                radius,
                inverse_mass: 1.0 / marbles.mass(row).as_f64(),
                material: marbles.own.material.get(row).unwrap_or_default().cast(),
                layers: marbles.layers_of_row(row),
                rotation: match self.settings.model.rotation {
                    Rotation::Dynamic if !marbles.is_rotation_locked(row) => BallRotation::Free,
                    _ => BallRotation::Locked,
                },
                position_error: 4.0 * digit * (largest + radius),
                rotation_increment: Vec3::new(0.0, 0.0, 0.0),
                trajectory: Trajectory::default(),
            }
        }));
    }

    /// Copies the contacts between marbles into the event-driven solver, as many of each as it
    /// takes.
    fn read_contacts(&mut self) {
        let cast = |contact: &Contact<S>| Contact {
            separation: -contact.penetration().as_f64(),
            ..Contact::between_marbles(contact.a, contact.b)
        };
        let near = &mut self.scratch.events.near;
        near.clear();
        let mut touches = vec![0; self.marbles.len()];
        let wanted = self.contacts.mm.iter().filter(|contact| {
            let (a, b) = (contact.a as usize, contact.b as usize);
            let wanted = touches[a].min(touches[b]) < event::MAX_CONTACTS;
            touches[a] += 1;
            touches[b] += 1;
            wanted
        });
        near.mm.extend(wanted.map(cast));
    }

    /// Writes the balls of the event-driven solver back to the columns.
    fn write_back_balls(&mut self) {
        for (row, ball) in self.scratch.events.balls.iter().enumerate() {
            let (position, velocity) = (ball.position, ball.velocity);
            let mut whole = self.marbles.set_motion_f64(row, Motion { position, velocity });
            if self.settings.model.rotation == Rotation::Dynamic {
                whole &= self.marbles.set_angular_velocity_f64(row, ball.spin);
                self.marbles.rotate_by(row, cast_vector(ball.rotation_increment));
            }
            if !whole && !self.scratch.stopped.contains(&(row as u32)) {
                self.scratch.stopped.push(row as u32);
            }
        }
    }

    /// Contact distance of resting marbles in metres: many times the tolerance of the method, and
    /// of rounding.
    fn resting_contact_distance(&self, dt: S) -> S {
        let strongest = self.scratch.accelerations.iter().map(|a| a.magnitude());
        let fall = strongest.fold(0.0, f64::max) * dt.as_f64() * dt.as_f64();
        let far = self.marbles.position().iter().map(|p| {
            let p = cast_point::<S, f64>(*p);
            p.x.abs().max(p.y.abs()).max(p.z.abs())
        });
        let rounding = 16.0 * S::epsilon().as_f64() * far.fold(0.0, f64::max);
        let reach = S::from_f64(0.02 * fall + rounding);
        if reach.is_finite() { reach } else { S::zero() }
    }
}

/// Walls of a world for a substep.
struct Source<'a, S> {
    walls: &'a Walls<S>,
    /// Time in seconds from the start of the substep until walls reach their current poses.
    there: f64,
    /// Motions of the walls on their way there.
    moving: Vec<WallMotion<f64>>,
}

impl<'a, S: Scalar> Source<'a, S> {
    fn new(walls: &'a Walls<S>, [dt, rest]: [f64; 2]) -> Self {
        let rows = (0..walls.len()).filter(|row| walls.has_moved(*row));
        let moving =
            rows.filter_map(|row| walls.motion_of_row(row)).map(WallMotion::cast).collect();
        Self { walls, there: dt + rest, moving }
    }
}

impl<S: Scalar> event::WallSource for Source<'_, S> {
    fn planes(&self, name: &mut dyn FnMut(u32)) {
        self.walls.planes().for_each(|(row, _)| name(row));
    }

    fn has_parts(&self) -> bool {
        !self.walls.are_half_spaces()
    }

    fn near(&self, point: Point3<f64>, reach: f64, name: &mut dyn FnMut(u32, u32)) {
        // Walls are at their final poses, from which they may be as far as they move.
        let way = |motion: &WallMotion<f64>| {
            let arm = (point - motion.pivot).magnitude() + reach;
            let arm = arm + motion.velocity.magnitude() * self.there;
            (motion.velocity.magnitude() + motion.angular_velocity.magnitude() * arm) * self.there
        };
        let way = self.moving.iter().map(way).fold(0.0, f64::max);
        let digits =
            8.0 * S::epsilon().as_f64() * point.x.abs().max(point.y.abs()).max(point.z.abs());
        let reach = S::from_f64((reach + way) * (1.0 + 1e-6) + digits);
        self.walls.for_each_near(cast_point(point), reach, |SubShape { wall, index: part }| {
            name(wall, part);
        });
    }

    fn wall(&self, row: u32, part: u32) -> Option<Wall> {
        let place = row as usize;
        let motion = self.walls.motion_of_row(place).map(WallMotion::cast);
        let moved = motion.is_some() && self.walls.has_moved(place);
        let form = self.walls.shapes().get(place)?.sub_shape_f64(part)?;
        Some(Wall {
            bounds: form.bounds(),
            collider: form,
            row,
            part,
            motion,
            arrival_time: moved.then_some(self.there),
            material: self.walls.material_of_row(place).map(Material::cast),
            layers: self.walls.layers_of_row(row),
            relative_rounding: 8.0 * S::epsilon().as_f64(),
        })
    }
}
