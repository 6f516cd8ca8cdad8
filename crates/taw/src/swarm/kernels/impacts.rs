//! Impacts of pairs, for those who are told of them.

use cgmath::EuclideanSpace;

use crate::math::{LANES, Point3, Scalar, Simd, Vec3, Vec3Wide};
use crate::response::Impact;
use crate::swarm::batches::Batch;

/// Notes the pairs of a batch that bounce, with their approach speeds, normals and points.
#[cold]
pub(super) fn note_impacts<S: Scalar, L: Simd<Scalar = S>>(
    impacts: &mut Vec<Impact<S>>,
    batch: &Batch,
    approach_speed: L,
    vectors: [Vec3Wide<L>; 2],
) {
    let (mut speeds, mut places) = ([S::zero(); LANES], [[[S::zero(); LANES]; 3]; 2]);
    approach_speed.store(&mut speeds);
    vectors.iter().zip(&mut places).for_each(|(vector, place)| vector.store(place));
    for ([a, b], lane) in batch.pairs().zip(0..).filter(|(_, lane)| speeds[*lane] > S::zero()) {
        let [normal, point] = places.map(|[x, y, z]| Vec3::new(x[lane], y[lane], z[lane]));
        let point = Point3::from_vec(point);
        let approach_speed = speeds[lane];
        impacts.push(Impact { a, on_wall: false, b, normal, point, approach_speed });
    }
}
