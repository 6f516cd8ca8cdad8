//! Contacts as data: geometry that the narrow phase fills in, impulses that the response adds, and
//! edits between the verbs that count.

use std::collections::HashSet;

use crate::draw::Draw;
use cgmath::{EuclideanSpace, InnerSpace, MetricSpace};
use taw::contact::{ContactMaterial, Elasticity};
use taw::prelude::*;
use taw::swarm::{SimdLevel, SwarmModel};

const DT: f64 = 1.0 / 64.0;

/// A floor, and a response with friction.
fn world<S: Scalar>(response: Response) -> World<S> {
    let mut world = World::default();
    let model = Model { response, rotation: Rotation::Dynamic, iterations: 50, ..Model::default() };
    world.set_model(model).unwrap();
    world.walls.insert(Plane::new(Vec3::unit_y(), S::zero()).unwrap()).unwrap();
    world
}

fn ball<S: Scalar>(at: [f64; 3], radius: f64) -> Marble<S> {
    Marble::new(Point3::from(at.map(S::from_f64)), S::from_f64(radius))
}

/// Mass of a ball of the default density, in kg.
fn mass<S: Scalar>(world: &World<S>, row: usize) -> S {
    let radius = world.marbles.radius()[row];
    radius * radius * radius * S::from_f64(2500.0 * 4.0 / 3.0 * std::f64::consts::PI)
}

/// One substep by its verbs, so that the contacts can be looked at in between.
fn substep<S: Scalar>(world: &mut World<S>, edit: impl FnOnce(&mut World<S>)) {
    let dt = S::from_f64(DT);
    world.begin_step();
    world.integrate(dt).unwrap();
    world.generate_contacts();
    edit(world);
    world.restitute(dt).unwrap();
    world.end_step();
}

const SOLVED: [Response; 3] = [
    Response::Impulse,
    Response::Penalty(ContactLaw::SpringDashpot),
    Response::Penalty(ContactLaw::HertzMindlin),
];

const LISTED: [Response; 4] = [Response::Displacement, SOLVED[0], SOLVED[1], SOLVED[2]];

fn places_contacts<S: Scalar>(response: Response) {
    let mut world = world::<S>(response);
    world
        .walls
        .insert(Sphere::new(Point3::new(S::from_f64(5.0), S::zero(), S::zero()), S::one()).unwrap())
        .unwrap();
    for (at, radius) in [([0.0, 0.49, 0.0], 0.5), ([0.0, 1.2, 0.3], 0.3), ([5.0, 1.3, 0.6], 0.5)] {
        world.marbles.insert(ball(at, radius)).unwrap();
    }
    world.generate_contacts();
    assert_eq!((world.contacts.wm.len(), world.contacts.mm.len()), (2, 1), "{response:?}");
    let near = |x: S, y: S| (x - y).abs() <= S::epsilon() * S::from_f64(64.0);
    for contact in &world.contacts.wm {
        let center = world.marbles.position()[contact.b as usize];
        let on_marble = center + contact.arms[1];
        let wall = world.walls.shapes()[contact.a as usize].project_point(center);
        assert!(near(contact.normal.magnitude(), S::one()), "{contact:?}");
        let distance = on_marble.distance(wall.point);
        assert!(near(distance, contact.separation.abs()), "{response:?} {contact:?}");
    }
    for contact in &world.contacts.mm {
        let [a, b] = [contact.a, contact.b].map(|row| world.marbles.position()[row as usize]);
        let apart = (b + contact.arms[1]) - (a + contact.arms[0]);
        assert!(near(apart.dot(contact.normal), contact.separation), "{response:?} {contact:?}");
        assert!(near(contact.mtv().magnitude(), contact.penetration()));
    }
}

#[test]
fn surfaces_lie_as_far_apart_at_the_arms_as_the_separation_says() {
    for response in LISTED {
        places_contacts::<f32>(response);
        places_contacts::<f64>(response);
    }
}

fn change_of_momentum_is_the_impulses<S: Scalar>(response: Response) {
    let mut world = world::<S>(response);
    let number = S::from_f64;
    // Three that slide and press on each other, of unlike masses.
    for (at, radius, vx) in [
        ([0.0, 0.495, 0.0], 0.5, 2.0),
        ([0.85, 0.395, 0.1], 0.4, -1.0),
        ([0.3, 1.2, 0.1], 0.4, 0.0),
    ] {
        let mut marble = ball(at, radius);
        marble.velocity = Vec3::new(number(vx), number(-1.0), S::zero());
        world.marbles.insert(marble).unwrap();
    }
    let (mut before, mut most) = (Vec::new(), S::zero());
    substep(&mut world, |world| before = world.marbles.velocity().to_vec());
    for (row, before) in before.iter().enumerate() {
        let (velocity, mass) = (world.marbles.velocity()[row], mass(&world, row));
        let mut impulse = Vec3::new(S::zero(), S::zero(), S::zero());
        for contact in &world.contacts.wm {
            impulse +=
                contact.impulse() * if contact.b as usize == row { S::one() } else { S::zero() };
        }
        for contact in &world.contacts.mm {
            let side = |at: u32| if at as usize == row { S::one() } else { S::zero() };
            impulse += contact.impulse() * (side(contact.b) - side(contact.a));
        }
        most = most.max(impulse.magnitude());
        let gap = ((velocity - *before) * mass - impulse).magnitude();
        let digits = S::epsilon() * number(1e3) * mass;
        assert!(gap <= digits, "{response:?} {row}: {gap:?} of {digits:?}");
    }
    assert!(most > S::zero(), "nothing touched by {response:?}");
}

#[test]
fn listed_impulses_are_the_change_of_momentum() {
    for response in SOLVED {
        change_of_momentum_is_the_impulses::<f32>(response);
        change_of_momentum_is_the_impulses::<f64>(response);
    }
}

#[test]
fn friction_is_at_most_the_coefficient_times_the_normal_impulse() {
    for response in SOLVED {
        let mut world = world::<f64>(response);
        let mut marble = ball([0.0, 0.499, 0.0], 0.5);
        marble.velocity = Vec3::new(3.0, 0.0, 1.0);
        marble.material = Some(Material { friction: 0.2, ..Material::default() });
        world.marbles.insert(marble).unwrap();
        for _ in 0..8 {
            substep(&mut world, |_| ());
            for contact in &world.contacts.wm {
                let (normal, tangent) = (contact.normal_impulse, contact.tangent_impulse);
                assert!(
                    normal >= 0.0 && tangent.dot(contact.normal).abs() < 1e-9 * normal.max(1.0)
                );
                assert!(tangent.magnitude() <= 0.2 * normal * (1.0 + 1e-9), "{response:?}");
            }
        }
    }
}

#[test]
fn a_resting_marble_is_borne_by_its_weight_times_the_substep() {
    let mut world = world::<f64>(Response::Impulse);
    let id = world.marbles.insert(ball([0.0, 0.5, 0.0], 0.5)).unwrap();
    for _ in 0..64 {
        substep(&mut world, |_| ());
    }
    let row = world.marbles.row(id).unwrap();
    let weight = mass(&world, row) * 9.81 * DT;
    let impulse = world.contacts.wm[0].normal_impulse;
    assert!((impulse / weight - 1.0).abs() < 1e-9, "{impulse} for {weight}");
}

#[test]
fn a_normal_edited_between_the_verbs_is_the_one_that_solves() {
    for response in LISTED {
        let mut world = world::<f64>(response);
        let mut marble = ball([0.0, 0.49, 0.0], 0.5);
        marble.velocity = Vec3::new(0.0, -1.0, 0.0);
        let id = world.marbles.insert(marble).unwrap();
        // A ramp that nobody sees.
        let ramp = Vec3::new(0.6, 0.8, 0.0);
        substep(&mut world, |world| world.contacts.wm[0].normal = ramp);
        let velocity = world.marbles.get(id).unwrap().velocity;
        assert!(velocity.x > 0.01, "{response:?}: {velocity:?}");
    }
}

/// Velocity and spin of a marble that comes down at a slant, after a substep in which its contact, or that
/// with another marble, is edited; and of another one that comes down far from it.
fn edited_bounce(
    response: Response,
    on_marble: bool,
    edit: impl Fn(&mut ContactMaterial<f64>),
) -> [[Vec3<f64>; 2]; 2] {
    let mut world = world::<f64>(response);
    let ids = [0.0, 20.0].map(|x| {
        let height = if on_marble {
            let below = Marble { mass: Mass::Infinite, ..ball([x, 0.5, 0.0], 0.5) };
            world.marbles.insert(below).unwrap();
            1.0
        } else {
            0.0
        };
        let mut marble = ball([x, height + 0.499, 0.0], 0.5);
        marble.velocity = Vec3::new(1.0, -2.0, 0.0);
        let material = Material { rolling_resistance: 0.1, ..Material::default() };
        marble.material = Some(Material { spinning_resistance: 0.1, ..material });
        world.marbles.insert(marble).unwrap()
    });
    let row = world.marbles.row(ids[0]).unwrap() as u32;
    // By springs, a bounce takes several.
    for _ in 0..20 {
        substep(&mut world, |world| {
            let Contacts { wm, mm } = &mut world.contacts;
            for contact in wm.iter_mut().chain(mm).filter(|contact| contact.b == row) {
                edit(&mut contact.material);
            }
        });
    }
    ids.map(|id| world.marbles.get(id).unwrap()).map(|it| [it.velocity, it.angular_velocity])
}

#[test]
fn a_contact_edited_to_ice_has_no_friction() {
    for response in SOLVED {
        for on_marble in [false, true] {
            let [[velocity, spin], rough] =
                edited_bounce(response, on_marble, |material| material.friction = 0.0);
            let case = format!("{response:?}, {on_marble}");
            assert!(spin.magnitude() < 1e-9, "{case}: {spin:?}");
            assert!(rough[1].magnitude() > 0.1, "the other one turns by friction, {case}");
            assert!(on_marble || (velocity.x - 1.0).abs() < 1e-9, "{case}: {velocity:?}");
        }
    }
}

#[test]
fn a_contact_edited_to_clay_does_not_bounce() {
    for response in SOLVED {
        let rebound = |restitution: f64| {
            let mut world = world::<f64>(response);
            let mut marble = ball([0.0, 0.499, 0.0], 0.5);
            marble.velocity = Vec3::new(0.0, -2.0, 0.0);
            let id = world.marbles.insert(marble).unwrap();
            let fastest = (0..20).map(|_| {
                substep(&mut world, |world| {
                    world.contacts.wm.iter_mut().for_each(|c| c.material.restitution = restitution);
                });
                world.marbles.get(id).unwrap().velocity.y
            });
            fastest.fold(f64::NEG_INFINITY, f64::max)
        };
        let [clay, rubber] = [0.0, 1.0].map(rebound);
        assert!(clay < 0.1 && rubber > 1.5, "{response:?}: {clay} and {rubber} m/s");
    }
}

#[test]
fn a_contact_edited_to_a_compliance_is_as_soft_as_a_marble_that_has_it() {
    let elasticity = Elasticity { youngs_modulus: 1e6, poissons_ratio: 0.3 };
    let soft = Material { elasticity, ..Material::default() };
    let fall = |material: Option<Material<f64>>, edit: &dyn Fn(&mut Contact<f64>)| {
        let mut world = world::<f64>(Response::Penalty(ContactLaw::HertzMindlin));
        let velocity = Vec3::new(1.0, -1.0, 0.0);
        let marble = Marble { velocity, material, ..ball([0.0, 0.5, 0.0], 0.5) };
        let id = world.marbles.insert(marble).unwrap();
        for _ in 0..100 {
            world.begin_step();
            world.integrate(1e-3).unwrap();
            world.generate_contacts();
            world.contacts.wm.iter_mut().for_each(edit);
            world.restitute(1e-3).unwrap();
            world.end_step();
        }
        world.marbles.get(id).unwrap().position
    };
    let compliance = soft.on_wall(None).compliance;
    let edited = fall(None, &|contact| contact.material.compliance = compliance);
    assert_eq!(edited, fall(Some(soft), &|_| ()));
    assert_ne!(edited, fall(None, &|_| ()));
}

/// Each number of a material, to be edited.
const NUMBERS: [fn(&mut ContactMaterial<f64>) -> &mut f64; 7] = [
    |material| &mut material.restitution,
    |material| &mut material.friction,
    |material| &mut material.tangential_restitution,
    |material| &mut material.rolling_resistance,
    |material| &mut material.spinning_resistance,
    |material| &mut material.compliance.normal,
    |material| &mut material.compliance.tangent,
];

#[test]
fn an_edited_number_out_of_its_range_counts_as_the_nearest_one_in_it() {
    const ENDS: [[f64; 2]; 7] = [
        [0.0, 1.0],
        [0.0, f64::MAX],
        [-1.0, 1.0],
        [0.0, f64::MAX],
        [0.0, f64::MAX],
        [f64::MIN_POSITIVE, f64::MAX],
        [f64::MIN_POSITIVE, f64::MAX],
    ];
    for response in SOLVED {
        let alone = edited_bounce(response, false, |_| ())[1];
        let mut read = 0;
        for (number, [low, high]) in NUMBERS.into_iter().zip(ENDS) {
            let with = |x: f64| edited_bounce(response, false, |material| *number(material) = x);
            let ([lowest, _], [highest, _]) = (with(low), with(high));
            read += u32::from(lowest != highest);
            for (nonsense, nearest) in [
                (f64::NAN, lowest),
                (f64::NEG_INFINITY, lowest),
                (-7.0, lowest),
                (f64::INFINITY, highest),
            ] {
                let [edited, other] = with(nonsense);
                assert_eq!(edited, nearest, "{response:?}: {nonsense} as in [{low}, {high}]");
                assert_eq!(other, alone, "{response:?}: {nonsense}");
            }
        }
        assert!(read >= 3, "{response:?} reads {read} numbers");
    }
}

#[test]
fn listed_materials_are_those_of_both_bodies() {
    for response in [Response::SoftStep, Response::EventDriven].into_iter().chain(LISTED) {
        let mut world = world::<f64>(response);
        let of = |friction: f64| Material { friction, ..Material::default() };
        for (x, friction) in [(0.0, None), (0.95, Some(0.9))] {
            let mut marble = ball([x, 0.5, 0.0], 0.5);
            marble.material = friction.map(of);
            world.marbles.insert(marble).unwrap();
        }
        let list = |world: &mut World<f64>| {
            world.begin_step();
            world.integrate(DT).unwrap();
            world.generate_contacts();
            let Contacts { wm, mm } = &mut world.contacts;
            wm.sort_by_key(|contact| contact.b);
            wm.iter().chain(&*mm).map(|contact| contact.material).collect::<Vec<_>>()
        };
        let (plain, own) = (Material::default(), of(0.9));
        let pair = own.combined_with(plain);
        let alone = [plain.on_wall(None), own.on_wall(None), pair];
        assert_eq!(list(&mut world.clone()), alone, "{response:?}");
        let (floor, of_floor) = (world.walls.id(0).unwrap(), of(0.1));
        world.walls.set_material(floor, Some(of_floor)).unwrap();
        let on_floor = [plain, own].map(|of| of.on_wall(Some(of_floor)));
        assert_eq!(list(&mut world), [on_floor[0], on_floor[1], pair], "{response:?}");
    }
}

#[test]
fn a_contact_that_is_not_touching_says_so() {
    let mut world = world::<f64>(Response::Impulse);
    for (at, touches) in [(0.499, true), (0.5, true), (0.5 + 1e-6, true), (0.5 + 1e-5, false)] {
        let id = world.marbles.insert(ball([0.0, at, 0.0], 0.5)).unwrap();
        world.integrate(DT).unwrap(); // for the margin
        world.marbles.set_position(id, Point3::new(0.0, at, 0.0)).unwrap();
        world.generate_contacts();
        assert_eq!(world.contacts.wm.len(), 1, "{at}");
        assert_eq!(world.contacts.wm[0].is_touching(), touches, "{at}");
        world.marbles.remove(id).unwrap();
    }
}

/// Marbles that fly about and overlap, at rest and fast.
fn cloud<S: Scalar>(count: u32) -> World<S> {
    let mut draw = Draw(count.into());
    let mut world = World::default();
    world.set_model(Model { substeps: 1, ..Model::GAME }).unwrap();
    world.walls.insert(Plane::new(Vec3::unit_y(), S::from_f64(-2.0)).unwrap()).unwrap();
    for _ in 0..count {
        let mut vector =
            |most: f64| Vec3::new(0, 0, 0).map(|_: i32| S::from_f64(draw.between(-most, most)));
        let (at, velocity) = (Point3::from_vec(vector(2.0)), vector(3.0));
        let velocity = if at.x > S::zero() { velocity } else { velocity * S::from_f64(0.01) };
        let marble = Marble { velocity, ..Marble::new(at, S::from_f64(draw.between(0.05, 0.2))) };
        world.marbles.insert(marble).unwrap();
    }
    world
}

/// Checks that all pairs that touch or may do so within the step are listed, whoever looks for them, and
/// no others.
#[test]
fn soft_step_lists_the_pairs_that_are_near() {
    lists_the_pairs_that_are_near::<f32>();
    lists_the_pairs_that_are_near::<f64>();
}

fn lists_the_pairs_that_are_near<S: Scalar>() {
    let dt = S::from_f64(DT);
    for count in [300, 1_000, 3_000] {
        let mut world = cloud::<S>(count);
        let mut portable = world.clone();
        portable.swarm.set_simd_level(SimdLevel::PORTABLE);
        let model = SwarmModel { threads: 3, ..portable.swarm.model() };
        portable.swarm.set_model(model).unwrap();
        for world in [&mut world, &mut portable] {
            world.begin_step();
            world.integrate(dt).unwrap();
            world.generate_contacts();
        }
        assert_eq!(world.contacts, portable.contacts, "{count} marbles");
        let listed: HashSet<_> = world.contacts.mm.iter().map(|c| (c.a, c.b)).collect();
        assert_eq!(listed.len(), world.contacts.mm.len(), "each once");
        let (at, velocity) = (world.marbles.position(), world.marbles.velocity());
        let radius = world.marbles.radius();
        let mut near = 0;
        for b in 0..at.len() {
            for a in 0..b {
                let apart = (at[b] - at[a]).cast::<f64>().unwrap();
                let separation = apart.magnitude() - radius[a].as_f64() - radius[b].as_f64();
                let speed = (velocity[a] - velocity[b]).cast::<f64>().unwrap().dot(apart);
                let closes = (speed / apart.magnitude()).max(0.0) * DT;
                let beyond = separation - 2.0 * 9.81 * DT * DT - closes;
                let is_listed = listed.contains(&(a as u32, b as u32));
                assert!(beyond.abs() < 1e-5 || is_listed == (beyond < 0.0), "{a} {b}: {beyond}");
                near += u32::from(is_listed);
            }
        }
        assert!(near > count / 20, "{near} of {count} are near");
        world.restitute(dt).unwrap();
    }
}
