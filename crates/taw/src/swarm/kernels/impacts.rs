//! Impacts of pairs, for those who are told of them.

use cgmath::EuclideanSpace;

use crate::math::{LANES, Point3, Scalar, Simd, Vec3, Vec3Wide};
use crate::response::Impact;
use crate::swarm::batches::Batch;

/// Notes the pairs of a batch that bounce, with their approach speeds, normals, points, slips and impulses.
#[cold]
pub(super) fn note_impacts<S: Scalar, L: Simd<Scalar = S>>(
    impacts: &mut Vec<Impact<S>>,
    batch: &Batch,
    approach_speed: L,
    vectors: [Vec3Wide<L>; 4],
) {
    let (mut speeds, mut places) = ([S::zero(); LANES], [[[S::zero(); LANES]; 3]; 4]);
    approach_speed.store(&mut speeds);
    vectors.iter().zip(&mut places).for_each(|(vector, place)| vector.store(place));
    for ([a, b], lane) in batch.pairs().zip(0..).filter(|(_, lane)| speeds[*lane] > S::zero()) {
        let [normal, point, slip, impulse] =
            places.map(|[x, y, z]| Vec3::new(x[lane], y[lane], z[lane]));
        let (point, approach_speed) = (Point3::from_vec(point), speeds[lane]);
        let (on_wall, part) = (false, 0);
        impacts.push(Impact { a, on_wall, b, part, normal, point, approach_speed, slip, impulse });
    }
}
