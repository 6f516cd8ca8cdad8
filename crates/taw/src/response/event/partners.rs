//! Partners: balls of a resting cluster that press each other. One that leaves the cluster within
//! the substep, by a collision, takes its own force along, and the force on its partners has lost its
//! reaction: they are put to rest again.

use super::{EventSettings, EventSolver, MAX_DISSIPATIONS, PRESS_SPEED, REST_COST, REST_SPEED};

/// Number of times in a substep that a ball may be put to rest again soon after a partner has left it, as often as
/// it may start to rest on others.
const MAX_SOON: f64 = MAX_DISSIPATIONS / REST_COST;

/// Ball that presses another one while both have these trajectories.
#[derive(Clone, Copy, Debug)]
pub(super) struct Partner {
    row: u32,
    /// Versions of the trajectories: of the ball itself, and of its partner.
    versions: [u32; 2],
}

impl EventSolver {
    /// Notes who presses whom in the cluster that has just been solved. A crowd is solved once per
    /// substep, so nobody in it has partners.
    pub(super) fn note_partners(&mut self) {
        self.partners.resize_with(self.balls.len(), Vec::new);
        let Self { cluster, partners, balls, crowds, .. } = self;
        cluster.scratch.for_each_pressed_pair(|a, b| {
            let [a, b] = [a, b].map(|local| cluster.rows[local]);
            if [a, b].iter().any(|row| crowds.of(*row as usize).is_some()) {
                return;
            }
            for (row, other) in [(a, b), (b, a)] {
                let versions = [row, other].map(|row| balls[row as usize].trajectory.version);
                partners[row as usize].push(Partner { row: other, versions });
            }
        });
    }

    /// Puts the partners that a ball has left to rest again: soon, when the collisions of this moment
    /// are over; or after as long as pressed balls take to collide again, if that has been too often.
    pub(super) fn leave_partners(&mut self, row: usize, now: f64, settings: &EventSettings) {
        let Some(list) = self.partners.get_mut(row) else { return };
        let version = self.balls[row].trajectory.version;
        let left: Vec<_> = list.extract_if(.., |partner| partner.versions[0] != version).collect();
        for partner in left {
            let other = partner.row as usize;
            let trajectory = &mut self.balls[other].trajectory;
            if trajectory.version != partner.versions[1] || !trajectory.clustered {
                continue;
            }
            let soon = now + REST_SPEED * settings.dt;
            let time = if f64::from(trajectory.rest_count) < MAX_SOON {
                soon
            } else {
                soon.max(trajectory.start + PRESS_SPEED * settings.dt)
            };
            if time < trajectory.regime_end {
                trajectory.regime_end = time;
                self.predict(other, now, settings);
            }
        }
    }
}
