//! Clusters that come to rest within a substep, and the accelerations that keep them at rest.

use cgmath::{InnerSpace, Zero};

use super::cluster::{Cluster, ClusterBodies};
use super::wall::MovingWalls;
use super::{EventBall, EventSettings, EventSolver, MAX_CONTACTS, Trajectory};
use crate::contact::{Contact, Contacts};
use crate::math::Vec3;
use crate::response::impulse::CachedImpulse;
use crate::response::rename_rows;

/// Balls that rest together from now on.
pub(super) struct RestingCluster {
    pub rows: Vec<usize>,
    pub pressed_by: PressedBy,
    /// True if walls squeeze them.
    pub squeezed: bool,
}

/// Causes that may press resting balls together again.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum PressedBy {
    /// None: all balls accelerate alike, and touch nothing else.
    Nothing,
    /// Forces that differ between balls.
    Forces,
    /// A wall, or a ball of infinite mass.
    FixedBody,
}

impl EventSolver {
    /// Puts balls to rest, with all that touch them and each other. Pairs that separate faster than
    /// `max_separation_speed`, in m/s, and than the rest threshold do not count as touching. The
    /// caller predicts their events again.
    pub(super) fn rest_cluster(
        &mut self,
        seeds: [usize; 2],
        max_separation_speed: f64,
        now: f64,
        settings: &EventSettings,
    ) -> RestingCluster {
        let (found, mut contacts) =
            self.connected_component(seeds, max_separation_speed, now, settings);
        let max_acceleration = found
            .iter()
            .map(|row| self.balls[*row].external_acceleration.magnitude())
            .fold(0.0, f64::max);
        // First the collision.
        self.cluster.gather(&mut contacts, (&self.balls, &self.walls), self.period);
        let remaining = settings.dt - now;
        let ends_all = max_separation_speed == f64::INFINITY;
        let tolerance = ends_all.then(|| self.cluster.tolerance(max_acceleration, settings));
        let squeezed = self.end_approach(&mut contacts, now, max_acceleration, tolerance, settings);
        self.take_cluster_velocities();
        let row_of = |local: u32| self.cluster.rows[local as usize];
        contacts.wm.iter_mut().for_each(|c| c.b = row_of(c.b));
        contacts.mm.iter_mut().for_each(|c| (c.a, c.b) = (row_of(c.a), row_of(c.b)));
        // Then the accelerations that keep it at rest, if there is any pressure and time left.
        let pressed_by = self.find_pressed_by(&found, &contacts);
        let is_free = max_separation_speed == f64::INFINITY && pressed_by == PressedBy::Nothing;
        if contacts.is_empty() || is_free {
            // No pressure any more.
        } else if remaining > 1e-6 * settings.dt {
            self.solve_resting(&mut contacts, now, settings, &mut Vec::new());
        } else {
            self.keep_velocity(&found);
        }
        RestingCluster { rows: found, pressed_by, squeezed }
    }

    /// Gives balls the velocities that they have in the gathered cluster.
    pub(super) fn take_cluster_velocities(&mut self) {
        for (local, row) in self.cluster.rows.iter().enumerate() {
            let ball = &mut self.balls[*row as usize];
            if !ball.is_frozen() {
                (ball.velocity, ball.spin) =
                    (self.cluster.bodies.velocity[local], self.cluster.bodies.spin[local]);
            }
        }
    }

    /// Solves the approach of a gathered cluster as one collision without restitution;
    /// `max_acceleration` in m/s².
    pub(super) fn solve_inelastic_impact(
        &mut self,
        contacts: &mut Contacts<f64>,
        (now, walls_at_rest): (f64, bool),
        max_acceleration: f64,
        settings: &EventSettings,
    ) {
        for c in contacts.wm.iter_mut().chain(&mut contacts.mm) {
            (c.material.restitution, c.material.tangential_restitution) = (0.0, 0.0);
        }
        let walls =
            MovingWalls { walls: &self.walls, start: now, end: now, at_rest: walls_at_rest };
        let before = self
            .work
            .map(|_| (self.cluster.bodies.velocity.clone(), self.cluster.bodies.spin.clone()));
        self.cluster.solve(contacts, &walls, max_acceleration, 0.0, settings, &mut Vec::new());
        if let (Some(work), Some((mut velocity, mut spin))) = (&mut self.work, before) {
            self.cluster.record_energy(&mut velocity, &mut spin, work);
        }
    }

    /// Keeps velocities constant, for a time too short for forces to matter.
    fn keep_velocity(&mut self, rows: &[usize]) {
        for row in rows {
            let trajectory = &mut self.balls[*row].trajectory;
            (trajectory.acceleration, trajectory.clustered) = (Vec3::zero(), true);
        }
    }

    fn find_pressed_by(&self, rows: &[usize], contacts: &Contacts<f64>) -> PressedBy {
        let is_fixed = |row: &usize| {
            let ball = &self.balls[*row];
            ball.inverse_mass <= 0.0 || ball.is_frozen()
        };
        if !contacts.wm.is_empty() || rows.iter().any(is_fixed) {
            return PressedBy::FixedBody;
        }
        let is_uniform = rows.windows(2).all(|two| {
            self.balls[two[0]].external_acceleration == self.balls[two[1]].external_acceleration
        });
        if is_uniform { PressedBy::Nothing } else { PressedBy::Forces }
    }

    /// Connected component of contacts around some balls, all in free flight at this time, and its
    /// contacts.
    fn connected_component(
        &mut self,
        seeds: [usize; 2],
        max_separation_speed: f64,
        now: f64,
        settings: &EventSettings,
    ) -> (Vec<usize>, Contacts<f64>) {
        let mut contacts = Contacts::default();
        // Index of each ball in `found`, plus one.
        let mut index = std::mem::take(&mut self.cluster.contact_counts);
        index.clear();
        index.resize(self.balls.len(), 0);
        let mut found = Vec::new();
        let add = |row: usize, index: &mut Vec<u32>, found: &mut Vec<usize>| {
            if index[row] == 0 {
                found.push(row);
                index[row] = found.len() as u32;
            }
        };
        for row in seeds {
            add(row, &mut index, &mut found);
        }
        let mut next = 0;
        let mut contact_counts = vec![0_u32; self.balls.len()];
        let mut near = Vec::new();
        while let Some(row) = found.get(next).copied() {
            next += 1;
            self.release(row, now);
            self.add_wall_contacts(row, max_separation_speed, now, settings, &mut contacts.wm);
            near.clear();
            self.for_each_near(row, settings, |other| near.push(other));
            settings.add_cost(near.len() as u64);
            near.sort_unstable();
            near.dedup();
            for other in near.iter().copied().filter(|other| *other != row) {
                // Visited balls have listed this contact already.
                if index[other] != 0 && index[other] <= next as u32 {
                    continue;
                }
                let before = self.balls[other];
                self.balls[other].advance(now);
                let (a, b) = (row.min(other) as u32, row.max(other) as u32);
                let contact = Contact::between_marbles(a, b);
                // The colliding two are in contact, whatever rounding says.
                let is_seed = seeds.contains(&row) && seeds.contains(&other);
                let is_full = contact_counts[row].min(contact_counts[other]) >= MAX_CONTACTS;
                if !is_full
                    && (is_seed
                        || self.ball_contact(&contact, max_separation_speed, settings).is_some())
                {
                    contact_counts[row] += 1;
                    contact_counts[other] += 1;
                    contacts.mm.push(contact);
                    add(other, &mut index, &mut found);
                }
                self.balls[other] = before;
            }
        }
        self.cluster.contact_counts = index;
        (found, contacts)
    }

    /// Starts free flight of a ball at a time, except if it is frozen.
    fn release(&mut self, row: usize, now: f64) {
        self.advance(row, now);
        let frozen = self.balls[row].is_frozen();
        self.balls[row].fly_free();
        if frozen {
            self.balls[row].freeze();
        }
    }

    fn add_wall_contacts(
        &self,
        row: usize,
        max_separation_speed: f64,
        now: f64,
        settings: &EventSettings,
        contacts: &mut Vec<Contact<f64>>,
    ) {
        let EventBall { position: at, radius, .. } = self.balls[row];
        let range = (at, radius + self.contact_tolerance(row as u32, settings));
        let cost = self.for_each_wall_within(row, range, |wall| {
            let contact = Contact::with_wall(wall as u32, 0, row as u32);
            if self.wall_contact(&contact, now, max_separation_speed, settings).is_some()
                && (self.parts_of(row).is_empty() || !self.is_seam(row, wall, at, now, settings))
            {
                contacts.push(contact);
            }
        });
        settings.add_cost(1 + cost);
    }

    /// Solves for the accelerations that keep contacts at rest from `now` to the end of the
    /// substep, or until their normals have turned too far.
    pub(super) fn solve_resting(
        &mut self,
        contacts: &mut Contacts<f64>,
        now: f64,
        settings: &EventSettings,
        impulse_cache: &mut Vec<CachedImpulse<f64>>,
    ) {
        self.cluster.gather(contacts, (&self.balls, &self.walls), self.period);
        let end = now + self.segment(contacts, now, settings.dt - now);
        let remaining = end - now;
        let max_acceleration = self.move_cluster_freely(remaining);
        rename_rows(impulse_cache, |row| self.cluster.local_index(row));
        let mut touches_balls = vec![false; self.cluster.rows.len()];
        for local in contacts.mm.iter().flat_map(|c| [c.a, c.b]) {
            touches_balls[local as usize] = true;
        }
        self.solve_until(contacts, [now, end], max_acceleration, settings, impulse_cache);
        let Cluster { rows, bodies, sets, scratch, .. } = &mut self.cluster;
        let ClusterBodies { position, velocity, spin, inverse_mass, .. } = bodies;
        rename_rows(impulse_cache, |at| rows.get(at).map(|row| *row as usize));
        let mut wall_power = self.work.map(|_| vec![0.0; rows.len()]);
        if let Some(wall_power) = &mut wall_power {
            scratch.for_each_supplied_energy(velocity, inverse_mass, |at, energy| {
                wall_power[at] += energy / remaining;
            });
        }
        // Position corrections of the solver, scaled so that no ball jumps through a thin wall, by
        // the same factor for a connected component, so that its center of mass stays.
        sets.build(contacts.mm.iter().map(|c| (Some(c.a as usize), c.b as usize)), rows.len());
        let (mut corrections, mut fractions) =
            (vec![Vec3::zero(); rows.len()], vec![1.0_f64; rows.len()]);
        for (at, row) in rows.iter().enumerate() {
            let ball = &mut self.balls[*row as usize];
            if ball.is_frozen() {
                continue;
            }
            let there = ball.position + (ball.velocity + velocity[at]) * (0.5 * remaining);
            ball.trajectory = Trajectory {
                acceleration: (velocity[at] - ball.velocity) / remaining,
                spin_acceleration: (spin[at] - ball.spin) / remaining,
                clustered: true,
                touches_balls: touches_balls[at],
                wall_power: wall_power.as_ref().map_or(0.0, |power| power[at]),
                regime_end: if end < settings.dt { end } else { f64::INFINITY },
                rest_count: ball.trajectory.rest_count + u32::from(now > 0.0),
                version: ball.trajectory.version + 1,
                ..ball.trajectory
            };
            corrections[at] = position[at] - there;
            let (set, distance) = (sets.set_of(at) as usize, corrections[at].magnitude());
            if distance > 0.5 * ball.radius {
                fractions[set] = fractions[set].min(0.5 * ball.radius / distance);
            }
        }
        for (at, correction) in corrections.into_iter().enumerate() {
            self.balls[rows[at] as usize].position +=
                correction * fractions[sets.set_of(at) as usize];
        }
        self.note_partners();
        self.push_cluster_out_of_walls(now, settings);
    }

    /// Moves a gathered cluster by external forces alone. Returns the largest acceleration, in
    /// m/s².
    fn move_cluster_freely(&mut self, time: f64) -> f64 {
        let Cluster { rows, bodies: ClusterBodies { position, velocity, .. }, .. } =
            &mut self.cluster;
        let mut max_acceleration: f64 = 0.0;
        for (at, row) in rows.iter().enumerate() {
            let ball = &self.balls[*row as usize];
            if ball.is_frozen() {
                continue;
            }
            position[at] += (ball.velocity + ball.external_acceleration * (0.5 * time)) * time;
            velocity[at] += ball.external_acceleration * time;
            max_acceleration = max_acceleration.max(ball.external_acceleration.magnitude());
        }
        max_acceleration
    }

    /// Pushes balls out of walls that they did not touch before the position corrections.
    fn push_cluster_out_of_walls(&mut self, now: f64, settings: &EventSettings) {
        for at in 0..self.cluster.rows.len() {
            let row = self.cluster.rows[at] as usize;
            if !self.balls[row].is_frozen() {
                self.ensure_candidates(row, now, settings);
                self.push_out_of_walls(row, now);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::{MAX_FREEZES, Wall, WallCollider, WallSource};
    use super::*;
    use crate::broad::CollisionLayers;
    use crate::math::Point3;
    use crate::motion::WallMotion;
    use crate::response::{BallRotation, Material};

    struct NoWalls;

    impl WallSource for NoWalls {
        fn planes(&self, _: &mut dyn FnMut(u32)) {}

        fn has_parts(&self) -> bool {
            false
        }

        fn near(&self, _: Point3<f64>, _: f64, _: &mut dyn FnMut(u32, u32)) {}

        fn wall(&self, _: u32, _: u32) -> Option<Wall> {
            None
        }
    }

    fn ball(position: [f64; 2], spin: f64, freeze_count: i32) -> EventBall {
        EventBall {
            position: Point3::new(position[0], position[1], 0.0),
            velocity: Vec3::zero(),
            spin: Vec3::unit_z() * spin,
            external_acceleration: Vec3::unit_y() * -9.81,
            radius: 1.0,
            inverse_mass: 1.0,
            material: Material { friction: 0.9, ..Material::default() },
            layers: CollisionLayers::ALL,
            rotation: BallRotation::Free,
            position_error: 1e-9,
            rotation_increment: Vec3::zero(),
            trajectory: Trajectory { freeze_count, ..Trajectory::default() },
        }
    }

    #[test]
    fn a_ball_wedged_between_frozen_ones_gains_no_energy_in_any_order() {
        // Friction holds it in the wedge: the line through the contact points is within both cones.
        let (x, y) = (f64::sqrt(3.0), 1.0);
        let frozen = MAX_FREEZES;
        let light = EventBall { velocity: Vec3::unit_y() * -0.1, ..ball([0.0, 0.0], 0.0, 0) };
        let balls = [ball([-x, -y], -9.0, frozen), light, ball([x, -y], 9.0, frozen)];
        for order in [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]] {
            let place = |of: usize| order.iter().position(|ball| *ball == of).unwrap();
            let mut method =
                EventSolver { balls: order.map(|i| balls[i]).to_vec(), ..EventSolver::default() };
            let settings = EventSettings {
                threads: 1,
                dt: 0.01,
                iterations: 8,
                gravity: Vec3::new(0.0, 0.0, 0.0),
                source: &NoWalls,
                budget_fraction: 1.0,
                cost: 0.into(),
            };
            method.assign_cells(settings.dt);
            method.find_candidates(&settings);
            method.rest_cluster([place(0), place(1)], f64::INFINITY, 0.0, &settings);
            let light = &method.balls[place(1)];
            assert!(light.trajectory.clustered, "{order:?}");
            assert!(light.velocity.magnitude() <= 0.1, "{order:?}: {light:?}");
            assert!(light.spin.magnitude() <= 0.1, "{order:?}: {light:?}");
            assert!(light.velocity_at(settings.dt).magnitude() <= 0.1, "{order:?}: {light:?}");
        }
    }

    /// Plane that rises by 1 m/s, from the origin.
    struct Lift;

    impl WallSource for Lift {
        fn planes(&self, visit: &mut dyn FnMut(u32)) {
            visit(0);
        }

        fn has_parts(&self) -> bool {
            false
        }

        fn near(&self, _: Point3<f64>, _: f64, _: &mut dyn FnMut(u32, u32)) {}

        fn wall(&self, row: u32, _: u32) -> Option<Wall> {
            let (normal, arrival_time) = (Vec3::unit_y(), Some(0.01));
            let (angular_velocity, pivot) = (Vec3::zero(), Point3::new(0.0, 0.0, 0.0));
            Some(Wall {
                collider: WallCollider::Plane { normal, offset: 0.01 },
                bounds: None,
                row,
                part: 0,
                motion: Some(WallMotion { velocity: normal, angular_velocity, pivot }),
                arrival_time,
                material: None,
                layers: CollisionLayers::ALL,
                relative_rounding: 0.0,
            })
        }
    }

    #[test]
    fn a_ball_that_freezes_carries_no_other_on() {
        let balls = vec![ball([0.0, 1.0], 0.0, MAX_FREEZES - 1), ball([0.0, 3.0], 0.0, 0)];
        let mut method = EventSolver { balls, ..EventSolver::default() };
        let settings = EventSettings {
            threads: 1,
            dt: 0.01,
            iterations: 8,
            gravity: Vec3::new(0.0, 0.0, 0.0),
            source: &Lift,
            budget_fraction: 1.0,
            cost: 0.into(),
        };
        method.assign_cells(settings.dt);
        method.find_candidates(&settings);
        method.stop_collapse([0, 1], 0.0, &settings);
        assert!(method.balls[0].is_frozen());
        let upper = &method.balls[1];
        let acceleration = upper.trajectory.acceleration;
        assert!((acceleration - upper.external_acceleration).magnitude() < 1e-9, "{upper:?}");
    }
}
