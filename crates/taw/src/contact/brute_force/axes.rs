//! Separating axes of two polyhedra (Gottschalk, Lin and Manocha, *`OBBTree`*, 1996).

use cgmath::InnerSpace;

use super::features::Features;
use crate::math::{Vec3, is_finite, normalize_and_length};

/// Sine below which two directions are parallel.
pub(in crate::contact) const PARALLEL: f64 = 1e-12;

/// A candidate separating axis.
#[derive(Clone, Copy, Debug)]
pub(in crate::contact) struct Axis {
    /// Unit vector from the first to the second.
    pub normal: Vec3<f64>,
    /// Separation along the axis, without the radii.
    pub separation: f64,
    pub source: AxisSource,
}

/// Features that define an axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::contact) enum AxisSource {
    /// A face of the first.
    FaceOfA(usize),
    FaceOfB(usize),
    /// An edge of each.
    Edges,
}

/// Axis of greatest separation or least overlap; none if neither polyhedron has a face. Among
/// equally good axes the first is taken, and faces win over edges.
pub(in crate::contact) fn axis_of_max_separation(a: &Features, b: &Features) -> Option<Axis> {
    let of_a = a.faces.iter().enumerate().map(|(face, (normal, corners))| Axis {
        normal: *normal,
        separation: -b.reach(-*normal) - a.points[corners[0] as usize].dot(*normal),
        source: AxisSource::FaceOfA(face),
    });
    let of_b = b.faces.iter().enumerate().map(|(face, (normal, corners))| Axis {
        normal: -*normal,
        separation: -a.reach(-*normal) - b.points[corners[0] as usize].dot(*normal),
        source: AxisSource::FaceOfB(face),
    });
    // Rounding must not choose among equally good axes.
    let better = 1e-12 * (a.size() + b.size());
    let wider = |best: Option<Axis>, next: Axis| match best {
        Some(best) if next.separation <= best.separation + better => Some(best),
        _ => Some(next),
    };
    let best = of_a.chain(of_b).fold(None, wider)?;
    let pairs = a.directions.iter().flat_map(|d| b.directions.iter().map(move |e| (*d, *e)));
    // For flat polyhedra, also the axes across their plane and an edge.
    let flat = |x: &Features| (x.faces.len() == 2).then(|| x.faces[0].0);
    let across = [flat(a), flat(b)].into_iter().flatten().flat_map(|plane| {
        let directions = a.directions.iter().chain(&b.directions);
        directions.filter_map(move |along| at_right_angles(plane, *along))
    });
    let normals = pairs.filter_map(|(d, e)| at_right_angles(d, e)).chain(across);
    let of_edges = normals.flat_map(|normal| {
        [normal, -normal].map(|normal| Axis {
            normal,
            separation: -b.reach(-normal) - a.reach(normal),
            source: AxisSource::Edges,
        })
    });
    of_edges.fold(Some(best), wider)
}

/// The unit vector perpendicular to two others, unless they are parallel.
///
/// Nearly parallel vectors leave few digits in the cross product, so it is corrected until it is
/// perpendicular to within rounding.
pub(in crate::contact) fn at_right_angles(d: Vec3<f64>, e: Vec3<f64>) -> Option<Vec3<f64>> {
    let cross = d.cross(e);
    let sin = cross.magnitude();
    if sin < PARALLEL {
        return None;
    }
    let mut normal = cross / sin;
    let (beside, _) = normalize_and_length(e - d * d.dot(e))?;
    for _ in 0..2 {
        normal -= d * normal.dot(d);
        normal -= beside * (normal.dot(e) / beside.dot(e));
    }
    Some(normal.normalize()).filter(|normal| is_finite(*normal))
}
