//! Contact messages.

use bevy::ecs::message::Messages;
use bevy::prelude::*;
use bevy_taw::prelude::*;

use crate::scene;

/// What was told, in order: the step, the kind, the pair.
#[derive(Resource, Default)]
struct Told(Vec<(char, Entity, Entity)>);

fn listen(
    mut told: ResMut<Told>,
    mut started: MessageReader<ContactStarted>,
    mut ongoing: MessageReader<ContactOngoing>,
    mut ended: MessageReader<ContactEnded>,
) {
    let mut tell = |kind, pair: ContactPair| told.0.push((kind, pair.a, pair.b));
    started.read().for_each(|m| tell('s', m.pair));
    ongoing.read().for_each(|m| tell('o', m.pair));
    ended.read().for_each(|m| tell('e', m.pair));
}

fn listening_app() -> App {
    let mut app = scene::app();
    app.init_resource::<Told>()
        .add_message::<ContactStarted>()
        .add_message::<ContactOngoing>()
        .add_message::<ContactEnded>()
        .add_systems(FixedUpdate, listen.after(TawSystems::Scatter));
    app
}

fn told(app: &mut App) -> Vec<(char, Entity, Entity)> {
    std::mem::take(&mut app.world_mut().resource_mut::<Told>().0)
}

#[test]
fn a_contact_starts_goes_on_and_ends_once_a_step() {
    let mut app = listening_app();
    app.world_mut().resource_mut::<TawModel>().substeps = 5;
    let floor = scene::floor(&mut app);
    let marble = scene::drop_marble(&mut app, 0.5, Vec3::Y * 0.5);
    scene::frames(&mut app, 3);
    assert_eq!(told(&mut app), [('s', floor, marble), ('o', floor, marble), ('o', floor, marble)]);
    app.world_mut().get_mut::<Transform>(marble).unwrap().translation.y = 9.0;
    scene::frames(&mut app, 2);
    assert_eq!(told(&mut app), [('e', floor, marble)]);
}

#[test]
fn a_start_says_how_hard_and_where_from() {
    let mut app = scene::app();
    app.add_message::<ContactStarted>().insert_resource(Gravity(Vec3::ZERO));
    let left = scene::drop_marble(&mut app, 0.5, Vec3::ZERO);
    let right = scene::drop_marble(&mut app, 0.5, Vec3::X * 1.05);
    app.world_mut().entity_mut(left).insert(Velocity(Vec3::X * 8.0));
    app.update();
    let messages = app.world().resource::<Messages<ContactStarted>>();
    let started: Vec<_> = messages.iter_current_update_messages().collect();
    assert_eq!(started.len(), 1);
    let pair = started[0].pair;
    assert_eq!((pair.other(left), pair.other(right)), (Some(right), Some(left)));
    let toward_right = if pair.a == left { Vec3::X } else { Vec3::NEG_X };
    assert_eq!((started[0].normal, started[0].approach_speed), (toward_right, 8.0));
}

#[test]
fn a_fall_is_heard_at_its_speed_by_every_response() {
    let responses =
        [Response::Displacement, Response::Impulse, Response::EventDriven, Response::SoftStep];
    for response in responses {
        for tenths in 5..25_u8 {
            let mut app = scene::app();
            app.add_message::<ContactStarted>();
            app.world_mut().resource_mut::<TawModel>().response = response;
            scene::floor(&mut app);
            let height = f32::from(tenths) / 10.0;
            scene::drop_marble(&mut app, 0.2, Vec3::Y * (0.2 + height));
            let mut heard = None;
            for _ in 0..64 {
                app.update();
                let messages = app.world().resource::<Messages<ContactStarted>>();
                heard = heard.or(messages.iter_current_update_messages().next().copied());
            }
            let heard = heard.expect("it fell for a second");
            let exact = (2.0 * 9.81 * height).sqrt();
            // Semi-implicit Euler is slower by g h / 2 at the same height, and it is heard
            // at the end of the step, which adds up to g h.
            let off = heard.approach_speed - exact;
            assert!(off.abs() < 0.51 * 9.81 * scene::STEP, "{response:?}, {height} m: {off}");
            assert_eq!(heard.normal, Vec3::Y);
        }
    }
}

#[test]
fn a_despawned_marble_ends_its_contacts() {
    let mut app = listening_app();
    let floor = scene::floor(&mut app);
    let below = scene::drop_marble(&mut app, 0.5, Vec3::Y * 0.5);
    let above = scene::drop_marble(&mut app, 0.5, Vec3::Y * 1.5);
    scene::frames(&mut app, 5);
    told(&mut app);
    app.world_mut().despawn(below);
    app.update();
    let mut ended = told(&mut app);
    ended.sort_unstable();
    let (low, high) = (below.min(above), below.max(above));
    let mut expected = [('e', floor, below), ('e', low, high)];
    expected.sort_unstable();
    assert_eq!(ended, expected);
}

#[test]
fn contacts_of_what_rests_do_not_flicker() {
    // Where gravity moves a marble by less than a fiftieth of its radius in a step,
    // and where it moves it by a quarter. (There, higher piles really do jump.)
    for (radius, layers) in [(0.5, 4), (0.01, 2)] {
        let mut app = listening_app();
        scene::floor(&mut app);
        for layer in 0..layers {
            let height = radius * (1.0 + 2.0 * f32::from(layer as u8));
            scene::drop_marble(&mut app, radius, Vec3::Y * height);
        }
        scene::frames(&mut app, 100);
        let all = told(&mut app);
        let count = |kind| all.iter().filter(|told| told.0 == kind).count();
        assert_eq!((count('s'), count('e')), (layers, 0), "radius {radius}");
        assert!(count('o') > 95 * layers, "radius {radius}: {} ongoing", count('o'));
    }
}

#[test]
fn nobody_listens_and_nothing_is_written() {
    let mut app = scene::app();
    scene::floor(&mut app);
    scene::drop_marble(&mut app, 0.5, Vec3::Y * 0.5);
    scene::frames(&mut app, 5);
    assert!(!app.world().resource::<TawWorld>().contacts.wm.is_empty());
    assert!(!app.world().contains_resource::<Messages<ContactStarted>>());
    assert!(!app.world().contains_resource::<Messages<ContactOngoing>>());
}

#[test]
fn a_system_between_the_verbs_can_take_contacts_out() {
    let mut app = listening_app();
    let ghosts = |mut world: ResMut<TawWorld>| world.contacts.wm.clear();
    app.add_systems(
        Substep,
        ghosts.after(TawSystems::GenerateContacts).before(TawSystems::Restitute),
    );
    scene::floor(&mut app);
    let marble = scene::drop_marble(&mut app, 0.5, Vec3::Y * 0.5);
    scene::frames(&mut app, 60);
    assert!(scene::position(&app, marble).y < -3.0);
    assert_eq!(told(&mut app), []);
}
