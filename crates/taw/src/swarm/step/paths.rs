//! Ends of paths: what the solver left going through something stops there.

use super::leaves;
use crate::math::{Row, Scalar};
use crate::swarm::batches::Batch;
use crate::swarm::kernels::squared;
use crate::swarm::rows::{dot, less, sum};
use crate::swarm::{Stage, StaticGeometry, Swarm};

/// Number of times that pairs are looked at: a ball that stops before one stands in the way of another.
const ROUNDS: usize = 32;
/// Distance of the centers over both radii at which paths end, and that at which they pass through
/// each other.
const STOP: f64 = 0.95;
const PASS: f64 = 0.9;

impl<S: Scalar> Swarm<S> {
    /// Finds what the balls meet that fast ones struck, and where the paths of the next substep end.
    /// Given are the seconds of the step, of the substep, and what is left of the step.
    pub(super) fn end_swift_paths(
        &mut self,
        [dt, h, left]: [S; 3],
        walls: &dyn StaticGeometry<S>,
        observe: &mut dyn FnMut(Stage),
    ) {
        if !self.may_pass(h) {
            return;
        }
        let mut struck = std::mem::take(&mut self.scratch.leaving);
        self.list_struck(h, &mut struck);
        if self.find_pairs_of_listed(struck, dt, walls, observe) {
            self.update_wall_contacts(walls, left, [dt, h], |_| true, false);
            self.restore_backing(); // rows may have changed
        }
        self.limit_paths(h);
    }

    /// Returns true if a ball goes further than skins reach.
    pub(super) fn has_swift(&self) -> bool {
        let reach = self.reach_of_skins();
        let is_swift = |row: &u32| self.skin_left[*row as usize] > reach;
        !self.fast_movers.crossing.is_empty() || self.fast_movers.rows.iter().any(is_swift)
    }

    /// Returns true if a fast mover may pass through another ball in `h` seconds. For that, two have to
    /// come nearer by both radii, so one goes half of its own.
    fn may_pass(&self, h: S) -> bool {
        let goes_far = |row: &u32| {
            let (radius, velocity) = (self.at[*row as usize][3], &self.velocity[*row as usize]);
            squared(*velocity) * (S::from_f64(2.0) * h) * (S::from_f64(2.0) * h) > radius * radius
        };
        !self.fast_movers.crossing.is_empty() || self.fast_movers.rows.iter().any(goes_far)
    }

    /// Lists the partners of fast movers that would leave their skin in the next `h` seconds, since
    /// these struck them.
    fn list_struck(&self, h: S, struck: &mut Vec<u32>) {
        struck.clear();
        let pairs = self.fast_movers.batches.iter().flat_map(Batch::pairs);
        struck.extend(pairs.flatten().filter(|row| {
            let at = *row as usize;
            leaves(&self.velocity[at], self.skin_left[at], h)
        }));
        struck.sort_unstable();
        struck.dedup();
    }

    /// Finds paths for the next `h` seconds on which no ball goes through another: three in
    /// a row are solved one pair after another, and the last pair makes the first one close again.
    /// The excess of a pair's path is taken from both, and their center of mass goes on; from a
    /// proxy, which goes its own way, nothing.
    fn limit_paths(&mut self, h: S) {
        let Self { at, velocity, fast_movers, proxies, scratch, .. } = self;
        let (changes, proxy_rows) = (&mut scratch.path_changes, &scratch.proxy_rows);
        changes.clear();
        let gives = |row: usize| match Self::proxy_at(proxies, proxy_rows, row as u32) {
            Some(_) => S::zero(),
            None => velocity[row][3].max(S::zero()),
        };
        for _ in 0..ROUNDS {
            let mut any = false;
            for [a, b] in fast_movers.batches.iter().flat_map(Batch::pairs) {
                let [a, b] = [a as usize, b as usize];
                let mut by = less(&velocity[b], &velocity[a]).map(|speed| speed * h);
                if !changes.is_empty() {
                    by = sum(&by, &less(&changes[b], &changes[a]));
                }
                let part = free_part(less(&at[b], &at[a]), by, at[a][3] + at[b][3]);
                let [by_a, by_b] = [a, b].map(gives);
                if part == S::one() || by_a + by_b == S::zero() {
                    continue;
                }
                any = true;
                changes.resize(at.len(), [S::zero(); 4]);
                let share = |by: S| (S::one() - part) * (by / (by_a + by_b));
                changes[a] = sum(&changes[a], &by.map(|x| x * share(by_a)));
                changes[b] = sum(&changes[b], &by.map(|x| x * -share(by_b)));
            }
            if !any {
                break;
            }
        }
    }

    /// Changes the paths as [`Self::limit_paths`] found. The changes are kept until the paths have
    /// been looked at for walls.
    pub(super) fn shorten_paths(&mut self) {
        let least = -self.skin;
        for (row, change) in self.scratch.path_changes.iter().enumerate() {
            let far = squared([change[0], change[1], change[2], S::zero()]).sqrt();
            if far == S::zero() {
                continue;
            }
            self.at[row] = sum(&self.at[row], change);
            self.skin_left[row] -= far;
            if self.skin_left[row] < least {
                let chunk = self.chunks.partition_point(|chunk| chunk.rows[1] as usize <= row);
                self.chunks[chunk].overrun = true;
            }
        }
    }
}

/// The part of a path, relative to a ball that is `apart`, that can be gone until they meet; all of
/// it if it does not lead through the ball.
fn free_part<S: Scalar>(apart: Row<S>, path: Row<S>, radii: S) -> S {
    let square = squared(path);
    let nearest = -dot(&apart, &path);
    if nearest <= S::zero() || square < S::min_positive_value() {
        return S::one();
    }
    let time = nearest / square;
    let past = squared([0, 1, 2, 3].map(|axis| apart[axis] + path[axis] * time));
    let [stop, pass] =
        [S::from_f64(STOP), S::from_f64(PASS)].map(|part| part * radii * part * radii);
    if past >= pass {
        return S::one();
    }
    (time - ((stop - past) / square).sqrt()).clamp(S::zero(), S::one())
}
