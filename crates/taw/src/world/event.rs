//! Between the columns and [`Response::EventDriven`](crate::response::Response), which
//! counts in `f64`.

use cgmath::InnerSpace;

use super::walls::Part;
use super::{Precision, World};
use crate::contact::Contact;
use crate::math::{Scalar, Vec3, cast_point, cast_vector, length};
use crate::motion::{Motion, Rotation, WallMotion};
use crate::response::event::{Ball, Path, Settings, Wall};
use crate::response::{BallSpin, Impact, Material, Work};
use crate::shape::Aabb;

impl<S: Scalar> World<S> {
    /// Goes through a substep of `dt` seconds, event by event.
    pub(super) fn go_through_events(&mut self, dt: S) {
        let exact = self.model.precision == Precision::Compensated;
        let named: Vec<_> = self.events.walls.iter().map(|wall| (wall.row, wall.part)).collect();
        let mut names: Vec<_> =
            self.walls.planes().map(|(wall, _)| Part { wall, part: 0 }).collect();
        if !self.walls.are_planes() {
            self.walls_on_the_way(dt, &mut names);
        }
        let marbles = &self.marbles;
        let events = &mut self.events;
        events.walls.clear();
        events.walls.extend(names.iter().filter_map(|Part { wall, part }| {
            let row = *wall as usize;
            Some(Wall {
                form: self.walls.shapes()[row].exact(*part)?,
                row: *wall,
                part: *part,
                motion: self.walls.motion_of_row(row).map(WallMotion::cast),
                material: self.walls.material_of_row(row).map(Material::cast),
            })
        }));
        if !named.iter().copied().eq(events.walls.iter().map(|wall| (wall.row, wall.part))) {
            events.warm.clear(); // it knows walls by their places
        }
        events.balls.clear();
        events.balls.extend((0..marbles.len()).map(|row| {
            let Motion { position, velocity } = marbles.exact(row);
            let largest = position.x.abs().max(position.y.abs()).max(position.z.abs());
            let digit = if exact { f64::EPSILON } else { S::epsilon().as_f64() };
            let radius = marbles.radius()[row].as_f64();
            Ball {
                position,
                velocity,
                spin: marbles.exact_spin(row),
                pull: self.accelerations.get(row).copied().unwrap_or(Vec3::new(0.0, 0.0, 0.0)),
                radius,
                inverse_mass: 1.0 / marbles.mass(row).as_f64(),
                material: marbles.material.get(row).unwrap_or_default().cast(),
                spins: match self.model.rotation {
                    Rotation::Dynamic if !marbles.is_held(row) => BallSpin::Free,
                    _ => BallSpin::Ignored,
                },
                rounding: 4.0 * digit * (largest + radius),
                turned: Vec3::new(0.0, 0.0, 0.0),
                path: Path::default(),
            }
        }));
        let cast = |contact: &Contact<S>| Contact {
            a: contact.a,
            b: contact.b,
            part: 0,
            along: [0.0; 2],
            mtv: cast_vector(contact.mtv),
        };
        let place = |contact: &Contact<S>| {
            let part = Part { wall: contact.a, part: contact.part };
            let a = names.binary_search(&part).ok()? as u32;
            Some(Contact { a, ..cast(contact) })
        };
        events.near.clear();
        events.near.wm.extend(self.contacts.wm.iter().filter_map(place));
        events.near.mm.extend(self.contacts.mm.iter().map(cast));
        let settings = Settings { dt: dt.as_f64(), iterations: self.model.iterations };
        events.work = self.accounting.is_some().then(Work::default);
        let mut impacts = Vec::new();
        self.stopped.extend(events.run(&settings, &mut impacts));
        self.impacts.extend(impacts.into_iter().map(Impact::cast));
        if let (Some(accounting), Some(work)) = (&mut self.accounting, self.events.work) {
            accounting.work = work;
        }
        for (row, ball) in self.events.balls.iter().enumerate() {
            let (position, velocity) = (ball.position, ball.velocity);
            self.marbles.set_exact(row, Motion { position, velocity });
            if self.model.rotation == Rotation::Dynamic {
                self.marbles.set_exact_spin(row, ball.spin);
                self.marbles.turn_by(row, cast_vector(ball.turned));
            }
        }
    }

    /// Adds the parts of walls, besides half-spaces, that a marble may meet in `dt` seconds:
    /// all that are nearer than twice what the fastest of them goes, since an equal one may
    /// have its speed, and one much lighter twice that. Leaves all names in order.
    fn walls_on_the_way(&self, dt: S, names: &mut Vec<Part>) {
        let two = S::constant(2.0);
        let velocities = self.marbles.velocity().iter().map(|v| length(*v));
        let pulls = self.accelerations.iter().map(|a| S::constant(a.magnitude()));
        let fastest = velocities.fold(S::zero(), S::max) + pulls.fold(S::zero(), S::max) * dt;
        for row in 0..self.marbles.len() {
            let sphere = self.marbles.sphere(row);
            let far = sphere.radius * two + fastest * two * dt;
            let more = Vec3::new(far, far, far);
            let bounds = Aabb { min: sphere.center - more, max: sphere.center + more };
            self.walls.near(&bounds, |part| names.push(part));
        }
        names.sort_unstable();
        names.dedup();
    }

    /// How wide a gap may still be one between marbles at rest: many times what the
    /// method takes for such, and what rounding hides.
    pub(super) fn reach_at_rest(&self, dt: S) -> S {
        let strongest = self.accelerations.iter().map(|a| a.magnitude());
        let fall = strongest.fold(0.0, f64::max) * dt.as_f64() * dt.as_f64();
        let far = self.marbles.position().iter().map(|p| {
            let p = cast_point::<S, f64>(*p);
            p.x.abs().max(p.y.abs()).max(p.z.abs())
        });
        let rounding = 16.0 * S::epsilon().as_f64() * far.fold(0.0, f64::max);
        let reach = S::constant(0.02 * fall + rounding);
        if reach.is_finite() { reach } else { S::zero() }
    }
}
