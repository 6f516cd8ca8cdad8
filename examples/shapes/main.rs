//! **Shapes**: any two shapes, and all that the core says of them.
//!
//! `cargo run --example shapes` (`-- --help` for options)
//!
//! Worth a look: drag the orange shape with the left mouse button, turn it with Q, E and
//! the arrow keys. Yellow is the shortest way between the two, or out of each other; red
//! crosses are where they touch; the green ghost is where it would stop on its way along the
//! arrow. The panel chooses the two and has the numbers.

mod drawing;
mod gallery;

use bevy::color::palettes::tailwind;
use bevy::prelude::*;
use bevy_egui::input::EguiWantsInput;
use bevy_egui::{EguiContexts, EguiPlugin, EguiPrimaryContextPass, egui};
use bevy_taw::taw::contact::{ClosestPoints, RayCast};
use clap::{Parser, ValueEnum};
use drawing::draw;
use gallery::{Answers, Kind, Scene, ask, bevy_point, second, shape};
use taw_examples::{ExamplePlugins, OrbitCameraPlugin, Picture, Pointer, orbit_camera};

/// Look at any two shapes, and all that the core says of them
#[derive(Parser)]
struct Options {
    /// The blue one, which stays
    #[arg(long, value_enum, default_value_t = Kind::Box)]
    first: Kind,
    /// The orange one, which can be dragged and turned
    #[arg(long, value_enum, default_value_t = Kind::Hull)]
    second: Kind,
    #[command(flatten)]
    picture: Picture,
}

fn main() -> AppExit {
    let Options { first, second, picture } = Options::parse();
    App::new()
        .add_plugins(ExamplePlugins { title: "Shapes", picture })
        .add_plugins((EguiPlugin::default(), OrbitCameraPlugin))
        .insert_resource(ClearColor(tailwind::SLATE_900.into()))
        .insert_resource(Scene {
            kinds: [first, second],
            place: Transform::from_xyz(1.7, 0.9, 0.4).with_rotation(Quat::from_euler(
                EulerRot::YXZ,
                0.6,
                0.3,
                0.2,
            )),
            held: None,
            way: Vec3::new(-1.5, -1.2, 0.0),
        })
        .add_systems(Startup, |mut commands: Commands| {
            commands.spawn(orbit_camera(Vec3::ZERO, 7.0));
        })
        .add_systems(Update, (drag, turn, draw).chain())
        .add_systems(EguiPrimaryContextPass, panel)
        .run()
}

/// Takes hold of the second shape where the mouse points, by casting a ray on it.
fn drag(
    mut scene: ResMut<Scene>,
    buttons: Res<ButtonInput<MouseButton>>,
    egui: Res<EguiWantsInput>,
    pointer: Pointer,
) {
    let Some(ray) = pointer.ray().filter(|_| buttons.pressed(MouseButton::Left)) else {
        scene.held = None;
        return;
    };
    if buttons.just_pressed(MouseButton::Left) && !egui.wants_any_pointer_input() {
        let hit = second(&scene).and_then(|shape| shape.cast_ray(&ray, f32::INFINITY));
        scene.held = hit.map(|hit| (hit.distance, scene.place.translation - bevy_point(hit.point)));
    }
    if let Some((distance, offset)) = scene.held {
        scene.place.translation = bevy_point(ray.at(distance)) + offset;
    }
}

fn turn(mut scene: ResMut<Scene>, keys: Res<ButtonInput<KeyCode>>, time: Res<Time>) {
    let key = |key| f32::from(u8::from(keys.pressed(key)));
    let by = Vec3::new(
        key(KeyCode::ArrowDown) - key(KeyCode::ArrowUp),
        key(KeyCode::ArrowRight) - key(KeyCode::ArrowLeft),
        key(KeyCode::KeyQ) - key(KeyCode::KeyE),
    );
    let turn = Quat::from_scaled_axis(by * time.delta_secs() * 1.5);
    scene.place.rotation = (turn * scene.place.rotation).normalize();
}

fn panel(mut contexts: EguiContexts, mut scene: ResMut<Scene>) -> Result {
    let answers = ask(&scene);
    egui::Window::new("Shapes").default_pos([10.0, 10.0]).show(contexts.ctx_mut()?, |ui| {
        for (number, name) in ["First (blue)", "Second (orange)"].into_iter().enumerate() {
            let kind = &mut scene.kinds[number];
            egui::ComboBox::from_label(name).selected_text(format!("{kind:?}")).show_ui(ui, |ui| {
                for other in Kind::value_variants() {
                    if number == 0 || shape(*other).is_some() {
                        ui.selectable_value(kind, *other, format!("{other:?}"));
                    }
                }
            });
        }
        ui.horizontal(|ui| {
            ui.label("way");
            for axis in 0..3 {
                ui.add(egui::DragValue::new(&mut scene.way[axis]).speed(0.02).suffix(" m"));
            }
        });
        ui.separator();
        let Some(Answers { closest, touches, impact }) = answers else { return };
        if let Some(ClosestPoints { distance, normal, .. }) = closest {
            let what = if distance <= 0.0 { "overlap" } else { "distance" };
            ui.label(format!("{what}: {:.6} m", distance.abs()));
            ui.label(format!("normal: {:.4} {:.4} {:.4}", normal.x, normal.y, normal.z));
        }
        ui.label(format!("touch in {} points", touches.len()));
        for (_, distance, feature) in touches {
            ui.weak(format!("{distance:.6} m, feature {feature:#x}"));
        }
        ui.label(impact.map_or("its way is free".into(), |(time, ..)| {
            format!("stops after {time:.4} of its way")
        }));
        ui.separator();
        ui.weak("Drag the orange one; Q, E and the arrow keys turn it");
    });
    Ok(())
}
