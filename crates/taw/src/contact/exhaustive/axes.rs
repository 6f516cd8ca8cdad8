//! Separating axes: directions along which two polyhedra can be told apart (Gottschalk,
//! Lin and Manocha, *`OBBTree`*, 1996).

use cgmath::InnerSpace;

use super::skeleton::Skeleton;
use crate::math::{Vec3, direction_and_length, is_finite};

/// Two directions whose sine is below this are parallel.
pub(in crate::contact) const PARALLEL: f64 = 1e-12;

/// A direction from one to the other, and how far it keeps them apart.
#[derive(Clone, Copy, Debug)]
pub(in crate::contact) struct Axis {
    /// From the first to the second, a unit vector.
    pub normal: Vec3<f64>,
    /// How far they are apart along it, without their radii.
    pub separation: f64,
    pub of: Of,
}

/// What an axis is at right angles to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::contact) enum Of {
    /// A face of the first.
    FaceOfA(usize),
    FaceOfB(usize),
    /// An edge of each.
    Edges,
}

/// The axis that keeps two polyhedra apart most, or along which they overlap least; none if
/// neither has a face. Of axes that are as good, the first, and that of a face rather than
/// that of edges.
pub(in crate::contact) fn widest_axis(a: &Skeleton, b: &Skeleton) -> Option<Axis> {
    let of_a = a.faces.iter().enumerate().map(|(face, (normal, corners))| Axis {
        normal: *normal,
        separation: -b.reach(-*normal) - a.points[corners[0] as usize].dot(*normal),
        of: Of::FaceOfA(face),
    });
    let of_b = b.faces.iter().enumerate().map(|(face, (normal, corners))| Axis {
        normal: -*normal,
        separation: -a.reach(-*normal) - b.points[corners[0] as usize].dot(*normal),
        of: Of::FaceOfB(face),
    });
    // Rounding must not choose between those that are as good.
    let better = 1e-12 * (a.size() + b.size());
    let wider = |best: Option<Axis>, next: Axis| match best {
        Some(best) if next.separation <= best.separation + better => Some(best),
        _ => Some(next),
    };
    let best = of_a.chain(of_b).fold(None, wider)?;
    let pairs = a.directions.iter().flat_map(|d| b.directions.iter().map(move |e| (*d, *e)));
    // Beside something flat, also those across its plane and an edge.
    let flat = |x: &Skeleton| (x.faces.len() == 2).then(|| x.faces[0].0);
    let across = [flat(a), flat(b)].into_iter().flatten().flat_map(|plane| {
        let directions = a.directions.iter().chain(&b.directions);
        directions.filter_map(move |along| at_right_angles(plane, *along))
    });
    let normals = pairs.filter_map(|(d, e)| at_right_angles(d, e)).chain(across);
    let of_edges = normals.flat_map(|normal| {
        [normal, -normal].map(|normal| Axis {
            normal,
            separation: -b.reach(-normal) - a.reach(normal),
            of: Of::Edges,
        })
    });
    of_edges.fold(Some(best), wider)
}

/// The unit vector at right angles to two others, unless they are parallel.
///
/// Of nearly parallel ones the cross product has few digits left, so it is turned until
/// it is at right angles as exactly as a product can tell.
pub(in crate::contact) fn at_right_angles(d: Vec3<f64>, e: Vec3<f64>) -> Option<Vec3<f64>> {
    let cross = d.cross(e);
    let sin = cross.magnitude();
    if sin < PARALLEL {
        return None;
    }
    let mut normal = cross / sin;
    let (beside, _) = direction_and_length(e - d * d.dot(e))?;
    for _ in 0..2 {
        normal -= d * normal.dot(d);
        normal -= beside * (normal.dot(e) / beside.dot(e));
    }
    Some(normal.normalize()).filter(|normal| is_finite(*normal))
}
