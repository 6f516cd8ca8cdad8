//! Contacts with walls, one at a time: few balls lie at a wall.

use cgmath::InnerSpace;

use super::kernels::{GROUNDED, Pass, Softness, SolverParams, WALL_SLOP};
use super::proxies::Proxy;
use super::simd::Row;
use super::surfaces::WallNumbers;
use crate::math::Vec3;

/// Contact constraint of a ball and a part of a wall.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct WallContact {
    pub row: u32,
    pub wall: u32,
    pub part: u32,
    /// Of a half-space, or of any other shape.
    pub is_plane: bool,
    /// Set if the ball is a proxy, whom others move: the wall only bears what the swarm presses
    /// on it.
    pub bears_proxy: bool,
    /// The plane that the wall is like there: its normal, and how far along it the surface is, now
    /// and at the end of the step.
    pub normal: Vec3<f32>,
    pub offset: f32,
    pub offset_at_end: f32,
    /// The velocity of the surface, in m/s.
    pub surface: Vec3<f32>,
    pub numbers: WallNumbers,
    /// Normal impulse for others that press on the ball, normal impulse for the ball itself, and
    /// tangent impulse (friction), accumulated, in N s.
    pub borne_for_others: f32,
    pub normal_impulse: f32,
    pub tangent_impulse: Vec3<f32>,
    /// Angular impulse against rolling and spinning, over the radius, in N s.
    pub torque: Vec3<f32>,
}

/// Separation in radii, and in roundings of the coordinates, up to which a ball stands on a wall. A
/// larger one would hold balls in the air that come down beside others.
const TOUCHES: f32 = 1e-4;
const ROUNDINGS: f32 = 4.0;

pub(super) fn xyz(row: &Row) -> Vec3<f32> {
    Vec3::new(row[0], row[1], row[2])
}

fn set(row: &mut Row, to: Vec3<f32>) {
    [row[0], row[1], row[2]] = to.into();
}

/// Clamps a tangential impulse to the friction cone.
fn clamp_length(target: Vec3<f32>, most: f32) -> Vec3<f32> {
    let size = target.magnitude();
    if size > most { target * (most / size) } else { target }
}

impl WallContact {
    pub fn separation(&self, at: &Row) -> f32 {
        self.normal.dot(xyz(at)) - self.offset - at[3]
    }

    /// The wall moves on for so long, in seconds; one that bears a proxy, as the proxy does.
    pub fn advance(&mut self, time: f32) {
        self.offset += self.surface.dot(self.normal) * time;
    }

    /// Limits it to what the swarm presses on a proxy: the proxy's own motion and its depth in the
    /// wall are left to the world's solver. The step goes on for so long, in seconds.
    pub fn bear(&mut self, proxy: &Proxy, left: f32) {
        self.bears_proxy = true;
        (self.numbers.friction, self.numbers.restitution) = (0.0, 0.0);
        self.surface = xyz(&proxy.velocity);
        self.offset = self.offset_at_end;
        self.offset += self.separation(&proxy.at).min(0.0);
        self.advance(-left);
    }

    /// Normal impulse in the last substep, in N s; zero if the ball has left the wall.
    pub fn bears(&self, at: &Row) -> f32 {
        let place = at[0].abs() + at[1].abs() + at[2].abs();
        let there = self.separation(at) <= at[3] * TOUCHES + place * (ROUNDINGS * f32::EPSILON);
        if there { self.normal_impulse + self.borne_for_others } else { 0.0 }
    }

    /// Takes over the impulses of an earlier contact of ball and wall.
    pub fn restore(&mut self, before: &Self) {
        (self.normal_impulse, self.tangent_impulse, self.torque) =
            (before.normal_impulse, before.tangent_impulse, before.torque);
        self.borne_for_others = before.borne_for_others;
    }

    /// The impulse that the wall has borne for others, if it is the one behind the ball.
    pub fn share_of(&self, backing: &Row) -> f32 {
        if xyz(backing) == self.normal { backing[3] } else { 0.0 }
    }

    /// Moves the ball out.
    pub fn displace(&self, at: &mut Row) {
        let overlap = (-self.separation(at)).max(0.0);
        set(at, xyz(at) + self.normal * overlap);
    }

    /// Moves the ball out, but for what a contact bears. Says how far, in metres.
    pub fn keep_out(&self, at: &mut Row) -> f32 {
        // All of it: a wall gives way to nobody.
        let overlap = (-self.separation(at) - at[3] * WALL_SLOP).max(0.0);
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
            Pass::Restitution(params) => {
                return self.apply_restitution(&params, at, velocity, spin);
            }
            Pass::WarmStart(_) => {
                self.tangent_impulse -= self.normal * self.tangent_impulse.dot(self.normal);
                self.apply_impulse(velocity, spin, self.normal_impulse, self.tangent_impulse);
                let give = self.numbers.inertia_factor * velocity[3];
                set(spin, xyz(spin) - self.torque * give);
            }
            Pass::Solve(params) => {
                self.push(params.time, Some(params.softness), at, velocity, spin);
            }
            Pass::Relax(params) => {
                let approach_speed = -(xyz(velocity) - self.surface).dot(self.normal);
                if self.normal_impulse > 0.0
                    || self.numbers.restitution == 0.0
                    || approach_speed <= params.restitution_threshold
                {
                    self.push(params.time, None, at, velocity, spin);
                }
            }
        }
        None
    }

    /// Turns the ball back if it meets the wall, with the speed that it then has. Says how far away
    /// that is, in metres.
    fn apply_restitution(
        &self,
        params: &SolverParams,
        at: &mut Row,
        velocity: &mut Row,
        spin: &mut Row,
    ) -> Option<f32> {
        let relative = xyz(velocity) - self.surface;
        let approach_speed = -relative.dot(self.normal);
        let separation = self.separation(at).max(0.0);
        if self.numbers.restitution == 0.0
            || approach_speed <= 0.0
            || separation >= approach_speed * params.time
        {
            return None;
        }
        // Gravity works on the ball as far as it comes nearer.
        let square = approach_speed * approach_speed
            - 2.0 * xyz(&params.gravity).dot(self.normal) * separation;
        let meets = square.max(0.0).sqrt();
        if meets <= params.restitution_threshold {
            return None;
        }
        let normal_part = (approach_speed + meets * self.numbers.restitution) / velocity[3];
        let target = self.tangent_velocity(relative, spin) * (-self.tangent_mass() / velocity[3]);
        let tangent_part = clamp_length(target, self.numbers.friction * normal_part);
        set(at, xyz(at) - self.normal * separation);
        self.apply_impulse(velocity, spin, normal_part, tangent_part);
        Some(separation)
    }

    /// Velocity at which the ball's surface slides over the wall's, in m/s.
    fn tangent_velocity(&self, relative: Vec3<f32>, spin: &Row) -> Vec3<f32> {
        let parting = self.normal * relative.dot(self.normal);
        relative - parting - xyz(spin).cross(self.normal)
    }

    /// Solves the contact: the ball approaches by no more than the separation within so many
    /// seconds.
    fn push(
        &mut self,
        time: f32,
        softness: Option<Softness>,
        at: &Row,
        velocity: &mut Row,
        spin: &mut Row,
    ) {
        let (separation, mass) = (self.separation(at), 1.0 / velocity[3]);
        let relative = xyz(velocity) - self.surface;
        let parting = relative.dot(self.normal);
        let change = match softness {
            Some(softness) if separation <= 0.0 => {
                let target = (separation * softness.bias_rate).max(-softness.max_push_speed);
                mass * softness.mass_scale * (parting + target)
                    + self.normal_impulse * softness.impulse_scale
            }
            _ => mass * (parting + separation.max(0.0) / time),
        };
        let normal_impulse = (self.normal_impulse - change).max(0.0);
        let normal_part = normal_impulse - self.normal_impulse;
        self.normal_impulse = normal_impulse;
        let target = self.tangent_impulse
            - self.tangent_velocity(relative, spin) * (mass * self.tangent_mass());
        let tangent_impulse =
            clamp_length(target, self.numbers.friction * (normal_impulse + self.borne_for_others));
        let tangent_part = tangent_impulse - self.tangent_impulse;
        self.tangent_impulse = tangent_impulse;
        if normal_impulse + self.borne_for_others > 0.0 {
            spin[3] = GROUNDED;
        }
        self.apply_impulse(velocity, spin, normal_part, tangent_part);
        self.solve_rolling(velocity, spin);
    }

    fn apply_impulse(
        &self,
        velocity: &mut Row,
        spin: &mut Row,
        normal_part: f32,
        tangent_part: Vec3<f32>,
    ) {
        let inverse_mass = velocity[3];
        set(velocity, xyz(velocity) + (self.normal * normal_part + tangent_part) * inverse_mass);
        let turn = self.normal.cross(tangent_part) * (self.numbers.inertia_factor * inverse_mass);
        set(spin, xyz(spin) - turn);
    }

    /// Effective mass of the touched point along the wall, over the mass of the ball.
    fn tangent_mass(&self) -> f32 {
        1.0 / (1.0 + self.numbers.inertia_factor)
    }

    /// Slows rolling and spinning, by a torque of at most the resistance times normal force times
    /// radius.
    fn solve_rolling(&mut self, velocity: &Row, spin: &mut Row) {
        let WallNumbers { rolling_resistance, spinning_resistance, inertia_factor, .. } =
            self.numbers;
        let give = inertia_factor * velocity[3];
        if rolling_resistance + spinning_resistance == 0.0 || give == 0.0 {
            return;
        }
        let target = self.torque + xyz(spin) / give;
        let about = self.normal * self.normal.dot(target);
        let torque = clamp_length(target - about, rolling_resistance * self.normal_impulse)
            + clamp_length(about, spinning_resistance * self.normal_impulse);
        set(spin, xyz(spin) - (torque - self.torque) * give);
        self.torque = torque;
    }
}
