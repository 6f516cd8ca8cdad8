use cgmath::{InnerSpace, Zero};

use crate::math::Vec3;

/// Energy bookkeeping of contacts, kept only for the energy audit. Energies in joules.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct EnergyLedger {
    /// Loss by sliding friction.
    pub friction: f64,
    /// Loss by collisions along their normals.
    pub restitution: f64,
    /// Loss by rolling and torsional friction.
    pub resistance: f64,
    /// Energy supplied by moving walls and marbles of infinite mass.
    pub walls: f64,
    /// Energy supplied by forces, where the response moves marbles by itself.
    pub forces: f64,
    /// Momentum supplied by both, in kg m/s.
    pub momentum: Vec3<f64>,
    /// Number of collisions.
    pub collisions: u32,
}

impl Default for EnergyLedger {
    fn default() -> Self {
        Self {
            friction: 0.0,
            restitution: 0.0,
            resistance: 0.0,
            walls: 0.0,
            forces: 0.0,
            momentum: Vec3::zero(),
            collisions: 0,
        }
    }
}

/// Impulse at a contact, for the bookkeeping.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ImpulseSample {
    /// Impulse on the second body, in N s.
    pub impulse: Vec3<f64>,
    /// Unit normal from the first body to the second.
    pub normal: Vec3<f64>,
    /// Mean relative velocity of the contact points before and after, in m/s: times the impulse, it
    /// is the work.
    pub mean_velocity: Vec3<f64>,
    /// Velocity of the contact point of each body of infinite mass, in m/s; none for a movable
    /// body.
    pub fixed_velocity: [Option<Vec3<f64>>; 2],
}

impl EnergyLedger {
    /// Books an impulse.
    pub fn record_impulse(
        &mut self,
        ImpulseSample { impulse, normal, mean_velocity, fixed_velocity }: ImpulseSample,
    ) {
        let normal_impulse = impulse.dot(normal);
        let total_work = impulse.dot(mean_velocity);
        let normal_work = normal_impulse * mean_velocity.dot(normal);
        self.restitution -= normal_work;
        self.friction -= total_work - normal_work;
        for (velocity, impulse) in fixed_velocity.into_iter().zip([impulse, -impulse]) {
            if let Some(velocity) = velocity {
                self.walls += impulse.dot(velocity);
                self.momentum += impulse;
            }
        }
    }

    /// Books an angular impulse (in kg m²/s), with the relative spin before and after, in rad/s.
    pub fn record_angular_impulse(
        &mut self,
        angular_impulse: Vec3<f64>,
        before: Vec3<f64>,
        after: Vec3<f64>,
    ) {
        self.resistance -= 0.5 * angular_impulse.dot(before + after);
    }
}
