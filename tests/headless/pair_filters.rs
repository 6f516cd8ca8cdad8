//! A game's own decision of each pair.

use bevy::ecs::system::SystemId;
use bevy::prelude::*;
use bevy_taw::prelude::*;

use crate::scene::{self, frames, position};

#[derive(Component, Clone, Copy, PartialEq)]
struct Team(u8);

/// Pairs of one team pass, and others collide.
fn meet_others(InMut(pairs): InMut<CandidatePairs>, teams: Query<&Team>) {
    let team = |entity| teams.get(entity).ok();
    pairs.retain(|pair| team(pair.a).is_none() || team(pair.a) != team(pair.b));
}

/// Models of every response.
fn models() -> [Model; 5] {
    let penalty = Response::Penalty(ContactLaw::SpringDashpot);
    let responses = [
        (Response::Displacement, 4),
        (Response::Impulse, 4),
        (penalty, 16),
        (Response::EventDriven, 1),
        (Response::SoftStep, 4),
    ];
    responses.map(|(response, substeps)| Model { response, substeps, ..Model::GAME })
}

fn app(model: Model) -> App {
    let mut app = scene::app();
    app.insert_resource(TawModel(model));
    let filter = PairFilter::new(app.world_mut(), meet_others);
    app.insert_resource(filter);
    app
}

/// A marble of a team falls through a slab of its own, and lands on one of another; also at 100 m/s, which
/// is through it within a step.
#[test]
fn a_marble_passes_the_walls_of_its_team_by_every_response() {
    for model in models() {
        for (speed, marble_is_marked) in [(0.0, true), (0.0, false), (100.0, true), (100.0, false)]
        {
            let mut app = app(model);
            let slab = |app: &mut App, y: f32, team: u8| {
                let slab = Wall::from(Cuboid::new(40.0, 0.2, 40.0));
                let at = Transform::from_xyz(0.0, y, 0.0);
                app.world_mut().spawn((slab, at, Team(team))).id()
            };
            let walls = [slab(&mut app, 0.0, 1), slab(&mut app, -3.0, 2)];
            let marble = scene::drop_marble(&mut app, 0.3, Vec3::Y * 2.0);
            let dull = SurfaceMaterial { restitution: 0.0, ..default() };
            let falls = (Team(1), Velocity(Vec3::NEG_Y * speed), dull);
            app.world_mut().entity_mut(marble).insert(falls);
            for entity in if marble_is_marked { vec![marble] } else { walls.to_vec() } {
                app.world_mut().entity_mut(entity).insert(FilterPairs);
            }
            frames(&mut app, 100);
            let y = position(&app, marble).y;
            let case = format!("{:?}, {speed} m/s, {marble_is_marked}: {y}", model.response);
            assert!((y + 2.6).abs() < 0.1, "{case}");
            // It changes sides, asleep, and falls on.
            app.world_mut().entity_mut(marble).insert(Team(2));
            frames(&mut app, 30);
            assert!(position(&app, marble).y < -3.3, "{case}");
        }
    }
}

/// Of three in a row, the one in the middle is of the team of the first, which passes through it.
#[test]
fn marbles_of_one_team_pass_through_each_other_by_every_response() {
    for model in models() {
        let mut app = app(model);
        app.insert_resource(Gravity(Vec3::ZERO));
        let [first, middle, last] = [(0.0, 1), (2.0, 1), (4.0, 2)].map(|(x, team)| {
            let marble = scene::drop_marble(&mut app, 0.5, Vec3::X * x);
            app.world_mut().entity_mut(marble).insert(Team(team));
            marble
        });
        app.world_mut().entity_mut(first).insert((FilterPairs, Velocity(Vec3::X * 8.0)));
        frames(&mut app, 60);
        let x = [first, middle, last].map(|marble| position(&app, marble).x);
        let case = format!("{:?}: {x:?}", model.response);
        assert!(x[1] == 2.0, "{case}");
        assert!(x[0] > 2.5 && x[2] > 5.0, "{case}");
    }
}

/// The filter is asked of pairs of which one is marked and the layers interact, once each, in order.
#[test]
fn a_filter_is_asked_of_pairs_with_a_marked_one() {
    #[derive(Resource, Default)]
    struct Asked(Vec<ContactPair>);
    fn note(InMut(pairs): InMut<CandidatePairs>, mut asked: ResMut<Asked>) {
        asked.0 = pairs.as_slice().to_vec();
    }
    let mut app = scene::app();
    let filter = PairFilter::new(app.world_mut(), note);
    app.insert_resource(filter).init_resource::<Asked>();
    let [far, floor] = [-9.0, -5.0]
        .map(|y| app.world_mut().spawn((Wall::default(), Transform::from_xyz(0.0, y, 0.0))).id());
    let sensor = Wall::from(Sphere::new(1.0));
    app.world_mut().spawn((sensor, Sensor, FilterPairs));
    let marbles: [_; 4] =
        core::array::from_fn(|i| scene::drop_marble(&mut app, 0.5, Vec3::X * 3.0 * i as f32));
    let mark = |app: &mut App, entity: Entity| {
        app.world_mut().entity_mut(entity).insert(FilterPairs);
        app.update();
        app.world().resource::<Asked>().0.clone()
    };
    app.update();
    assert_eq!(app.world().resource::<Asked>().0, []);
    app.world_mut().entity_mut(marbles[3]).insert(CollisionLayers::NONE);
    let pair = |a: Entity, b: Entity| ContactPair { a, b };
    let [m0, m1, m2, _] = marbles;
    let sorted = |mut pairs: Vec<ContactPair>| {
        pairs.sort_unstable();
        pairs
    };
    let of = |x: Entity, y: Entity| pair(x.min(y), x.max(y));
    let mut expected = vec![pair(far, m0), pair(floor, m0), of(m0, m1), of(m0, m2)];
    assert_eq!(mark(&mut app, m0), sorted(expected.clone()));
    expected.extend([pair(far, m1), pair(floor, m1), of(m1, m2)]);
    assert_eq!(mark(&mut app, m1), sorted(expected.clone()));
    expected.push(pair(floor, m2));
    assert_eq!(mark(&mut app, floor), sorted(expected));
}

/// Without a filter, with one that is gone, and without marks all collide; the app goes on and says why.
#[test]
fn a_filter_that_cannot_be_run_is_refused_once_and_pairs_collide() {
    let mut app = scene::app();
    app.insert_resource(TawModel(Model::GAME));
    let floor = scene::floor(&mut app);
    let marble = scene::drop_marble(&mut app, 0.5, Vec3::Y * 0.5);
    app.world_mut().entity_mut(floor).insert((FilterPairs, Team(1)));
    app.world_mut().entity_mut(marble).insert(Team(1));
    frames(&mut app, 2);
    let name = "FilterPairs without a PairFilter";
    assert!(app.world().resource::<IgnoredComponents>().contains(&name));
    let nobody: SystemId<InMut<CandidatePairs>> = SystemId::from_entity(marble);
    app.insert_resource(PairFilter(nobody));
    let mut told = Vec::new();
    for _ in 0..20 {
        app.update();
        let refused = app.world().resource::<Messages<InputRefused>>();
        told.extend(refused.iter_current_update_messages().map(|it| it.error));
    }
    assert_eq!(told, [Refusal::PairFilter(marble)]);
    assert!(!app.world().resource::<IgnoredComponents>().contains(&name));
    assert!(position(&app, marble).y > 0.49);
    let filter = PairFilter::new(app.world_mut(), meet_others);
    app.insert_resource(filter);
    frames(&mut app, 20);
    assert!(position(&app, marble).y < 0.4);
    app.world_mut().get_mut::<Transform>(marble).unwrap().translation.y = 0.5;
    app.world_mut().entity_mut(floor).remove::<FilterPairs>();
    frames(&mut app, 60);
    assert!(position(&app, marble).y > 0.4);
}
