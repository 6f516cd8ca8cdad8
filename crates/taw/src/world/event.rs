//! Between the columns and [`Response::EventDriven`](crate::response::Response), which
//! counts in `f64`.

use cgmath::InnerSpace;

use super::{Precision, World};
use crate::contact::Contact;
use crate::math::{Scalar, Vec3, cast_point, cast_vector};
use crate::motion::{Motion, Rotation, WallMotion};
use crate::response::event::{Ball, Path, Settings, Wall};
use crate::response::{BallSpin, Impact, Material};

impl<S: Scalar> World<S> {
    /// Goes through a substep of `dt` seconds, event by event.
    pub(super) fn go_through_events(&mut self, dt: S) {
        let exact = self.model.precision == Precision::Compensated;
        let marbles = &self.marbles;
        let events = &mut self.events;
        events.walls.clear();
        events.walls.extend(self.walls.planes().iter().enumerate().map(|(row, plane)| {
            // What rounding leaves of a unit vector's length would add energy.
            let normal = cast_vector::<S, f64>(plane.normal());
            let length = normal.magnitude();
            Wall {
                normal: normal / length,
                offset: plane.offset().as_f64() / length,
                motion: self.walls.motion_of_row(row).map(WallMotion::cast),
                material: self.walls.material_of_row(row).map(Material::cast),
            }
        }));
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
            mtv: cast_vector(contact.mtv),
        };
        events.near.clear();
        events.near.wm.extend(self.contacts.wm.iter().map(cast));
        events.near.mm.extend(self.contacts.mm.iter().map(cast));
        let settings = Settings { dt: dt.as_f64(), iterations: self.model.iterations };
        let mut impacts = Vec::new();
        self.stopped.extend(events.run(&settings, &mut impacts));
        self.impacts.extend(impacts.into_iter().map(Impact::cast));
        for (row, ball) in self.events.balls.iter().enumerate() {
            let (position, velocity) = (ball.position, ball.velocity);
            self.marbles.set_exact(row, Motion { position, velocity });
            if self.model.rotation == Rotation::Dynamic {
                self.marbles.set_exact_spin(row, ball.spin);
                self.marbles.turn_by(row, cast_vector(ball.turned));
            }
        }
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
