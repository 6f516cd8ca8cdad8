//! Marbles come and go.

use bevy::color::palettes::tailwind;
use bevy::prelude::*;
use bevy_taw::prelude::*;
use taw::scene::MarbleDesc;

use crate::Options;
use crate::board::{HalfWidth, Tilt};
use crate::controls::{Action, just_pressed};
use crate::level::Level;

/// Requests about the marbles.
#[derive(Message, Clone, Copy, Debug)]
pub enum Order {
    /// Drop so many more.
    Drop(u32),
    /// Take all away.
    Clear,
    /// Take all away and begin as at the start.
    Reset,
}

/// Settings of new marbles.
#[derive(Resource)]
pub struct Bag {
    /// The smallest and the largest radius, in metres.
    pub smallest: f32,
    pub largest: f32,
    /// True for capsules, twice as long as wide.
    pub capsules: bool,
    random: fastrand::Rng,
}

/// The colour of a marble or pad: an index into [`COLOURS`].
#[derive(Component, Clone, Copy, Debug, PartialEq, Eq)]
pub struct Colour(pub usize);

/// Colours of marbles and pads.
pub const COLOURS: [Srgba; 4] =
    [tailwind::RED_500, tailwind::YELLOW_400, tailwind::GREEN_500, tailwind::BLUE_500];

/// Names of the marbles of each colour.
const NAMES: [&str; COLOURS.len()] = ["red marble", "yellow marble", "green marble", "blue marble"];

#[derive(Resource)]
struct Look {
    ball: Handle<Mesh>,
    capsule: Handle<Mesh>,
    materials: [Handle<StandardMaterial>; COLOURS.len()],
}

pub fn plugin(app: &mut App) {
    let options = app.world().resource::<Options>();
    let (random, capsules) = (fastrand::Rng::with_seed(options.seed), options.capsules);
    app.add_message::<Order>()
        .insert_resource(Bag { smallest: 0.2, largest: 0.6, capsules, random })
        .add_systems(Startup, (make_look, reset))
        .add_systems(
            Update,
            (
                reset.run_if(just_pressed(Action::Reset)),
                drop_more.run_if(just_pressed(Action::DropMore)),
            ),
        )
        .add_systems(
            FixedUpdate,
            (obey, shape_marbles, bring_back).chain().before(TawSystems::Gather),
        );
}

fn reset(mut orders: MessageWriter<Order>) {
    orders.write(Order::Reset);
}

fn drop_more(mut orders: MessageWriter<Order>) {
    orders.write(Order::Drop(10));
}

fn make_look(
    mut commands: Commands,
    assets: Res<AssetServer>,
    mut meshes: ResMut<Assets<Mesh>>,
    mut materials: ResMut<Assets<StandardMaterial>>,
) {
    let swirl: Handle<Image> = assets.load("textures/marble.png");
    commands.insert_resource(Look {
        ball: meshes.add(Sphere::new(1.0).mesh().uv(28, 16)),
        capsule: meshes.add(Capsule3d::new(1.0, 2.0).mesh().longitudes(28).latitudes(16)),
        materials: COLOURS.map(|colour| {
            materials.add(StandardMaterial {
                base_color: colour.into(),
                base_color_texture: Some(swirl.clone()),
                perceptual_roughness: 0.16,
                reflectance: 0.7,
                ..default()
            })
        }),
    });
}

#[expect(clippy::too_many_arguments, reason = "a Bevy system")]
fn obey(
    mut orders: MessageReader<Order>,
    mut commands: Commands,
    mut bag: ResMut<Bag>,
    mut tilt: ResMut<Tilt>,
    options: Res<Options>,
    half_width: Res<HalfWidth>,
    look: Res<Look>,
    level: Res<Level>,
    world: Res<TawWorld>,
    marbles: Query<Entity, With<Marble>>,
) {
    for order in orders.read() {
        let count = match *order {
            Order::Drop(count) => count,
            Order::Clear => 0,
            Order::Reset => {
                bag.random = fastrand::Rng::with_seed(options.seed);
                tilt.level();
                options.marbles
            }
        };
        let balls = level.balls();
        if matches!(order, Order::Reset) && !balls.is_empty() {
            marbles.iter().for_each(|marble| commands.entity(marble).despawn());
            for ball in balls {
                let made_of = level.material(&ball).unwrap_or_default();
                commands.spawn((marble_of(&ball, &mut bag, &look), made_of));
            }
            continue;
        }
        let mut highest = 0.0;
        if let Order::Drop(_) = order {
            let heights = world.marbles.position().iter().map(|p| p.y);
            highest = heights.fold(0.0, f32::max);
        } else {
            marbles.iter().for_each(|marble| commands.entity(marble).despawn());
        }
        let bottom = highest + 2.0 + bag.largest;
        let lattice = Lattice::new(count, bag.largest, **half_width, bottom);
        for i in 0..count {
            commands.spawn(marble(i, &lattice, &mut bag, &look));
        }
    }
}

/// Makes capsules of balls and balls of capsules, as the bag says.
fn shape_marbles(
    mut commands: Commands,
    bag: Res<Bag>,
    look: Res<Look>,
    marbles: Query<(Entity, &Marble, Has<HalfLength>)>,
) {
    for (entity, marble, is_capsule) in &marbles {
        if bag.capsules && !is_capsule {
            let half = HalfLength(marble.radius);
            commands.entity(entity).insert((half, Mesh3d(look.capsule.clone())));
        } else if !bag.capsules && is_capsule {
            commands.entity(entity).remove::<HalfLength>().insert(Mesh3d(look.ball.clone()));
        }
    }
}

/// Drops those onto the board again that fell off it.
fn bring_back(
    half_width: Res<HalfWidth>,
    mut marbles: Query<(&mut Transform, &mut Velocity), With<Marble>>,
) {
    for (mut transform, mut velocity) in &mut marbles {
        if transform.translation.y < -**half_width {
            let Vec3 { x, z, .. } = transform.translation;
            let middle = Vec3::new(x, 0.0, z).clamp_length_max(0.6 * **half_width);
            transform.translation = middle + Vec3::Y * 4.0;
            **velocity = Vec3::ZERO;
        }
    }
}

/// Cells above the board, each wide enough for the largest marble: as many as
/// there are marbles, in layers if need be.
struct Lattice {
    /// Cells along one side of a layer.
    side: u32,
    /// The width of a cell along x and z, in metres.
    pitch: f32,
    /// The height of a layer, in metres.
    layer: f32,
    /// The height of the lowest centers, in metres.
    bottom: f32,
}

impl Lattice {
    fn new(count: u32, largest: f32, half_width: f32, bottom: f32) -> Self {
        let layer = 2.1 * largest;
        let room = (2.0 * half_width / layer) as u32;
        let side = f64::from(count).sqrt().ceil().min(f64::from(room)).max(1.0) as u32;
        Self { side, pitch: 2.0 * half_width / side as f32, layer, bottom }
    }
}

/// A marble of a level, of any colour.
fn marble_of(ball: &MarbleDesc, bag: &mut Bag, look: &Look) -> impl Bundle + use<> {
    let place = |at: [f64; 3]| Vec3::from_array(at.map(|x| x as f32));
    let (at, radius) = (place(ball.position), ball.radius as f32);
    let velocity = place(ball.velocity);
    (
        MarbleMass::Density(ball.density as f32),
        AngularVelocity(place(ball.angular_velocity)),
        colored(Transform::from_translation(at), velocity, radius, bag, look),
    )
}

/// The marble in cell number `i`, anywhere in that cell.
fn marble(i: u32, lattice: &Lattice, bag: &mut Bag, look: &Look) -> impl Bundle + use<> {
    let Lattice { side, pitch, layer, bottom } = *lattice;
    let radius = bag.smallest + (bag.largest - bag.smallest) * bag.random.f32();
    let spare = (pitch - 2.0 * radius).max(0.0);
    let mut place = |cell: u32| {
        let middle = (cell as f32 + 0.5 - side as f32 / 2.0) * pitch;
        middle + spare * (bag.random.f32() - 0.5)
    };
    let (x, z) = (place(i % side), place(i / side % side));
    let y = bottom + (i / (side * side)) as f32 * layer;
    colored(Transform::from_xyz(x, y, z), Vec3::ZERO, radius, bag, look)
}

/// A marble of any colour, turned anyhow.
fn colored(
    place: Transform,
    velocity: Vec3,
    radius: f32,
    bag: &mut Bag,
    look: &Look,
) -> impl Bundle + use<> {
    let colour = bag.random.usize(..COLOURS.len());
    let mut angle = || bag.random.f32() * std::f32::consts::TAU;
    let turn = Quat::from_euler(EulerRot::YXZ, angle(), angle(), angle());
    (
        Marble::new(radius),
        Velocity(velocity),
        (Colour(colour), Name::new(NAMES[colour])),
        Mesh3d(look.ball.clone()),
        MeshMaterial3d(look.materials[colour].clone()),
        place.with_rotation(turn).with_scale(Vec3::splat(radius)),
    )
}
