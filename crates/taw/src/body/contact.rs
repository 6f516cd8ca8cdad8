//! Contacts of bodies: up to four points of a pair of convex parts, and their impulses.

use cgmath::{EuclideanSpace, InnerSpace, Zero};
use smallvec::SmallVec;

use super::state::SolverBody;
use crate::constraint::ContactImpulse;
use crate::contact::{ContactMaterial, Manifold, ManifoldPoint};
use crate::frame::Pose;
use crate::handle::{BallId, BodyId, WallId};
use crate::math::Vec3;

/// Partner of a body in a contact, in the order in which contacts are solved: walls last, so that nothing is pushed into
/// them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum BodyPartner {
    Body(BodyId),
    /// Ball of the swarm.
    Ball(BallId),
    Wall(WallId),
}

/// Identity of a contact: who touches, and with which convex parts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct BodyContactKey {
    pub partner: BodyPartner,
    pub body: BodyId,
    /// Part of the partner, and of the body.
    pub parts: [u32; 2],
}

/// Contact of two convex parts.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct BodyContact {
    pub key: BodyContactKey,
    /// Partner and body, by index in the solver.
    pub bodies: [u32; 2],
    /// Unit normal, from the partner to the body.
    pub normal: Vec3<f64>,
    pub material: ContactMaterial<f64>,
    /// Radii around the cores of both parts, in metres; zero of polyhedra.
    pub radii: [f64; 2],
    /// True from when it first bears something until a gap opens.
    pub touches: bool,
    pub points: SmallVec<[BodyContactPoint; 4]>,
}

/// Point of a contact.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct BodyContactPoint {
    /// Feature id, by which a point is known in the next step.
    pub feature: u32,
    /// Points of the two cores, in the frames of the two bodies.
    pub anchors: [Vec3<f64>; 2],
    /// Separation beyond the distance of the anchors along the normal, in metres.
    pub offset: f64,
    /// From the centers to the point on each surface, in metres.
    pub arms: [Vec3<f64>; 2],
    /// Separation in metres.
    pub separation: f64,
    /// Impulse accumulated in the substep, in N s.
    pub impulse: ContactImpulse<f64>,
    /// Speed along the normal before contacts were solved in the substep, in m/s; negative of an approach.
    pub approach: f64,
    /// Sum of the impulses of the step, in N s.
    pub total: ContactImpulse<f64>,
    /// Largest approach speed along the normal in the step, before contacts are solved, and the speed of the slip
    /// then, in m/s.
    pub fastest: [f64; 2],
    /// True if its contact touches at this point.
    pub touches: bool,
    /// Point on the partner's surface where contacts were found.
    pub place: Vec3<f64>,
}

/// Manifold whose normal is from the partner to the body, with the two where it was found.
#[derive(Clone, Debug)]
pub(crate) struct SweptManifold {
    pub manifold: Manifold<f64>,
    /// Radii around the cores of both parts, in metres; zero of polyhedra.
    pub radii: [f64; 2],
    pub ends: [SolverBody; 2],
}

/// Contact of a manifold between two parts.
pub(crate) fn manifold_contact(
    key: BodyContactKey,
    bodies: [u32; 2],
    SweptManifold { manifold, radii, ends }: &SweptManifold,
    material: ContactMaterial<f64>,
) -> BodyContact {
    let (normal, radii) = (manifold.normal, *radii);
    let point = |point: &ManifoldPoint<f64>| {
        let [place, on_b] = [point.on_a, point.on_b].map(EuclideanSpace::to_vec);
        let cores = [place - normal * radii[0], on_b + normal * radii[1]];
        let anchors = [0, 1].map(|end: usize| {
            let Pose { rotation, translation } = ends[end].pose;
            rotation.conjugate() * (cores[end] - translation)
        });
        let offset = point.distance - (cores[1] - cores[0]).dot(normal);
        BodyContactPoint { feature: point.feature, offset, place, ..BodyContactPoint::new(anchors) }
    };
    BodyContact {
        key,
        bodies,
        normal,
        material,
        radii,
        touches: false,
        points: manifold.points.iter().map(point).collect(),
    }
}

/// Contact of a ball of this radius and a part of a body, which is found anew in each substep.
pub(crate) fn ball_contact(
    key: BodyContactKey,
    bodies: [u32; 2],
    radius: f64,
    material: ContactMaterial<f64>,
) -> BodyContact {
    let points = [BodyContactPoint::new([Vec3::zero(); 2])].into_iter().collect();
    let (normal, radii) = (Vec3::unit_y(), [radius, 0.0]);
    BodyContact { key, bodies, normal, material, radii, touches: false, points }
}

impl BodyContactPoint {
    fn new(anchors: [Vec3<f64>; 2]) -> Self {
        Self {
            feature: 0,
            anchors,
            offset: 0.0,
            arms: [Vec3::zero(); 2],
            separation: 0.0,
            impulse: ContactImpulse::zero(),
            approach: 0.0,
            total: ContactImpulse::zero(),
            fastest: [f64::NEG_INFINITY, 0.0],
            touches: false,
            place: Vec3::zero(),
        }
    }
}

impl BodyContact {
    /// Separation of its nearest points, in metres.
    pub fn separation(&self) -> f64 {
        self.points.iter().map(|point| point.separation).fold(f64::INFINITY, f64::min)
    }

    /// Returns true if it is one of a body.
    pub fn is_of(&self, id: BodyId) -> bool {
        self.key.body == id || self.key.partner == BodyPartner::Body(id)
    }

    /// The other body of a contact of this one.
    pub fn other(&self, id: BodyId) -> Option<BodyId> {
        match self.key.partner {
            BodyPartner::Body(partner) if self.key.body == id => Some(partner),
            BodyPartner::Body(partner) if partner == id => Some(self.key.body),
            _ => None,
        }
    }

    /// Finds separations and arms where the bodies are now. The normal stays.
    pub fn update(&mut self, bodies: &[SolverBody]) {
        let ends = self.bodies.map(|body| &bodies[body as usize]);
        let (normal, radii) = (self.normal, self.radii);
        for point in &mut self.points {
            let cores = [0, 1].map(|end: usize| ends[end].place(point.anchors[end]));
            point.separation = point.offset + (cores[1] - cores[0]).dot(normal);
            point.arms = [
                cores[0] + normal * radii[0] - ends[0].pose.translation,
                cores[1] - normal * radii[1] - ends[1].pose.translation,
            ];
        }
    }

    /// Velocity of the body's point relative to the partner's.
    #[inline]
    pub fn relative_velocity(&self, point: &BodyContactPoint, bodies: &[SolverBody]) -> Vec3<f64> {
        let [a, b] = self.bodies.map(|body| &bodies[body as usize]);
        b.velocity_at(point.arms[1]) - a.velocity_at(point.arms[0])
    }

    /// Takes over the impulses of the last step's contact of these parts.
    pub fn take_impulses(&mut self, before: &Self) {
        self.touches = before.touches;
        for point in &mut self.points {
            let known = before.points.iter().find(|known| known.feature == point.feature);
            if let Some(known) = known {
                point.impulse = known.impulse;
                // Across the normal of now.
                let tangent = point.impulse.tangent;
                point.impulse.tangent = tangent - self.normal * tangent.dot(self.normal);
                point.approach = known.approach;
            }
        }
    }
}
