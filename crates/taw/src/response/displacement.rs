use crate::contact::{Contacts, mtv_sphere_sphere};
use crate::math::{Scalar, Vec3, is_finite, is_finite_point};
use crate::response::{Columns, Walls};
use crate::shape::Sphere;

/// [`Response::Displacement`](super::Response::Displacement), exactly as taught in the
/// lecture: the readable reference for the rest. The lab counts velocity in units per
/// frame; here it is metres per second, so the change is displacement / dt.
///
/// The contacts' rows exist. A row that would become infinite or NaN keeps its place,
/// loses its velocity, and is added to `stopped`; the other half of its contact is not
/// affected. `by_walls` hears by how much a wall changed a velocity.
pub(crate) fn displacement<S: Scalar>(
    walls: &impl Walls<S>,
    marbles: &mut Columns<S>,
    contacts: &mut Contacts<S>,
    dt: S,
    stopped: &mut Vec<u32>,
    mut by_walls: impl FnMut(u32, Vec3<S>),
) {
    contacts.sort();
    for contact in &contacts.wm {
        let Sphere { center, radius } = marbles.sphere(contact.b, contact.along[1]);
        let (wall, part) = (contact.a as usize, contact.part);
        let (normal, distance) = walls.normal_and_distance(wall, part, center);
        if distance <= radius {
            let by = normal * (radius - distance);
            marbles.displace(contact.b, by, dt, stopped);
            by_walls(contact.b, by / dt);
        }
    }
    let half = S::constant(0.5);
    for contact in &contacts.mm {
        let (a, b) = (
            marbles.sphere(contact.a, contact.along[0]),
            marbles.sphere(contact.b, contact.along[1]),
        );
        if let Some(mtv) = mtv_sphere_sphere(&a, &b) {
            marbles.displace(contact.a, mtv * -half, dt, stopped);
            marbles.displace(contact.b, mtv * half, dt, stopped);
        }
    }
}

impl<S: Scalar> Columns<'_, S> {
    /// The part of a marble that a contact is about.
    fn sphere(&self, row: u32, along: S) -> Sphere<S> {
        let row = row as usize;
        Sphere { center: self.position[row] + self.offset(row, along), radius: self.radius[row] }
    }

    fn displace(&mut self, row: u32, by: Vec3<S>, dt: S, stopped: &mut Vec<u32>) {
        let index = row as usize;
        let position = self.position[index] + by;
        let velocity = self.velocity[index] + by / dt;
        if is_finite_point(position) && is_finite(velocity) {
            self.position[index] = position;
            self.velocity[index] = velocity;
        } else {
            self.velocity[index] = Vec3::new(S::zero(), S::zero(), S::zero());
            stopped.push(row);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::Contact;
    use crate::math::Point3;
    use crate::response::Material;
    use crate::shape::Plane;

    impl<S: Scalar> Walls<S> for Vec<Plane<S>> {
        fn normal_and_distance(&self, wall: usize, _: u32, point: Point3<S>) -> (Vec3<S>, S) {
            (self[wall].normal(), self[wall].signed_distance(point))
        }

        fn surface_velocity(&self, _: usize, _: Point3<S>) -> Vec3<S> {
            Vec3::new(S::zero(), S::zero(), S::zero())
        }

        fn material(&self, _: usize) -> Option<Material<S>> {
            None
        }
    }

    /// Runs one restitution over all contacts among `spheres` (center, radius,
    /// velocity) and a floor at zero, and gives positions and velocities.
    fn restituted(spheres: &[(Point3<f64>, f64, Vec3<f64>)]) -> (Vec<Point3<f64>>, Vec<Vec3<f64>>) {
        let floor = Plane::new(Vec3::unit_y(), 0.0).unwrap();
        let mut position: Vec<_> = spheres.iter().map(|s| s.0).collect();
        let radius: Vec<_> = spheres.iter().map(|s| s.1).collect();
        let mut velocity: Vec<_> = spheres.iter().map(|s| s.2).collect();
        let mut contacts = Contacts::default();
        let all = Vec3::new(9.0, 9.0, 9.0); // only the order depends on it
        let count = spheres.len() as u32;
        contacts.wm =
            (0..count).map(|b| Contact { a: 0, b, part: 0, along: [0.0; 2], mtv: all }).collect();
        crate::broad::all_pairs(count, |a, b| {
            contacts.mm.push(Contact { a, b, part: 0, along: [0.0; 2], mtv: all });
        });
        let mut stopped = Vec::new();
        let mut columns = Columns {
            position: &mut position,
            velocity: &mut velocity,
            radius: &radius,
            inverse_mass: &[],
            spin: &mut [],
            held: &[],
            rods: &[],
        };
        displacement(&vec![floor], &mut columns, &mut contacts, 0.5, &mut stopped, |_, _| ());
        assert_eq!(stopped, []);
        (position, velocity)
    }

    #[test]
    fn a_wall_pushes_out_and_adds_the_displacement_per_step() {
        let (position, velocity) =
            restituted(&[(Point3::new(1.0, 0.25, 0.0), 0.5, Vec3::new(3.0, -2.0, 0.0))]);
        assert_eq!(position, [Point3::new(1.0, 0.5, 0.0)]);
        assert_eq!(velocity, [Vec3::new(3.0, -1.5, 0.0)], "0.25 m in 0.5 s");
    }

    #[test]
    fn marbles_take_half_each() {
        let still = Vec3::new(0.0, 0.0, 0.0);
        let (position, velocity) = restituted(&[
            (Point3::new(0.0, 5.0, 0.0), 1.0, still),
            (Point3::new(1.5, 5.0, 0.0), 1.0, still),
        ]);
        assert_eq!(position, [Point3::new(-0.25, 5.0, 0.0), Point3::new(1.75, 5.0, 0.0)]);
        assert_eq!(velocity, [Vec3::new(-0.5, 0.0, 0.0), Vec3::new(0.5, 0.0, 0.0)]);
    }

    #[test]
    fn a_contact_that_an_earlier_one_settled_does_nothing() {
        // The first pushes the second out of reach of the third, which it touched.
        let still = Vec3::new(0.0, 0.0, 0.0);
        let third = Point3::new(-0.6, 6.58, 0.0);
        let (position, velocity) = restituted(&[
            (Point3::new(0.0, 5.0, 0.0), 0.2, still),
            (Point3::new(0.6, 5.0, 0.0), 1.0, still),
            (third, 1.0, still),
        ]);
        assert!((position[1].x - 0.9).abs() < 1e-15);
        assert_eq!((position[2], velocity[2]), (third, still));
    }

    #[test]
    fn coincident_marbles_part_completely() {
        let still = Vec3::new(0.0, 0.0, 0.0);
        let at = Point3::new(0.0, 5.0, 0.0);
        let (position, _) = restituted(&[(at, 1.0, still), (at, 1.0, still)]);
        assert_eq!(position[1].x - position[0].x, 2.0);
    }

    #[test]
    fn what_would_become_infinite_is_stopped_and_named() {
        let floor = Plane::new(Vec3::unit_y(), 0.0_f32).unwrap();
        let mut position = [Point3::new(0.0, 0.0, 0.0), Point3::new(0.0, 0.5, 0.0)];
        let mut velocity = [Vec3::new(7.0, f32::MAX, 0.0), Vec3::new(0.0, 0.0, 0.0)];
        let wm = [0, 1]
            .map(|b| Contact { a: 0, b, part: 0, along: [0.0; 2], mtv: Vec3::unit_y() })
            .to_vec();
        let mut contacts = Contacts { wm, mm: vec![] };
        let mut stopped = Vec::new();
        let mut columns = Columns {
            position: &mut position,
            velocity: &mut velocity,
            radius: &[1.0, 1.0],
            inverse_mass: &[],
            spin: &mut [],
            held: &[],
            rods: &[],
        };
        // 1 m in 1e-33 s is 1e33 m/s, more than the gap below f32::MAX.
        displacement(&vec![floor], &mut columns, &mut contacts, 1e-33, &mut stopped, |_, _| ());
        assert_eq!(stopped, [0]);
        assert_eq!((position[0].y, velocity[0]), (0.0, Vec3::new(0.0, 0.0, 0.0)));
        assert_eq!(position[1].y, 1.0, "the other one is restituted as ever");
    }
}
