use cgmath::{EuclideanSpace, InnerSpace};

use crate::contact::core::{BOX_FACES, Core, CoreKind};
use crate::math::{Vec3, normalize_and_length};

/// Vertices, edges and faces of a [`Core`].
#[derive(Clone, Debug, PartialEq)]
pub struct Features {
    /// Vertices, in metres.
    pub points: Vec<Vec3<f64>>,
    /// Pairs of vertices.
    pub edges: Vec<[u32; 2]>,
    /// Distinct edge directions, as unit vectors.
    pub directions: Vec<Vec3<f64>>,
    /// Unit normals of the faces with their vertices, counterclockwise.
    pub faces: Vec<(Vec3<f64>, Vec<u32>)>,
}

/// The edges of a box: four along each axis.
const BOX_EDGES: [[u32; 2]; 12] = [
    [0, 1],
    [2, 3],
    [4, 5],
    [6, 7],
    [0, 2],
    [1, 3],
    [4, 6],
    [5, 7],
    [0, 4],
    [1, 5],
    [2, 6],
    [3, 7],
];

impl Features {
    /// Lists all features of a core.
    #[must_use]
    pub fn of(core: &Core<'_>) -> Self {
        let (points, edges, faces): (Vec<_>, Vec<_>, _) = match &core.kind {
            CoreKind::Point(point) => (vec![*point], Vec::new(), 0),
            CoreKind::Segment(ends) => (ends.to_vec(), vec![[0, 1]], 0),
            // Both sides count. A degenerate triangle has none.
            CoreKind::Triangle(corners) => {
                let edges = vec![[0, 1], [1, 2], [2, 0]];
                (corners.to_vec(), edges, 2 * usize::from(core.is_nondegenerate_triangle()))
            }
            CoreKind::Cuboid(cuboid) => {
                ((0..8).map(|i| cuboid.corner(i)).collect(), BOX_EDGES.to_vec(), BOX_FACES.len())
            }
            CoreKind::Hull { points, edges, faces, rotation, translation, .. } => {
                let there = points.iter().map(|point| rotation * point.to_vec() + translation);
                (there.collect(), edges.to_vec(), faces.len())
            }
        };
        let face = |face: usize| {
            (core.normal(face), core.face(face).into_iter().map(|(_, number)| number).collect())
        };
        let mut directions: Vec<Vec3<f64>> = match &core.kind {
            CoreKind::Cuboid(cuboid) => cuboid.axes.to_vec(), // a flat one has them, too
            _ => Vec::new(),
        };
        for [a, b] in &edges {
            let along = normalize_and_length(points[*b as usize] - points[*a as usize]);
            if let Some((unit, _)) = along
                && !directions.iter().any(|other| other.cross(unit).magnitude2() < 1e-20)
            {
                directions.push(unit);
            }
        }
        Self { faces: (0..faces).map(face).collect(), points, edges, directions }
    }

    /// Greatest distance of a vertex from the first one.
    pub(super) fn size(&self) -> f64 {
        let far = self.points.iter().map(|point| (point - self.points[0]).magnitude());
        far.fold(0.0, f64::max)
    }

    /// Support distance along a direction, from the origin.
    pub(super) fn reach(&self, direction: Vec3<f64>) -> f64 {
        self.points.iter().map(|point| point.dot(direction)).fold(f64::NEG_INFINITY, f64::max)
    }
}
