//! Two boxes by the separating axis test with 15 axes (Gottschalk, Lin and Manocha 1996; terms as
//! in Ericson, *Real-Time Collision Detection*, 2005, §4.4.1).

use cgmath::InnerSpace;

use super::brute_force::{Axis, AxisSource, at_right_angles, crossing};
use super::closest::{LocalClosestPoints, TOLERANCE};
use super::core::{Core, CoreKind, Cuboid};
use super::manifold::deepest;
use crate::math::Vec3;

/// Axis of least overlap or greatest separation of two boxes.
#[derive(Clone, Copy, Debug)]
pub(super) struct BoxAxis {
    /// Unit vector from the first to the second.
    pub normal: Vec3<f64>,
    /// Separation along the axis; negative for an overlap.
    pub distance: f64,
    pub of: BoxAxisSource,
}

/// Features that define a [`BoxAxis`].
#[derive(Clone, Copy, Debug)]
pub(super) enum BoxAxisSource {
    FaceOfA,
    FaceOfB,
    Edges(usize, usize),
}

/// Sine below which the terms of an edge axis have lost too many digits.
const NEARLY_PARALLEL: f64 = 1e-3;

/// Axis of greatest separation. Among equally good axes the first is taken, and faces win over
/// edges.
pub(super) fn boxes(a: &Cuboid, b: &Cuboid, size: f64) -> BoxAxis {
    let apart = b.center - a.center;
    let (along_a, along_b) = (a.axes.map(|x| x.dot(apart)), b.axes.map(|x| x.dot(apart)));
    let cos = a.axes.map(|x| b.axes.map(|y| x.dot(y)));
    let signed = |axis: Vec3<f64>, along: f64| if along < 0.0 { -axis } else { axis };
    // Rounding must not choose among equally good axes.
    let better = TOLERANCE * size;
    let mut best =
        BoxAxis { normal: Vec3::unit_x(), distance: f64::NEG_INFINITY, of: BoxAxisSource::FaceOfA };
    let mut offer = |distance: f64, normal: &dyn Fn() -> Vec3<f64>, of: BoxAxisSource| {
        if distance > best.distance + better || best.distance == f64::NEG_INFINITY {
            best = BoxAxis { normal: normal(), distance, of };
        }
    };
    for i in 0..3 {
        let reach: f64 = (0..3).map(|j| b.half[j] * cos[i][j].abs()).sum();
        let distance = along_a[i].abs() - a.half[i] - reach;
        offer(distance, &|| signed(a.axes[i], along_a[i]), BoxAxisSource::FaceOfA);
    }
    for j in 0..3 {
        let reach: f64 = (0..3).map(|i| a.half[i] * cos[i][j].abs()).sum();
        let distance = along_b[j].abs() - b.half[j] - reach;
        offer(distance, &|| signed(b.axes[j], along_b[j]), BoxAxisSource::FaceOfB);
    }
    for i in 0..3 {
        for j in 0..3 {
            let sin = (1.0 - cos[i][j] * cos[i][j]).max(0.0).sqrt();
            let of = BoxAxisSource::Edges(i, j);
            if sin < NEARLY_PARALLEL {
                let Some(unit) = at_right_angles(a.axes[i], b.axes[j]) else { continue };
                let along = apart.dot(unit);
                let distance = along.abs() - a.reach(unit) - b.reach(unit);
                offer(distance, &|| signed(unit, along), of);
                continue;
            }
            let ((i1, i2), (j1, j2)) = (((i + 1) % 3, (i + 2) % 3), ((j + 1) % 3, (j + 2) % 3));
            let along = along_a[i2] * cos[i1][j] - along_a[i1] * cos[i2][j];
            let reach = a.half[i1] * cos[i2][j].abs()
                + a.half[i2] * cos[i1][j].abs()
                + b.half[j1] * cos[i][j2].abs()
                + b.half[j2] * cos[i][j1].abs();
            let unit = || signed(a.axes[i].cross(b.axes[j]).normalize(), along);
            offer((along.abs() - reach) / sin, &unit, of);
        }
    }
    best
}

impl BoxAxis {
    /// Adds the deepest points.
    pub fn with_points(self, a: &Core<'_>, b: &Core<'_>) -> LocalClosestPoints {
        let Self { normal, distance, of } = self;
        let on_b = if let (CoreKind::Cuboid(x), CoreKind::Cuboid(y), BoxAxisSource::Edges(i, j)) =
            (&a.kind, &b.kind, of)
        {
            // The support edges.
            let edge = |of: &Cuboid, row: usize, out: Vec3<f64>| {
                let corner = of.support(out);
                [of.corner(corner & !(1 << row)), of.corner(corner | 1 << row)]
            };
            crossing(edge(x, i, normal), edge(y, j, -normal)).map(|(_, on_b)| on_b)
        } else {
            let of_a = || a.face_along(normal).map(AxisSource::FaceOfA);
            let of_b = || b.face_along(-normal).map(AxisSource::FaceOfB);
            let of = if matches!(of, BoxAxisSource::FaceOfB) { of_b() } else { of_a() };
            of.map(|of| deepest(a, b, &Axis { normal, separation: distance, source: of }).1)
        };
        let on_b = on_b.unwrap_or_else(|| b.support(-normal).0);
        LocalClosestPoints { distance, normal, on_a: on_b - normal * distance, on_b }
    }
}
