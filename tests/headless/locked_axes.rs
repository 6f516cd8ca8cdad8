//! The component `LockedAxes`, by each response, changed while running.

use bevy::prelude::*;
use bevy_taw::prelude::*;
use bevy_taw::taw;

use crate::scene;

/// Responses that obey locks.
const RESPONSES: [Response; 4] = [
    Response::SoftStep,
    Response::Impulse,
    Response::Penalty(ContactLaw::SpringDashpot),
    Response::Displacement,
];

fn app(response: Response) -> App {
    let mut app = scene::app();
    let substeps = if matches!(response, Response::Penalty(_)) { 16 } else { 4 };
    app.insert_resource(TawModel(Model { response, substeps, ..Model::GAME }));
    app
}

/// A table with pins and one wall, and no glass: it is tilted out of its plane, too.
#[test]
fn twenty_balls_of_a_pinball_in_a_plane_stay_in_it_to_the_bit() {
    for response in RESPONSES {
        let mut app = app(response);
        app.insert_resource(Gravity(Vec3::new(0.5, -6.0, 3.0)));
        for (normal, at) in
            [(Dir3::X, -2.0), (Dir3::NEG_X, 2.0), (Dir3::Y, -2.0), (Dir3::NEG_Y, 3.5)]
        {
            let at = Transform::from_translation(normal.abs() * at);
            app.world_mut().spawn((Wall::HalfSpace(normal), at));
        }
        for i in 0..12_u8 {
            let [x, y] = [i % 4, i / 4].map(f32::from);
            let at = Transform::from_xyz(x - 1.5 + 0.4 * (y % 2.0), y - 1.0, 0.02);
            app.world_mut().spawn((Wall::from(Sphere::new(0.15)), at));
        }
        let place = |i: u8| {
            let [x, y] = [i % 5, i / 5].map(f32::from);
            Vec3::new(0.7 * x - 1.4 + 0.03 * y, 1.6 + 0.35 * y, 0.01 * x)
        };
        let marbles: Vec<_> = (0..20)
            .map(|i| {
                let marble = scene::drop_marble(&mut app, 0.12, place(i));
                app.world_mut().entity_mut(marble).insert(LockedAxes::PLANE_XY);
                marble
            })
            .collect();
        scene::frames(&mut app, 20 * 64);
        for (i, marble) in (0..).zip(marbles) {
            let at = scene::position(&app, marble);
            assert_eq!(at.z.to_bits(), place(i).z.to_bits(), "{response:?}");
            let is_inside = at.x.abs() < 2.0 && at.y > -2.0 && at.y < 3.5;
            assert!(is_inside && at.y < place(i).y, "{response:?}: {at}");
        }
    }
}

#[test]
fn locks_come_and_go_with_the_component() {
    for response in RESPONSES {
        let mut app = app(response);
        let marble = scene::drop_marble(&mut app, 0.5, Vec3::Y * 10.0);
        app.world_mut().entity_mut(marble).insert((LockedAxes::TRANSLATION_Y, Velocity(Vec3::ONE)));
        scene::frames(&mut app, 64);
        let at = scene::position(&app, marble);
        assert!(at.y == 10.0 && at.x > 0.9, "{response:?}: {at}");
        let velocity = **app.world().get::<Velocity>(marble).unwrap();
        assert_eq!(velocity, Vec3::new(1.0, 0.0, 1.0), "{response:?}: what is locked is zero");
        app.world_mut().get_mut::<Transform>(marble).unwrap().translation.y = 12.0;
        scene::frames(&mut app, 64);
        assert_eq!(scene::position(&app, marble).y, 12.0, "{response:?}: a teleport counts");
        *app.world_mut().get_mut::<LockedAxes>(marble).unwrap() = LockedAxes::TRANSLATION_X;
        let before = scene::position(&app, marble);
        scene::frames(&mut app, 32);
        let after = scene::position(&app, marble);
        assert!(after.x == before.x && after.y < 11.5, "{response:?}: {before} {after}");
        app.world_mut().entity_mut(marble).remove::<LockedAxes>();
        app.world_mut().entity_mut(marble).insert(Velocity(Vec3::X));
        scene::frames(&mut app, 32);
        assert!(scene::position(&app, marble).x > after.x + 0.4, "{response:?}");
    }
}

#[test]
fn a_sleeping_marble_wakes_when_its_lock_goes() {
    let mut app = app(Response::SoftStep);
    scene::floor(&mut app);
    app.insert_resource(Gravity(Vec3::new(0.0, -9.81, 3.0)));
    let marble = scene::drop_marble(&mut app, 0.5, Vec3::Y * 0.5);
    app.world_mut().entity_mut(marble).insert(LockedAxes::PLANE_XY);
    scene::frames(&mut app, 300);
    assert!(app.world().get::<Sleeping>(marble).is_some());
    app.world_mut().entity_mut(marble).remove::<LockedAxes>();
    scene::frames(&mut app, 60);
    assert!(scene::position(&app, marble).z > 0.1);
}

#[test]
fn the_event_driven_response_refuses_a_locked_marble_by_name_and_steps_the_others() {
    let mut app = app(Response::EventDriven);
    let free = scene::drop_marble(&mut app, 0.5, Vec3::Y * 5.0);
    let locked = scene::drop_marble(&mut app, 0.5, Vec3::new(3.0, 5.0, 0.0));
    app.world_mut().entity_mut(locked).insert(LockedAxes::ROTATION);
    app.update();
    let messages = app.world().resource::<Messages<InputRefused>>();
    let refused: Vec<_> = messages.iter_current_update_messages().copied().collect();
    let error = taw::Error::Unsupported { response: "EventDriven", feature: "locked axes" };
    assert_eq!(refused, [InputRefused { entity: Some(locked), error: error.into() }]);
    scene::frames(&mut app, 30);
    assert!(scene::position(&app, free).y < 4.5);
    assert_eq!(scene::position(&app, locked).y, 5.0);
    // By another response it is a marble again.
    app.insert_resource(TawModel(Model::GAME));
    scene::frames(&mut app, 30);
    assert!(scene::position(&app, locked).y < 4.5);
}

#[test]
fn locked_axes_of_a_wall_are_named() {
    let mut app = app(Response::SoftStep);
    let floor = scene::floor(&mut app);
    app.world_mut().entity_mut(floor).insert(LockedAxes::PLANE_XY);
    scene::frames(&mut app, 2);
    let ignored = app.world().resource::<IgnoredComponents>().to_vec();
    assert_eq!(ignored, ["LockedAxes of a wall"]);
}

#[test]
fn the_component_has_the_axes_of_the_core() {
    use taw::motion::LockedAxes as Core;
    let pairs = [
        (LockedAxes::NONE, Core::NONE),
        (
            LockedAxes::TRANSLATION_X | LockedAxes::ROTATION_Y,
            Core::TRANSLATION_X | Core::ROTATION_Y,
        ),
        (LockedAxes::TRANSLATION, Core::TRANSLATION),
        (LockedAxes::ROTATION, Core::ROTATION),
        (LockedAxes::ALL, Core::ALL),
        (LockedAxes::PLANE_XY, Core::PLANE_XY),
        (LockedAxes::PLANE_YZ, Core::PLANE_YZ),
        (LockedAxes::PLANE_ZX, Core::PLANE_ZX),
    ];
    for (axes, core) in pairs {
        assert_eq!(Core::from(axes), core, "{axes:?}");
    }
}
