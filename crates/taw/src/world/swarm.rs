//! The swarm of a world, and what its balls meet there.

use cgmath::{EuclideanSpace, InnerSpace};

use super::World;
use super::marbles::MarbleId;
use super::touch::{Near, drop_seams, parts_near};
use super::walls::{Part, Walls};
use crate::Error;
use crate::error::positive;
use crate::math::{Point3, Scalar, Vec3, cast_point, cast_vector};
use crate::response::Material;
use crate::shape::{Aabb, Sphere};
use crate::swarm::{BallId, Guest, Stage, Surroundings};

/// The marbles that are guests of the swarm.
#[derive(Clone, Debug, Default)]
pub(super) struct Guests {
    names: Vec<(MarbleId, BallId)>,
    /// How many marbles there were, and how many had gone.
    seen: [u64; 2],
}

impl<S: Scalar> World<S> {
    /// Moves the [swarm](Self::swarm) on, which a step does after the marbles. `observe` is told
    /// what it goes about, as often as that changes.
    ///
    /// Marbles and the swarm push each other; the swarm takes a capsule for the ball in its
    /// middle.
    ///
    /// # Errors
    /// [`Error::NotPositive`] for `dt`, [`Error::Full`] at 2³² balls.
    pub fn step_swarm(&mut self, dt: S, observe: &mut dyn FnMut(Stage)) -> Result<(), Error> {
        positive("dt", dt)?;
        let dt = positive("dt", dt.as_f64() as f32)?;
        if self.swarm.len() == self.guests.names.len() {
            return Ok(());
        }
        self.invite_guests()?;
        self.walls.prepare();
        let gravity = cast_vector(self.gravity);
        self.swarm.step(dt, gravity, &self.walls, self.walls.version(), observe);
        self.part_with_guests();
        Ok(())
    }

    /// Tells the swarm where the marbles are.
    fn invite_guests(&mut self) -> Result<(), Error> {
        let seen = [self.marbles.len() as u64, self.marbles.removals()];
        if seen != self.guests.seen {
            let names = &mut self.guests.names;
            let marbles = &self.marbles;
            let gone: Vec<_> = names
                .iter()
                .filter(|(marble, _)| marbles.row(*marble).is_err())
                .map(|(_, ball)| *ball)
                .collect();
            self.swarm.remove(&gone)?;
            names.retain(|(marble, _)| marbles.row(*marble).is_ok());
            // Both are in the order of the marbles' handles.
            names.sort_unstable();
            let known = |id: &MarbleId| names.binary_search_by_key(id, |(id, _)| *id).is_ok();
            let ids = (0..marbles.len()).filter_map(|row| marbles.id(row));
            let new: Vec<_> = ids.filter(|id| !known(id)).collect();
            let balls = self.swarm.invite(new.len())?;
            names.extend(new.into_iter().zip(balls));
            names.sort_unstable();
            self.guests.seen = seen;
        }
        let marbles = &self.marbles;
        let guests = self.guests.names.iter().filter_map(|(marble, ball)| {
            let row = marbles.row(*marble).ok()?;
            let single = |x: S| (x.as_f64() as f32).clamp(-FURTHEST, FURTHEST);
            let rows = |v: Vec3<S>, last: f32| [single(v.x), single(v.y), single(v.z), last];
            let radius = marbles.radius()[row];
            let spin = marbles.spin().get(row).map_or([0.0; 4], |spin| rows(*spin * radius, 0.0));
            let inverse_mass = (S::one() / marbles.mass(row)).as_f64() as f32;
            Some(Guest {
                ball: *ball,
                at: rows(marbles.position()[row].to_vec(), single(radius)),
                velocity: rows(marbles.velocity()[row], inverse_mass),
                rim: spin,
            })
        });
        self.swarm.host(guests);
        Ok(())
    }

    /// Gives the marbles what the swarm did to them.
    fn part_with_guests(&mut self) {
        for ((marble, _), (before, after)) in self.guests.names.iter().zip(self.swarm.hosted()) {
            let change = |before: &[f32; 4], after: &[f32; 4]| {
                let [x, y, z] = [0, 1, 2].map(|i| S::constant(f64::from(after[i] - before[i])));
                Vec3::new(x, y, z)
            };
            let moved = change(&before.at, &after.at);
            let faster = change(&before.velocity, &after.velocity);
            let turned = change(&before.rim, &after.rim);
            self.marbles.push(*marble, moved, faster, turned);
        }
    }
}

/// In metres and m/s.
const FURTHEST: f32 = 1e12;

impl<S: Scalar> Surroundings for Walls<S> {
    fn planes(&self, name: &mut dyn FnMut(u32, Vec3<f32>, f32)) {
        for (wall, plane) in Walls::planes(self) {
            let normal: Vec3<f32> = cast_vector(plane.normal());
            name(wall, normal.normalize(), plane.offset().as_f64() as f32);
        }
    }

    fn has_shapes(&self) -> bool {
        !self.are_planes()
    }

    fn near(&self, low: [f32; 3], high: [f32; 3]) -> bool {
        let bounds = Aabb { min: cast_point(low.into()), max: cast_point(high.into()) };
        let mut any = false;
        Walls::near(self, &bounds, |_| any = true);
        any
    }

    fn shapes_at(
        &self,
        &[x, y, z, radius]: &[f32; 4],
        reach: f32,
        name: &mut dyn FnMut([u32; 2], Vec3<f32>, f32),
    ) {
        let number = |x: f32| S::constant(f64::from(x));
        let center = cast_point(Point3::new(x, y, z));
        let sphere = Sphere { center, radius: number(radius) };
        let mut near = Vec::new();
        parts_near(self, &sphere, number(reach), &mut near);
        if near.len() > 1 {
            drop_seams(self, &sphere, &mut near);
        }
        for Near { part: Part { wall, part }, nearest } in near {
            let normal: Vec3<f32> = cast_vector(nearest.normal);
            name([wall, part], normal, nearest.distance.as_f64() as f32);
        }
    }

    fn surface_velocity(&self, wall: u32, point: Point3<f32>) -> Vec3<f32> {
        cast_vector(crate::response::Walls::surface_velocity(
            self,
            wall as usize,
            cast_point(point),
        ))
    }

    fn material(&self, wall: u32) -> Option<Material<f32>> {
        self.material_of_row(wall as usize).map(Material::cast)
    }
}
