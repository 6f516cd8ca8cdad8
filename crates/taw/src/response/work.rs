use cgmath::{InnerSpace, Zero};

use crate::math::Vec3;

/// What contacts did to marbles, counted only where somebody asks. Energies in joules.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Work {
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

impl Default for Work {
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
pub(crate) struct Push {
    /// What the second one feels, in N s.
    pub impulse: Vec3<f64>,
    /// From the first to the second.
    pub normal: Vec3<f64>,
    /// The mean of the velocities of the second's point relative to the first's before and
    /// after, in m/s: times the impulse, that is the work.
    pub mean: Vec3<f64>,
    /// Which of the two nothing can move, and how its point moves, in m/s.
    pub fixed: [Option<Vec3<f64>>; 2],
}

impl Work {
    /// Counts an impulse.
    pub fn push(&mut self, Push { impulse, normal, mean, fixed }: Push) {
        let pressure = impulse.dot(normal);
        let all = impulse.dot(mean);
        let along = pressure * mean.dot(normal);
        self.restitution -= along;
        self.friction -= all - along;
        for (velocity, impulse) in fixed.into_iter().zip([impulse, -impulse]) {
            if let Some(velocity) = velocity {
                self.walls += impulse.dot(velocity);
                self.momentum += impulse;
            }
        }
    }

    /// Counts an angular impulse (in kg m²/s) between two that turn against each other so fast
    /// before and after, in rad/s.
    pub fn twist(&mut self, twist: Vec3<f64>, before: Vec3<f64>, after: Vec3<f64>) {
        self.resistance -= 0.5 * twist.dot(before + after);
    }
}
