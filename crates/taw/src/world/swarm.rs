//! The swarm of a world, and what its balls meet there.

use cgmath::{EuclideanSpace, InnerSpace};

use super::MarbleId;
use super::World;
use super::continuous::{Frame, RelativePath};
use super::narrow_phase::{Candidate, candidate_sub_shapes, remove_ghost_collisions};
use super::soft_step::inverse_mass;
use super::walls::{SubShape, Walls};
use crate::Error;
use crate::broad::CollisionLayers;
use crate::math::{Point3, Scalar, Vec3, cast_point, cast_vector};
use crate::motion::{Motion, acceleration_in_step};
use crate::response::{Material, Response};
use crate::shape::{Aabb, Aabb3, BoundedShape, PointProjection, Sphere};
use crate::swarm::{BallId, Proxy, Stage, StaticGeometry, VelocityChange};

impl<S: Scalar> World<S> {
    /// Moves the [swarm](Self::swarm) on, which a step does after the marbles. `observe` is told
    /// what it goes about, as often as that changes.
    ///
    /// Marbles and the swarm push each other; the swarm takes a capsule for the ball in its
    /// middle.
    ///
    /// # Errors
    /// [`Error::NotPositive`] for `dt`, [`Error::OutOfRange`] if it is not in [`World::TIMES`],
    /// [`Error::Full`] at 2³² balls.
    pub fn step_swarm(&mut self, dt: S, observe: &mut dyn FnMut(Stage)) -> Result<(), Error> {
        let step = Self::validated_dt(dt)?;
        let dt = step.as_f64() as f32;
        if self.settings.model.response == Response::SoftStep {
            return Ok(()); // it moved with the marbles
        }
        self.swarm.set_bodies_are_rows(false);
        self.remove_stale_bodies()?;
        if self.swarm.len() == self.swarm.body_balls.len() {
            return Ok(());
        }
        self.sync_proxies(dt)?;
        self.walls.update_tree();
        let (gravity, changes) =
            (cast_vector(self.settings.gravity), self.field_changes_of_swarm(step));
        self.swarm.set_velocity_changes(changes);
        self.swarm.step(dt, gravity, &self.walls, self.walls.identity(), observe);
        self.walls.mark_seen();
        self.write_back_proxies();
        Ok(())
    }

    /// Changes of velocity by force fields and gravity scales of the swarm's own balls in a step of
    /// `dt` seconds.
    pub(super) fn field_changes_of_swarm(&self, dt: S) -> Vec<VelocityChange> {
        let acceleration = |motion: Motion<f32>, mass: f32| {
            let motion = Motion {
                position: cast_point(motion.position),
                velocity: cast_vector(motion.velocity),
            };
            let mass = S::from_f64(f64::from(mass));
            cast_vector(acceleration_in_step(&self.settings.forces, motion, mass, dt))
        };
        let acceleration = (!self.settings.forces.is_empty()).then_some(acceleration);
        let (gravity, dt) = (cast_vector(self.settings.gravity), dt.as_f64() as f32);
        self.swarm.field_changes(acceleration, gravity, dt)
    }

    /// Forgets proxies of which the world lost the marble or the swarm the ball, whoever took
    /// them out.
    pub(super) fn remove_stale_bodies(&mut self) -> Result<(), Error> {
        let (marbles, swarm) = (&self.marbles, &mut self.swarm);
        let stays = |(marble, _): &(MarbleId, BallId)| marbles.row(*marble).is_ok();
        let is_there = |(_, ball): &(MarbleId, BallId)| swarm.row(*ball).is_ok();
        if swarm.body_balls.iter().all(|proxy| stays(proxy) && is_there(proxy)) {
            return Ok(());
        }
        let (there, _): (Vec<_>, Vec<_>) = swarm.body_balls.iter().copied().partition(is_there);
        let (stay, gone): (Vec<_>, Vec<_>) = there.into_iter().partition(stays);
        swarm.body_balls = stay;
        swarm.take_out(&gone.into_iter().map(|(_, ball)| ball).collect::<Vec<_>>())
    }

    /// Gives every marble a ball in the swarm.
    pub(super) fn insert_missing_bodies(&mut self) -> Result<(), Error> {
        if self.swarm.body_balls.len() != self.marbles.len() {
            let (marbles, swarm) = (&self.marbles, &mut self.swarm);
            let known =
                |id: &MarbleId| swarm.body_balls.binary_search_by_key(id, |(id, _)| *id).is_ok();
            let ids = (0..marbles.len()).filter_map(|row| marbles.id(row));
            let new: Vec<_> = ids.filter(|id| !known(id)).collect();
            let balls = swarm.insert_bodies(new.len())?;
            swarm.body_balls.extend(new.into_iter().zip(balls));
            swarm.body_balls.sort_unstable();
        }
        Ok(())
    }

    /// Tells the swarm where the marbles are.
    fn sync_proxies(&mut self, dt: f32) -> Result<(), Error> {
        self.insert_missing_bodies()?;
        let (marbles, body_balls) = (&self.marbles, std::mem::take(&mut self.swarm.body_balls));
        let slots = &self.swarm;
        let layers = body_balls.iter().filter_map(|(marble, ball)| {
            Some((slots.slot_of(*ball)?, marbles.layers_of_row(marbles.row(*marble).ok()?)))
        });
        let layers: Vec<_> = layers.collect();
        self.swarm.set_layers_of_slots(layers.into_iter());
        let proxies = body_balls.iter().filter_map(|(marble, ball)| {
            let row = marbles.row(*marble).ok()?;
            let single = |x: S| (x.as_f64() as f32).clamp(-MAX_COORDINATE, MAX_COORDINATE);
            let rows = |v: Vec3<S>, last: f32| [single(v.x), single(v.y), single(v.z), last];
            let radius = marbles.radius()[row];
            let spin = marbles
                .angular_velocity()
                .get(row)
                .map_or([0.0; 4], |spin| rows(*spin * radius, 0.0));
            let inverse_mass = inverse_mass(marbles.mass(row));
            let at = rows(marbles.position()[row].to_vec(), single(radius));
            Some(Proxy::new(*ball, at, rows(marbles.velocity()[row], inverse_mass), spin))
        });
        self.swarm.set_proxies(proxies, dt, cast_vector(self.settings.gravity));
        self.swarm.body_balls = body_balls;
        Ok(())
    }

    /// Gives the marbles what the swarm did to them.
    fn write_back_proxies(&mut self) {
        for ((marble, _), (before, after)) in
            self.swarm.body_balls.iter().zip(self.swarm.proxies_and_results())
        {
            let change = |before: &[f32; 4], after: &[f32; 4]| {
                let [x, y, z] = [0, 1, 2].map(|i| S::from_f64(f64::from(after[i] - before[i])));
                Vec3::new(x, y, z)
            };
            let moved = change(&before.at, &after.at);
            let faster = change(&before.velocity, &after.velocity);
            let turned = change(&before.spin_velocity, &after.spin_velocity);
            self.marbles.apply_delta(*marble, moved, faster, turned);
        }
    }
}

/// Overlap in radii at the end of a path up to which a ball only grazes a wall.
const GRAZES: f64 = 0.02;
/// In metres and m/s.
pub(super) const MAX_COORDINATE: f32 = 1e12;

impl<S: Scalar> Walls<S> {
    /// Time at which a sphere meets the first part that it passes into on a path, as a fraction of
    /// it. Its core, or how deep it comes in the end, says whether it passes into a wall: one that
    /// grazes it goes on.
    fn time_of_passage(
        &self,
        (sphere, layers): (&Sphere<S>, CollisionLayers),
        displacement: Vec3<S>,
        reached: &Aabb3<S>,
    ) -> Option<S> {
        let core = sphere.radius * S::from_f64(0.5);
        let path = RelativePath { start: sphere.center, displacement, frame: Frame::Standing };
        let deep = sphere.radius * S::from_f64(1.0 - GRAZES);
        let mut first: Option<S> = None;
        self.for_each_colliding(reached, layers, |part| {
            let distance = |point| self.project_point(part, point).distance;
            let ends_in_it = || {
                let end = distance(sphere.center + displacement);
                end < deep && end < distance(sphere.center)
            };
            let passes = ends_in_it() || self.time_of_impact(part, core, &path).is_some();
            let stop = passes.then(|| self.time_of_impact(part, sphere.radius, &path)).flatten();
            if let Some(stop) = stop {
                first = Some(first.map_or(stop.time, |time| time.min(stop.time)));
            }
        });
        first
    }
}

impl<S: Scalar> StaticGeometry for Walls<S> {
    fn planes(&self, visit: &mut dyn FnMut(u32, Vec3<f32>, f32)) {
        for (wall, plane) in Walls::planes(self) {
            let normal: Vec3<f32> = cast_vector(plane.normal());
            visit(wall, normal.normalize(), plane.offset().as_f64() as f32);
        }
    }

    fn has_shapes(&self) -> bool {
        !self.are_half_spaces()
    }

    fn visit_removals_since(&self, identity: u64, visit: &mut dyn FnMut([u32; 2])) -> bool {
        self.changes().visit_removals_since(identity, visit)
    }

    fn visit_changes_since(&self, identity: u64, visit: &mut dyn FnMut([[f32; 3]; 2])) -> bool {
        self.changes().visit_since(identity, |region| {
            let corner = |point: Point3<S>| cast_point::<S, f32>(point).into();
            visit([corner(region.min), corner(region.max)]);
        })
    }

    fn near(&self, low: [f32; 3], high: [f32; 3]) -> bool {
        let bounds = Aabb { min: cast_point(low.into()), max: cast_point(high.into()) };
        let mut any = false;
        Walls::for_each_in_box(self, &bounds, |_| any = true);
        any
    }

    fn shapes_at(
        &self,
        &[x, y, z, radius]: &[f32; 4],
        layers: CollisionLayers,
        reach: f32,
        visit: &mut dyn FnMut([u32; 2], Vec3<f32>, f32),
    ) {
        let number = |x: f32| S::from_f64(f64::from(x));
        let center = cast_point(Point3::new(x, y, z));
        let sphere = Sphere { center, radius: number(radius) };
        let mut near = Vec::new();
        candidate_sub_shapes(self, (&sphere, layers), number(reach), &mut near);
        if near.len() > 1 {
            remove_ghost_collisions(self, (&sphere, layers), &mut near);
        }
        for Candidate { part: SubShape { wall, index: part }, nearest } in near {
            let normal: Vec3<f32> = cast_vector(nearest.normal);
            visit([wall, part], normal, nearest.distance.as_f64() as f32);
        }
    }

    fn first_hit_on_path(
        &self,
        &[x, y, z, radius]: &[f32; 4],
        layers: CollisionLayers,
        displacement: Vec3<f32>,
    ) -> Option<([u32; 2], Vec3<f32>, f32)> {
        let number = |x: f32| S::from_f64(f64::from(x));
        let center: Point3<S> = cast_point(Point3::new(x, y, z));
        let sphere = Sphere { center, radius: number(radius) };
        let displacement: Vec3<S> = cast_vector(displacement);
        let (start, end) =
            (sphere.bounding_box(), Sphere { center: center + displacement, ..sphere });
        let reached = start.union(&end.bounding_box());
        let time = self.time_of_passage((&sphere, layers), displacement, &reached)?;
        // Before the part that it passes into it may meet another one, of which that is the
        // continuation: then the edge between them is no obstacle.
        let path = RelativePath { start: center, displacement, frame: Frame::Standing };
        let mut first: Option<(SubShape, S, PointProjection<S>)> = None;
        self.for_each_colliding(&reached, layers, |part| {
            let Some(stop) = self.time_of_impact(part, sphere.radius, &path) else { return };
            if stop.time > time || first.as_ref().is_some_and(|(_, time, _)| stop.time >= *time) {
                return;
            }
            let nearest = self.project_point(part, center + displacement * stop.time);
            let approach = -displacement.dot(nearest.normal);
            if stop.time == time || approach > displacement.magnitude() * S::from_f64(GRAZES) {
                first = Some((part, stop.time, nearest));
            }
        });
        let (part, time, nearest) = first?;
        // The plane there is nearer by the displacement up to it.
        let distance = nearest.distance - displacement.dot(nearest.normal) * time;
        let normal: Vec3<f32> = cast_vector(nearest.normal);
        Some(([part.wall, part.index], normal, distance.as_f64() as f32))
    }

    fn surface_velocity(&self, wall: u32, point: Point3<f32>) -> Vec3<f32> {
        cast_vector(crate::response::Colliders::surface_velocity(
            self,
            wall as usize,
            cast_point(point),
        ))
    }

    fn layers(&self, wall: u32) -> CollisionLayers {
        self.layers_of_row(wall)
    }

    fn material(&self, wall: u32) -> Option<Material<f32>> {
        self.material_of_row(wall as usize).map(Material::cast)
    }
}
