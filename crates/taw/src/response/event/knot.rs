//! The end of a knot. Where light balls are between heavy ones, sweeps over contacts with friction
//! may take as many rounds as one is times as heavy as the other. What they leave is solved here
//! at once: impulses along the normals, by which balls that touch come no nearer to each other.
//!
//! Of all motions in which nothing comes nearer it is the next one, counted by kinetic energy of
//! the difference (Moreau, *Unilateral contact and dry friction in finite freedom dynamics*, 1988).
//! So among walls at rest energy only gets less; and each impulse has its opposite.

use cgmath::InnerSpace;

use super::heap::Table;
use super::wall::Between;
use super::{EventDriven, Settings};
use crate::broad::Period;
use crate::contact::Contacts;
use crate::math::{Point3, Vec3, direction_and_length};
use crate::response::{Push, Walls};

/// Impulses at once, at most: so many take some ten milliseconds. What a larger knot leaves meets
/// again.
const MOST_TIES: usize = 100;
/// A tie whose direction is this near to one that others make together (as the square of a sine)
/// adds nothing but rounding.
const DEPENDENT: f64 = 1e-14;
/// Rounding of the first solution is solved again, and once more.
const PASSES: u32 = 3;

/// Products of two ties that take the time of a look: three nanoseconds each, of twenty.
const PRODUCTS: u64 = 7;

/// Two that touch and shall come no nearer.
#[derive(Clone, Copy, Debug)]
struct Tie {
    /// None for a wall.
    a: Option<usize>,
    b: usize,
    /// From a to b.
    normal: Vec3<f64>,
    /// The velocity of the wall's surface, in m/s.
    surface: Vec3<f64>,
}

impl Tie {
    fn closing(&self, velocity: &[Vec3<f64>]) -> Vec3<f64> {
        velocity[self.b] - self.a.map_or(self.surface, |a| velocity[a])
    }

    fn speed(&self, velocity: &[Vec3<f64>]) -> f64 {
        self.closing(velocity).dot(self.normal)
    }

    /// Pushes the two apart, by an impulse in N s.
    fn push(&self, impulse: f64, inverse_mass: &[f64], velocity: &mut [Vec3<f64>]) {
        velocity[self.b] += self.normal * (impulse * inverse_mass[self.b]);
        if let Some(a) = self.a {
            velocity[a] -= self.normal * (impulse * inverse_mass[a]);
        }
    }

    /// The speed that an impulse of one at the other tie gives to this one.
    fn given_by(&self, other: &Self, inverse_mass: &[f64]) -> f64 {
        let ends = |tie: &Self| [(Some(tie.b), 1.0), (tie.a, -1.0)];
        let mut shared = 0.0;
        for (row, sign) in ends(self) {
            for (same, other) in ends(other) {
                if let Some(row) = row
                    && Some(row) == same
                {
                    shared += sign * other * inverse_mass[row];
                }
            }
        }
        shared * self.normal.dot(other.normal)
    }
}

/// Active set method for impulses that only push (Lawson and Hanson, *Solving least squares
/// problems*, 1974, chapter 23).
struct Knot<'a> {
    ties: &'a [Tie],
    inverse_mass: &'a [f64],
    /// Before any of them pushes, in m/s.
    velocity: &'a [Vec3<f64>],
    /// Those that push.
    active: Vec<usize>,
    /// Rows of the Cholesky factor of what they give each other.
    factor: Vec<Vec<f64>>,
    /// In N s.
    impulse: Vec<f64>,
    /// Those that others determine already.
    dependent: Vec<bool>,
    settings: &'a Settings<'a>,
}

impl Knot<'_> {
    /// Impulses after which no tie closes faster than `enough`, in m/s.
    fn untie(mut self, speeds: &[f64], enough: f64) -> Vec<f64> {
        for _ in 0..3 * self.ties.len() {
            if self.active.len() >= MOST_TIES {
                break;
            }
            let Some(next) = self.fastest(enough) else { break };
            self.active.push(next);
            let Some(mut whole) = self.solve(speeds) else {
                self.active.pop();
                self.dependent[next] = true;
                continue;
            };
            // As far as nothing would pull; what would is let go.
            while whole.iter().any(|impulse| *impulse <= 0.0) {
                let part = self.active.iter().zip(&whole).filter(|(_, to)| **to <= 0.0);
                let part = part.map(|(tie, to)| self.impulse[*tie] / (self.impulse[*tie] - to));
                let part = part.filter(|part| part.is_finite()).fold(1.0, f64::min);
                for (tie, to) in self.active.iter().zip(&whole) {
                    let impulse = &mut self.impulse[*tie];
                    *impulse += part * (to - *impulse);
                    if *to <= 0.0 && *impulse <= f64::EPSILON * to.abs() {
                        *impulse = 0.0;
                    }
                }
                let Self { active, impulse, factor, .. } = &mut self;
                let Some(first) = active.iter().position(|tie| impulse[*tie] <= 0.0) else {
                    return self.impulse; // rounding has the last word
                };
                active.retain(|tie| impulse[*tie] > 0.0);
                factor.truncate(first);
                let Some(rest) = self.solve(speeds) else { return self.impulse };
                whole = rest;
            }
            for (tie, to) in self.active.iter().zip(whole) {
                self.impulse[*tie] = to;
            }
        }
        self.impulse
    }

    /// Adds products of ties to the cost of the substep.
    fn count(&self, products: usize) {
        self.settings.count(products as u64 / PRODUCTS);
    }

    /// The tie that closes fastest beside those that push.
    fn fastest(&self, enough: f64) -> Option<usize> {
        self.count(self.velocity.len() + self.ties.len());
        let mut velocity = self.velocity.to_vec();
        for tie in &self.active {
            self.ties[*tie].push(self.impulse[*tie], self.inverse_mass, &mut velocity);
        }
        let mut fastest = (-enough, None);
        for (number, tie) in self.ties.iter().enumerate() {
            let speed = tie.speed(&velocity);
            if speed < fastest.0 && !self.dependent[number] && !self.active.contains(&number) {
                fastest = (speed, Some(number));
            }
        }
        fastest.1
    }

    /// Impulses of those that push, after which none of them closes or parts (Cholesky). None if
    /// the last one is determined by the others.
    fn solve(&mut self, speeds: &[f64]) -> Option<Vec<f64>> {
        let count = self.active.len();
        for i in self.factor.len()..count {
            self.count(i * (4 + i) / 4);
            let tie = &self.ties[self.active[i]];
            let mut row: Vec<f64> = Vec::with_capacity(i + 1);
            for j in 0..=i {
                let given = tie.given_by(&self.ties[self.active[j]], self.inverse_mass);
                let other = self.factor.get(j).unwrap_or(&row);
                let rest = given - row.iter().zip(other).map(|(x, y)| x * y).sum::<f64>();
                if i > j {
                    row.push(rest / self.factor[j][j]);
                } else if rest > DEPENDENT * given {
                    row.push(rest.sqrt());
                } else {
                    return None;
                }
            }
            self.factor.push(row);
        }
        self.count(count * count / 4);
        let mut impulse = vec![0.0; count];
        for (i, row) in self.factor.iter().enumerate() {
            let before: f64 = row[..i].iter().zip(&impulse).map(|(x, y)| x * y).sum();
            impulse[i] = (-speeds[self.active[i]] - before) / row[i];
        }
        for i in (0..count).rev() {
            let after: f64 = (i + 1..count).map(|k| self.factor[k][i] * impulse[k]).sum();
            impulse[i] = (impulse[i] - after) / self.factor[i][i];
        }
        Some(impulse)
    }
}

impl EventDriven {
    /// Ends what a heap that was solved at once has left of its approach, above `enough`, in m/s.
    pub(super) fn end_knot(
        &mut self,
        contacts: &Contacts<f64>,
        now: f64,
        enough: f64,
        settings: &Settings,
    ) {
        let walls = Between { walls: &self.walls, begin: now, end: now };
        let ties = ties(contacts, &walls, &self.heap.start, self.period);
        let Table { velocity, inverse_mass, .. } = &mut self.heap.table;
        for _ in 0..PASSES {
            let speeds: Vec<_> = ties.iter().map(|tie| tie.speed(velocity)).collect();
            if speeds.iter().all(|speed| *speed >= -enough) {
                break;
            }
            let knot = Knot {
                ties: &ties,
                inverse_mass,
                velocity,
                active: Vec::new(),
                factor: Vec::new(),
                impulse: vec![0.0; ties.len()],
                dependent: vec![false; ties.len()],
                settings,
            };
            let impulses = knot.untie(&speeds, enough);
            let before: Vec<_> = ties.iter().map(|tie| tie.closing(velocity)).collect();
            for (tie, impulse) in ties.iter().zip(&impulses) {
                tie.push(*impulse, inverse_mass, velocity);
            }
            let Some(work) = &mut self.work else { continue };
            for ((tie, impulse), before) in ties.iter().zip(impulses).zip(before) {
                let fixed = |row: usize| (inverse_mass[row] == 0.0).then_some(velocity[row]);
                work.push(Push {
                    impulse: tie.normal * impulse,
                    normal: tie.normal,
                    mean: (before + tie.closing(velocity)) * 0.5,
                    fixed: [tie.a.map_or(Some(tie.surface), fixed), fixed(tie.b)],
                });
            }
        }
    }
}

fn ties(
    contacts: &Contacts<f64>,
    walls: &Between,
    position: &[Point3<f64>],
    period: Period<f64>,
) -> Vec<Tie> {
    let on_walls = contacts.wm.iter().map(|c| {
        let (wall, b) = (c.a as usize, c.b as usize);
        let (normal, _) = walls.normal_and_distance(wall, c.part, position[b]);
        Tie { a: None, b, normal, surface: walls.walls[wall].way(position[b], walls.end) }
    });
    let between = contacts.mm.iter().filter_map(|c| {
        let (a, b) = (c.a as usize, c.b as usize);
        let (normal, _) = direction_and_length(period.nearest(position[b] - position[a]))?;
        Some(Tie { a: Some(a), b, normal, surface: Vec3::new(0.0, 0.0, 0.0) })
    });
    on_walls.chain(between).collect()
}
