//! Balls against walls, one at a time: few balls lie at a wall.

use cgmath::InnerSpace;

use super::kernels::{Pass, Soft};
use super::lanes::Row;
use crate::math::Vec3;

/// A ball near a part of a wall.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Touch {
    pub row: u32,
    pub wall: u32,
    pub part: u32,
    /// Of a half-space, or of any other shape.
    pub is_plane: bool,
    /// The plane that the wall is like there: its normal, and how far along it the surface is.
    pub normal: Vec3<f32>,
    pub offset: f32,
    /// The velocity of the surface, in m/s.
    pub surface: Vec3<f32>,
    pub friction: f32,
    pub restitution: f32,
    /// The impulses, in N s, and how fast it shall part, in m/s.
    pub pressure: f32,
    pub grip: Vec3<f32>,
    pub rebound: f32,
}

fn xyz(row: &Row) -> Vec3<f32> {
    Vec3::new(row[0], row[1], row[2])
}

fn set(row: &mut Row, to: Vec3<f32>) {
    [row[0], row[1], row[2]] = to.into();
}

impl Touch {
    fn gap(&self, at: &Row) -> f32 {
        self.normal.dot(xyz(at)) - self.offset - at[3]
    }

    /// The wall moves on for so long, in seconds.
    pub fn drift(&mut self, time: f32) {
        self.offset += self.surface.dot(self.normal) * time;
    }

    /// Pushes the ball out.
    pub fn displace(&self, at: &mut Row) {
        let overlap = (-self.gap(at)).max(0.0);
        set(at, xyz(at) + self.normal * overlap);
    }

    /// A pass as for the pairs of balls.
    pub fn solve(&mut self, pass: Pass, at: &Row, velocity: &mut Row, spin: &mut Row) {
        match pass {
            Pass::Approach { speed, .. } => {
                let closing = -(xyz(velocity) - self.surface).dot(self.normal);
                self.rebound = if closing > speed { closing * self.restitution } else { 0.0 };
            }
            Pass::Begin => {
                self.grip -= self.normal * self.grip.dot(self.normal);
                self.hit(velocity, spin, self.pressure, self.grip);
            }
            Pass::Solve { soft, per_second } => {
                self.push(Some(soft), per_second, at, velocity, spin);
            }
            Pass::Relax { per_second } => self.push(None, per_second, at, velocity, spin),
            Pass::Bounce => {
                if self.rebound > 0.0 && self.pressure > 0.0 {
                    let parting = (xyz(velocity) - self.surface).dot(self.normal);
                    let change = (self.rebound - parting) / velocity[3];
                    let pressure = (self.pressure + change).max(0.0);
                    let change = pressure - self.pressure;
                    (self.pressure, self.rebound) = (pressure, 0.0);
                    self.hit(velocity, spin, change, Vec3::new(0.0, 0.0, 0.0));
                }
            }
        }
    }

    fn push(
        &mut self,
        soft: Option<Soft>,
        per_second: f32,
        at: &Row,
        velocity: &mut Row,
        spin: &mut Row,
    ) {
        let gap = self.gap(at);
        let mass = 1.0 / velocity[3];
        let relative = xyz(velocity) - self.surface;
        let parting = relative.dot(self.normal);
        let change = match soft {
            Some(soft) if gap <= 0.0 => {
                let wish = (gap * soft.rate).max(-soft.fastest);
                mass * soft.mass * (parting + wish) + self.pressure * soft.back
            }
            _ => mass * (parting + gap.max(0.0) * per_second),
        };
        let pressure = (self.pressure - change).max(0.0);
        let along = pressure - self.pressure;
        self.pressure = pressure;
        let sliding = relative - self.normal * parting - xyz(spin).cross(self.normal);
        let mut grip = self.grip - sliding * (mass * (2.0 / 7.0));
        let (most, size) = (self.friction * pressure, grip.magnitude());
        if size > most {
            grip *= most / size;
        }
        let across = grip - self.grip;
        self.grip = grip;
        self.hit(velocity, spin, along, across);
    }

    fn hit(&self, velocity: &mut Row, spin: &mut Row, along: f32, across: Vec3<f32>) {
        let inverse_mass = velocity[3];
        set(velocity, xyz(velocity) + (self.normal * along + across) * inverse_mass);
        let turn = self.normal.cross(across) * (2.5 * inverse_mass);
        set(spin, xyz(spin) - turn);
    }
}
