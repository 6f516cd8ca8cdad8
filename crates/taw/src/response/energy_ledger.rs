use cgmath::{InnerSpace, Zero};

use crate::math::Vec3;

/// What contacts did to marbles, counted only where somebody asks. Energies in joules.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct EnergyLedger {
    /// What sliding took.
    pub friction: f64,
    /// What collisions took along their normals.
    pub restitution: f64,
    /// What rolling and spinning resistance took.
    pub resistance: f64,
    /// What moving walls and marbles of infinite mass brought in.
    pub walls: f64,
    /// What forces brought in, where the response moves marbles by itself.
    pub forces: f64,
    /// The momentum that came in by both, in kg m/s.
    pub momentum: Vec3<f64>,
    /// How many collisions there were.
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

/// An impulse through a contact.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ImpulseSample {
    /// What the second one feels, in N s.
    pub impulse: Vec3<f64>,
    /// From the first to the second.
    pub normal: Vec3<f64>,
    /// The mean of the velocities of the second's point relative to the first's before and
    /// after, in m/s: times the impulse, that is the work.
    pub mean_velocity: Vec3<f64>,
    /// Which of the two nothing can move, and how its point moves, in m/s.
    pub fixed_velocity: [Option<Vec3<f64>>; 2],
}

impl EnergyLedger {
    /// Counts an impulse.
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

    /// Counts an angular impulse (in kg m²/s) between two that turn against each other so fast
    /// before and after, in rad/s.
    pub fn record_angular_impulse(
        &mut self,
        angular_impulse: Vec3<f64>,
        before: Vec3<f64>,
        after: Vec3<f64>,
    ) {
        self.resistance -= 0.5 * angular_impulse.dot(before + after);
    }
}
