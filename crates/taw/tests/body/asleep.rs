//! Sleep in scenes that nobody chose: what sleeps would stay where it is if it were awake.

use super::random::{any_shape, unit};
use super::*;
use taw::body::ContactPartner;
use taw::broad::CollisionLayers;
use taw::swarm::Ball;
use taw::world::Marble;

struct Room {
    world: World<f32>,
    random: fastrand::Rng,
    seed: u64,
}

/// Half of the width of the room, in metres.
const HALF: f64 = 0.35;

impl Room {
    /// Room with bodies, marbles and balls of a swarm, which have fallen asleep.
    fn new(seed: u64) -> Self {
        let mut world = world::<f32>(true);
        for normal in [Vec3::unit_x(), Vec3::unit_z()] {
            for normal in [normal, -normal] {
                world.walls.insert(Plane::new(normal, -HALF as f32).unwrap()).unwrap();
            }
        }
        let mut room = Self { world, random: fastrand::Rng::with_seed(seed), seed };
        for _ in 0..room.random.u8(6..24) {
            room.insert();
        }
        run(&mut room.world, 8.0);
        room
    }

    fn place(&mut self) -> Point3<f32> {
        let mut across = || unit(&mut self.random, -0.7, 0.7) * HALF;
        let (x, z) = (across(), across());
        point(x, unit(&mut self.random, 0.1, 1.5), z)
    }

    fn insert(&mut self) {
        let at = self.place();
        let radius = unit(&mut self.random, 0.04, 0.15) as f32;
        match self.random.u8(0..5) {
            0 => drop(self.world.marbles.insert(Marble::new(at, radius)).unwrap()),
            1 => drop(self.world.swarm.insert(&[Ball::new(at, radius)]).unwrap()),
            _ => {
                let shape = any_shape(&mut self.random);
                self.world.bodies.insert(Body::new(shape, at)).unwrap();
            }
        }
    }

    /// Changes one thing from outside. Returns its name.
    fn disturb(&mut self) -> &'static str {
        let at = self.place();
        let bodies: Vec<_> = self.world.bodies.ids().collect();
        let body = self.random.choice(bodies);
        // Marbles and balls that bear a body.
        let bearing: Vec<_> = self.world.body_contacts().filter(|it| it.normal.y > 0.2).collect();
        let marbles = bearing.iter().filter_map(|contact| match contact.partner {
            ContactPartner::Marble(id) => Some(id),
            _ => None,
        });
        let marble = self.random.choice(marbles.collect::<Vec<_>>());
        let balls = bearing.iter().filter_map(|contact| match contact.partner {
            ContactPartner::Ball(id) => Some(id),
            _ => None,
        });
        let ball = self.random.choice(balls.collect::<Vec<_>>());
        // In no layer of things, but with all walls.
        let passes = CollisionLayers { memberships: 2, filters: 0 };
        match (self.random.u8(0..8), body, marble, ball) {
            (0, Some(body), ..) => drop(self.world.bodies.remove(body).unwrap()),
            (1, _, Some(marble), _) => drop(self.world.marbles.remove(marble).unwrap()),
            (2, .., Some(ball)) => self.world.swarm.remove(&[ball]).unwrap(),
            (3, Some(body), ..) => {
                let pose = self.world.bodies.pose(body).unwrap();
                let pose = taw::frame::Pose { translation: at.to_vec(), ..pose };
                self.world.bodies.set_pose(body, pose).unwrap();
            }
            (4, _, Some(marble), _) => self.world.marbles.set_position(marble, at).unwrap(),
            (5, _, Some(marble), _) => self.world.marbles.set_layers(marble, passes).unwrap(),
            (6, .., Some(ball)) => self.world.swarm.set_layers(&[ball], passes).unwrap(),
            _ => {
                self.insert();
                return "inserted";
            }
        }
        "removed, placed or let through"
    }

    /// Heights of all that sleeps, with names. What was put into another, and is wedged in its parts, is left out.
    fn sleepers(&self) -> Vec<(String, f32)> {
        let world = &self.world;
        let wedged: Vec<_> = world
            .body_contacts()
            .filter(|contact| contact.separation < -0.02)
            .flat_map(|contact| [format!("{:?}", contact.body), format!("{:?}", contact.partner)])
            .collect();
        let is_wedged = |name: &str| wedged.iter().any(|known| known.contains(name));
        let asleep = |id: &BodyId| world.bodies.is_asleep(*id).unwrap();
        let bodies = world.bodies.ids().filter(asleep);
        let bodies =
            bodies.map(|id| (format!("{id:?}"), world.bodies.pose(id).unwrap().translation.y));
        let marbles = (0..world.marbles.len()).filter_map(|row| {
            let id = world.marbles.id(row)?;
            let y = world.marbles.position()[row].y;
            world.is_asleep(id).unwrap().then(|| (format!("{id:?}"), y))
        });
        bodies.chain(marbles).filter(|(name, _)| !is_wedged(name)).collect()
    }
}

/// After something came, went or was placed elsewhere, and all fell asleep again, nothing falls when gravity changes by
/// a little, for which all wakes. (What tips or creeps from an unstable place does so later.)
#[test]
fn what_sleeps_would_stay_awake_where_it_is() {
    let scenes = std::env::var("SCENES").map_or(100, |n| n.parse().unwrap());
    let (mut asleep, mut fell) = (0, Vec::new());
    for seed in 0..scenes {
        let mut room = Room::new(seed);
        let what = room.disturb();
        run(&mut room.world, 5.0);
        let before = room.sleepers();
        asleep += before.len();
        room.world.set_gravity(vector(0.0, -9.8101, 0.0)).unwrap();
        step(&mut room.world);
        run(&mut room.world, 0.1);
        let world = &room.world;
        let bodies = world
            .bodies
            .ids()
            .map(|id| (format!("{id:?}"), world.bodies.pose(id).unwrap().translation.y));
        let marbles = (0..world.marbles.len()).filter_map(|row| {
            Some((format!("{:?}", world.marbles.id(row)?), world.marbles.position()[row].y))
        });
        for (name, y) in bodies.chain(marbles) {
            if let Some((_, height)) = before.iter().find(|(known, _)| *known == name)
                && height - y > 0.02
            {
                fell.push((room.seed, what, name, *height, y));
            }
        }
    }
    assert!(fell.is_empty(), "{} of {asleep} sleepers fell: {fell:#?}", fell.len());
    assert!(asleep > 2 * scenes as usize, "{asleep}");
}
