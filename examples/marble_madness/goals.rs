//! The game: four pads, each of which takes the marbles of its own colour.

use bevy::prelude::*;
use bevy_taw::prelude::*;

use crate::board::{Board, HalfWidth};
use crate::marbles::{COLOURS, Colour, Order};

/// The radius of a pad, in metres.
const PAD_RADIUS: f32 = 1.5;

/// Names of the pads, by colour.
const PAD_NAMES: [&str; COLOURS.len()] = ["red pad", "yellow pad", "green pad", "blue pad"];

/// Score and progress of the game.
#[derive(Resource, Default)]
pub struct Score {
    /// Marbles that came home.
    pub home: u32,
    /// Seconds since the start, until the last marble came home.
    pub seconds: f32,
    /// True while pads take no marbles.
    pub paused: bool,
}

/// Takes marbles of its [`Colour`].
#[derive(Component)]
struct Pad;

pub fn plugin(app: &mut App) {
    app.init_resource::<Score>()
        .add_systems(Startup, spawn_pads.after(crate::board::spawn_board))
        .add_systems(FixedUpdate, (restart, take_home).chain().after(TawSystems::Scatter));
}

fn spawn_pads(
    mut commands: Commands,
    board: Single<Entity, With<Board>>,
    half_width: Res<HalfWidth>,
    mut meshes: ResMut<Assets<Mesh>>,
    mut materials: ResMut<Assets<StandardMaterial>>,
) {
    let mesh = meshes.add(Cylinder::new(PAD_RADIUS, 0.04));
    let ring = meshes.add(Torus::new(PAD_RADIUS - 0.08, PAD_RADIUS + 0.08));
    let away = **half_width - 2.2;
    for (index, colour) in COLOURS.into_iter().enumerate() {
        let x = if index % 2 == 0 { -away } else { away };
        let z = if index < 2 { -away } else { away };
        let look = |lightness: f32| StandardMaterial {
            base_color: colour.lighter(lightness).into(),
            emissive: LinearRgba::from(colour) * 0.05,
            perceptual_roughness: 0.5,
            ..default()
        };
        commands.spawn((
            ChildOf(*board),
            (Pad, Colour(index), Name::new(PAD_NAMES[index])),
            (Wall::from(Sphere::new(PAD_RADIUS)), Sensor), // who is there, for the inspector
            Mesh3d(mesh.clone()),
            MeshMaterial3d(materials.add(look(0.0))),
            Transform::from_xyz(x, 0.0, z),
            children![(
                Mesh3d(ring.clone()),
                MeshMaterial3d(materials.add(look(0.25))),
                Transform::default(),
            )],
        ));
    }
}

fn restart(mut orders: MessageReader<Order>, mut score: ResMut<Score>) {
    if orders.read().any(|order| !matches!(order, Order::Drop(_))) {
        *score = Score { paused: score.paused, ..default() };
    }
}

fn take_home(
    mut commands: Commands,
    mut score: ResMut<Score>,
    time: Res<Time>,
    board: Single<&Transform, (With<Board>, Without<Marble>)>,
    pads: Query<(&Transform, &Colour), (With<Pad>, Without<Marble>)>,
    marbles: Query<(Entity, &Transform, &Marble, &Colour)>,
) {
    if score.paused || marbles.is_empty() {
        return;
    }
    score.seconds += time.delta_secs();
    let to_board = board.to_matrix().inverse();
    for (entity, at, marble, colour) in &marbles {
        let at = to_board.transform_point3(at.translation);
        let on_floor = at.y < 1.2 * marble.radius;
        let home = pads.iter().any(|(pad, pad_colour)| {
            pad_colour == colour && pad.translation.xz().distance(at.xz()) < PAD_RADIUS
        });
        if on_floor && home {
            score.home += 1;
            commands.entity(entity).despawn();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pad_takes_marbles_of_its_colour_that_lie_on_it() {
        let mut app = App::new();
        app.add_plugins(MinimalPlugins).init_resource::<Score>().add_systems(Update, take_home);
        let tilted = Transform::from_rotation(Quat::from_rotation_z(0.3));
        let board = app.world_mut().spawn((Board, tilted)).id();
        let pad_at = Transform::from_xyz(5.0, 0.0, 5.0);
        app.world_mut().spawn((Pad, Colour(2), pad_at, ChildOf(board)));
        let mut marble = |colour, x, y, z| {
            let at = tilted.transform_point(Vec3::new(x, y, z));
            let place = Transform::from_translation(at);
            app.world_mut().spawn((Marble::new(0.4), Colour(colour), place)).id()
        };
        let on_pad = marble(2, 5.9, 0.4, 4.1);
        let others = [
            marble(1, 5.0, 0.4, 5.0), // of another colour
            marble(2, 5.0, 0.4, 3.4), // beside it
            marble(2, 5.0, 2.0, 5.0), // in the air above it
        ];
        app.update();
        assert!(app.world().get_entity(on_pad).is_err(), "it went home");
        assert!(others.iter().all(|marble| app.world().get_entity(*marble).is_ok()));
        assert_eq!(app.world().resource::<Score>().home, 1);
    }
}
