//! **Machines**: a marble run of bodies and joints: a wheel, a gate, a bridge, a see-saw, a bucket, dominoes.
//!
//! `cargo run --example machines` (`-- --help` for options)
//!
//! Worth a look: each marble turns the wheel, pushes the gate open, crosses the bridge and tips the see-saw. The bucket
//! hangs on a hinge that breaks. Space fires the launcher at the dominoes; R builds all anew.

#[path = "games/paint.rs"]
mod paint;

use std::time::Duration;

use bevy::color::palettes::tailwind;
use bevy::ecs::system::SystemParam;
use bevy::input::common_conditions::input_just_pressed;
use bevy::prelude::*;
use bevy::time::common_conditions::on_timer;
use bevy_egui::{EguiContexts, EguiPlugin, EguiPrimaryContextPass, egui};
use bevy_taw::prelude::*;
use clap::Parser;
use paint::{Paint, Said, look};
use taw_examples::{ExamplePlugins, Picture};

const RADIUS: f32 = 0.12;
/// From front to back, of most parts. Two panes of glass are 10 cm farther apart.
const DEPTH: f32 = 0.5;
pub(crate) const LINKS: usize = 8;
/// Distance of the hinges of a link, in metres.
pub(crate) const LINK: f32 = 0.22;
pub(crate) const BRIDGE: [Vec3; 2] = [Vec3::new(-1.9, 2.55, 0.0), Vec3::new(-0.3, 1.95, 0.0)];

#[derive(Parser)]
struct Options {
    #[command(flatten)]
    picture: Picture,
}

/// Body or joint that R builds anew.
#[derive(Component, Clone, Copy, Debug, PartialEq)]
pub(crate) enum Part {
    Wheel,
    Gate,
    Link,
    SeeSaw,
    Bucket,
    Plunger,
    Domino,
    Joint,
}

/// Marbles dropped, and hinges broken.
#[derive(Resource, Default)]
pub(crate) struct Tally(pub(crate) u32, pub(crate) u32);

fn main() -> AppExit {
    App::new()
        .add_plugins(ExamplePlugins { title: "Machines", picture: Options::parse().picture })
        .add_plugins((EguiPlugin::default(), TawPlugins, plugin))
        .add_systems(EguiPrimaryContextPass, panel)
        .run()
}

/// The run without a window.
pub(crate) fn plugin(app: &mut App) {
    let build = || (clear, wheel_and_gate, bridge, see_saw, bucket, launcher, dominoes).chain();
    app.init_resource::<ButtonInput<KeyCode>>()
        .init_resource::<Said>()
        .init_resource::<Tally>()
        .add_systems(Startup, (stage, build()).chain())
        .add_systems(Update, (build().run_if(input_just_pressed(KeyCode::KeyR)), launch, show))
        .add_systems(FixedUpdate, drop_marble.run_if(on_timer(Duration::from_millis(1500))));
}

/// Commands that spawn what is drawn, too.
#[derive(SystemParam)]
struct Workshop<'w, 's> {
    commands: Commands<'w, 's>,
    paint: Paint<'w>,
}

impl Workshop<'_, '_> {
    /// Bar that nothing moves, turned about z.
    fn bar(&mut self, at: Vec3, length: f32, turn: f32) {
        let shape = Cuboid::new(length, 0.08, DEPTH + 0.1);
        let place = Transform::from_translation(at).with_rotation(Quat::from_rotation_z(turn));
        let drawn = self.paint.shape(shape, tailwind::SLATE_500);
        self.commands.spawn((Wall::from(shape), place, drawn));
    }

    /// Wooden body of boxes: of each, its size and place.
    fn body(&mut self, part: Part, at: Vec3, boxes: &[(Vec3, Vec3)], colour: Srgba) -> Entity {
        let (mut body, mut drawn) = (Body { parts: Vec::new() }, Vec::new());
        for &(size, at) in boxes {
            let shape = Cuboid::from_size(size);
            body = body.with_part(BodyShape::Cuboid(shape), at, Quat::IDENTITY);
            drawn.push((self.paint.shape(shape, colour), Transform::from_translation(at)));
        }
        let wood = (MarbleMass::Density(400.0), Transform::from_translation(at));
        let mut body = self.commands.spawn((part, body, wood, Visibility::default()));
        body.with_children(|parent| drawn.into_iter().for_each(|it| _ = parent.spawn(it)));
        body.id()
    }

    fn marble(&mut self, at: Vec3, colour: Srgba) {
        let drawn = self.paint.shape(Sphere::new(RADIUS), colour);
        let wood = (MarbleMass::Density(700.0), Transform::from_translation(at));
        let surface = SurfaceMaterial { restitution: 0.2, ..default() };
        self.commands.spawn((Marble::new(RADIUS), wood, surface, drawn));
    }

    fn joint(&mut self, joint: Joint) {
        self.commands.spawn((Part::Joint, joint));
    }
}

/// Rusty hinge between a place in the world and one in the frame of a body: its motor holds a speed of zero.
fn hinge(at: Vec3, body: Entity, anchor: Vec3, limits: Option<[f32; 2]>) -> Joint {
    let motor = Some(JointMotor::Speed { target: 0.0, max: 1.0 });
    let kind = JointKind::Hinge(JointDrive { limits, motor });
    Joint::new(kind, JointEnd::world(at), JointEnd::on(body, anchor))
}

/// Place in the plane of the run.
fn at(x: f32, y: f32) -> Vec3 {
    Vec3::new(x, y, 0.0)
}

/// Size of a box as deep as the run.
fn plank(length: f32, height: f32) -> Vec3 {
    Vec3::new(length, height, DEPTH)
}

fn stage(mut shop: Workshop) {
    look(&mut shop.commands, Vec3::new(-0.6, 3.0, 7.2), at(-0.6, 2.4));
    for (z, normal) in [(0.3, Dir3::NEG_Z), (-0.3, Dir3::Z)] {
        shop.commands.spawn((Wall::HalfSpace(normal), Transform::from_xyz(0.0, 0.0, z)));
    }
    shop.bar(at(0.0, -0.04), 9.0, 0.0);
    shop.bar(at(-4.1, 3.3), 0.7, 1.6);
    shop.bar(at(-3.0, 2.8), 2.2, -0.2);
    shop.bar(at(1.25, 1.0), 0.7, -0.2);
    shop.bar(at(-2.4, 0.86), 3.4, 0.0);
    shop.commands.spawn((Wall::from(Cuboid::new(9.0, 0.2, 0.6)), Sensor)).observe(drain);
}

fn drain(entered: On<SensorEntered>, marbles: Query<(), With<Marble>>, mut commands: Commands) {
    if marbles.contains(entered.collider) {
        commands.entity(entered.collider).despawn();
    }
}

fn clear(mut commands: Commands, parts: Query<Entity, Or<(With<Part>, With<Marble>)>>) {
    parts.iter().for_each(|part| commands.entity(part).despawn());
    commands.insert_resource(Tally::default());
}

fn wheel_and_gate(mut shop: Workshop) {
    let hub = at(-3.2, 3.9);
    let paddles = [(plank(1.2, 0.03), Vec3::ZERO), (plank(0.03, 1.2), Vec3::ZERO)];
    let wheel = shop.body(Part::Wheel, hub, &paddles, tailwind::AMBER_500);
    shop.joint(hinge(hub, wheel, Vec3::ZERO, None));
    // Hangs down, and opens to the right only.
    let (top, up, board) = (at(-2.15, 3.15), Vec3::Y * 0.2, (plank(0.03, 0.4), Vec3::ZERO));
    let gate = shop.body(Part::Gate, top - up, &[board], tailwind::ROSE_500);
    shop.joint(hinge(top, gate, up, Some([0.0, 1.5])));
}

/// Its links begin as a zigzag, so that all of their hinges fit.
fn bridge(mut shop: Workshop) {
    let ([first, last], reach) = (BRIDGE, Vec3::X * LINK / 2.0);
    let slope = Quat::from_rotation_arc(Vec3::X, (last - first).normalize());
    let fold = (first.distance(last) / (LINKS as f32 * LINK)).acos();
    let (hinge, board) = (JointKind::Hinge(default()), (plank(LINK - 0.03, 0.05), Vec3::ZERO));
    let (mut place, mut before) = (first, JointEnd::world(first));
    for i in 0..LINKS {
        let turn = slope * Quat::from_rotation_z(if i % 2 == 0 { -fold } else { fold });
        let link = shop.body(Part::Link, place, &[board], tailwind::ORANGE_300);
        let middle = Transform::from_translation(place + turn * reach).with_rotation(turn);
        let damping = MarbleDamping { linear: 1.0, angular: 1.0 };
        shop.commands.entity(link).insert((middle, damping));
        shop.joint(Joint::new(hinge, before, JointEnd::on(link, -reach)));
        place += turn * reach * 2.0;
        before = JointEnd::on(link, reach);
    }
    shop.joint(Joint::new(hinge, before, JointEnd::world(last)));
}

/// A weight under its left arm brings it back.
fn see_saw(mut shop: Workshop) {
    let pivot = at(0.0, 1.45);
    let boxes = [(plank(1.5, 0.04), Vec3::ZERO), (plank(0.1, 0.08), at(-0.65, -0.06))];
    let see_saw = shop.body(Part::SeeSaw, pivot, &boxes, tailwind::SKY_400);
    shop.joint(hinge(pivot, see_saw, Vec3::ZERO, Some([-0.3, 0.3])));
}

/// It hangs on a hinge that breaks under the blow of a marble sooner or later.
fn bucket(mut shop: Workshop) {
    let (top, up, side) = (at(2.1, 1.6), Vec3::Y * 0.9, plank(0.06, 0.4));
    let handle = (Vec3::new(0.06, 0.9, 0.02), Vec3::new(0.0, 0.45, -0.24));
    let sides = [(side, at(-0.37, 0.23)), (side, at(0.37, 0.23))];
    let boxes = [(plank(0.8, 0.06), Vec3::ZERO), sides[0], sides[1], handle];
    let bucket = shop.body(Part::Bucket, top - up, &boxes, tailwind::LIME_400);
    shop.joint(Joint { breaking_force: Some(3000.0), ..hinge(top, bucket, up, None) });
}

/// A plunger on a slider, which a spring drives, and a marble before it.
fn launcher(mut shop: Workshop) {
    let (place, boxes) = (at(-3.85, 1.02), [(Vec3::new(0.3, 0.2, 0.4), Vec3::ZERO)]);
    let plunger = shop.body(Part::Plunger, place, &boxes, tailwind::VIOLET_400);
    let (first, second) = (JointEnd::world(place), JointEnd::on(plunger, Vec3::ZERO));
    shop.joint(Joint::new(slider(0.0), first, second));
    shop.marble(at(-3.5, 0.9 + RADIUS), tailwind::SLATE_100);
}

fn slider(target: f32) -> JointKind {
    let spring = JointSpring { frequency: 2.0, damping_ratio: 0.3 };
    let motor = Some(JointMotor::Position { target, spring, max: 5000.0 });
    JointKind::Slider(JointDrive { limits: Some([0.0, 0.4]), motor })
}

fn dominoes(mut shop: Workshop) {
    let boxes = [(Vec3::new(0.06, 0.4, 0.3), Vec3::ZERO)];
    for i in 0..7 {
        shop.body(Part::Domino, at(-2.6 + 0.2 * i as f32, 1.1), &boxes, tailwind::RED_500);
    }
}

fn drop_marble(mut shop: Workshop, mut tally: ResMut<Tally>) {
    shop.marble(at(-2.9, 4.9), tailwind::BLUE_500);
    tally.0 += 1;
}

fn launch(keys: Res<ButtonInput<KeyCode>>, mut joints: Query<&mut Joint>) {
    let kind = slider(if keys.pressed(KeyCode::Space) { 0.4 } else { 0.0 });
    for joint in joints.iter_mut().filter(|it| matches!(it.kind, JointKind::Slider(_))) {
        joint.map_unchanged(|it| &mut it.kind).set_if_neq(kind);
    }
}

fn show(mut broken: MessageReader<JointBroken>, mut tally: ResMut<Tally>, mut said: ResMut<Said>) {
    tally.1 += broken.read().count() as u32;
    said.0 = format!("{} marbles, {} broken\nSpace: launch, R: build anew", tally.0, tally.1);
}

fn panel(mut contexts: EguiContexts, said: Res<Said>) -> Result {
    egui::Window::new("Machines").default_pos([960.0, 12.0]).show(contexts.ctx_mut()?, |ui| {
        ui.label(egui::RichText::new(&said.0).size(18.0));
    });
    Ok(())
}
