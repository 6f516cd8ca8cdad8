//! Walls that are made of many parts.

use std::sync::Arc;

use super::{Form, Movement, Surface};
use crate::Error;
use crate::frame::Pose;
use crate::math::{Point3, Quat, Scalar, cast_vector};
use crate::shape::{Compound, HeightField, Mesh};
use crate::world::WallShape;

/// A wall of many parts.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct Structure {
    /// Where it is at the beginning.
    pub shape: Build,
    /// What it is made of, if not the scene's surface.
    #[cfg_attr(feature = "serde", serde(default))]
    pub surface: Option<Surface>,
    /// How it moves, if it does.
    #[cfg_attr(feature = "serde", serde(default))]
    pub moves: Option<Movement>,
}

/// The parts of a [`Structure`].
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub enum Build {
    /// A [mesh](crate::shape::Mesh).
    Mesh {
        /// The corners, in metres.
        #[cfg_attr(feature = "serde", serde(deserialize_with = "files::points"))]
        points: Vec<[f64; 3]>,
        /// Three corners each, by their numbers from zero.
        triangles: Vec<[u32; 3]>,
    },
    /// A [height field](crate::shape::HeightField), solid below.
    HeightField {
        /// Where the first column and row meet, at height zero, in metres.
        #[cfg_attr(feature = "serde", serde(default, deserialize_with = "super::number::vector"))]
        corner: [f64; 3],
        /// From one column to the next along x, and from row to row along z, in metres, above
        /// zero.
        #[cfg_attr(feature = "serde", serde(deserialize_with = "files::cell"))]
        cell: [f64; 2],
        /// How many heights a row has, at least two.
        columns: u32,
        /// In metres, row by row.
        #[cfg_attr(feature = "serde", serde(deserialize_with = "files::heights"))]
        heights: Vec<f64>,
    },
    /// A [compound](crate::shape::Compound) of bounded forms.
    Compound {
        /// At least one, and no half-space.
        parts: Vec<Form>,
    },
}

impl Build {
    /// The wall, moved by a pose.
    ///
    /// # Errors
    /// What the parts refuse, and [`Error::NotFinite`] for a half-space in a compound.
    pub(super) fn wall<S: Scalar>(&self, pose: Pose<f64>) -> Result<WallShape<S>, Error> {
        let point = |p: &[f64; 3]| Point3::from(p.map(S::constant));
        Ok(match self {
            Self::Mesh { points, triangles } => {
                let mesh = Mesh::new(points.iter().map(point).collect(), triangles.clone())?;
                WallShape::Mesh(Arc::new(mesh), cast_pose(pose))
            }
            Self::HeightField { corner, cell, columns, heights } => {
                let heights = heights.iter().map(|height| S::constant(*height)).collect();
                let cell = cell.map(S::constant);
                let field = HeightField::new(point(corner), cell, *columns, heights)?;
                WallShape::HeightField(Arc::new(field), cast_pose(pose))
            }
            Self::Compound { parts } => {
                let solid = |form: &Form| match form.wall(pose)? {
                    WallShape::Solid(shape) => Ok(shape),
                    // Endless.
                    _ => Err(Error::NotFinite { field: "parts", value: f64::INFINITY }),
                };
                let parts = parts.iter().map(solid).collect::<Result<_, _>>()?;
                WallShape::Solid(crate::shape::Shape::Compound(Compound::new(parts)?))
            }
        })
    }
}

/// The pose in another scalar.
pub(super) fn cast_pose<S: Scalar>(pose: Pose<f64>) -> Pose<S> {
    let rotation = Quat::from_sv(S::constant(pose.rotation.s), cast_vector(pose.rotation.v));
    Pose { rotation, translation: cast_vector(pose.translation) }
}

/// Numbers of a structure, refused where they stand.
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
