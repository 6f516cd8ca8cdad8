//! Walls: the fixed and moving solids that marbles collide with.

use bevy::prelude::*;
use taw::shape as core;
use taw::world::WallShape;

use crate::components::WallState;
use crate::convert::{to_point, to_vector};

/// A wall: something solid that no contact can move. Any number of them may form one body,
/// as children of one entity say; where they are flush, a marble feels one flat floor.
///
/// It lies in the entity's own frame, about the place of its [`Transform`], and its scale
/// counts. Move or turn that (or a parent's), in any schedule, and the wall follows, pushing marbles
/// before it, as fast as it was moved: see [`wall_motion`](crate::wall_motion). A jump is no motion:
/// see [`Teleport`](crate::components::Teleport) and [`Kinematic`](crate::components::Kinematic).
///
/// An entity that is a marble, too, is no wall. While its entity is
/// [`Disabled`](bevy::ecs::entity_disabling::Disabled), a wall is out of the world.
///
/// ```
/// use bevy::prelude::*;
/// use bevy_taw::prelude::*;
///
/// fn spawn(mut commands: Commands) {
///     commands.spawn((Wall::from(Cuboid::new(4.0, 0.5, 4.0)), Transform::from_xyz(0.0, -1.0, 0.0)));
///     commands.spawn(Wall::HalfSpace(Dir3::Y));
/// }
/// ```
#[derive(Component, Clone, Debug, PartialEq, Reflect)]
#[reflect(Component, Debug, Default, PartialEq)]
#[require(Transform, WallState)]
pub enum Wall {
    /// All that is behind a plane through the place of the entity. Free where this points.
    HalfSpace(Dir3),
    /// A ball. Its scale must be even.
    Sphere(Sphere),
    /// A box.
    Cuboid(Cuboid),
    /// All points near a line along y. Its scale must be even.
    Capsule(Capsule3d),
    /// Convex hull of these points, in metres: at least four that are in no plane.
    Hull(Vec<Vec3>),
    /// Triangles, solid from both sides.
    Mesh {
        /// The corners, in metres.
        points: Vec<Vec3>,
        /// Three numbers of points each.
        triangles: Vec<[u32; 3]>,
    },
    /// A landscape about the place of the entity: a solid with vertical sides and a bottom, which is
    /// below the lowest point by the diagonal of the landscape's bounding box.
    HeightField {
        /// Distance between heights along x and z, in metres.
        cell: Vec2,
        /// Number of heights along x.
        columns: u32,
        /// In metres along y: row after row, from the far left (−x, −z) on.
        heights: Vec<f32>,
    },
}

impl Default for Wall {
    /// A floor: free above, like Bevy's `Plane3d`.
    fn default() -> Self {
        Self::HalfSpace(Dir3::Y)
    }
}

impl From<Sphere> for Wall {
    fn from(sphere: Sphere) -> Self {
        Self::Sphere(sphere)
    }
}

impl From<Cuboid> for Wall {
    fn from(cuboid: Cuboid) -> Self {
        Self::Cuboid(cuboid)
    }
}

impl From<Capsule3d> for Wall {
    fn from(capsule: Capsule3d) -> Self {
        Self::Capsule(capsule)
    }
}

impl Wall {
    /// The shape in the entity's own frame, at this scale.
    pub(crate) fn shape(&self, scale: Vec3) -> Result<WallShape<f32>, taw::Error> {
        let points =
            |points: &[Vec3]| points.iter().map(|p| to_point(*p * scale)).collect::<Vec<_>>();
        let origin = to_point(Vec3::ZERO);
        Ok(match self {
            Self::HalfSpace(normal) => {
                // A normal is perpendicular to its surface also where the scale is uneven.
                core::Plane::through(origin, to_vector(Vec3::from(*normal) / scale))?.into()
            }
            Self::Sphere(sphere) => core::Sphere::new(origin, sphere.radius * even(scale)?)?.into(),
            Self::Cuboid(cuboid) => {
                let half = to_vector(cuboid.half_size * scale.abs());
                let turn = taw::math::Quat::new(1.0, 0.0, 0.0, 0.0);
                core::Obb::new(origin, turn, half)?.into()
            }
            Self::Capsule(Capsule3d { radius, half_length }) => {
                let scale = even(scale)?;
                let end = to_vector(Vec3::Y * half_length * scale);
                core::Capsule::new(origin - end, origin + end, radius * scale)?.into()
            }
            Self::Hull(corners) => core::Hull::new(&points(corners))?.into(),
            Self::Mesh { points: corners, triangles } => {
                core::Mesh::new(points(corners), triangles.clone())?.into()
            }
            Self::HeightField { cell, columns, heights } => {
                let rows = heights.len() as f32 / *columns as f32;
                let wide = Vec3::new(cell.x * (*columns as f32 - 1.0), 0.0, cell.y * (rows - 1.0));
                let corner = to_point(wide * scale * -0.5);
                let heights = heights.iter().map(|height| height * scale.y).collect();
                let cell = [cell.x * scale.x, cell.y * scale.z];
                core::HeightField::new(corner, cell, *columns, heights)?.into()
            }
        })
    }
}

impl Wall {
    /// Distance of its farthest point from the origin of its frame at this scale, in metres.
    pub(crate) fn reach(&self, scale: Vec3) -> f32 {
        let largest = scale.abs().max_element();
        let farthest = |points: &[Vec3]| {
            points.iter().map(|point| (*point * scale).length()).fold(0.0, f32::max)
        };
        match self {
            Self::HalfSpace(_) => 1.0,
            Self::Sphere(Sphere { radius }) => radius * largest,
            Self::Cuboid(Cuboid { half_size }) => (half_size * scale).length(),
            Self::Capsule(Capsule3d { radius, half_length }) => (radius + half_length) * largest,
            Self::Hull(points) | Self::Mesh { points, .. } => farthest(points),
            Self::HeightField { cell, columns, heights } => {
                let rows = heights.len() as f32 / *columns as f32;
                let highest = heights.iter().fold(0.0, |most: f32, height| most.max(height.abs()));
                let wide = Vec2::new(*columns as f32, rows) * *cell * 0.5;
                (Vec3::new(wide.x, highest, wide.y) * scale).length()
            }
        }
    }
}

/// The scale of what has only one.
fn even(scale: Vec3) -> Result<f32, taw::Error> {
    let Vec3 { x, y, z } = scale.abs();
    for (field, value) in [("scale.y", y), ("scale.z", z)] {
        // Rotations leave a few epsilons.
        if (value - x).abs() > x * 1e-5 {
            let (value, even) = (f64::from(value), f64::from(x));
            return Err(taw::Error::OutOfRange { field, value, min: even, max: even });
        }
    }
    Ok(x)
}
