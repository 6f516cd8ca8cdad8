//! Which key does what, for keyboard, mouse and gamepad.

use bevy::prelude::*;
use bevy_egui::input::EguiWantsInput;
use bevy_panorbit_camera::PanOrbitCamera;
use leafwing_input_manager::plugin::InputManagerSystem;
use leafwing_input_manager::prelude::*;

/// Actions of the player.
#[derive(Actionlike, Clone, Copy, Debug, PartialEq, Eq, Hash, Reflect)]
pub enum Action {
    #[actionlike(DualAxis)]
    Tilt,
    /// Way of the mouse; only counts while [`Action::Grab`] is held.
    #[actionlike(DualAxis)]
    Drag,
    Grab,
    #[actionlike(DualAxis)]
    Orbit,
    DropMore,
    Flick,
    /// Shows what is under the mouse.
    Inspect,
    Reset,
    Pause,
    SingleStep,
    SlowMotion,
    Panels,
    Help,
}

/// All keys, as the help panel lists them.
pub const HELP: [(&str, &str); 11] = [
    ("Arrows, WASD, left drag, left stick", "tilt the board"),
    ("Right drag, right stick", "turn the view"),
    ("Middle drag · wheel", "move the view · zoom"),
    ("Space · A", "drop ten more marbles"),
    ("F", "flick the marble under the mouse"),
    ("I", "inspect the marble or wall under the mouse"),
    ("R · Select", "start over"),
    ("P · Start", "pause"),
    ("N", "one step while paused"),
    ("M", "slow motion"),
    ("Tab · F1", "panels · this help"),
];

fn bindings() -> InputMap<Action> {
    InputMap::default()
        .with_dual_axis(Action::Tilt, VirtualDPad::arrow_keys())
        .with_dual_axis(Action::Tilt, VirtualDPad::wasd())
        .with_dual_axis(Action::Tilt, GamepadStick::LEFT.with_circle_deadzone(0.1))
        .with_dual_axis(Action::Drag, MouseMove::default())
        .with(Action::Grab, MouseButton::Left)
        .with_dual_axis(Action::Orbit, GamepadStick::RIGHT.with_circle_deadzone(0.1))
        .with(Action::DropMore, KeyCode::Space)
        .with(Action::DropMore, GamepadButton::South)
        .with(Action::Flick, KeyCode::KeyF)
        .with(Action::Inspect, KeyCode::KeyI)
        .with(Action::Reset, KeyCode::KeyR)
        .with(Action::Reset, GamepadButton::Select)
        .with(Action::Pause, KeyCode::KeyP)
        .with(Action::Pause, GamepadButton::Start)
        .with(Action::SingleStep, KeyCode::KeyN)
        .with(Action::SlowMotion, KeyCode::KeyM)
        .with(Action::Panels, KeyCode::Tab)
        .with(Action::Help, KeyCode::F1)
}

/// Toward where the player tilts the board in world space (x and z), and how far:
/// at most 1 in length.
#[derive(Resource, Default, Deref)]
pub struct TiltInput(Vec2);

pub fn plugin(app: &mut App) {
    app.add_plugins(InputManagerPlugin::<Action>::default())
        .init_resource::<TiltInput>()
        .add_systems(Startup, |mut commands: Commands| {
            commands.spawn(bindings());
        })
        // Before any fixed step of this frame, for which leafwing keeps other records.
        .add_systems(
            PreUpdate,
            (read_tilt, orbit_by_stick).after(InputManagerSystem::ManualControl),
        );
}

/// A condition for systems: the player does this now, and no text field is typing.
pub fn just_pressed(
    action: Action,
) -> impl FnMut(Single<&ActionState<Action>>, Res<EguiWantsInput>) -> bool {
    move |actions, egui| actions.just_pressed(&action) && !egui.wants_any_keyboard_input()
}

/// Pixels of mouse movement for the whole tilt.
const DRAG_PIXELS: f32 = 150.0;

/// A drag that began on the board; it stays one wherever the mouse then goes.
#[derive(Default)]
enum Drag {
    #[default]
    None,
    OnBoard(Vec2),
    OnPanel,
}

fn read_tilt(
    mut tilt: ResMut<TiltInput>,
    actions: Single<&ActionState<Action>>,
    egui: Res<EguiWantsInput>,
    camera: Single<&GlobalTransform, With<Camera3d>>,
    mut drag: Local<Drag>,
) {
    if actions.just_pressed(&Action::Grab) {
        let on_panel = egui.wants_any_pointer_input();
        *drag = if on_panel { Drag::OnPanel } else { Drag::OnBoard(Vec2::ZERO) };
    } else if !actions.pressed(&Action::Grab) {
        *drag = Drag::None;
    }
    let mut wanted = Vec2::ZERO;
    if !egui.wants_any_keyboard_input() {
        wanted += actions.axis_pair(&Action::Tilt);
    }
    if let Drag::OnBoard(moved) = &mut *drag {
        let now = actions.axis_pair(&Action::Drag);
        *moved += Vec2::new(now.x, -now.y) / DRAG_PIXELS;
        *moved = moved.clamp_length_max(1.0);
        wanted += *moved;
    }
    tilt.0 = to_world(wanted.clamp_length_max(1.0), &camera);
}

/// Turns the player's right and up into the world's x and z, as seen through the
/// camera.
fn to_world(wanted: Vec2, camera: &GlobalTransform) -> Vec2 {
    let right = camera.right().xz().normalize_or(Vec2::X);
    let away = Vec2::new(right.y, -right.x);
    right * wanted.x + away * wanted.y
}

fn orbit_by_stick(
    actions: Single<&ActionState<Action>>,
    time: Res<Time<Real>>,
    mut camera: Single<&mut PanOrbitCamera>,
) {
    let stick = actions.axis_pair(&Action::Orbit) * 2.0 * time.delta_secs();
    if stick != Vec2::ZERO {
        camera.target_yaw -= stick.x;
        camera.target_pitch += stick.y;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bevy::input::InputPlugin;

    #[test]
    fn up_is_away_from_the_camera_wherever_it_is() {
        for angle in [0.0, 0.5, 2.0, 4.0] {
            let at = Quat::from_rotation_y(angle) * Vec3::new(0.0, 8.0, 10.0);
            let camera = Transform::from_translation(at).looking_at(Vec3::ZERO, Vec3::Y);
            let away = to_world(Vec2::Y, &camera.into());
            let toward = at.xz().normalize();
            assert!((away + toward).length() < 1e-6, "from {at}: {away}");
            assert!(to_world(Vec2::X, &camera.into()).dot(away).abs() < 1e-6);
        }
    }

    /// The controls alone, with a camera that looks along -Z.
    fn app() -> App {
        let mut app = App::new();
        app.add_plugins((MinimalPlugins, InputPlugin, plugin)).init_resource::<EguiWantsInput>();
        let camera = Transform::from_xyz(0.0, 5.0, 9.0).looking_at(Vec3::ZERO, Vec3::Y);
        app.world_mut().spawn((Camera3d::default(), GlobalTransform::from(camera)));
        app.update();
        app
    }

    fn tilt(app: &mut App) -> Vec2 {
        app.update();
        **app.world().resource::<TiltInput>()
    }

    #[test]
    fn keys_tilt_the_board_and_release_it() {
        let right_away = Vec2::new(1.0, -1.0).normalize();
        for (keys, toward) in [
            (&[KeyCode::ArrowRight][..], Vec2::X),
            (&[KeyCode::KeyA], Vec2::NEG_X),
            (&[KeyCode::KeyW], Vec2::NEG_Y),
            (&[KeyCode::ArrowDown], Vec2::Y),
            (&[KeyCode::KeyD, KeyCode::ArrowUp], right_away),
            (&[KeyCode::KeyD, KeyCode::ArrowRight], Vec2::X),
        ] {
            let mut app = app();
            for key in keys {
                key.press(app.world_mut());
            }
            let now = tilt(&mut app);
            assert!(now.distance(toward) < 1e-5, "{keys:?} tilt toward {now}");
            for key in keys {
                key.release(app.world_mut());
            }
            assert_eq!(tilt(&mut app), Vec2::ZERO, "{keys:?}");
        }
    }

    #[test]
    fn the_left_stick_tilts_as_far_as_it_is_pushed() {
        let mut app = app();
        let gamepad = app.world_mut().spawn(Gamepad::default()).id();
        let mut push = |x: f32, y: f32| {
            let stick = GamepadStick::LEFT;
            stick.set_axis_pair_as_gamepad(app.world_mut(), Vec2::new(x, y), Some(gamepad));
            tilt(&mut app)
        };
        assert!(push(1.0, 0.0).distance(Vec2::X) < 1e-5);
        let half = push(0.0, 0.55);
        assert!(half.distance(Vec2::new(0.0, -0.5)) < 1e-5, "beyond the dead zone: {half}");
        assert_eq!(push(0.05, 0.05), Vec2::ZERO, "in the dead zone");
    }

    #[test]
    fn a_drag_tilts_until_the_button_is_let_go() {
        let mut app = app();
        let drag = |app: &mut App, x: f32, y: f32| {
            MouseMove::default().set_axis_pair(app.world_mut(), Vec2::new(x, y));
            tilt(app)
        };
        assert_eq!(drag(&mut app, 90.0, 0.0), Vec2::ZERO, "no button is pressed");
        MouseButton::Left.press(app.world_mut());
        tilt(&mut app);
        let mut now = Vec2::ZERO;
        for _ in 0..5 {
            now = drag(&mut app, DRAG_PIXELS / 10.0, 0.0);
        }
        assert!(now.distance(Vec2::X * 0.5) < 1e-5, "{now}");
        let down = drag(&mut app, -DRAG_PIXELS / 2.0, DRAG_PIXELS);
        assert!(down.distance(Vec2::Y) < 1e-5, "toward the camera: {down}");
        MouseButton::Left.release(app.world_mut());
        assert_eq!(tilt(&mut app), Vec2::ZERO);
    }
}
