//! Contact manifolds of two parts that move: of where they are, or of where they meet in the step.

use cgmath::InnerSpace;

use crate::body::{SolverBody, SweptManifold};
use crate::contact::{
    Convex, Manifold, Sweep, as_convex, manifold, manifold_of_plane, time_of_impact,
};
use crate::frame::Pose;
use crate::response::event::WallCollider;
use crate::shape::{Plane, Shape, Triangle};

/// Distances in metres within which contacts are listed: with the motion of the step of `dt` seconds, and
/// without.
#[derive(Clone, Copy, Debug)]
pub(super) struct ContactReach {
    pub margin: f64,
    pub slack: f64,
    pub dt: f64,
}

/// Manifold of two colliders, of which the second is a convex part of a body; none of those that do not come near
/// each other. If they are apart and fast, it is that of where they meet.
pub(super) fn swept_manifold(
    colliders: [&WallCollider; 2],
    ends: [&SolverBody; 2],
    ContactReach { margin, slack, dt }: ContactReach,
) -> Option<SweptManifold> {
    // As fast as they are in its middle.
    let ends = ends
        .map(|end| SolverBody { velocity: end.velocity + end.acceleration * (0.5 * dt), ..*end });
    let (found, radii) = manifold_of(colliders, margin)?;
    let is_near = found.points.iter().any(|point| point.distance <= slack);
    let is_plane = matches!(colliders[0], WallCollider::Plane { .. });
    if is_near || is_plane || margin < SLOW * slack {
        return Some(SweptManifold { manifold: found, radii, ends });
    }
    let sweep = |end: &SolverBody| Sweep {
        translation: if end.moves { end.velocity * dt } else { end.velocity * 0.0 },
        rotation: if end.moves { end.spin * dt } else { end.spin * 0.0 },
        center: end.center(),
    };
    let [one, other] = colliders.map(convex);
    let hit = time_of_impact(one?, &sweep(&ends[0]), other?, &sweep(&ends[1]))?;
    let then = ends.map(|end| end.later(hit.time * dt));
    let moved = |at: usize| moved(colliders[at], then[at].pose * ends[at].pose.inverse());
    let (manifold, radii) = manifold_of([&moved(0), &moved(1)], slack)?;
    Some(SweptManifold { manifold, radii, ends: then })
}

/// Margin over the slack below which nothing is fast.
const SLOW: f64 = 4.0;

/// Radius around the core of a convex shape, in metres.
fn rounding(shape: &Shape<f64>) -> f64 {
    match shape {
        Shape::Sphere(ball) => ball.radius,
        Shape::Capsule(capsule) => capsule.radius,
        _ => 0.0,
    }
}

/// Manifold of a collider and a convex part, and the radii around their cores.
fn manifold_of([one, other]: [&WallCollider; 2], margin: f64) -> Option<(Manifold<f64>, [f64; 2])> {
    let WallCollider::Solid(shape) = other else { return None };
    let part = as_convex(shape)?;
    let (found, radius) = match one {
        WallCollider::Plane { normal, offset } => {
            let plane = Plane::new(*normal, *offset).ok()?;
            (manifold_of_plane(&plane, part, margin), 0.0)
        }
        WallCollider::Solid(solid) => (manifold(as_convex(solid)?, part, margin), rounding(solid)),
        WallCollider::Triangle(triangle) => (manifold(triangle, part, margin), 0.0),
        WallCollider::OneSidedTriangle(triangle, _) => {
            let found = manifold(triangle, part, margin);
            triangle.normal().filter(|up| up.dot(found.normal) > 0.0)?;
            (found, 0.0)
        }
    };
    (!found.points.is_empty()).then_some((found, [radius, rounding(shape)]))
}

fn convex(collider: &WallCollider) -> Option<&dyn Convex<f64>> {
    match collider {
        WallCollider::Plane { .. } => None,
        WallCollider::Solid(shape) => as_convex(shape),
        WallCollider::Triangle(triangle) | WallCollider::OneSidedTriangle(triangle, _) => {
            Some(triangle)
        }
    }
}

/// Collider transformed by a pose.
fn moved(collider: &WallCollider, pose: Pose<f64>) -> WallCollider {
    let turned = |triangle: &Triangle<f64>| Triangle {
        corners: triangle.corners.map(|corner| pose.transform_point(corner)),
    };
    match collider {
        WallCollider::Plane { .. } => collider.clone(),
        WallCollider::Solid(shape) => WallCollider::Solid(shape.transformed(pose)),
        WallCollider::Triangle(triangle) => WallCollider::Triangle(turned(triangle)),
        WallCollider::OneSidedTriangle(triangle, solid) => {
            WallCollider::OneSidedTriangle(turned(triangle), solid.clone())
        }
    }
}
