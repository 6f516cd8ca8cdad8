use bevy::core_pipeline::tonemapping::Tonemapping;
use bevy::prelude::*;
use bevy_egui::input::EguiWantsInput;
use bevy_panorbit_camera::{PanOrbitCamera, PanOrbitCameraPlugin};

/// Lets a camera made by [`orbit_camera`] be turned and moved by the mouse, unless
/// the mouse is over a panel. Needs `EguiPlugin`, added before it.
pub struct OrbitCameraPlugin;

impl Plugin for OrbitCameraPlugin {
    fn build(&self, app: &mut App) {
        app.add_plugins(PanOrbitCameraPlugin).add_systems(PreUpdate, yield_to_panels);
    }
}

/// A camera that looks at `focus` from `distance` metres away and orbits it: right
/// mouse button to turn, middle to move, wheel to zoom.
#[must_use]
pub fn orbit_camera(focus: Vec3, distance: f32) -> impl Bundle {
    orbit_camera_at(focus, distance, 0.95)
}

/// Orbiting camera as [`orbit_camera`], which looks down by `pitch` radians at first.
#[must_use]
pub fn orbit_camera_at(focus: Vec3, distance: f32, pitch: f32) -> impl Bundle {
    (
        Camera3d::default(),
        // The default needs a look-up table, which Bevy is built without here.
        Tonemapping::AcesFitted,
        PanOrbitCamera {
            focus,
            radius: Some(distance),
            yaw: Some(0.0),
            pitch: Some(pitch),
            pitch_lower_limit: Some(0.1),
            zoom_lower_limit: 2.0,
            zoom_upper_limit: Some(6.0 * distance),
            zoom_sensitivity: 0.5,
            button_orbit: MouseButton::Right,
            button_pan: MouseButton::Middle,
            use_real_time: true, // also while the game is paused
            ..default()
        },
    )
}

fn yield_to_panels(mut cameras: Query<&mut PanOrbitCamera>, egui: Res<EguiWantsInput>) {
    for mut camera in &mut cameras {
        camera.enabled = !egui.wants_any_pointer_input();
    }
}
