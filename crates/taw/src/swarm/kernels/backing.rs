//! Walls behind the balls of a pair, where masses differ much: the Schur complement of their
//! contacts, so that a light ball between a heavy one and a wall carries the load at once.

use super::contact::SolverColumns;
use super::{gather, inverse_mass};
use crate::math::{LANES, Scalar, Simd, Vec3Wide};
use crate::swarm::batches::Batch;

/// In place of the impulse of [`SolverColumns::backing`]: the ball has left the wall behind it. The
/// impulses that its pairs had with that wall are larger than those without.
pub(in crate::swarm) const LOST: f64 = -1.0;

/// Mass that the walls behind two balls add to their pair.
pub(super) struct Backing<L> {
    /// Effective mass of both along their normal, in kilograms, as long as the walls bear.
    pub load: L,
    /// Speed at which they leave the walls along it, in m/s: until then, they weigh as they are.
    leaving: L,
    /// Above zero if a wall bears.
    bears: L,
}

impl<L: Simd> Backing<L> {
    /// Impulse that lowers the speed at which a pair of this mass parts by `slower`, in m/s; less than zero
    /// raises it.
    #[inline(always)]
    pub fn impulse(&self, alone: L, slower: L) -> L {
        let zero = L::constant(0.0);
        let plain = alone * slower;
        let at_wall = slower + self.leaving;
        let pressed = zero - (zero - self.load * at_wall).max(zero - plain);
        let released = self.bears.select_gt(zero, self.load * slower, plain);
        let apart = slower.select_gt(zero, released, plain);
        zero.select_gt(at_wall, pressed, apart)
    }
}

impl<S: Scalar> SolverColumns<'_, S> {
    /// Tests if it is known which balls have a wall behind them.
    pub fn backed(&self) -> bool {
        self.backing.len() > 0
    }

    /// Velocities of the walls behind two balls along their normals, in m/s.
    #[inline(always)]
    pub(super) fn backing_speeds<L: Simd<Scalar = S>>(&self, batch: &Batch) -> [L; 2] {
        if self.backing_speed.len() == 0 {
            return [L::constant(0.0); 2];
        }
        let mut speeds = [[S::zero(); LANES]; 2];
        for lane in 0..batch.count as usize {
            for (speeds, row) in speeds.iter_mut().zip(batch.pair(lane)) {
                // SAFETY: as in `gather`.
                speeds[lane] = unsafe { *self.backing_speed.row(row as usize) };
            }
        }
        [L::load(&speeds[0]), L::load(&speeds[1])]
    }

    /// The walls behind two balls.
    #[inline(always)]
    pub(super) fn backing_of<L: Simd<Scalar = S>>(
        &self,
        batch: &Batch,
        [a, b]: [&[L; 4]; 2],
        normal: Vec3Wide<L>,
    ) -> Backing<L> {
        let (zero, one) = (L::constant(0.0), L::constant(1.0));
        let [back_a, back_b] = gather::<L>(self.backing, batch);
        // How far the pair's normal goes into the wall.
        let into_a = normal.dot(Vec3Wide::of(&back_a)).max(zero);
        let into_b = (zero - normal.dot(Vec3Wide::of(&back_b))).max(zero);
        let free = |into: L| (one - into * into).max(zero);
        let [of_a, of_b] = [inverse_mass(a), inverse_mass(b)];
        // Two that have a wall behind them each weigh no more than the heavier one.
        let heavier = of_a + of_b - of_a.max(of_b);
        let sum = (of_a * free(into_a) + of_b * free(into_b)).max(heavier);
        let [speed_a, speed_b] = self.backing_speeds(batch);
        let away = |ball: &[L; 4], back: &[L; 4], speed: L| {
            (Vec3Wide::of(ball).dot(Vec3Wide::of(back)) - speed).max(zero)
        };
        Backing {
            load: sum.select_gt(zero, one / sum, zero),
            leaving: away(a, &back_a, speed_a) * into_a + away(b, &back_b, speed_b) * into_b,
            bears: (back_a[3] * into_a).max(back_b[3] * into_b),
        }
    }
}

/// An impulse on a ball, and with it what the wall behind takes so that the ball does not come
/// nearer, or gives back of that; and the wall, of this speed along its normal, with what it bears then.
#[inline(always)]
pub(super) fn borne_by_wall<L: Simd>(
    impulse: Vec3Wide<L>,
    ball: &[L; 4],
    back: &[L; 4],
    speed: L,
) -> (Vec3Wide<L>, [L; 4]) {
    let (zero, one) = (L::constant(0.0), L::constant(1.0));
    let (normal, free) = (Vec3Wide::of(back), inverse_mass(ball));
    let some = free.select_gt(zero, normal.dot(normal), zero);
    let mass = free.select_gt(zero, one / free, zero);
    let before = back[3].max(zero);
    let away = (Vec3Wide::of(ball).dot(normal) - speed) * mass + impulse.dot(normal);
    let borne = (before - away).max(zero) * some;
    (impulse + normal * (borne - before), normal.with(borne))
}
