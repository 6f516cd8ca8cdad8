//! Velocities at the end of a substep.

use super::body::JointRow;
use super::rows::RowRule;
use super::system::{JointSystem, MAX_ITERATIONS};

impl JointSystem {
    /// Begins to make velocities right at the end of a substep of `h` seconds.
    pub fn begin_relaxation(&mut self, h: f64) {
        self.list_rows();
        self.list_entries();
        self.count_gain(|joints| {
            joints.damp_bending(h);
            joints.relax(h);
        });
    }

    /// Makes velocities right at the end of a substep of `h` seconds, after others changed some, and stores
    /// impulses and loads.
    pub fn finish_relaxation(&mut self, h: f64) {
        self.count_gain(|joints| joints.relax(h));
        self.limit_gain();
        self.find_pulls();
        self.store(h);
    }

    /// Finds impulses by which velocities are right.
    fn relax(&mut self, h: f64) {
        let is_free = |row: &JointRow| match row.geometry.rule {
            RowRule::AtLeastZero => row.impulse <= 0.0,
            _ => false,
        };
        for _ in 0..MAX_ITERATIONS {
            self.residual.clear();
            self.residual.extend(self.rows.iter().zip(&self.diagonal).map(
                |(row, inverse_mass)| {
                    let speed = row.speed(&self.bodies);
                    match row.geometry.rule {
                        RowRule::Speed { target, .. } => speed - target,
                        RowRule::Spring { spring, .. } => {
                            let kick = spring.step(h).kicks[1];
                            speed
                                + kick.compliance * inverse_mass * row.relaxation
                                + kick.bias * row.geometry.error
                        }
                        _ => speed,
                    }
                },
            ));
            let mut changed = false;
            for (row, residual) in self.rows.iter_mut().zip(&self.residual) {
                if is_free(row) {
                    row.active = false;
                } else {
                    let total = row.impulse + row.relaxation;
                    changed |= row.update_active(*residual, total, row.bounds(h));
                }
            }
            self.solve_linear(|row| match row.geometry.rule {
                RowRule::Spring { spring, .. } => spring.step(h).kicks[1].compliance,
                _ => 0.0,
            });
            for (row, change) in self.rows.iter_mut().zip(&self.residual) {
                let [least, most] = row.bounds(h);
                if row.active && change.is_finite() {
                    let total = row.impulse + row.relaxation;
                    let change = (total + change).clamp(least, most) - total;
                    row.relaxation += change;
                    row.apply(change, &mut self.bodies);
                }
            }
            if !changed {
                break;
            }
        }
    }
}
