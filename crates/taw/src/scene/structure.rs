//! Walls of composite shapes.

use std::sync::Arc;

use super::{KinematicMotion, MaterialDesc, ShapeDesc};
use crate::Error;
use crate::frame::Pose;
use crate::math::{Point3, Quat, Scalar, cast_vector};
use crate::shape::{Compound, HeightField, Mesh};
use crate::world::WallShape;

/// Description of a wall of a composite shape.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct Structure {
    /// Shape and initial pose.
    pub shape: Build,
    /// Own material instead of the scene's.
    #[cfg_attr(feature = "serde", serde(default))]
    pub material: Option<MaterialDesc>,
    /// Kinematic motion, if any.
    #[cfg_attr(feature = "serde", serde(default))]
    pub motion: Option<KinematicMotion>,
}

/// Shape of a [`Structure`].
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub enum Build {
    /// A [mesh](crate::shape::Mesh).
    Mesh {
        /// Vertices, in metres.
        #[cfg_attr(feature = "serde", serde(deserialize_with = "files::points"))]
        points: Vec<[f64; 3]>,
        /// Three vertex indices each, from zero.
        triangles: Vec<[u32; 3]>,
    },
    /// A [height field](crate::shape::HeightField): a solid with vertical sides and a bottom.
    HeightField {
        /// Corner of the first column and row, at height zero, in metres.
        #[cfg_attr(
            feature = "serde",
            serde(default, deserialize_with = "super::validate::vector")
        )]
        corner: [f64; 3],
        /// Spacing of columns along x and of rows along z, in metres, above zero.
        #[cfg_attr(feature = "serde", serde(deserialize_with = "files::cell"))]
        cell: [f64; 2],
        /// Number of heights per row, at least two.
        columns: u32,
        /// Heights in metres, row by row.
        #[cfg_attr(feature = "serde", serde(deserialize_with = "files::heights"))]
        heights: Vec<f64>,
    },
    /// A [compound](crate::shape::Compound) of bounded simple shapes.
    Compound {
        /// Sub-shapes: at least one, and no half-space.
        parts: Vec<ShapeDesc>,
    },
}

impl Build {
    /// The wall shape, transformed by a pose.
    ///
    /// # Errors
    /// Errors of the sub-shapes, and [`Error::NotFinite`] for a half-space in a compound.
    pub(super) fn wall<S: Scalar>(&self, pose: Pose<f64>) -> Result<WallShape<S>, Error> {
        let point = |p: &[f64; 3]| Point3::from(p.map(S::from_f64));
        Ok(match self {
            Self::Mesh { points, triangles } => {
                let mesh = Mesh::new(points.iter().map(point).collect(), triangles.clone())?;
                WallShape::Mesh(Arc::new(mesh), cast_pose(pose))
            }
            Self::HeightField { corner, cell, columns, heights } => {
                let heights = heights.iter().map(|height| S::from_f64(*height)).collect();
                let cell = cell.map(S::from_f64);
                let field = HeightField::new(point(corner), cell, *columns, heights)?;
                WallShape::HeightField(Arc::new(field), cast_pose(pose))
            }
            Self::Compound { parts } => {
                let solid = |form: &ShapeDesc| match form.wall(pose)? {
                    WallShape::Solid(shape) => Ok(shape),
                    // Unbounded.
                    _ => Err(Error::NotFinite { field: "parts", value: f64::INFINITY }),
                };
                let parts = parts.iter().map(solid).collect::<Result<_, _>>()?;
                WallShape::Solid(crate::shape::Shape::Compound(Compound::new(parts)?))
            }
        })
    }
}

/// Converts to another scalar.
pub(super) fn cast_pose<S: Scalar>(pose: Pose<f64>) -> Pose<S> {
    let rotation = Quat::from_sv(S::from_f64(pose.rotation.s), cast_vector(pose.rotation.v));
    Pose { rotation, translation: cast_vector(pose.translation) }
}

/// Deserialization with validation.
#[cfg(feature = "serde")]
mod files {
    use serde::{Deserialize, Deserializer, de::Error};

    fn all<'de, T: Deserialize<'de>, D: Deserializer<'de>>(
        deserializer: D,
        what: &str,
        right: impl Fn(&T) -> bool,
    ) -> Result<T, D::Error> {
        let value = T::deserialize(deserializer)?;
        if right(&value) { Ok(value) } else { Err(D::Error::custom(format!("must be {what}"))) }
    }

    pub fn points<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<[f64; 3]>, D::Error> {
        let finite = |points: &Vec<[f64; 3]>| points.iter().flatten().all(|x| x.is_finite());
        all(deserializer, "finite", finite)
    }

    pub fn heights<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<f64>, D::Error> {
        all(deserializer, "finite", |heights: &Vec<f64>| heights.iter().all(|x| x.is_finite()))
    }

    pub fn cell<'de, D: Deserializer<'de>>(deserializer: D) -> Result<[f64; 2], D::Error> {
        let right = |cell: &[f64; 2]| cell.iter().all(|x| *x > 0.0 && x.is_finite());
        all(deserializer, "finite and above zero", right)
    }
}
