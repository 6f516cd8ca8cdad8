//! Walls of Bevy's meshes, and meshes of walls: what is drawn is touched, what is touched is drawn.

use bevy::asset::RenderAssetUsages;
use bevy::ecs::message::{MessageCursor, Messages};
use bevy::mesh::{Indices, MeshTrianglesError, PrimitiveTopology};
use bevy::platform::collections::{HashMap, HashSet};
use bevy::prelude::*;

use crate::body::{Body, BodyPart, BodyShape};
use crate::components::Marble;
use crate::convert::{from_point, to_point};
use crate::wall::Wall;

/// Makes walls of meshes: see [`MeshWalls`].
#[derive(Debug, Default)]
pub struct TawMeshWallsPlugin;

impl Plugin for TawMeshWallsPlugin {
    fn build(&self, app: &mut App) {
        app.register_type::<MeshWalls>().add_systems(
            RunFixedMainLoop,
            make.in_set(RunFixedMainLoopSystems::BeforeFixedMainLoop),
        );
    }
}

/// Makes walls of the meshes of its entity and of all that descends from it, also of what comes later:
/// the `Mesh3d` of a level, or a whole glTF scene. An entity that is a marble, or was a [`Wall`]
/// before, stays what it is, unless it has this component itself. A mesh that cannot be a wall is named in the log.
///
/// Each wall follows its entity, and its mesh when that asset changes. The mesh must stay in the main world
/// ([`RenderAssetUsages::MAIN_WORLD`], as it does by default).
///
/// ```
/// # use bevy::prelude::*;
/// # use bevy_taw::prelude::*;
/// fn spawn(mut commands: Commands, mut meshes: ResMut<Assets<Mesh>>) {
///     let ring = meshes.add(Torus::new(1.0, 2.0));
///     commands.spawn((Mesh3d(ring), MeshWalls::default()));
///     // Of a scene with these nodes: `(WorldAssetRoot(scene), MeshWalls::named(["Track", "Rim"]))`.
/// }
/// ```
#[derive(Component, Clone, Debug, Default, PartialEq, Eq, Reflect)]
#[reflect(Component, Debug, Default, PartialEq)]
#[require(Transform)]
pub struct MeshWalls {
    /// Shape of each wall.
    pub shape: MeshShape,
    /// Names of the entities whose meshes count, or that carry such meshes; empty for all.
    pub names: Vec<String>,
}

/// Shape of a wall that is made of a mesh.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Reflect)]
#[reflect(Debug, Default, PartialEq)]
pub enum MeshShape {
    /// Its triangles, solid from both sides: tracks, bowls, levels.
    #[default]
    Triangles,
    /// The convex hull of its corners: a solid, and cheaper.
    ConvexHull,
}

impl MeshWalls {
    /// Walls of the meshes of entities with these names, and of what they carry.
    #[must_use]
    pub fn named<N: Into<String>>(names: impl IntoIterator<Item = N>) -> Self {
        Self { names: names.into_iter().map(Into::into).collect(), ..Self::default() }
    }
}

impl MeshShape {
    /// The wall of a mesh.
    fn wall(self, mesh: &Mesh) -> Result<Wall, MeshTrianglesError> {
        Ok(match (self, Wall::from_mesh(mesh)?) {
            (Self::ConvexHull, Wall::Mesh { points, .. }) => Wall::Hull(points),
            (_, wall) => wall,
        })
    }
}

/// Mesh that the [`Wall`] of an entity was made of, whether or not it could be.
#[derive(Component, Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct MadeOf {
    mesh: AssetId<Mesh>,
    shape: MeshShape,
}

impl Wall {
    /// A wall of a mesh's triangles. Corners at the same place become one.
    ///
    /// # Errors
    /// A mesh whose data is in the render world only, or that has no triangles; then, and if a corner is not
    /// finite, it is `BadIndices`.
    pub fn from_mesh(mesh: &Mesh) -> Result<Self, MeshTrianglesError> {
        let mut corners = HashMap::new();
        let mut points = Vec::new();
        let mut triangles = Vec::new();
        for triangle in triangles_of(mesh)? {
            triangles.push(triangle.map(|corner| {
                // Zero has two signs.
                let key = (corner + Vec3::ZERO).to_array().map(f32::to_bits);
                *corners.entry(key).or_insert_with(|| {
                    points.push(corner);
                    points.len() as u32 - 1
                })
            }));
        }
        if triangles.is_empty() || points.iter().any(|point| !point.is_finite()) {
            return Err(MeshTrianglesError::BadIndices);
        }
        Ok(Self::Mesh { points, triangles })
    }

    /// The wall as a mesh, to draw it: of a half-space a square of 100 m. `None` for a hull, a mesh or a
    /// landscape that cannot be one.
    #[must_use]
    pub fn to_mesh(&self) -> Option<Mesh> {
        Some(match self {
            Self::HalfSpace(normal) => {
                Plane3d::new((*normal).into(), Vec2::splat(50.0)).mesh().build()
            }
            Self::Sphere(sphere) => sphere.mesh().build(),
            Self::Cuboid(cuboid) => cuboid.mesh().build(),
            Self::Capsule(capsule) => capsule.mesh().build(),
            Self::Mesh { points, triangles } => flat(triangles.iter().map(|corners| {
                let corner = |corner: u32| points.get(corner as usize).copied();
                corners.map(|it| corner(it).unwrap_or(Vec3::NAN))
            }))?,
            Self::Hull(points) => {
                let points: Vec<_> = points.iter().map(|point| to_point(*point)).collect();
                let hull = taw::shape::Hull::new(&points).ok()?;
                let corners: Vec<_> = hull.points().map(from_point).collect();
                let fan = |face: &taw::shape::Face| {
                    let corner = |i: usize| corners[face.corners[i] as usize];
                    let triangle = |i: usize| [corner(0), corner(i), corner(i + 1)];
                    (1..face.corners.len() - 1).map(triangle).collect::<Vec<_>>()
                };
                flat(hull.faces().iter().flat_map(fan))?
            }
            Self::HeightField { cell, columns, heights } => {
                flat(landscape(*cell, *columns, heights))?
            }
        })
    }
}

impl Body {
    /// The body as a mesh, to draw it. `None` for a hull that cannot be one, or without parts.
    #[must_use]
    pub fn to_mesh(&self) -> Option<Mesh> {
        let mut parts = self.parts.iter().map(|part| {
            let BodyPart { translation, rotation, .. } = *part;
            let shape = match part.shape.clone() {
                BodyShape::Sphere(sphere) => Wall::Sphere(sphere),
                BodyShape::Cuboid(cuboid) => Wall::Cuboid(cuboid),
                BodyShape::Capsule(capsule) => Wall::Capsule(capsule),
                BodyShape::Hull(points) => Wall::Hull(points),
            };
            let place = Transform { translation, rotation, ..default() };
            Some(shape.to_mesh()?.transformed_by(place))
        });
        let mut mesh = parts.next()??;
        for part in parts {
            mesh.merge(&part?).ok()?;
        }
        Some(mesh)
    }
}

/// Triangles of a landscape about its middle, seen from above counterclockwise.
fn landscape(cell: Vec2, columns: u32, heights: &[f32]) -> impl Iterator<Item = [Vec3; 3]> {
    let columns = columns.max(1) as usize;
    let rows = heights.len() / columns;
    let middle = Vec2::new(columns as f32 - 1.0, rows as f32 - 1.0) * 0.5;
    let point = move |column: usize, row: usize| {
        let flat = (Vec2::new(column as f32, row as f32) - middle) * cell;
        Vec3::new(flat.x, heights[row * columns + column], flat.y)
    };
    let cells = (1..rows).flat_map(move |row| (1..columns).map(move |column| (column, row)));
    cells.flat_map(move |(column, row)| {
        // Divided as the core divides it: see `HeightField`.
        let [near, far] = [point(column - 1, row - 1), point(column, row)];
        let [right, left] = [point(column, row - 1), point(column - 1, row)];
        [[near, far, right], [near, left, far]]
    })
}

/// A mesh of triangles with flat normals, if their places are finite.
fn flat(triangles: impl Iterator<Item = [Vec3; 3]>) -> Option<Mesh> {
    let (mut points, mut normals) = (Vec::new(), Vec::new());
    for [a, b, c] in triangles {
        points.extend([a, b, c]);
        normals.extend([(b - a).cross(c - a).normalize_or(Vec3::Y); 3]);
    }
    if points.iter().any(|point| !point.is_finite()) {
        return None;
    }
    let count = points.len() as u32;
    let mesh = Mesh::new(PrimitiveTopology::TriangleList, RenderAssetUsages::default())
        .with_inserted_attribute(Mesh::ATTRIBUTE_UV_0, vec![[0.0_f32; 2]; points.len()])
        .with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, points)
        .with_inserted_attribute(Mesh::ATTRIBUTE_NORMAL, normals);
    Some(mesh.with_inserted_indices(Indices::U32((0..count).collect())))
}

/// Triangles of a mesh, with or without indices.
fn triangles_of(mesh: &Mesh) -> Result<Vec<[Vec3; 3]>, MeshTrianglesError> {
    if mesh.try_indices_option()?.is_some() {
        return Ok(mesh.triangles()?.map(|triangle| triangle.vertices).collect());
    }
    if mesh.primitive_topology() != PrimitiveTopology::TriangleList {
        return Err(MeshTrianglesError::WrongTopology);
    }
    let points = mesh.try_attribute(Mesh::ATTRIBUTE_POSITION)?;
    let points = points.as_float3().ok_or(MeshTrianglesError::PositionsFormat)?;
    let (triangles, _) = points.as_chunks::<3>();
    Ok(triangles.iter().map(|corners| corners.map(Vec3::from)).collect())
}

/// Meshes that may be walls.
type Candidates<'w, 's> = Query<
    'w,
    's,
    (Entity, Option<&'static Mesh3d>, Option<&'static MadeOf>, Has<Marble>),
    Or<((With<Mesh3d>, Without<Wall>), (With<Mesh3d>, With<MeshWalls>), With<MadeOf>)>,
>;

/// Changes that make another look necessary.
type Changes<'w, 's> = (
    Query<'w, 's, (), Or<(Changed<Mesh3d>, Changed<ChildOf>, Changed<Name>, Changed<MeshWalls>)>>,
    Query<'w, 's, (), With<MeshWalls>>,
    Option<Res<'w, Messages<AssetEvent<Mesh>>>>,
    (RemovedComponents<'w, 's, Mesh3d>, RemovedComponents<'w, 's, ChildOf>),
    (RemovedComponents<'w, 's, Name>, Query<'w, 's, (), (With<MadeOf>, Added<Marble>)>),
);

/// Ancestors, with their names, and what they make of meshes.
type Ancestors<'w, 's> =
    Query<'w, 's, (Option<&'static ChildOf>, Option<&'static Name>, Option<&'static MeshWalls>)>;

/// Makes walls of meshes, and takes those back that are to be none.
pub(crate) fn make(
    candidates: Candidates,
    ancestors: Ancestors,
    (changed, roots, events, (mut lost, mut orphans), (mut nameless, marbles)): Changes,
    meshes: Option<Res<Assets<Mesh>>>,
    mut read: Local<MessageCursor<AssetEvent<Mesh>>>,
    mut number_of_roots: Local<usize>,
    mut commands: Commands,
) {
    let (Some(meshes), Some(events)) = (meshes, events) else { return };
    let before = std::mem::replace(&mut *number_of_roots, roots.iter().len());
    let mut modified = HashSet::new();
    let removed = lost.read().count() + orphans.read().count() + nameless.read().count();
    for event in read.read(&events) {
        if let AssetEvent::Modified { id } | AssetEvent::Added { id } = event {
            modified.insert(*id);
        }
    }
    if before.max(*number_of_roots) == 0 {
        return;
    }
    let any = before != *number_of_roots || removed > 0 || !modified.is_empty();
    if !any && changed.is_empty() && marbles.is_empty() {
        return;
    }
    for (entity, mesh, made, is_marble) in &candidates {
        let wanted = mesh.filter(|_| !is_marble).zip(wanted_shape(&ancestors, entity));
        let Some((Mesh3d(handle), shape)) = wanted else {
            if made.is_some() {
                commands.entity(entity).try_remove::<(Wall, MadeOf)>();
            }
            continue;
        };
        let id = handle.id();
        let made_of = MadeOf { mesh: id, shape };
        if made == Some(&made_of) && !modified.contains(&id) {
            continue;
        }
        let Some(mesh) = meshes.get(id) else { continue }; // its loading is an event, too
        match shape.wall(mesh) {
            Ok(wall) => {
                commands.entity(entity).try_insert((wall, made_of));
            }
            Err(error) => {
                log::warn!("taw makes no wall of the mesh of {entity}: {error}");
                commands.entity(entity).try_remove::<Wall>().try_insert(made_of);
            }
        }
    }
}

/// Shape that the nearest [`MeshWalls`] wants for the mesh of an entity.
fn wanted_shape(ancestors: &Ancestors, mesh: Entity) -> Option<MeshShape> {
    let mut names = Vec::new();
    let mut next = Some(mesh);
    while let Some(entity) = next {
        let (parent, name, walls) = ancestors.get(entity).ok()?;
        names.extend(name.map(Name::as_str));
        if let Some(MeshWalls { shape, names: wanted }) = walls {
            let is_named = |name: &String| names.contains(&name.as_str());
            return (wanted.is_empty() || wanted.iter().any(is_named)).then_some(*shape);
        }
        next = parent.map(ChildOf::parent);
    }
    None
}
