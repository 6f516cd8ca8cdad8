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
    /// Those that push.
    active: Vec<usize>,
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
            let Some(next) = self.fastest(speeds, enough) else { break };
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
                let Self { active, impulse, .. } = &mut self;
                let before = active.len();
                active.retain(|tie| impulse[*tie] > 0.0);
                if active.len() == before {
                    return self.impulse; // rounding has the last word
                }
                let Some(rest) = self.solve(speeds) else { return self.impulse };
                whole = rest;
            }
            for (tie, to) in self.active.iter().zip(whole) {
                self.impulse[*tie] = to;
            }
        }
        self.impulse
    }

    /// The tie that closes fastest beside those that push.
    fn fastest(&self, speeds: &[f64], enough: f64) -> Option<usize> {
        self.settings.count((self.ties.len() * (1 + self.active.len())) as u64);
        let mut fastest = (-enough, None);
        for (number, tie) in self.ties.iter().enumerate() {
            if self.dependent[number] || self.active.contains(&number) {
                continue;
            }
            let others = self.active.iter().map(|other| {
                tie.given_by(&self.ties[*other], self.inverse_mass) * self.impulse[*other]
            });
            let speed = speeds[number] + others.sum::<f64>();
            if speed < fastest.0 {
                fastest = (speed, Some(number));
            }
        }
        fastest.1
    }

    /// Impulses of those that push, after which none of them closes or parts (Cholesky). None if
    /// the last one is determined by the others.
    fn solve(&self, speeds: &[f64]) -> Option<Vec<f64>> {
        let count = self.active.len();
        self.settings.count((count * count * (1 + count / 6)) as u64);
        let mut lower = vec![0.0; count * count];
        let mut impulse = vec![0.0; count];
        for i in 0..count {
            let tie = &self.ties[self.active[i]];
            for j in 0..=i {
                let given = tie.given_by(&self.ties[self.active[j]], self.inverse_mass);
                let before: f64 = (0..j).map(|k| lower[i * count + k] * lower[j * count + k]).sum();
                let rest = given - before;
                if i > j {
                    lower[i * count + j] = rest / lower[j * count + j];
                } else if rest > DEPENDENT * given {
                    lower[i * count + i] = rest.sqrt();
                } else {
                    return None;
                }
            }
            let before: f64 = (0..i).map(|k| lower[i * count + k] * impulse[k]).sum();
            impulse[i] = (-speeds[self.active[i]] - before) / lower[i * count + i];
        }
        for i in (0..count).rev() {
            let after: f64 = (i + 1..count).map(|k| lower[k * count + i] * impulse[k]).sum();
            impulse[i] = (impulse[i] - after) / lower[i * count + i];
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
            let (active, impulse, dependent) =
                (Vec::new(), vec![0.0; ties.len()], vec![false; ties.len()]);
            let knot = Knot { ties: &ties, inverse_mass, active, impulse, dependent, settings };
            let impulses = knot.untie(&speeds, enough);
            let before: Vec<_> = ties.iter().map(|tie| tie.closing(velocity)).collect();
            for (tie, impulse) in ties.iter().zip(&impulses) {
                velocity[tie.b] += tie.normal * (impulse * inverse_mass[tie.b]);
                if let Some(a) = tie.a {
                    velocity[a] -= tie.normal * (impulse * inverse_mass[a]);
                }
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
