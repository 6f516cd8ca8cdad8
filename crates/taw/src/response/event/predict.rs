//! Prediction of a ball's next event.

use std::cmp::Reverse;

use cgmath::InnerSpace;

use super::toi::{SeparationMotion, time_of_impact_plane};
use super::{CellSlot, Event, EventBall, EventKind, EventSettings, EventSolver, TIME_RESOLUTION};

impl EventSolver {
    /// Predicts the next event of a ball and queues it.
    pub(super) fn predict(&mut self, row: usize, now: f64, settings: &EventSettings) {
        self.leave_partners(row, now, settings);
        self.update_cell(row, now, settings.dt);
        let refresh = self.candidates_expiry(row, now, settings);
        settings.add_cost(1);
        let ball = &self.balls[row];
        let remaining = settings.dt - now;
        let mut next = (ball.trajectory.regime_end.max(now), EventKind::RegimeChange);
        let mut simultaneous = false;
        let mut consider = |after: Option<f64>, kind: EventKind| {
            // An event in the past by rounding happens now.
            let Some(after) = after.filter(|after| !after.is_nan()) else { return };
            let time = now + after.max(0.0);
            match (next.1, kind) {
                (EventKind::BallImpact(a, _), EventKind::BallImpact(b, _))
                    if a != b && time == next.0 =>
                {
                    simultaneous = true;
                }
                _ if time < next.0 => (next, simultaneous) = ((time, kind), false),
                _ => {}
            }
        };
        consider(refresh, EventKind::RefreshCandidates);
        // Walls at rest beyond this distance from where it is halfway cannot matter in the rest of
        // the substep.
        let halfway = ball.position_at(now + 0.5 * remaining);
        let speed = ball.velocity_at(now).magnitude();
        let acceleration = ball.trajectory.acceleration.magnitude();
        let travel = (speed + acceleration * remaining) * remaining;
        let max_distance = (ball.radius + ball.position_error + 0.5 * travel) * (1.0 + 1e-9);
        self.for_each_wall_within(row, (halfway, max_distance), |wall| {
            settings.add_cost(1);
            if ball.trajectory.support != Some(wall)
                && let Some((after, kind)) = self.predict_wall(row, wall, now, settings)
            {
                consider(Some(after), kind);
            }
        });
        let mut other = |other: usize| {
            settings.add_cost(1);
            if other != row
                && let Some((after, kind)) = self.predict_ball(row, other, now, settings)
            {
                consider(Some(after), kind);
            }
        };
        self.for_each_near(row, settings, &mut other);
        self.for_each_crossing(ball, now, settings.dt, consider);
        let (time, kind) = next;
        if time <= now + remaining && time.is_finite() {
            let version = ball.trajectory.version;
            self.queue.push(Reverse(Event { time, row, version, kind, simultaneous }));
        }
    }

    /// Visits the crossings of the borders of a ball's cell, with the seconds until them.
    fn for_each_crossing(
        &self,
        ball: &EventBall,
        now: f64,
        dt: f64,
        mut visit: impl FnMut(Option<f64>, EventKind),
    ) {
        let CellSlot::Cell(cell) = ball.trajectory.cell_slot else { return };
        let (position, velocity) = (ball.position_at(now), ball.velocity_at(now));
        for (axis, width) in self.cells.width().into_iter().enumerate() {
            let border = cell[axis] as f64 * width;
            let (x, v, a) = (position[axis], velocity[axis], ball.trajectory.acceleration[axis]);
            let above =
                SeparationMotion { distance: border + width - x, speed: -v, acceleration: -a };
            let below = SeparationMotion { distance: x - border, speed: v, acceleration: a };
            for (separation, step) in [(above, 1), (below, -1)] {
                let to = cell[axis] + step;
                visit(
                    crossing_time(separation, TIME_RESOLUTION * dt),
                    EventKind::CellCrossing { axis, to },
                );
            }
        }
    }

    /// Visits balls that a ball may touch soon and collides with, outside of its crowd; itself may
    /// be among them.
    pub(super) fn for_each_near(
        &self,
        row: usize,
        settings: &EventSettings,
        mut visit: impl FnMut(usize),
    ) {
        let (layers, crowd) = (self.balls[row].layers, self.crowds.of(row));
        let mut in_crowd = 0;
        let mut visit = |other: usize| {
            if crowd.is_some() && self.crowds.of(other) == crowd {
                in_crowd += 1;
            } else if self.balls[other].layers.interacts_with(layers)
                && !self.ignored.has_balls(row as u32, other as u32)
            {
                visit(other);
            }
        };
        match self.balls[row].trajectory.cell_slot {
            CellSlot::Cell(cell) => {
                self.for_each_around(row, cell, &mut visit);
                self.unbounded.iter().copied().for_each(&mut visit);
            }
            CellSlot::Unbounded => (0..self.balls.len()).for_each(&mut visit),
        }
        settings.add_cost(Self::crowd_cost(in_crowd));
    }
}

/// Time until a center leaves its cell through a border, on which it may lie, in seconds; if it comes
/// back to that, at least the resolution of times.
fn crossing_time(separation: SeparationMotion, resolution: f64) -> Option<f64> {
    if separation.distance > 0.0 {
        time_of_impact_plane(separation)
    } else if separation.speed < 0.0 || (separation.speed == 0.0 && separation.acceleration < 0.0) {
        Some(0.0)
    } else if separation.acceleration < 0.0 {
        Some((-2.0 * separation.speed / separation.acceleration).max(resolution))
    } else {
        None
    }
}
