//! Levels: scenes in RON, the same files that `taw-lab advise` reads. The half-spaces of one are
//! the board, its other walls stand on it, its marbles are those of the game; how gravity changes
//! in it is for the lab, since here the player tilts.

use std::path::Path;

use bevy::color::palettes::tailwind;
use bevy::prelude::*;
use bevy_taw::prelude::*;
use taw::scene::{KinematicMotion, MarbleDesc, MaterialDesc, Scene, ShapeDesc};
use taw_examples::assets;

use crate::board::{Board, HalfWidth};

/// The level that is played, if it is one.
#[derive(Resource, Default)]
pub struct Level(pub Option<Scene>);

/// Motion of a wall, from where it began.
#[derive(Component)]
struct Moves {
    movement: KinematicMotion,
    begin: Transform,
}

impl Level {
    /// Reads a file, or one of `assets/levels` by its name.
    pub fn read(name: Option<&Path>) -> Result<Self, String> {
        let Some(name) = name else { return Ok(Self(None)) };
        let shipped = assets().join("levels").join(name).with_extension("ron");
        let file = if name.exists() { name } else { &shipped };
        let text = std::fs::read_to_string(file).map_err(|e| format!("{}: {e}", file.display()))?;
        Self::from_text(&text).map_err(|e| format!("{}:{e}", file.display()))
    }

    fn from_text(text: &str) -> Result<Self, String> {
        let scene = taw_lab::advise::read_scene(text)?;
        half_width(&scene)?;
        if scene
            .walls
            .iter()
            .any(|wall| matches!(wall.motion, Some(KinematicMotion::Conveyor { .. })))
        {
            return Err(" walls that convey cannot be played yet".into());
        }
        if !scene.force_fields.is_empty() {
            return Err(" force fields cannot be played yet".into());
        }
        if !scene.structures.is_empty() {
            return Err(" walls of many parts cannot be played yet".into());
        }
        if scene.all_marbles().any(|ball| ball.half_length > 0.0) {
            return Err(" capsules cannot be played yet".into());
        }
        Ok(Self(Some(scene)))
    }

    /// The board of the level.
    pub fn half_width(&self) -> Option<f32> {
        half_width(self.0.as_ref()?).ok()
    }

    /// The marbles of the level, if it brings any.
    pub fn balls(&self) -> Vec<MarbleDesc> {
        self.0.iter().flat_map(Scene::all_marbles).collect()
    }

    /// Material of its marbles.
    pub fn material(&self, ball: &MarbleDesc) -> Option<SurfaceMaterial> {
        Some(material(ball.material.unwrap_or(self.0.as_ref()?.material)))
    }
}

/// Half of the inner width of the board, if the half-spaces of a scene are one.
fn half_width(scene: &Scene) -> Result<f32, String> {
    let mut sides = Vec::new();
    let mut floor = false;
    for wall in &scene.walls {
        let ShapeDesc::HalfSpace { normal, point: through } = wall.shape else { continue };
        let (normal, through) = (point(normal).normalize(), point(through));
        let distance = -normal.dot(through);
        if normal.distance(Vec3::Y) < 1e-6 && distance.abs() < 1e-6 {
            floor = true;
        } else if normal.y.abs() < 1e-6 && normal.x.abs().max(normal.z.abs()) > 1.0 - 1e-6 {
            sides.push(distance);
        } else {
            floor = false;
            break;
        }
    }
    let width = sides.first().copied().unwrap_or(0.0);
    let even = sides.iter().all(|side| (side - width).abs() < 1e-4);
    if floor && sides.len() == 4 && even && width >= 4.0 {
        Ok(width)
    } else {
        Err(" the half-spaces of a level are a floor at height 0 and four sides, all of them at \
             the same distance of at least 4 m"
            .into())
    }
}

fn point(at: [f64; 3]) -> Vec3 {
    Vec3::from_array(at.map(|x| x as f32))
}

fn material(surface: MaterialDesc) -> SurfaceMaterial {
    SurfaceMaterial {
        restitution: surface.restitution as f32,
        friction: surface.friction as f32,
        tangential_restitution: surface.tangential_restitution as f32,
        rolling_resistance: surface.rolling_resistance as f32,
        spinning_resistance: surface.spinning_resistance as f32,
        elasticity: [surface.youngs_modulus as f32, surface.poissons_ratio as f32],
        ..default()
    }
}

pub fn plugin(app: &mut App) {
    app.add_systems(Startup, build.after(crate::board::spawn_board))
        .add_systems(FixedUpdate, move_walls.before(TawSystems::Gather));
}

/// Puts the walls of the level onto the board.
fn build(
    mut commands: Commands,
    level: Res<Level>,
    board: Single<Entity, With<Board>>,
    mut meshes: ResMut<Assets<Mesh>>,
    mut materials: ResMut<Assets<StandardMaterial>>,
) {
    let Some(scene) = &level.0 else { return };
    let look = materials.add(StandardMaterial {
        base_color: tailwind::TEAL_600.into(),
        perceptual_roughness: 0.5,
        ..default()
    });
    for wall in &scene.walls {
        let (solid, mesh, place): (Wall, Mesh, _) = match wall.shape {
            ShapeDesc::HalfSpace { .. } => continue,
            ShapeDesc::Box { center, size, rotation } => {
                let cuboid = Cuboid::from_size(point(size));
                let (axis, angle) = (point(rotation.axis).normalize(), rotation.degrees as f32);
                let turn = Quat::from_axis_angle(axis, angle.to_radians());
                let place = Transform::from_translation(point(center)).with_rotation(turn);
                (cuboid.into(), cuboid.into(), place)
            }
            ShapeDesc::Ball { center, radius } => {
                let ball = Sphere::new(radius as f32);
                (ball.into(), ball.into(), Transform::from_translation(point(center)))
            }
            ShapeDesc::Capsule { from, to, radius } => {
                let (from, to) = (point(from), point(to));
                let capsule = Capsule3d::new(radius as f32, from.distance(to));
                let turn = Quat::from_rotation_arc(Vec3::Y, (to - from).normalize_or(Vec3::Y));
                let place = Transform::from_translation((from + to) / 2.0).with_rotation(turn);
                (capsule.into(), capsule.into(), place)
            }
        };
        let made_of = material(wall.material.unwrap_or(scene.material));
        let mesh = Mesh3d(meshes.add(mesh));
        let look = MeshMaterial3d(look.clone());
        let mut wall_entity = commands.spawn((ChildOf(*board), solid, made_of, mesh, look, place));
        if let Some(movement) = wall.motion {
            wall_entity.insert(Moves { movement, begin: place });
        }
    }
}

/// Moves what moves by itself on the board.
fn move_walls(time: Res<Time>, mut walls: Query<(&Moves, &mut Transform)>) {
    for (moves, mut transform) in &mut walls {
        let Ok(pose) = moves.movement.pose(time.elapsed_secs_f64()) else { continue };
        let (turn, way) = (pose.rotation, pose.translation);
        let turn =
            Quat::from_xyzw(turn.v.x as f32, turn.v.y as f32, turn.v.z as f32, turn.s as f32);
        let way = point(way.into());
        *transform = Transform::from_translation(way).with_rotation(turn) * moves.begin;
    }
}

/// The width of the board that the level has, or that so many marbles need.
pub fn board_width(level: &Level, marbles: u32) -> HalfWidth {
    level.half_width().map_or_else(|| HalfWidth::for_marbles(marbles), HalfWidth)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_shipped_levels_can_be_played() {
        for name in ["maze", "mill"] {
            let level = Level::read(Some(Path::new(name))).unwrap();
            assert_eq!(level.half_width(), Some(10.0), "{name}");
            assert!(level.balls().len() > 10);
            // Nothing begins inside of something else.
            let scene = level.0.unwrap();
            let mut world = scene.run::<f64>(Model::default()).unwrap().world;
            world.generate_contacts();
            assert!(world.contacts.is_empty(), "{name}: {:?}", world.contacts);
        }
    }

    #[test]
    fn what_is_no_board_is_refused() {
        let board = "(duration: 1, walls: [
            (shape: HalfSpace(normal: (0, 1, 0))),
            (shape: HalfSpace(normal: (1, 0, 0), point: (-5, 0, 0))),
            (shape: HalfSpace(normal: (-1, 0, 0), point: (5, 0, 0))),
            (shape: HalfSpace(normal: (0, 0, 1), point: (0, 0, -5))),
            (shape: HalfSpace(normal: (0, 0, -1), point: (0, 0, 5))),
        ])";
        assert_eq!(Level::from_text(board).unwrap().half_width(), Some(5.0));
        for (from, to) in [
            ("point: (5, 0, 0)", "point: (6, 0, 0)"),
            ("normal: (0, 1, 0)", "normal: (1, 1, 0)"),
            ("(shape: HalfSpace(normal: (0, 1, 0))),", ""),
            ("duration: 1", "duration: -1"),
            ("duration: 1", "duration: 1, force_fields: [Drag(linear: 1)]"),
        ] {
            assert!(Level::from_text(&board.replace(from, to)).is_err(), "{to}");
        }
        assert!(Level::read(Some(Path::new("no such level"))).is_err());
    }
}
