//! Active-set solver for the approach that iterations leave. Where light balls are between heavy
//! ones, iterations over contacts with friction need as many rounds as the ratio of masses. The
//! rest is solved here directly: normal impulses after which no pair in contact approaches.
//!
//! Of all such velocities it finds the nearest one, in the metric of kinetic energy (Moreau,
//! *Unilateral contact and dry friction in finite freedom dynamics*, 1988). So among walls at rest
//! it only loses energy, and momentum is conserved.

use cgmath::{InnerSpace, Zero};

use super::cluster::ClusterBodies;
use super::wall::MovingWalls;
use super::{EventSettings, EventSolver};
use crate::broad::Period;
use crate::contact::Contacts;
use crate::math::{Point3, Vec3, normalize_and_length};
use crate::response::{Colliders, ImpulseSample};

/// Maximum number of active constraints, which take some ten milliseconds. Pairs beyond that
/// collide again.
const MAX_ACTIVE: usize = 100;
/// A constraint is dependent if the squared sine of its angle to the span of the active ones is
/// below this: it would add rounding only.
const DEPENDENCE: f64 = 1e-14;
/// Number of passes; the later ones solve for the rounding of the first.
const PASSES: u32 = 3;

/// Products of two constraints per unit of cost: three nanoseconds each, of twenty.
const PRODUCTS_PER_COST: u64 = 7;

/// Constraint of a pair in contact: no approach along the normal.
#[derive(Clone, Copy, Debug)]
struct NormalConstraint {
    /// First body; none for a wall.
    a: Option<usize>,
    b: usize,
    /// Unit normal from a to b.
    normal: Vec3<f64>,
    /// Velocity of the wall's surface, in m/s.
    surface_velocity: Vec3<f64>,
}

impl NormalConstraint {
    fn relative_velocity(&self, velocity: &[Vec3<f64>]) -> Vec3<f64> {
        velocity[self.b] - self.a.map_or(self.surface_velocity, |a| velocity[a])
    }

    fn separation_speed(&self, velocity: &[Vec3<f64>]) -> f64 {
        self.relative_velocity(velocity).dot(self.normal)
    }

    /// Applies an impulse, in N s, that separates the two.
    fn apply_impulse(&self, impulse: f64, inverse_mass: &[f64], velocity: &mut [Vec3<f64>]) {
        velocity[self.b] += self.normal * (impulse * inverse_mass[self.b]);
        if let Some(a) = self.a {
            velocity[a] -= self.normal * (impulse * inverse_mass[a]);
        }
    }

    /// Coupling: separation speed of this constraint per impulse at the other one, in 1/kg.
    fn coupling(&self, other: &Self, inverse_mass: &[f64]) -> f64 {
        let ends = |c: &Self| [(Some(c.b), 1.0), (c.a, -1.0)];
        let mut shared = 0.0;
        for (row, sign) in ends(self) {
            for (other_row, other) in ends(other) {
                if let Some(row) = row
                    && Some(row) == other_row
                {
                    shared += sign * other * inverse_mass[row];
                }
            }
        }
        shared * self.normal.dot(other.normal)
    }
}

/// Active-set method for non-negative least squares (Lawson and Hanson, *Solving least squares
/// problems*, 1974, chapter 23).
struct ActiveSet<'a> {
    constraints: &'a [NormalConstraint],
    inverse_mass: &'a [f64],
    /// Velocities before the impulses, in m/s.
    velocity: &'a [Vec3<f64>],
    /// Indices of the constraints with an impulse.
    active: Vec<usize>,
    /// Rows of the Cholesky factor of their coupling matrix.
    factor: Vec<Vec<f64>>,
    /// Impulses, in N s.
    impulse: Vec<f64>,
    /// Constraints that depend on active ones.
    dependent: Vec<bool>,
    settings: &'a EventSettings<'a>,
}

impl ActiveSet<'_> {
    /// Impulses after which no constraint approaches faster than `tolerance`, in m/s.
    fn solve_active_set(mut self, separation_speeds: &[f64], tolerance: f64) -> Vec<f64> {
        for _ in 0..3 * self.constraints.len() {
            if self.active.len() >= MAX_ACTIVE {
                break;
            }
            let Some(next) = self.most_violated(tolerance) else { break };
            self.active.push(next);
            let Some(mut full) = self.solve_active(separation_speeds) else {
                self.active.pop();
                self.dependent[next] = true;
                continue;
            };
            // Steps only as far as all impulses stay positive; constraints that would pull leave
            // the active set.
            while full.iter().any(|impulse| *impulse <= 0.0) {
                let fraction = self.active.iter().zip(&full).filter(|(_, target)| **target <= 0.0);
                let fraction =
                    fraction.map(|(c, target)| self.impulse[*c] / (self.impulse[*c] - target));
                let fraction = fraction.filter(|fraction| fraction.is_finite()).fold(1.0, f64::min);
                for (c, target) in self.active.iter().zip(&full) {
                    let impulse = &mut self.impulse[*c];
                    *impulse += fraction * (target - *impulse);
                    if *target <= 0.0 && *impulse <= f64::EPSILON * target.abs() {
                        *impulse = 0.0;
                    }
                }
                let Self { active, impulse, factor, .. } = &mut self;
                let Some(first) = active.iter().position(|c| impulse[*c] <= 0.0) else {
                    return self.impulse; // only rounding is left
                };
                active.retain(|c| impulse[*c] > 0.0);
                factor.truncate(first);
                let Some(remainder) = self.solve_active(separation_speeds) else {
                    return self.impulse;
                };
                full = remainder;
            }
            for (c, target) in self.active.iter().zip(full) {
                self.impulse[*c] = target;
            }
        }
        self.impulse
    }

    /// Adds to the cost of the substep, in products.
    fn add_cost(&self, products: usize) {
        self.settings.add_cost(products as u64 / PRODUCTS_PER_COST);
    }

    /// Constraint with the fastest approach outside of the active set.
    fn most_violated(&self, tolerance: f64) -> Option<usize> {
        self.add_cost(self.velocity.len() + self.constraints.len());
        let mut velocity = self.velocity.to_vec();
        for c in &self.active {
            self.constraints[*c].apply_impulse(self.impulse[*c], self.inverse_mass, &mut velocity);
        }
        let mut most_violated = (-tolerance, None);
        for (index, c) in self.constraints.iter().enumerate() {
            let separation_speed = c.separation_speed(&velocity);
            if separation_speed < most_violated.0
                && !self.dependent[index]
                && !self.active.contains(&index)
            {
                most_violated = (separation_speed, Some(index));
            }
        }
        most_violated.1
    }

    /// Impulses after which the separation speeds of all active constraints vanish (Cholesky). None
    /// if the last one depends on the others.
    fn solve_active(&mut self, separation_speeds: &[f64]) -> Option<Vec<f64>> {
        let count = self.active.len();
        for i in self.factor.len()..count {
            self.add_cost(i * (4 + i) / 4);
            let c = &self.constraints[self.active[i]];
            let mut row: Vec<f64> = Vec::with_capacity(i + 1);
            for j in 0..=i {
                let coupling = c.coupling(&self.constraints[self.active[j]], self.inverse_mass);
                let other = self.factor.get(j).unwrap_or(&row);
                let remainder = coupling - row.iter().zip(other).map(|(x, y)| x * y).sum::<f64>();
                if i > j {
                    row.push(remainder / self.factor[j][j]);
                } else if remainder > DEPENDENCE * coupling {
                    row.push(remainder.sqrt());
                } else {
                    return None;
                }
            }
            self.factor.push(row);
        }
        self.add_cost(count * count / 4);
        let mut impulse = vec![0.0; count];
        for (i, row) in self.factor.iter().enumerate() {
            let before: f64 = row[..i].iter().zip(&impulse).map(|(x, y)| x * y).sum();
            impulse[i] = (-separation_speeds[self.active[i]] - before) / row[i];
        }
        for i in (0..count).rev() {
            let after: f64 = (i + 1..count).map(|k| self.factor[k][i] * impulse[k]).sum();
            impulse[i] = (impulse[i] - after) / self.factor[i][i];
        }
        Some(impulse)
    }
}

impl EventSolver {
    /// Ends the approach that a cluster's instantaneous solve has left, above `tolerance`, in m/s.
    pub(super) fn end_remaining_approach(
        &mut self,
        contacts: &Contacts<f64>,
        (now, walls_at_rest): (f64, bool),
        tolerance: f64,
        settings: &EventSettings,
    ) {
        let walls =
            MovingWalls { walls: &self.walls, start: now, end: now, at_rest: walls_at_rest };
        let constraints = constraints(contacts, &walls, &self.cluster.start, self.period);
        let ClusterBodies { velocity, inverse_mass, .. } = &mut self.cluster.bodies;
        for _ in 0..PASSES {
            let separation_speeds: Vec<_> =
                constraints.iter().map(|c| c.separation_speed(velocity)).collect();
            if separation_speeds.iter().all(|separation_speed| *separation_speed >= -tolerance) {
                break;
            }
            let active_set = ActiveSet {
                constraints: &constraints,
                inverse_mass,
                velocity,
                active: Vec::new(),
                factor: Vec::new(),
                impulse: vec![0.0; constraints.len()],
                dependent: vec![false; constraints.len()],
                settings,
            };
            let impulses = active_set.solve_active_set(&separation_speeds, tolerance);
            let before: Vec<_> =
                constraints.iter().map(|c| c.relative_velocity(velocity)).collect();
            for (c, impulse) in constraints.iter().zip(&impulses) {
                c.apply_impulse(*impulse, inverse_mass, velocity);
            }
            let Some(work) = &mut self.work else { continue };
            for ((c, impulse), before) in constraints.iter().zip(impulses).zip(before) {
                let fixed_velocity =
                    |row: usize| (inverse_mass[row] == 0.0).then_some(velocity[row]);
                work.record_impulse(ImpulseSample {
                    impulse: c.normal * impulse,
                    normal: c.normal,
                    mean_velocity: (before + c.relative_velocity(velocity)) * 0.5,
                    fixed_velocity: [
                        c.a.map_or(Some(c.surface_velocity), fixed_velocity),
                        fixed_velocity(c.b),
                    ],
                });
            }
        }
    }
}

fn constraints(
    contacts: &Contacts<f64>,
    walls: &MovingWalls,
    position: &[Point3<f64>],
    period: Period<f64>,
) -> Vec<NormalConstraint> {
    let on_walls = contacts.wm.iter().map(|c| {
        let (wall, b) = (c.a as usize, c.b as usize);
        let (normal, _) = walls.normal_and_distance(wall, c.part, position[b]);
        NormalConstraint {
            a: None,
            b,
            normal,
            surface_velocity: if walls.at_rest {
                Vec3::zero()
            } else {
                walls.walls[wall].velocity_at(position[b], walls.end)
            },
        }
    });
    let between = contacts.mm.iter().filter_map(|c| {
        let (a, b) = (c.a as usize, c.b as usize);
        let (normal, _) = normalize_and_length(period.minimum_image(position[b] - position[a]))?;
        Some(NormalConstraint { a: Some(a), b, normal, surface_velocity: Vec3::new(0.0, 0.0, 0.0) })
    });
    on_walls.chain(between).collect()
}
