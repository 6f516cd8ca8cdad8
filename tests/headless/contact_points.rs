//! Single contacts of the pairs that touch.

use bevy::ecs::message::Messages;
use bevy::prelude::*;
use bevy_taw::prelude::*;
use taw::response::ContactLaw;

use crate::scene;

/// App that sends single contacts, with this response.
fn listening_app(response: Response) -> App {
    let mut app = scene::app();
    app.insert_resource(TawModel(Model { response, ..Model::GAME })).add_message::<ContactPoint>();
    app
}

/// Contacts of the last step.
fn contacts(app: &App) -> Vec<ContactPoint> {
    let messages = app.world().resource::<Messages<ContactPoint>>();
    messages.iter_current_update_messages().copied().collect()
}

/// Weight of a marble, in N.
fn weight(app: &App, marble: Entity) -> f32 {
    let world = app.world().resource::<TawWorld>();
    let mut rows = 0..world.marbles.len();
    let row = rows.find(|row| world.marble_entity(*row as u32) == Some(marble));
    let marble = world.marbles.get(world.marbles.id(row.unwrap()).unwrap()).unwrap();
    let mass = marble.mass.of_capsule(marble.radius, marble.half_length);
    mass * 9.81
}

/// Capsule of three metres along x, this high above the floor.
fn lying_capsule(app: &mut App, height: f32) -> Entity {
    let lying = Quat::from_rotation_z(core::f32::consts::FRAC_PI_2);
    let at = Transform::from_xyz(0.0, 0.25 + height, 0.0).with_rotation(lying);
    app.world_mut().spawn((Marble::new(0.25), HalfLength(1.25), at)).id()
}

#[test]
fn a_capsule_on_its_side_has_two_contacts_that_bear_half_of_it_each() {
    for response in [Response::Impulse, Response::Penalty(ContactLaw::SpringDashpot)] {
        let mut app = listening_app(response);
        app.world_mut().resource_mut::<TawModel>().detection = Detection::Discrete;
        app.add_message::<ContactStarted>().add_message::<ContactEnded>();
        let floor = scene::floor(&mut app);
        let capsule = lying_capsule(&mut app, 0.0);
        let mut first = Vec::new();
        while first.is_empty() {
            app.update();
            first = contacts(&app);
        }
        assert_eq!(first.len(), 2, "{response:?}: {first:#?}");
        assert!(first.iter().all(|contact| contact.is_new), "{first:#?}");
        scene::frames(&mut app, 300);
        for asleep in [false, true] {
            scene::frames(&mut app, if asleep { 100 } else { 0 });
            let mut all = contacts(&app);
            all.sort_by(|p, q| p.point.x.total_cmp(&q.point.x));
            assert_eq!(all.len(), 2, "{response:?}: {all:#?}");
            for (contact, x) in all.iter().zip([-1.25, 1.25]) {
                assert_eq!(contact.pair, ContactPair { a: floor, b: capsule });
                assert!(contact.normal.distance(Vec3::Y) < 1e-3, "{response:?}: {contact:?}");
                assert!(contact.point.distance(Vec3::X * x) < 0.02, "{response:?}: {contact:?}");
                assert!(!contact.is_new && contact.approach_speed.abs() < 1e-2, "{contact:?}");
                let of_weight = contact.normal_impulse / (weight(&app, capsule) * scene::STEP);
                assert!((of_weight - 0.5).abs() < 0.02, "{response:?}: {of_weight}");
                let on = [floor, capsule].map(|it| contact.impulse_on(it));
                assert_eq!(on[0], -on[1]);
            }
        }
        let told = |app: &App| app.world().resource::<Messages<ContactEnded>>().len();
        assert_eq!(told(&app), 0, "{response:?}");
    }
}

/// A trough of two triangles each side, open upwards, of one mesh.
fn trough(app: &mut App) -> Entity {
    let corner = |x: f32, y: f32, z: f32| Vec3::new(x, y, z);
    let points = [-2.0, 2.0]
        .iter()
        .flat_map(|z| [corner(-2.0, 2.0, *z), corner(0.0, 0.0, *z), corner(2.0, 2.0, *z)])
        .collect();
    let triangles = vec![[0, 4, 1], [0, 3, 4], [1, 5, 2], [1, 4, 5]];
    app.world_mut().spawn(Wall::Mesh { points, triangles }).id()
}

#[test]
fn a_ball_in_the_v_of_one_mesh_has_a_contact_with_each_side() {
    for response in [Response::Impulse, Response::SoftStep, Response::Displacement] {
        let mut app = listening_app(response);
        app.add_message::<ContactOngoing>();
        let trough = trough(&mut app);
        let ball = scene::drop_marble(&mut app, 0.5, Vec3::new(0.0, 0.5 * 2.0_f32.sqrt(), 0.3));
        scene::frames(&mut app, 200);
        let mut all = contacts(&app);
        all.sort_by(|p, q| p.normal.x.total_cmp(&q.normal.x));
        assert_eq!(all.len(), 2, "{response:?}: {all:#?}");
        assert_ne!(all[0].part, all[1].part, "{all:#?}");
        let mut sum = Vec3::ZERO;
        for (contact, x) in all.iter().zip([-1.0, 1.0]) {
            assert_eq!(contact.pair, ContactPair { a: trough, b: ball });
            let normal = Vec3::new(x, 1.0, 0.0).normalize();
            assert!(contact.normal.distance(normal) < 1e-2, "{response:?}: {contact:?}");
            let at = scene::position(&app, ball) - normal * 0.5;
            assert!(contact.point.distance(at) < 1e-2, "{response:?}: {contact:?}");
            sum += contact.impulse_on(ball);
        }
        let messages = app.world().resource::<Messages<ContactOngoing>>();
        let ongoing = messages.iter_current_update_messages().next().copied().unwrap();
        assert!(all.iter().any(|it| it.normal.distance(ongoing.normal) < 1e-3), "{ongoing:?}");
        let expected = weight(&app, ball) * Vec3::Y;
        if response != Response::Displacement {
            assert!((sum / scene::STEP).distance(expected) < 0.03 * expected.y, "{sum}");
            assert!(ongoing.force.distance(expected) < 0.03 * expected.y, "{ongoing:?}");
        }
    }
}

/// The first contact of a ball that slides as it lands: its speeds, its impulse, and its friction.
#[test]
fn a_new_contact_says_how_fast_and_how_hard() {
    for response in [Response::Impulse, Response::SoftStep, Response::EventDriven] {
        let mut app = listening_app(response);
        let floor = scene::floor(&mut app);
        let ball = scene::drop_marble(&mut app, 0.5, Vec3::Y * 0.75);
        let smooth = SurfaceMaterial { restitution: 0.0, friction: 0.3, ..default() };
        app.world_mut().entity_mut(ball).insert((smooth, Velocity(Vec3::X * 8.0)));
        let mut all = Vec::new();
        while all.is_empty() {
            app.update();
            all = contacts(&app);
        }
        let case = format!("{response:?}: {all:#?}");
        assert_eq!(all.len(), 1, "{case}");
        let ContactPoint { pair, is_new, approach_speed, slip_speed, .. } = all[0];
        assert!(pair == ContactPair { a: floor, b: ball } && is_new, "{case}");
        let fall = (2.0 * 9.81 * 0.25_f32).sqrt();
        assert!((approach_speed - fall).abs() < 0.12 && (slip_speed - 8.0).abs() < 0.01, "{case}");
        // It slides: friction is the coefficient times the normal impulse, against the slip.
        let expected = weight(&app, ball) / 9.81 * approach_speed;
        assert!((all[0].normal_impulse / expected - 1.0).abs() < 0.1, "{expected} {case}");
        let friction = all[0].tangent_impulse;
        assert!(friction.x < 0.0 && friction.y.abs() < 1e-2 * friction.length(), "{case}");
        let coefficient = friction.length() / all[0].normal_impulse;
        assert!(coefficient > 0.25 && coefficient < 0.35, "{coefficient} {case}");
    }
}

/// One that stands hovers above the floor within rounding, as one that lies does.
#[test]
fn a_capsule_that_stands_touches_all_the_time() {
    for height in [0.25, 1.5] {
        let mut app = listening_app(Response::Impulse);
        app.world_mut().resource_mut::<TawModel>().rotation = Rotation::None;
        app.add_message::<ContactStarted>().add_message::<ContactEnded>();
        scene::floor(&mut app);
        let capsule = lying_capsule(&mut app, height - 0.25);
        let standing = Transform::from_xyz(0.0, height, 0.0);
        if height > 1.0 {
            app.world_mut().entity_mut(capsule).insert(standing);
        }
        let mut told = [0; 2];
        for _ in 0..100 {
            app.update();
            let started = app.world().resource::<Messages<ContactStarted>>();
            told[0] += started.iter_current_update_messages().count();
            let ended = app.world().resource::<Messages<ContactEnded>>();
            told[1] += ended.iter_current_update_messages().count();
        }
        assert_eq!(told, [1, 0], "{height} m");
    }
}

/// Observers see a contact as their entity does, and those of two marbles are swapped as a whole.
#[test]
fn observers_hear_each_contact_with_their_entity_first() {
    #[derive(Resource, Default)]
    struct Heard(Vec<ContactPoint>);
    let mut app = scene::app();
    app.insert_resource(TawModel(Model { response: Response::Impulse, ..Model::GAME }));
    app.init_resource::<Heard>();
    scene::floor(&mut app);
    let [below, above] = [0.0, 0.5].map(|height| lying_capsule(&mut app, height));
    app.add_observer(|contact: On<ContactPoint>, mut heard: ResMut<Heard>| {
        heard.0.push(*contact);
    });
    scene::frames(&mut app, 10);
    app.world_mut().resource_mut::<Heard>().0.clear();
    app.update();
    assert!(!app.world().contains_resource::<Messages<ContactPoint>>());
    let heard = &app.world().resource::<Heard>().0;
    let of = |a: Entity, b: Entity| -> Vec<_> {
        heard.iter().filter(|contact| contact.pair == ContactPair { a, b }).collect()
    };
    let [up, down] = [of(below, above), of(above, below)];
    assert!(up.len() == 2 && down.len() == 2, "{heard:#?}");
    for (up, down) in up.iter().zip(&down) {
        assert!(up.normal.y > 0.9 && up.normal == -down.normal, "{up:?}");
        assert_eq!(up.impulse_on(above), down.impulse_on(above));
        assert!(up.impulse_on(above).y > 0.0, "{up:?}");
    }
}

/// Impulses are recorded, and contacts kept, only while somebody reads them.
#[test]
fn nobody_reads_contacts_and_nothing_is_recorded() {
    let mut app = scene::app();
    scene::floor(&mut app);
    scene::drop_marble(&mut app, 0.5, Vec3::Y * 0.5);
    let records = |app: &App| app.world().resource::<TawWorld>().records_impulses();
    scene::frames(&mut app, 2);
    assert!(!records(&app));
    let observer = app.world_mut().add_observer(|_: On<ContactPoint>| ()).id();
    scene::frames(&mut app, 2);
    assert!(records(&app));
    app.world_mut().despawn(observer);
    scene::frames(&mut app, 2);
    assert!(!records(&app));
    assert!(!app.world().contains_resource::<Messages<ContactPoint>>());
}

#[test]
fn contacts_of_what_is_despawned_are_over_whoever_of_the_two_it_is() {
    for wall_goes in [true, false] {
        let mut app = listening_app(Response::SoftStep);
        app.add_message::<ContactEnded>();
        let floor = scene::floor(&mut app);
        let ball = scene::drop_marble(&mut app, 0.5, Vec3::Y * 0.5);
        scene::frames(&mut app, 100); // it sleeps
        assert_eq!(contacts(&app).len(), 1);
        app.world_mut().despawn(if wall_goes { floor } else { ball });
        app.update();
        assert_eq!(contacts(&app), []);
        let messages = app.world().resource::<Messages<ContactEnded>>();
        let ended: Vec<_> = messages.iter_current_update_messages().map(|it| it.pair).collect();
        assert_eq!(ended, [ContactPair { a: floor, b: ball }]);
    }
}
