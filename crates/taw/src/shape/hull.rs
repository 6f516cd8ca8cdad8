use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use super::convex_hull::convex_hull;
use super::polygon::{normal_of_polygon, project_on_segment};
use super::{Aabb, Aabb3, BoundedShape, PointProjection};
use crate::Error;
use crate::error::{finite_point, within};
use crate::frame::Pose;
use crate::math::{Point3, Quat, Scalar, Vec3, cast_point, cast_vector, normalize_and_length};
use cgmath::{EuclideanSpace, InnerSpace};

/// Convex hull of points. Transformed copies share its vertices.
#[derive(Clone, Debug, PartialEq)]
pub struct Hull<S> {
    pose: Pose<S>,
    polyhedron: Arc<Polyhedron>,
}

/// Vertices, edges and faces relative to the center; in `f64` for any scalar, so that results are
/// rounded only once.
#[derive(Debug, PartialEq)]
struct Polyhedron {
    points: Vec<Point3<f64>>,
    edges: Vec<[u32; 2]>,
    faces: Vec<Face>,
    /// Plane offsets of the faces, from the origin.
    offsets: Vec<f64>,
    /// Greatest distance of a vertex from the first one.
    size: f64,
    /// Greatest absolute coordinate of a vertex.
    largest: f64,
}

/// A face of a hull.
#[derive(Clone, Debug, PartialEq)]
pub struct Face {
    /// Outward unit normal in the hull's own frame.
    pub normal: Vec3<f64>,
    /// Vertex indices, counterclockwise as seen from outside.
    pub corners: Vec<u32>,
}

/// Resolution of the integer lattice over the size of the points, on which the hull is computed
/// exactly.
const LATTICE_CELLS: f64 = (1_u64 << 38) as f64;
/// Triangles are coplanar if their vertices are within this fraction of the size, or within twice
/// the scalar's epsilon, by which the points themselves are rounded.
const COPLANARITY: f64 = 1e-11;

impl<S: Scalar> Hull<S> {
    /// Computes the hull of points; interior points are dropped. Each point is compared with each
    /// face so far, so a hull of thousands of vertices takes seconds.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] for fewer than four points, [`Error::NotFinite`] for a coordinate,
    /// [`Error::Coplanar`] if they lie in a plane to within 1e-11 of their size or two epsilons.
    pub fn new(points: &[Point3<S>]) -> Result<Self, Error> {
        let count = f64::from(u32::try_from(points.len()).unwrap_or(u32::MAX));
        within("points.len()", count, 4.0, f64::from(u32::MAX - 1))?;
        for point in points {
            finite_point(["points.x", "points.y", "points.z"], *point)?;
        }
        let exact = points.iter().map(|p| cast_point::<S, f64>(*p));
        let first = cast_point::<S, f64>(points[0]);
        let bounds = exact.fold(Aabb { min: first, max: first }, |all, point| {
            all.union(&Aabb { min: point, max: point })
        });
        let (center, size) = (bounds.center(), bounds.max - bounds.min);
        let size = size.x.max(size.y).max(size.z);
        let flat = Error::Coplanar { field: "points" };
        if size.is_nan() || size <= 0.0 {
            return Err(flat);
        }
        let (corners, triangles) = vertices_and_triangles(points, center, size).ok_or(flat)?;
        // Relative to the center as rounded to the scalar.
        let middle = cast_point::<S, f64>(cast_point(center)).to_vec();
        let local = |row: &usize| cast_point::<S, f64>(points[*row]) - middle;
        let points: Vec<_> = corners.iter().map(local).collect();
        let thin = size * COPLANARITY.max(2.0 * S::epsilon().as_f64());
        let mut faces = merge_coplanar(&points, &triangles, thin);
        let points = remove_non_vertices(&points, &mut faces);
        if faces.len() < 4 || faces.iter().any(|face| face.corners.len() < 3) {
            return Err(flat);
        }
        let far = |point: &Point3<f64>| (*point - points[0]).magnitude();
        let size = points.iter().map(far).fold(0.0, f64::max);
        let on = |face: &Face| points[face.corners[0] as usize].to_vec().dot(face.normal);
        let coordinates = points.iter().flat_map(|p| [p.x.abs(), p.y.abs(), p.z.abs()]);
        let polyhedron = Polyhedron {
            edges: edges_of(&faces),
            offsets: faces.iter().map(on).collect(),
            size,
            largest: coordinates.fold(0.0, f64::max),
            points,
            faces,
        };
        let thinnest = polyhedron.faces.iter().map(|face| polyhedron.thickness_behind(face));
        if thinnest.fold(f64::INFINITY, f64::min) <= thin {
            return Err(flat);
        }
        let translation = cast_point::<f64, S>(center).to_vec();
        let pose = Pose { translation, ..Pose::identity() };
        Ok(Self { pose, polyhedron: Arc::new(polyhedron) })
    }

    /// Transforms the hull by a pose.
    #[must_use]
    pub fn transformed(&self, pose: Pose<S>) -> Self {
        Self { pose: pose * self.pose, polyhedron: Arc::clone(&self.polyhedron) }
    }

    /// Validates the pose.
    pub(crate) fn validated(self) -> Result<Self, Error> {
        Ok(Self { pose: self.pose.validated()?, ..self })
    }

    /// Converts to another scalar.
    pub(crate) fn cast<T: Scalar>(&self) -> Hull<T> {
        let Pose { rotation, translation } = self.pose;
        let (s, v) = (T::from_f64(rotation.s.as_f64()), cast_vector(rotation.v));
        let pose = Pose { rotation: Quat::from_sv(s, v), translation: cast_vector(translation) };
        Hull { pose, polyhedron: Arc::clone(&self.polyhedron) }
    }

    /// Pose of the hull's own frame.
    #[must_use]
    pub fn pose(&self) -> Pose<S> {
        self.pose
    }

    /// Vertices in the world.
    pub fn points(&self) -> impl ExactSizeIterator<Item = Point3<S>> + '_ {
        let pose = self.pose_f64();
        self.polyhedron.points.iter().map(move |point| cast_point(pose.transform_point(*point)))
    }

    /// Edges as pairs of vertex indices.
    #[must_use]
    pub fn edges(&self) -> &[[u32; 2]] {
        &self.polyhedron.edges
    }

    /// Faces.
    #[must_use]
    pub fn faces(&self) -> &[Face] {
        &self.polyhedron.faces
    }

    /// Vertices in the hull's own frame, in metres.
    #[must_use]
    pub fn local_points(&self) -> &[Point3<f64>] {
        &self.polyhedron.points
    }

    /// Greatest distance of a vertex from the first one, in metres.
    pub(crate) fn size(&self) -> f64 {
        self.polyhedron.size
    }

    /// The pose in `f64` with the rotation normalized.
    pub(crate) fn pose_f64(&self) -> Pose<f64> {
        let Pose { rotation, translation } = self.pose;
        let rotation = Quat::from_sv(rotation.s.as_f64(), cast_vector(rotation.v)).normalize();
        Pose { rotation, translation: cast_vector(translation) }
    }

    fn local(&self, corner: u32) -> Point3<f64> {
        self.polyhedron.points[corner as usize]
    }
}

impl Polyhedron {
    /// Thickness: distance of the farthest vertex behind a face.
    fn thickness_behind(&self, face: &Face) -> f64 {
        let on = self.points[face.corners[0] as usize];
        let depth = |point: &Point3<f64>| (on - *point).dot(face.normal);
        self.points.iter().map(depth).fold(0.0, f64::max)
    }
}

impl<S: Scalar> BoundedShape<S> for Hull<S> {
    fn support(&self, direction: Vec3<S>) -> Point3<S> {
        let pose = self.pose_f64();
        let local = pose.inverse_transform_vector(cast_vector(direction));
        let farthest = farthest_of(&self.polyhedron.points, local);
        cast_point(pose.transform_point(self.polyhedron.points[farthest]))
    }

    fn bounding_box(&self) -> Aabb3<S> {
        let corner = |point: Point3<S>| Aabb { min: point, max: point };
        let first = corner(cast_point(self.pose_f64().transform_point(self.local(0))));
        self.points().fold(first, |all, point| all.union(&corner(point)))
    }

    fn volume(&self) -> S {
        // Tetrahedra from the center to the triangles of each face.
        let mut six = 0.0;
        for face in self.faces() {
            let first = self.local(face.corners[0]).to_vec();
            for pair in face.corners[1..].windows(2) {
                let [a, b] = [pair[0], pair[1]].map(|corner| self.local(corner).to_vec());
                six += first.dot(a.cross(b));
            }
        }
        S::from_f64(six / 6.0)
    }

    fn project_point(&self, point: Point3<S>) -> PointProjection<S> {
        let pose = self.pose_f64();
        let local = pose.inverse_transform_point(cast_point(point));
        let answer = |surface: Point3<f64>, normal: Vec3<f64>, distance: f64| PointProjection {
            point: cast_point(pose.transform_point(surface)),
            normal: cast_vector(pose.transform_vector(normal)),
            distance: S::from_f64(distance),
        };
        let Polyhedron { points, faces, offsets, largest, .. } = &*self.polyhedron;
        let height = |(face, offset): (&Face, &f64)| local.to_vec().dot(face.normal) - offset;
        let (mut highest, mut face) = (f64::NEG_INFINITY, &faces[0]);
        for next in faces.iter().zip(offsets) {
            let above = height(next);
            if above > highest {
                (highest, face) = (above, next.0);
            }
        }
        let below = local - face.normal * highest;
        // Just outside, within rounding, counts as on the face.
        if highest <= largest * f64::EPSILON * 64.0 || is_over_face(points, face, local, |_, _| ())
        {
            return answer(below, face.normal, highest);
        }
        // Beside the face: nearest point on the edges and faces that face the point.
        let mut nearest = (f64::INFINITY, local);
        for next in faces.iter().zip(offsets).filter(|next| height(*next) > 0.0) {
            let over = is_over_face(points, next.0, local, |from, to| {
                let there = project_on_segment(from, to, local);
                let squared = (local - there).magnitude2();
                if squared < nearest.0 {
                    nearest = (squared, there);
                }
            });
            if over {
                let above = height(next);
                let there = local - next.0.normal * above;
                if above * above < nearest.0 {
                    nearest = (above * above, there);
                }
            }
        }
        let out = normalize_and_length(local - nearest.1);
        let (normal, distance) = out.unwrap_or((face.normal, 0.0));
        answer(nearest.1, normal, distance)
    }
}

/// Index of the support point along a direction; among several, the first.
pub(crate) fn farthest_of(points: &[Point3<f64>], direction: Vec3<f64>) -> usize {
    let (mut best, mut reach) = (0, f64::NEG_INFINITY);
    for (i, point) in points.iter().enumerate() {
        let next = point.x * direction.x + point.y * direction.y + point.z * direction.z;
        // Branchless: a branch would be mispredicted too often.
        let farther = next > reach;
        best = if farther { i } else { best };
        reach = if farther { next } else { reach };
    }
    best
}

/// Returns true if a point projects into a face; else reports the edges that it is beside.
fn is_over_face(
    points: &[Point3<f64>],
    face: &Face,
    point: Point3<f64>,
    mut beside: impl FnMut(Point3<f64>, Point3<f64>),
) -> bool {
    let mut over = true;
    let mut from = points[face.corners[face.corners.len() - 1] as usize];
    for corner in &face.corners {
        let to = points[*corner as usize];
        if (to - from).cross(face.normal).dot(point - from) > 0.0 {
            over = false;
            beside(from, to);
        }
        from = to;
    }
    over
}

/// Vertices of the hull and its triangles by vertex index; none if the points are coplanar.
fn vertices_and_triangles<S: Scalar>(
    points: &[Point3<S>],
    center: Point3<f64>,
    size: f64,
) -> Option<(Vec<usize>, Vec<[u32; 3]>)> {
    let mut rows = Vec::new();
    let mut lattice = Vec::new();
    let mut seen = BTreeSet::new();
    for (row, point) in points.iter().enumerate() {
        let apart = (cast_point::<S, f64>(*point) - center) / size * LATTICE_CELLS;
        let at = apart.map(|x| x.round() as i128);
        if seen.insert([at.x, at.y, at.z]) {
            rows.push(row);
            lattice.push(at);
        }
    }
    let mut triangles = convex_hull(&lattice)?;
    let mut corners: Vec<_> = triangles.iter().flatten().copied().collect();
    corners.sort_unstable();
    corners.dedup();
    for corner in triangles.iter_mut().flatten() {
        *corner = corners.binary_search(corner).map_or(0, |name| name as u32);
    }
    Some((corners.into_iter().map(|corner| rows[corner as usize]).collect(), triangles))
}

/// Merges coplanar triangles into faces.
fn merge_coplanar(points: &[Point3<f64>], triangles: &[[u32; 3]], flat: f64) -> Vec<Face> {
    let at = |corner: u32| points[corner as usize];
    let mut faces = Vec::new();
    let mut left: Vec<[u32; 3]> = triangles.to_vec();
    // Largest first, since its plane is known best.
    let area = |[a, b, c]: &[u32; 3]| (at(*b) - at(*a)).cross(at(*c) - at(*a)).magnitude();
    left.sort_by(|s, t| area(t).partial_cmp(&area(s)).unwrap_or(std::cmp::Ordering::Equal));
    while let Some(first) = left.first().copied() {
        let triangle: Vec<_> = first.iter().map(|corner| at(*corner)).collect();
        let normal = normal_of_polygon(&triangle);
        let lies = |corner: &u32| (at(*corner) - at(first[0])).dot(normal).abs() <= flat;
        let (within, others): (Vec<_>, Vec<_>) =
            left.into_iter().partition(|t| *t == first || t.iter().all(lies));
        left = others;
        faces.push(Face { normal, corners: outline(&within) });
    }
    faces
}

/// Keeps points where at least three faces meet and remaps the indices in the faces. Others lie on
/// an edge.
fn remove_non_vertices(points: &[Point3<f64>], faces: &mut [Face]) -> Vec<Point3<f64>> {
    let mut meet = vec![0_u32; points.len()];
    faces.iter().flat_map(|face| &face.corners).for_each(|corner| meet[*corner as usize] += 1);
    let mut kept = Vec::new();
    let mut name = vec![0_u32; points.len()];
    for (point, (name, meet)) in points.iter().zip(name.iter_mut().zip(&meet)) {
        if *meet >= 3 {
            *name = kept.len() as u32;
            kept.push(*point);
        }
    }
    for face in faces {
        face.corners.retain(|corner| meet[*corner as usize] >= 3);
        face.corners.iter_mut().for_each(|corner| *corner = name[*corner as usize]);
    }
    kept
}

/// Boundary loop of coplanar triangles: along the edges that only one of them has.
fn outline(triangles: &[[u32; 3]]) -> Vec<u32> {
    let sides = triangles.iter().flat_map(|[a, b, c]| [(*a, *b), (*b, *c), (*c, *a)]);
    let sides: BTreeSet<_> = sides.collect();
    let outer = sides.iter().filter(|(a, b)| !sides.contains(&(*b, *a)));
    let mut next: BTreeMap<u32, u32> = outer.copied().collect();
    let mut corners = Vec::new();
    if let Some((first, _)) = next.first_key_value() {
        let mut corner = *first;
        while let Some(then) = next.remove(&corner) {
            corners.push(corner);
            corner = then;
        }
    }
    corners
}

fn edges_of(faces: &[Face]) -> Vec<[u32; 2]> {
    let sides = faces.iter().flat_map(|Face { corners, .. }| {
        let ends = corners.iter().skip(1).chain(corners.first());
        corners.iter().zip(ends).map(|(a, b)| [*a.min(b), *a.max(b)])
    });
    let mut edges: Vec<_> = sides.collect();
    edges.sort_unstable();
    edges.dedup();
    edges
}
