//! **Staircase**: the lab's comparison. Does a staircase of boxes do what a ramp of planes
//! does? A sphere and a capsule go down each, side by side.
//!
//! `cargo run --example staircase` (`-- --help` for options; `-- --table` prints what a run
//! shows, by every response, without a window)
//!
//! Worth a look: the plots. On the ramp both roll down evenly; on the stairs they fly from
//! edge to edge, lose what each landing takes, and come later and slower. The arrow keys
//! push all four, R starts anew.

mod lanes;

use bevy::color::palettes::tailwind;
use bevy::prelude::*;
use bevy_egui::{EguiContexts, EguiPlugin, EguiPrimaryContextPass, egui};
use bevy_taw::prelude::*;
use clap::Parser;
use egui_plot::{Legend, Line, Plot};
use lanes::{END, HALF_WIDTH, PUSH, RADIUS, RUNNERS};
use taw_examples::{ExamplePlugins, OrbitCameraPlugin, Picture, orbit_camera_at};

/// Compare a staircase of boxes with a ramp of planes
#[derive(Parser)]
struct Options {
    /// Print what a run shows, by every response, and end
    #[arg(long)]
    table: bool,
    #[command(flatten)]
    picture: Picture,
}

/// Which of the [`RUNNERS`], and what it did so far: seconds, distance, height, speed.
#[derive(Component)]
struct Track {
    runner: usize,
    samples: Vec<[f64; 4]>,
    arrival: Option<f64>,
}

const COLOURS: [Srgba; 4] =
    [tailwind::ROSE_500, tailwind::AMBER_400, tailwind::SKY_400, tailwind::EMERALD_400];

fn main() -> AppExit {
    let options = Options::parse();
    if options.table {
        println!("{}", table());
        return AppExit::Success;
    }
    App::new()
        .add_plugins(ExamplePlugins { title: "Staircase", picture: options.picture })
        .add_plugins((EguiPlugin::default(), OrbitCameraPlugin, TawPlugins))
        .insert_resource(TawModel(lanes::model(Response::Impulse)))
        .insert_resource(ClearColor(tailwind::SLATE_900.into()))
        .add_systems(Startup, (build, start).chain())
        .add_systems(
            Update,
            start.run_if(|keys: Res<ButtonInput<KeyCode>>| keys.just_pressed(KeyCode::KeyR)),
        )
        .add_systems(
            FixedUpdate,
            (push.before(TawSystems::Gather), record.after(TawSystems::Scatter)),
        )
        .add_systems(EguiPrimaryContextPass, panel)
        .run()
}

fn build(
    mut commands: Commands,
    mut meshes: ResMut<Assets<Mesh>>,
    mut materials: ResMut<Assets<StandardMaterial>>,
) {
    let mut look = |colour: Srgba| {
        materials.add(StandardMaterial {
            base_color: colour.into(),
            perceptual_roughness: 0.8,
            ..default()
        })
    };
    let (stone, ramp) = (look(tailwind::STONE_500), look(tailwind::AMBER_900));
    for [min, max] in lanes::boxes() {
        let (min, max) = (Vec3::from(min), Vec3::from(max));
        let cuboid = Cuboid::from_corners(min, max);
        commands.spawn((
            Wall::from(cuboid),
            Transform::from_translation((min + max) / 2.0),
            Mesh3d(meshes.add(cuboid)),
            MeshMaterial3d(stone.clone()),
        ));
    }
    for (point, normal) in lanes::half_spaces() {
        let normal = Dir3::new(normal.into()).expect("a direction");
        commands.spawn((Wall::HalfSpace(normal), Transform::from_translation(point.into())));
    }
    // What can be seen of the half-spaces: the ramp beside the stairs, and the floor.
    let ([slope, _], down) = (lanes::half_spaces(), END - lanes::RUN);
    let long = down.hypot(down * lanes::RISE / lanes::RUN);
    let normal = Vec3::from(slope.1).normalize();
    let middle = Vec3::new(down / 2.0, lanes::top() - lanes::RISE, 0.0)
        - Vec3::Y * (down / 2.0 * lanes::RISE / lanes::RUN);
    commands.spawn((
        Mesh3d(meshes.add(Cuboid::new(long, 0.02, 2.0 * HALF_WIDTH))),
        MeshMaterial3d(ramp.clone()),
        Transform::from_translation(middle - Vec3::Z * HALF_WIDTH - normal * 0.01)
            .with_rotation(Quat::from_rotation_arc(Vec3::Y, normal)),
    ));
    commands.spawn((
        Mesh3d(meshes.add(Plane3d::default().mesh().size(14.0, 9.0))),
        MeshMaterial3d(look(tailwind::SLATE_700)),
        Transform::from_xyz(6.0, -0.005, 0.0),
    ));
    commands.spawn((
        DirectionalLight { illuminance: 6000.0, shadow_maps_enabled: true, ..default() },
        Transform::from_xyz(4.0, 8.0, 5.0).looking_at(Vec3::ZERO, Vec3::Y),
    ));
    commands.insert_resource(GlobalAmbientLight { brightness: 350.0, ..default() });
    commands.spawn(orbit_camera_at(Vec3::new(3.0, 0.9, 0.0), 10.0, 0.55));
}

/// Puts all four at the top.
fn start(
    mut commands: Commands,
    old: Query<Entity, With<Track>>,
    mut meshes: ResMut<Assets<Mesh>>,
    mut materials: ResMut<Assets<StandardMaterial>>,
    assets: Res<AssetServer>,
) {
    old.iter().for_each(|runner| commands.entity(runner).despawn());
    for (number, runner) in RUNNERS.into_iter().enumerate() {
        let half = runner.half_length();
        let capsule = Capsule3d { radius: RADIUS, half_length: half };
        let material = lanes::material();
        commands.spawn((
            Marble::new(RADIUS),
            HalfLength(half),
            Velocity::default(),
            ExternalForce::default(),
            SurfaceMaterial {
                restitution: material.restitution,
                friction: material.friction,
                ..default()
            },
            Track { runner: number, samples: Vec::new(), arrival: None },
            Transform::from_translation(runner.start().into())
                .with_rotation(Quat::from_rotation_x(std::f32::consts::FRAC_PI_2)),
            Mesh3d(meshes.add(capsule.mesh().longitudes(32).latitudes(16))),
            MeshMaterial3d(materials.add(StandardMaterial {
                base_color: COLOURS[number].into(),
                base_color_texture: Some(assets.load("textures/marble.png")),
                perceptual_roughness: 0.3,
                ..default()
            })),
        ));
    }
}

/// At the top all are pushed over the edge; from there on, the keys push.
fn push(
    keys: Res<ButtonInput<KeyCode>>,
    world: Res<TawWorld>,
    mut runners: Query<(&Transform, &Track, &mut ExternalForce)>,
) {
    let key = |key| f32::from(u8::from(keys.pressed(key)));
    let by_keys = Vec3::new(
        key(KeyCode::ArrowRight) - key(KeyCode::ArrowLeft),
        0.0,
        key(KeyCode::ArrowDown) - key(KeyCode::ArrowUp),
    );
    let Some(first) = world.marbles.id(0).and_then(|id| world.marbles.get(id).ok()) else { return };
    for (transform, track, mut force) in &mut runners {
        let mass = first.mass.of_capsule(RADIUS, RUNNERS[track.runner].half_length());
        let at_the_top = transform.translation.x < 0.2;
        let way = if at_the_top { by_keys + Vec3::X } else { by_keys };
        force.force = way * (PUSH * mass);
    }
}

fn record(time: Res<Time>, mut runners: Query<(&Transform, &Velocity, &mut Track)>) {
    for (transform, velocity, mut track) in &mut runners {
        let Vec3 { x, y, .. } = transform.translation;
        let before = track.samples.last().map_or(0.0, |sample| sample[0]);
        let seconds = before + time.delta_secs_f64();
        if track.arrival.is_none() {
            let sample = [x, y - RADIUS, velocity.length()].map(f64::from);
            track.samples.push([seconds, sample[0], sample[1], sample[2]]);
            track.arrival = (x >= END).then_some(seconds);
        }
    }
}

fn panel(mut contexts: EguiContexts, tracks: Query<&Track>) -> Result {
    let line = |track: &Track, x: usize, y: usize| {
        let points: Vec<_> = track.samples.iter().map(|sample| [sample[x], sample[y]]).collect();
        let [r, g, b, _] = COLOURS[track.runner].to_u8_array();
        Line::new(RUNNERS[track.runner].name(), points).color(egui::Color32::from_rgb(r, g, b))
    };
    egui::Window::new("Staircase and ramp").default_pos([10.0, 10.0]).show(
        contexts.ctx_mut()?,
        |ui| {
            for (title, x, y) in
                [("height over distance (m)", 1, 2), ("speed over time (m/s)", 0, 3)]
            {
                ui.label(title);
                Plot::new(title)
                    .height(170.0)
                    .width(330.0)
                    .legend(Legend::default())
                    .show(ui, |plot| tracks.iter().for_each(|track| plot.line(line(track, x, y))));
            }
            for track in &tracks {
                let name = RUNNERS[track.runner].name();
                let end = track.arrival.map_or("on its way".into(), |s| format!("{s:.2} s"));
                ui.label(format!("{name}: {end}"));
            }
            ui.weak("Arrow keys push, R starts anew");
        },
    );
    Ok(())
}

/// Results of a run, as Markdown.
fn table() -> String {
    let mut lines = vec![
        "| response | who, where | arrives | at | flies up to | touches down |".to_string(),
        "|---|---|---|---|---|---|".to_string(),
    ];
    for (name, response) in [
        ("displacement", Response::Displacement),
        ("impulse", Response::Impulse),
        ("penalty", Response::Penalty(ContactLaw::SpringDashpot)),
        ("event-driven", Response::EventDriven),
    ] {
        for runner in RUNNERS {
            let cells = match lanes::run(runner, response) {
                Ok(run) => {
                    let arrival = run.arrival.map_or("never | –".into(), |(time, speed)| {
                        format!("after {time:.2} s | {speed:.2} m/s")
                    });
                    format!("{arrival} | {:.3} m | {} times", run.highest, run.hops)
                }
                Err(_) => "balls only | – | – | –".into(),
            };
            lines.push(format!("| {name} | {} | {cells} |", runner.name()));
        }
    }
    lines.join("\n")
}
