//! Balls against walls, one at a time: few balls lie at a wall.

use cgmath::InnerSpace;

use super::guests::Guest;
use super::kernels::{GROUNDED, Impact, Pass, Soft, WALL_SLOP};
use super::lanes::Row;
use super::surfaces::WallNumbers;
use crate::math::Vec3;

/// A ball near a part of a wall.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Touch {
    pub row: u32,
    pub wall: u32,
    pub part: u32,
    /// Of a half-space, or of any other shape.
    pub is_plane: bool,
    /// Set if the ball is a guest, whom others move: the wall only bears what the swarm presses
    /// on it.
    pub bears_guest: bool,
    /// The plane that the wall is like there: its normal, and how far along it the surface is, now
    /// and at the end of the step.
    pub normal: Vec3<f32>,
    pub offset: f32,
    pub offset_at_end: f32,
    /// The velocity of the surface, in m/s.
    pub surface: Vec3<f32>,
    pub numbers: WallNumbers,
    /// The impulses, in N s: for the ball itself, and for others that press on it.
    pub borne_for_others: f32,
    pub pressure: f32,
    pub grip: Vec3<f32>,
    /// Angular impulse against rolling and spinning, over the radius, in N s.
    pub torque: Vec3<f32>,
}

/// Separation in radii, and in roundings of the coordinates, up to which a ball stands on a wall. A
/// larger one would hold balls in the air that come down beside others.
const TOUCHES: f32 = 1e-4;
const ROUNDINGS: f32 = 4.0;

fn xyz(row: &Row) -> Vec3<f32> {
    Vec3::new(row[0], row[1], row[2])
}

fn set(row: &mut Row, to: Vec3<f32>) {
    [row[0], row[1], row[2]] = to.into();
}

/// The most of an impulse that friction bears.
fn held(wish: Vec3<f32>, most: f32) -> Vec3<f32> {
    let size = wish.magnitude();
    if size > most { wish * (most / size) } else { wish }
}

impl Touch {
    pub fn gap(&self, at: &Row) -> f32 {
        self.normal.dot(xyz(at)) - self.offset - at[3]
    }

    /// The wall moves on for so long, in seconds; one that bears a guest, as the guest does.
    pub fn drift(&mut self, time: f32) {
        self.offset += self.surface.dot(self.normal) * time;
    }

    /// Makes it one that only bears what the swarm presses on a guest: the guest's own motion, and
    /// how deep it is in the wall already, are left to whoever moves it. The step goes on for so
    /// long, in seconds.
    pub fn bear(&mut self, guest: &Guest, left: f32) {
        self.bears_guest = true;
        (self.numbers.friction, self.numbers.restitution) = (0.0, 0.0);
        self.surface = xyz(&guest.velocity);
        self.offset = self.offset_at_end;
        self.offset += self.gap(&guest.at).min(0.0);
        self.drift(-left);
    }

    /// The impulse that the wall bore in the last substep, in N s; nothing, if the ball has left it.
    pub fn bears(&self, at: &Row) -> f32 {
        let place = at[0].abs() + at[1].abs() + at[2].abs();
        let there = self.gap(at) <= at[3] * TOUCHES + place * (ROUNDINGS * f32::EPSILON);
        if there { self.pressure + self.borne_for_others } else { 0.0 }
    }

    /// Takes over what the same touch bore before.
    pub fn recall(&mut self, before: &Self) {
        (self.pressure, self.grip, self.torque) = (before.pressure, before.grip, before.torque);
        self.borne_for_others = before.borne_for_others;
    }

    /// The impulse that the wall has borne for others, if it is the one behind the ball.
    pub fn share_of(&self, backing: &Row) -> f32 {
        if xyz(backing) == self.normal { backing[3] } else { 0.0 }
    }

    /// Pushes the ball out.
    pub fn displace(&self, at: &mut Row) {
        let overlap = (-self.gap(at)).max(0.0);
        set(at, xyz(at) + self.normal * overlap);
    }

    /// Moves the ball out, but for what a contact bears. Says how far, in metres.
    pub fn keep_out(&self, at: &mut Row) -> f32 {
        // All of it: a wall gives way to nobody.
        let overlap = (-self.gap(at) - at[3] * WALL_SLOP).max(0.0);
        set(at, xyz(at) + self.normal * overlap);
        overlap
    }

    /// A pass as for the pairs of balls. Says how far it moved the ball if that bounced, in metres.
    pub fn solve(
        &mut self,
        pass: Pass,
        at: &mut Row,
        velocity: &mut Row,
        spin: &mut Row,
    ) -> Option<f32> {
        match pass {
            Pass::Impact(impact) => return self.bounce(&impact, at, velocity, spin),
            Pass::Begin(_) => {
                self.grip -= self.normal * self.grip.dot(self.normal);
                self.hit(velocity, spin, self.pressure, self.grip);
                let give = self.numbers.inertia_factor * velocity[3];
                set(spin, xyz(spin) - self.torque * give);
            }
            Pass::Solve(impact) => {
                self.push(impact.time, Some(impact.soft), at, velocity, spin);
            }
            Pass::Relax(impact) => {
                let closing = -(xyz(velocity) - self.surface).dot(self.normal);
                if self.pressure > 0.0 || self.numbers.restitution == 0.0 || closing <= impact.speed
                {
                    self.push(impact.time, None, at, velocity, spin);
                }
            }
        }
        None
    }

    /// Turns the ball back if it meets the wall, with the speed that it then has. Says how far away
    /// that is, in metres.
    fn bounce(
        &self,
        impact: &Impact,
        at: &mut Row,
        velocity: &mut Row,
        spin: &mut Row,
    ) -> Option<f32> {
        let relative = xyz(velocity) - self.surface;
        let closing = -relative.dot(self.normal);
        let gap = self.gap(at).max(0.0);
        if self.numbers.restitution == 0.0 || closing <= 0.0 || gap >= closing * impact.time {
            return None;
        }
        // Gravity works on the ball as far as it comes nearer.
        let square = closing * closing - 2.0 * xyz(&impact.gravity).dot(self.normal) * gap;
        let meets = square.max(0.0).sqrt();
        if meets <= impact.speed {
            return None;
        }
        let along = (closing + meets * self.numbers.restitution) / velocity[3];
        let wish = self.sliding(relative, spin) * (-self.tangent_mass() / velocity[3]);
        let across = held(wish, self.numbers.friction * along);
        set(at, xyz(at) - self.normal * gap);
        self.hit(velocity, spin, along, across);
        Some(gap)
    }

    /// Velocity at which the ball's surface slides over the wall's, in m/s.
    fn sliding(&self, relative: Vec3<f32>, spin: &Row) -> Vec3<f32> {
        let parting = self.normal * relative.dot(self.normal);
        relative - parting - xyz(spin).cross(self.normal)
    }

    /// Lets the ball come no nearer than the gap within so many seconds.
    fn push(
        &mut self,
        time: f32,
        soft: Option<Soft>,
        at: &Row,
        velocity: &mut Row,
        spin: &mut Row,
    ) {
        let (gap, mass) = (self.gap(at), 1.0 / velocity[3]);
        let relative = xyz(velocity) - self.surface;
        let parting = relative.dot(self.normal);
        let change = match soft {
            Some(soft) if gap <= 0.0 => {
                let wish = (gap * soft.rate).max(-soft.fastest);
                mass * soft.mass * (parting + wish) + self.pressure * soft.back
            }
            _ => mass * (parting + gap.max(0.0) / time),
        };
        let pressure = (self.pressure - change).max(0.0);
        let along = pressure - self.pressure;
        self.pressure = pressure;
        let wish = self.grip - self.sliding(relative, spin) * (mass * self.tangent_mass());
        let grip = held(wish, self.numbers.friction * (pressure + self.borne_for_others));
        let across = grip - self.grip;
        self.grip = grip;
        if pressure + self.borne_for_others > 0.0 {
            spin[3] = GROUNDED;
        }
        self.hit(velocity, spin, along, across);
        self.resist(velocity, spin);
    }

    fn hit(&self, velocity: &mut Row, spin: &mut Row, along: f32, across: Vec3<f32>) {
        let inverse_mass = velocity[3];
        set(velocity, xyz(velocity) + (self.normal * along + across) * inverse_mass);
        let turn = self.normal.cross(across) * (self.numbers.inertia_factor * inverse_mass);
        set(spin, xyz(spin) - turn);
    }

    /// Effective mass of the touched point along the wall, over the mass of the ball.
    fn tangent_mass(&self) -> f32 {
        1.0 / (1.0 + self.numbers.inertia_factor)
    }

    /// Slows rolling and spinning, by a torque of at most the resistance times normal force times
    /// radius.
    fn resist(&mut self, velocity: &Row, spin: &mut Row) {
        let WallNumbers { rolling_resistance, spinning_resistance, inertia_factor, .. } =
            self.numbers;
        let give = inertia_factor * velocity[3];
        if rolling_resistance + spinning_resistance == 0.0 || give == 0.0 {
            return;
        }
        let wish = self.torque + xyz(spin) / give;
        let about = self.normal * self.normal.dot(wish);
        let torque = held(wish - about, rolling_resistance * self.pressure)
            + held(about, spinning_resistance * self.pressure);
        set(spin, xyz(spin) - (torque - self.torque) * give);
        self.torque = torque;
    }
}
