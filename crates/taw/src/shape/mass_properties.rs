//! Mass, center of mass and moments of inertia of solid shapes of uniform density.

use cgmath::{EuclideanSpace, InnerSpace, Matrix, One, SquareMatrix, Zero};

use super::{Capsule, Hull, Obb, Shape, Sphere};
use crate::Error;
use crate::error::{finite_point, positive, rotation};
use crate::math::{
    Mat3, Point3, Quat, Scalar, Vec3, cast_point, cast_vector, normalize_and_length,
};

/// Moment of inertia of a solid ball of uniform density, over its mass and the square of its radius.
pub(crate) const BALL_INERTIA: f64 = 0.4;
/// Moment of inertia of a thin spherical shell, over its mass and the square of its radius.
const SHELL_INERTIA: f64 = 2.0 / 3.0;
/// Least principal moment over the largest: a rod without width turns about its axis, too.
const LEAST_MOMENT: f64 = 1e-6;
/// Rotations at most to find principal axes; some ten are enough.
const MAX_ROTATIONS: u32 = 50;

/// Mass, center of mass, and principal moments of inertia of a rigid body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MassProperties<S> {
    /// Mass in kg, above zero.
    pub mass: S,
    /// Center of mass in the frame of the body, in metres.
    pub center: Point3<S>,
    /// Moments of inertia about the principal axes through the center of mass, in kg m², above zero.
    pub inertia: Vec3<S>,
    /// Rotation from the principal axes to the frame of the body.
    pub axes: Quat<S>,
}

impl<S: Scalar> MassProperties<S> {
    /// Mass properties of a solid of uniform density in kg/m³. The parts of a compound count one by one, also
    /// where they overlap.
    ///
    /// Hulls by integrals over tetrahedra (Tonon, *Explicit exact formulas for the 3-D tetrahedron inertia tensor*,
    /// 2004), compounds by the theorem of parallel axes.
    ///
    /// # Errors
    /// [`Error::NotPositive`] for the density, or for a shape without volume: `field` is `volume`.
    pub fn of_shape(shape: &Shape<S>, density: S) -> Result<Self, Error> {
        let density = positive("density", density)?.as_f64();
        let moments = Moments::of_shape(&shape.cast());
        positive("volume", moments.volume)?;
        Ok(moments.scaled(density).properties().cast())
    }

    /// Mass properties of a thin spherical shell: a hollow ball of this mass in kg and radius in metres.
    ///
    /// # Errors
    /// [`Error::NotPositive`].
    pub fn of_hollow_ball(mass: S, radius: S) -> Result<Self, Error> {
        let moment = S::from_f64(SHELL_INERTIA) * positive("mass", mass)?;
        let moment = moment * positive("radius", radius)? * radius;
        let (center, axes) = (Point3::origin(), Quat::one());
        Ok(Self { mass, center, inertia: Vec3::new(moment, moment, moment), axes })
    }

    /// Mass properties of several parts in the frame of one body, each with its own density; none of no parts.
    #[must_use]
    pub fn sum(parts: &[Self]) -> Option<Self> {
        let sum =
            parts.iter().map(|part| Moments::of_properties(&part.cast())).reduce(Moments::plus)?;
        Some(sum.properties().cast())
    }

    /// Mass properties of the same distribution of mass with another mass in kg.
    #[must_use]
    pub fn with_mass(self, mass: S) -> Self {
        Self { mass, inertia: self.inertia * (mass / self.mass), ..self }
    }

    /// Returns the mass properties if all numbers are in range.
    ///
    /// # Errors
    /// [`Error::NotPositive`], [`Error::NotFinite`] or [`Error::NotUnit`].
    pub fn validated(self) -> Result<Self, Error> {
        positive("mass", self.mass)?;
        finite_point(["center.x", "center.y", "center.z"], self.center)?;
        positive("inertia.x", self.inertia.x)?;
        positive("inertia.y", self.inertia.y)?;
        positive("inertia.z", self.inertia.z)?;
        Ok(Self { axes: rotation("axes", self.axes)?, ..self })
    }

    /// Converts to another scalar.
    pub(crate) fn cast<T: Scalar>(&self) -> MassProperties<T> {
        MassProperties {
            mass: T::from_f64(self.mass.as_f64()),
            center: cast_point(self.center),
            inertia: cast_vector(self.inertia),
            axes: Quat::from_sv(T::from_f64(self.axes.s.as_f64()), cast_vector(self.axes.v)),
        }
    }
}

/// Axial and transverse moment of inertia of a capsule over its mass, in m²: a cylinder with a hemisphere at
/// each end, of uniform density.
pub(crate) fn capsule_unit_inertia<S: Scalar>(radius: S, half_length: S) -> [S; 2] {
    let number = S::from_f64;
    let squared = radius * radius;
    // Fractions of the mass: the cylinder has volume π r² 2 h, the two hemispheres 4/3 π r³.
    let cylinder = half_length / (half_length + radius * number(2.0 / 3.0));
    let ends = S::one() - cylinder;
    let axial = cylinder * squared * number(0.5) + ends * squared * number(BALL_INERTIA);
    // The centroid of a hemisphere is 3/8 r from its flat side (Steiner).
    let cylinder_transverse = squared * number(0.25) + half_length * half_length / number(3.0);
    let ends_transverse = squared * number(BALL_INERTIA)
        + half_length * half_length
        + half_length * radius * number(0.75);
    [axial, cylinder * cylinder_transverse + ends * ends_transverse]
}

/// Integrals over a solid of density one: volume, first and second moments about the origin.
#[derive(Clone, Copy, Debug)]
struct Moments {
    volume: f64,
    first: Vec3<f64>,
    /// Integral of the outer product of position with itself.
    second: Mat3<f64>,
}

/// Outer product of a vector with itself.
fn square(v: Vec3<f64>) -> Mat3<f64> {
    Mat3::from_cols(v * v.x, v * v.y, v * v.z)
}

impl Moments {
    fn of_shape(shape: &Shape<f64>) -> Self {
        match shape {
            Shape::Sphere(Sphere { center, radius }) => {
                let volume = 4.0 / 3.0 * std::f64::consts::PI * radius.powi(3);
                let moment = volume * BALL_INERTIA * radius * radius;
                Self::of_inertia(volume, *center, Mat3::from_value(moment))
            }
            Shape::Aabb(aabb) => Self::of_box(&aabb.obb()),
            Shape::Obb(obb) => Self::of_box(obb),
            Shape::Capsule(capsule) => Self::of_capsule(capsule),
            Shape::Hull(hull) => Self::of_hull(hull),
            Shape::Compound(compound) => {
                let none = Self { volume: 0.0, first: Vec3::zero(), second: Mat3::zero() };
                compound.parts().iter().map(Self::of_shape).fold(none, Self::plus)
            }
        }
    }

    fn of_box(obb: &Obb<f64>) -> Self {
        let Vec3 { x, y, z } = obb.half_extents;
        let volume = 8.0 * x * y * z;
        let [a, b, c] = obb.axes_f64();
        let second = square(a) * (x * x) + square(b) * (y * y) + square(c) * (z * z);
        Self::of_second(volume, obb.center, second * (volume / 3.0))
    }

    fn of_capsule(Capsule { a, b, radius }: &Capsule<f64>) -> Self {
        let (axis, long) = normalize_and_length(b - a).unwrap_or((Vec3::unit_y(), 0.0));
        let ball = 4.0 / 3.0 * std::f64::consts::PI * radius.powi(3);
        let volume = ball + std::f64::consts::PI * radius * radius * long;
        let [axial, transverse] =
            if *radius > 0.0 { capsule_unit_inertia(*radius, 0.5 * long) } else { [0.0; 2] };
        let inertia = Mat3::from_value(transverse) + square(axis) * (axial - transverse);
        Self::of_inertia(volume, a + (b - a) * 0.5, inertia * volume)
    }

    /// Sum over tetrahedra from the hull's center to the triangles of its faces.
    fn of_hull(hull: &Hull<f64>) -> Self {
        let points = hull.local_points();
        let mut sum = Self { volume: 0.0, first: Vec3::zero(), second: Mat3::zero() };
        for face in hull.faces() {
            let corner = |at: usize| points[face.corners[at] as usize].to_vec();
            for at in 2..face.corners.len() {
                let [a, b, c] = [corner(0), corner(at - 1), corner(at)];
                let volume = a.dot(b.cross(c)) / 6.0;
                let all = a + b + c;
                let second = square(a) + square(b) + square(c) + square(all);
                sum = sum.plus(Self {
                    volume,
                    first: all * (volume / 4.0),
                    second: second * (volume / 20.0),
                });
            }
        }
        let pose = hull.pose_f64();
        let turn = Mat3::from(pose.rotation);
        let center = if sum.volume > 0.0 { sum.first / sum.volume } else { Vec3::zero() };
        let about_center = sum.second - square(center) * sum.volume;
        let second = turn * about_center * turn.transpose();
        Self::of_second(sum.volume, pose.transform_point(Point3::from_vec(center)), second)
    }

    /// Moments from the second moments about the center of mass.
    fn of_second(volume: f64, center: Point3<f64>, second: Mat3<f64>) -> Self {
        let center = center.to_vec();
        Self { volume, first: center * volume, second: second + square(center) * volume }
    }

    /// Moments from the inertia tensor about the center of mass: `C = tr(I) / 2 − I`.
    fn of_inertia(volume: f64, center: Point3<f64>, inertia: Mat3<f64>) -> Self {
        Self::of_second(volume, center, Mat3::from_value(0.5 * inertia.trace()) - inertia)
    }

    fn of_properties(of: &MassProperties<f64>) -> Self {
        let axes = Mat3::from(of.axes);
        let inertia = axes * Mat3::from_diagonal(of.inertia) * axes.transpose();
        Self::of_inertia(of.mass, of.center, inertia)
    }

    fn plus(self, other: Self) -> Self {
        Self {
            volume: self.volume + other.volume,
            first: self.first + other.first,
            second: self.second + other.second,
        }
    }

    fn scaled(self, density: f64) -> Self {
        Self {
            volume: self.volume * density,
            first: self.first * density,
            second: self.second * density,
        }
    }

    fn properties(self) -> MassProperties<f64> {
        let center = self.first / self.volume;
        let second = self.second - square(center) * self.volume;
        let (inertia, axes) = principal_axes(Mat3::from_value(second.trace()) - second);
        let least = inertia.x.max(inertia.y).max(inertia.z) * LEAST_MOMENT;
        let inertia = inertia.map(|moment| moment.max(least));
        MassProperties { mass: self.volume, center: Point3::from_vec(center), inertia, axes }
    }
}

/// Eigenvalues of a symmetric matrix, and the rotation from its eigenvectors to the frame of the matrix
/// (Jacobi, 1846). A diagonal matrix is not rotated.
fn principal_axes(mut matrix: Mat3<f64>) -> (Vec3<f64>, Quat<f64>) {
    let mut axes = Quat::one();
    for _ in 0..MAX_ROTATIONS {
        let off = [[0, 1], [0, 2], [1, 2]].map(|[i, j]: [usize; 2]| (matrix[i][j].abs(), i, j));
        let (largest, i, j) =
            off.into_iter().fold((0.0, 0, 1), |a, b| if b.0 > a.0 { b } else { a });
        if largest <= f64::EPSILON * matrix.trace().abs() {
            break;
        }
        // Angle that makes this entry zero, of at most an eighth of a turn.
        let theta = (matrix[j][j] - matrix[i][i]) / (2.0 * matrix[i][j]);
        let sign = if theta < 0.0 { -1.0 } else { 1.0 };
        let tangent = sign / (theta.abs() + (theta * theta + 1.0).sqrt());
        let cosine = 1.0 / (tangent * tangent + 1.0).sqrt();
        let half_cosine = ((1.0 + cosine) * 0.5).sqrt();
        let half_sine = tangent * cosine / (2.0 * half_cosine);
        let mut axis = Vec3::zero();
        axis[3 - i - j] = if j - i == 1 { -half_sine } else { half_sine };
        let turn = Quat::from_sv(half_cosine, axis);
        let by = Mat3::from(turn);
        matrix = by.transpose() * matrix * by;
        axes = (axes * turn).normalize();
    }
    (matrix.diagonal(), axes)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::frame::Pose;
    use crate::shape::Compound;

    fn tensor(of: &MassProperties<f64>) -> Mat3<f64> {
        let axes = Mat3::from(of.axes);
        axes * Mat3::from_diagonal(of.inertia) * axes.transpose()
    }

    fn assert_same(one: &MassProperties<f64>, other: &MassProperties<f64>) {
        assert!((one.mass / other.mass - 1.0).abs() < 1e-12, "{one:?} {other:?}");
        assert!((one.center - other.center).magnitude() < 1e-12, "{one:?} {other:?}");
        let (one, other) = (tensor(one), tensor(other));
        for column in 0..3 {
            let apart = (one[column] - other[column]).magnitude();
            assert!(apart < 1e-11 * one.trace(), "{one:?} {other:?}");
        }
    }

    fn of(shape: &Shape<f64>) -> MassProperties<f64> {
        MassProperties::of_shape(shape, 3.0).unwrap()
    }

    fn cuboid(half: Vec3<f64>) -> Obb<f64> {
        Obb::new(Point3::origin(), Quat::one(), half).unwrap()
    }

    #[test]
    fn textbook_values() {
        let found = of(&Shape::Obb(cuboid(Vec3::new(1.0, 2.0, 3.0))));
        assert_eq!((found.mass, found.axes), (144.0, Quat::one()));
        assert!((found.inertia / 144.0 - Vec3::new(13.0, 10.0, 5.0) / 3.0).magnitude() < 1e-14);
        let ball = Sphere::new(Point3::new(1.0, 0.0, 0.0), 0.5).unwrap();
        let ball = MassProperties::of_shape(&Shape::Sphere(ball), 1.0).unwrap();
        assert!((ball.inertia / ball.mass - Vec3::new(0.1, 0.1, 0.1)).magnitude() < 1e-14);
        assert_eq!(ball.center, Point3::new(1.0, 0.0, 0.0));
        let hollow = MassProperties::of_hollow_ball(3.0, 0.5).unwrap();
        assert_eq!(hollow.inertia, Vec3::new(0.5, 0.5, 0.5));
    }

    proptest! {
        /// A box, its hull, its halves as a compound, and the sum of these are one thing, wherever it is.
        #[test]
        fn the_same_solid_made_in_four_ways(
            half in prop::array::uniform3(0.1_f64..3.0),
            turn in prop::array::uniform4(-1.0_f64..1.0),
            place in prop::array::uniform3(-5.0_f64..5.0),
        ) {
            let rotation = Quat::new(turn[0], turn[1], turn[2], turn[3]);
            prop_assume!(rotation.magnitude() > 0.1);
            let pose = Pose { rotation: rotation.normalize(), translation: Vec3::from(place) };
            let half = Vec3::from(half);
            let whole = cuboid(half).transformed(pose);
            let expected = of(&Shape::Obb(whole));
            let hull = Hull::new(&whole.corners()).unwrap();
            assert_same(&of(&Shape::Hull(hull)), &expected);
            let parts = [-0.5, 0.5].map(|side| {
                let part = cuboid(Vec3::new(half.x * 0.5, half.y, half.z));
                let beside = Vec3::new(half.x * side, 0.0, 0.0);
                Shape::Obb(part.transformed(pose * Pose { translation: beside, ..Pose::identity() }))
            });
            let sum = MassProperties::sum(&parts.each_ref().map(of)).unwrap();
            assert_same(&sum, &expected);
            assert_same(&of(&Shape::Compound(Compound::new(parts.to_vec()).unwrap())), &expected);
            let by = Mat3::from(pose.rotation);
            let along = by * Mat3::from_diagonal(of(&Shape::Obb(cuboid(half))).inertia) * by.transpose();
            for column in 0..3 {
                let apart = (along[column] - tensor(&expected)[column]).magnitude();
                prop_assert!(apart < 1e-11 * along.trace());
            }
        }

        /// A long capsule is a hull of many points, to the area that these cut off.
        #[test]
        fn a_capsule_is_its_hull(half in 0.1_f64..2.0, radius in 0.2_f64..1.0) {
            let capsule = Capsule::new(Point3::new(0.0, -half, 0.0), Point3::new(0.0, half, 0.0), radius);
            let capsule = of(&Shape::Capsule(capsule.unwrap()));
            let ring = |i: u32, j: u32| {
                let (around, up) = (f64::from(i) * std::f64::consts::TAU / 24.0, f64::from(j) / 12.0);
                let (high, wide) = ((up * std::f64::consts::PI).cos(), (up * std::f64::consts::PI).sin());
                let y = high * radius + if j > 6 { -half } else { half };
                Point3::new(around.cos() * wide * radius, y, around.sin() * wide * radius)
            };
            let rings = (0..24).flat_map(|i| (0..=12).map(move |j| (i, j)));
            let mut points: Vec<_> = rings.map(|(i, j)| ring(i, j)).collect();
            points.extend((0..24).map(|i| ring(i, 6) - Vec3::new(0.0, 2.0 * half, 0.0)));
            let hull = of(&Shape::Hull(Hull::new(&points).unwrap()));
            prop_assert!((hull.mass / capsule.mass - 1.0).abs() < 0.05);
            for axis in 0..3 {
                let [one, other] = [&hull, &capsule].map(|it| tensor(it)[axis][axis]);
                prop_assert!((one / other - 1.0).abs() < 0.08, "{one} {other}");
            }
        }
    }

    #[test]
    fn bad_input_is_refused() {
        let flat = Shape::Obb(cuboid(Vec3::new(1.0, 0.0, 1.0)));
        assert!(matches!(
            MassProperties::of_shape(&flat, 1.0),
            Err(Error::NotPositive { field: "volume", .. })
        ));
        assert!(MassProperties::of_shape(&flat, f64::NAN).is_err());
        let good = MassProperties::of_hollow_ball(1.0, 1.0).unwrap();
        let turned = MassProperties { axes: Quat::zero(), ..good };
        assert!(matches!(turned.validated(), Err(Error::NotUnit { field: "axes", .. })));
    }
}
