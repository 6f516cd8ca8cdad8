//! Ghost collisions of rigid bodies: contacts at the seams of tiles and of meshes.

use cgmath::{EuclideanSpace, InnerSpace};

use crate::body::BodyContact;
use crate::math::{Point3, Vec3};
use crate::response::event::WallCollider;
use crate::shape::BoundedShape;

/// Cosine of the angle between two normals from which on they count as one.
const PARALLEL: f64 = 0.99;

/// Drops contacts of a body, from index `first` on, all of whose points are on another wall that it touches:
/// those at the seams of tiles and meshes.
pub(super) fn drop_ghosts(
    contacts: &mut Vec<BodyContact>,
    first: usize,
    colliders: &[WallCollider],
    flush: f64,
) {
    if contacts.len() - first < 2 {
        return;
    }
    let found = &contacts[first..];
    let is_on = |point: Vec3<f64>, collider: &WallCollider| {
        let point = Point3::from_vec(point);
        let distance = match collider {
            WallCollider::Plane { normal, offset } => point.to_vec().dot(*normal) - offset,
            WallCollider::Solid(shape) => shape.project_point(point).distance,
            WallCollider::Triangle(triangle) | WallCollider::OneSidedTriangle(triangle, _) => {
                triangle.project_point(point).distance
            }
        };
        distance.abs() <= flush
    };
    let lies_on = |contact: &BodyContact, other: usize| {
        contact.points.iter().all(|point| is_on(point.place, &colliders[other]))
    };
    // A wall that rises above the other one is no tile beside it.
    let rises_above = |collider: &WallCollider, by: &BodyContact| {
        let level = by.points.iter().map(|point| point.place.dot(by.normal));
        let level = level.fold(f64::NEG_INFINITY, f64::max);
        let top = match collider {
            WallCollider::Plane { .. } => f64::INFINITY,
            WallCollider::Solid(shape) => shape.support(by.normal).to_vec().dot(by.normal),
            WallCollider::Triangle(triangle) | WallCollider::OneSidedTriangle(triangle, _) => {
                triangle.support(by.normal).to_vec().dot(by.normal)
            }
        };
        top > level + flush
    };
    let is_ghost = |at: usize| {
        found.iter().enumerate().any(|(other, by)| {
            by.normal.dot(found[at].normal) < PARALLEL
                && lies_on(&found[at], other)
                && !lies_on(by, at)
                && !rises_above(&colliders[at], by)
        })
    };
    let mut ghosts = (0..found.len()).map(is_ghost).collect::<Vec<_>>().into_iter();
    let mut at = 0;
    contacts.retain(|_| {
        at += 1;
        at <= first || !ghosts.next().unwrap_or(false)
    });
}
