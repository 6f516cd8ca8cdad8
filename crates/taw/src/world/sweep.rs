//! Swept detection: what would pass through each other within a substep is stopped
//! where it first touches.

use super::World;
use crate::contact::time_of_impact_sphere_sphere;
use crate::math::{Point3, Scalar, length};
use crate::shape::Sphere;

/// How far into each other marbles are put that meet, over the sum of their radii: what
/// only just touches would not be held by a response that looks at overlap.
const INTO: f64 = 1e-5;

/// What a sweep remembers, and scribbles on.
#[derive(Clone, Debug, Default)]
pub(super) struct Sweep<S> {
    /// Where marbles were before they moved.
    pub start: Vec<Point3<S>>,
    middle: Vec<Point3<S>>,
    reach: Vec<S>,
    hits: Vec<(S, u32, u32)>,
    stopped: Vec<bool>,
}

impl<S: Scalar> World<S> {
    /// Puts marbles that met on their way back to where they touched, the earliest first.
    /// What was left of their way is lost.
    pub(super) fn stop_where_they_meet(&mut self) {
        let marbles = &mut self.marbles;
        let Sweep { start, middle, reach, hits, stopped } = &mut self.sweep;
        let half = S::constant(0.5);
        let moved = |row: usize| marbles.position[row] - start[row];
        // What moves by less than a fiftieth of its radius has its normal right as it is.
        let slow = S::constant(0.02);
        let fast = |row: usize| length(moved(row)) > marbles.radius[row] * slow;
        if start.len() != marbles.len() || !(0..start.len()).any(fast) {
            return;
        }
        middle.clear();
        middle.extend((0..start.len()).map(|row| start[row] + moved(row) * half));
        reach.clear();
        reach.extend((0..start.len()).map(|row| marbles.radius[row] + length(moved(row)) * half));
        self.grid.rebuild(middle, reach, S::zero());
        hits.clear();
        self.grid.pairs(middle, |a, b| {
            let (first, second) = (a as usize, b as usize);
            if fast(first) || fast(second) {
                let into = S::one() - S::constant(INTO);
                let sphere =
                    |row: usize| Sphere { center: start[row], radius: marbles.radius[row] * into };
                let (a_moves, b_moves) = (moved(first), moved(second));
                let (x, y) = (sphere(first), sphere(second));
                let time = time_of_impact_sphere_sphere(&x, a_moves, &y, b_moves);
                hits.extend(time.map(|time| (time, a, b)));
            }
        });
        hits.sort_unstable_by(|x, y| {
            let time = x.0.partial_cmp(&y.0).unwrap_or(std::cmp::Ordering::Equal);
            time.then((x.1, x.2).cmp(&(y.1, y.2)))
        });
        stopped.clear();
        stopped.resize(start.len(), false);
        for &(time, a, b) in hits.iter() {
            let rows = [a as usize, b as usize];
            // Whoever was stopped before did not get there.
            if rows.iter().any(|row| stopped[*row]) {
                continue;
            }
            for row in rows {
                stopped[row] = true;
                marbles.position[row] = start[row] + (marbles.position[row] - start[row]) * time;
            }
        }
    }
}
