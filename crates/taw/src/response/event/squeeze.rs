//! Clusters squeezed by walls that move against each other. Nothing stops a wall, so that no
//! velocities satisfy all contacts, or only such as no wall explains: a chain of balls between two
//! walls would buckle the faster, the straighter it is. Then the balls give way, and overlap.

use super::wall::MovingWalls;
use super::{EventSettings, EventSolver};
use crate::contact::Contacts;
use crate::response::impulse::CachedImpulse;

/// Relative rounding of energies, many times that of their sums.
const ROUNDING: f64 = 1e-9;

impl EventSolver {
    /// Ends the approach of a gathered cluster as one collision without restitution, down to
    /// `tolerance` in m/s, if there is one; `max_acceleration` in m/s². If walls squeeze it, it ends
    /// its approach to where they are, and they go on into it; returns true then.
    pub(super) fn end_approach(
        &mut self,
        contacts: &mut Contacts<f64>,
        now: f64,
        max_acceleration: f64,
        tolerance: Option<f64>,
        settings: &EventSettings,
    ) -> bool {
        let walls = MovingWalls { walls: &self.walls, start: now, end: now, at_rest: false };
        let Some(carried) = self.cluster.carried_energy(contacts, &walls) else {
            self.end_approach_to(contacts, (now, false), max_acceleration, tolerance, settings);
            return false;
        };
        let (bodies, work) = (self.cluster.bodies.clone(), self.work);
        let initial = self.cluster.kinetic_energy();
        self.end_approach_to(contacts, (now, false), max_acceleration, tolerance, settings);
        // Among walls that move alike, a collision without restitution leads to a velocity on the
        // sphere whose diameter is from the initial velocity to that of the walls, or inside, in the
        // metric of kinetic energy (Moreau 1988). So its square is at most the sum of the two.
        let max_energy = (initial + carried) * (1.0 + ROUNDING);
        if self.cluster.kinetic_energy() <= max_energy {
            return false;
        }
        // Iterations over balls of very different masses may end beside that sphere. Normal impulses
        // alone have a direct solution, which tells if it is the walls that squeeze.
        (self.cluster.bodies, self.work) = (bodies.clone(), work);
        let direct_tolerance = self.cluster.tolerance(max_acceleration, settings);
        self.end_remaining_approach(contacts, (now, false), direct_tolerance, settings);
        if self.cluster.kinetic_energy() <= max_energy {
            return false;
        }
        (self.cluster.bodies, self.work) = (bodies, work);
        self.end_approach_to(contacts, (now, true), max_acceleration, tolerance, settings);
        true
    }

    /// Ends the approach to walls that move or, if the flag is set, to where they are.
    fn end_approach_to(
        &mut self,
        contacts: &mut Contacts<f64>,
        (now, walls_at_rest): (f64, bool),
        max_acceleration: f64,
        tolerance: Option<f64>,
        settings: &EventSettings,
    ) {
        self.solve_inelastic_impact(contacts, (now, walls_at_rest), max_acceleration, settings);
        if let Some(tolerance) = tolerance {
            self.end_remaining_approach(contacts, (now, walls_at_rest), tolerance, settings);
        }
    }

    /// Solves the contacts of a gathered cluster, which has moved freely, between two times. If walls
    /// squeeze it, they carry nothing along.
    pub(super) fn solve_until(
        &mut self,
        contacts: &mut Contacts<f64>,
        [now, end]: [f64; 2],
        max_acceleration: f64,
        settings: &EventSettings,
        impulse_cache: &mut Vec<CachedImpulse<f64>>,
    ) {
        let (remaining, cluster) = (end - now, &mut self.cluster);
        let mut walls = MovingWalls { walls: &self.walls, start: now, end, at_rest: false };
        let before = cluster
            .carried_energy(contacts, &walls)
            .map(|carried| (carried, cluster.kinetic_energy(), cluster.bodies.clone()));
        cluster.solve(contacts, &walls, max_acceleration, remaining, settings, impulse_cache);
        let Some((carried, initial, bodies)) = before else { return };
        // Here with restitution: relative to walls that move alike, the energy does not grow, and
        // the triangle inequality says by how much it may grow in the frame of the world.
        let max_energy = (initial.sqrt() + 2.0 * carried.sqrt()).powi(2) * (1.0 + ROUNDING);
        if cluster.kinetic_energy() > max_energy {
            cluster.bodies = bodies;
            impulse_cache.clear();
            walls.at_rest = true;
            cluster.solve(contacts, &walls, max_acceleration, remaining, settings, impulse_cache);
        }
    }
}
