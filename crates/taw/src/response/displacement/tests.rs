use super::*;
use crate::broad::Period;
use crate::contact::Contact;
use crate::math::Point3;
use crate::response::impulse::{SolverSettings, SubstepStart};
use crate::shape::Plane;

impl<S: Scalar> Colliders<S> for Vec<Plane<S>> {
    fn normal_and_distance(&self, wall: usize, _: u32, point: Point3<S>) -> (Vec3<S>, S) {
        (self[wall].normal(), self[wall].signed_distance(point))
    }

    fn surface_velocity(&self, _: usize, _: Point3<S>, _: Vec3<S>) -> Vec3<S> {
        Vec3::zero()
    }
}

/// Solves one substep of `dt` seconds over all contacts among `spheres` (center, radius, velocity)
/// and a floor at zero, without gravity. Returns positions, velocities and quarantined rows.
fn restituted<S: Scalar>(
    spheres: &[(Point3<S>, S, Vec3<S>)],
    dt: S,
) -> (Vec<Point3<S>>, Vec<Vec3<S>>, Vec<u32>) {
    let floor = vec![Plane::new(Vec3::unit_y(), S::zero()).unwrap()];
    let mut position: Vec<_> = spheres.iter().map(|s| s.0).collect();
    let radius: Vec<_> = spheres.iter().map(|s| s.1).collect();
    let mut velocity: Vec<_> = spheres.iter().map(|s| s.2).collect();
    let count = spheres.len() as u32;
    let contact = Contact::between_marbles;
    let mut contacts = Contacts { wm: (0..count).map(|b| contact(0, b)).collect(), mm: vec![] };
    crate::broad::brute_force_pairs(count, |a, b| contacts.mm.push(contact(a, b)));
    let mut columns = SolverBodies {
        period: Period::default(),
        position: &mut position,
        velocity: &mut velocity,
        radius: &radius,
        inverse_mass: &[],
        spin: &mut [],
        rotation_locked: &[],
        locked_axes: &[],
        capsules: &[],
    };
    let zero = S::zero();
    let settings = SolverSettings {
        iterations: 8,
        dt,
        restitution_threshold: zero,
        tolerance: zero,
        slop: zero,
        max_relative_slop: zero,
        max_relative_push: zero,
        gravity: Vec3::zero(),
        threads: 1,
        resolve_jams: false,
    };
    let context = Context {
        walls: &floor,
        position_weight: |_| S::one(),
        start: SubstepStart { position: &[], velocity: &[], ccd_stops: &[] },
        settings: &settings,
    };
    let (mut scratch, mut cache, mut quarantined) =
        (DisplacementScratch::default(), vec![], vec![]);
    columns.place_contacts(&mut contacts, &floor);
    contacts.sort();
    solve_displacement(
        &mut columns,
        &mut contacts,
        &context,
        &mut scratch,
        &mut cache,
        &mut quarantined,
        |_, _, _| (),
    );
    (position, velocity, quarantined)
}

const STILL: Vec3<f64> = Vec3::new(0.0, 0.0, 0.0);

#[test]
fn a_wall_pushes_out_and_adds_the_displacement_per_step() {
    let (position, velocity, _) =
        restituted(&[(Point3::new(1.0, 0.25, 0.0), 0.5, Vec3::new(3.0, -2.0, 0.0))], 0.5);
    assert_eq!(position, [Point3::new(1.0, 0.5, 0.0)]);
    assert_eq!(velocity, [Vec3::new(3.0, -1.5, 0.0)], "0.25 m in 0.5 s");
}

#[test]
fn marbles_take_half_each() {
    // Each moved 0.5 m, so half a metre of penetration is older.
    let (position, velocity, _) = restituted(
        &[
            (Point3::new(0.0, 5.0, 0.0), 1.0, Vec3::new(0.25, 0.0, 0.0)),
            (Point3::new(1.5, 5.0, 0.0), 1.0, Vec3::new(-0.25, 0.0, 0.0)),
        ],
        0.5,
    );
    assert_eq!(position, [Point3::new(-0.25, 5.0, 0.0), Point3::new(1.75, 5.0, 0.0)]);
    assert_eq!(velocity, [STILL; 2]);
}

#[test]
fn what_overlaps_at_rest_parts_and_stays_at_rest() {
    let (position, velocity, _) = restituted(
        &[
            (Point3::new(0.0, 5.0, 0.0), 1.0, STILL),
            (Point3::new(1.5, 5.0, 0.0), 1.0, STILL),
            (Point3::new(9.0, -0.5, 0.0), 1.0, STILL),
        ],
        0.5,
    );
    assert_eq!((position[1].x - position[0].x, position[2].y), (2.0, 1.0));
    assert_eq!(velocity, [STILL; 3]);
}

#[test]
fn a_contact_that_an_earlier_one_settled_does_nothing() {
    // The first pushes the second out of contact with the third.
    let third = Point3::new(-0.6, 6.58, 0.0);
    let (position, velocity, _) = restituted(
        &[
            (Point3::new(0.0, 5.0, 0.0), 0.2, STILL),
            (Point3::new(0.6, 5.0, 0.0), 1.0, STILL),
            (third, 1.0, STILL),
        ],
        0.5,
    );
    assert!((position[1].x - 0.9).abs() < 1e-15);
    assert_eq!((position[2], velocity[2]), (third, STILL));
}

#[test]
fn coincident_marbles_part_completely_each_pair_its_own_way() {
    let at = |x| (Point3::new(x, 5.0, 0.0), 1.0, STILL);
    let (position, velocity, _) = restituted(&[at(0.0), at(0.0), at(9.0), at(9.0)], 0.5);
    let (first, second) = (position[1] - position[0], position[3] - position[2]);
    assert!((first.magnitude() - 2.0).abs() < 1e-12 && (second.magnitude() - 2.0).abs() < 1e-12);
    assert!((first - second).magnitude() > 0.1, "{first:?}, {second:?}");
    assert_eq!(velocity, [STILL; 4]);
}

#[test]
fn two_whose_speeds_overflow_disturb_no_other() {
    let fast = |y, vy| (Point3::new(0.0, y, 0.0), 1.0, Vec3::new(0.0, vy, 0.0));
    let low = (Point3::new(9.0, 0.5, 0.0), 1.0, Vec3::new(0.0, -0.25, 0.0));
    let (position, velocity, quarantined) =
        restituted(&[fast(5.0, f32::MAX), fast(6.0, f32::MIN), low], 2.0);
    assert_eq!(quarantined, [] as [u32; 0]);
    assert!(velocity.iter().all(|v| is_finite(*v)), "{velocity:?}");
    assert!(position.iter().all(|at| is_finite_point(*at)), "{position:?}");
    assert_eq!((position[2].y, velocity[2].y), (1.0, 0.0));
}
