//! Frames and the forms of a rotation, against each other.

use cgmath::num_traits::FloatConst;
use cgmath::{MetricSpace, Transform};
use proptest::prelude::*;
use taw::frame::{
    AxisAngle, Line, LookAt, Motor, Pose, Rotor, YawPitchRoll, matrix_of_rotation,
    rotation_of_matrix, slerp,
};
use taw::math::Quat;
use taw::prelude::*;

/// Any rotation, and often one that is nearly none, a half turn, or about one axis.
fn rotation() -> impl Strategy<Value = Quat<f64>> {
    let part = || {
        prop_oneof![
            3 => -1.0..1.0_f64,
            1 => Just(0.0),
            1 => -1e-9..1e-9_f64,
            1 => -1e-30..1e-30_f64,
            1 => Just(std::f64::consts::FRAC_1_SQRT_2),
        ]
    };
    let parts = [part(), part(), part(), part()];
    let is_some = |q: &[f64; 4]| q.iter().map(|x| x * x).sum::<f64>() > 1e-4;
    parts
        .prop_filter("a direction", is_some)
        .prop_map(|[s, x, y, z]| Quat::new(s, x, y, z).normalize())
}

fn cast<S: Scalar>(q: Quat<f64>) -> Quat<S> {
    Quat::new(S::from_f64(q.s), S::from_f64(q.v.x), S::from_f64(q.v.y), S::from_f64(q.v.z))
        .normalize()
}

/// Distance of two rotations, in epsilons of the scalar: as components, one of which
/// may have all signs turned.
fn apart<S: Scalar>(a: Quat<S>, b: Quat<S>) -> f64 {
    let b = if a.dot(b) < S::zero() { -b } else { b };
    let worst = [a.s - b.s, a.v.x - b.v.x, a.v.y - b.v.y, a.v.z - b.v.z]
        .map(|x| x.as_f64().abs())
        .into_iter()
        .fold(0.0, f64::max);
    worst / S::epsilon().as_f64()
}

/// The worst round trip through any of the forms, in epsilons, with its name.
fn round_trips<S: Scalar + FloatConst>(q: Quat<f64>) -> (f64, &'static str) {
    let q = cast::<S>(q);
    [
        (apart(q, Quat::from(AxisAngle::from(q))), "axis and angle"),
        (apart(q, Quat::from(LookAt::from(q))), "look-at"),
        (apart(q, Quat::from(YawPitchRoll::from(q))), "yaw, pitch and roll"),
        (apart(q, rotation_of_matrix(&matrix_of_rotation(q))), "matrix"),
        (apart(q, Quat::from(Rotor::from(q))), "rotor"),
    ]
    .into_iter()
    .fold((0.0, ""), |worst, next| if next.0 > worst.0 { next } else { worst })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(20_000))]

    #[test]
    fn every_form_comes_back_within_four_epsilons(q in rotation()) {
        let (worst, form) = round_trips::<f64>(q);
        prop_assert!(worst <= 4.0, "{worst} epsilons of f64 by {form}");
        let (worst, form) = round_trips::<f32>(q);
        prop_assert!(worst <= 4.0, "{worst} epsilons of f32 by {form}");
    }

    #[test]
    fn a_rotor_turns_as_its_quaternion_does(p in rotation(), q in rotation()) {
        let both = Rotor::from(p) * Rotor::from(q);
        prop_assert!(apart(Quat::from(both), p * q) <= 4.0);
        let none = both * both.reverse();
        prop_assert!((none.scalar - 1.0).abs() < 1e-14);
        prop_assert!(none.bivector.dual().magnitude() < 1e-14);
    }

    #[test]
    fn a_motor_moves_all_as_its_pose_does(
        q in rotation(), t in [-9.0..9.0_f64, -9.0..9.0, -9.0..9.0],
        p in [-9.0..9.0_f64, -9.0..9.0, -9.0..9.0],
    ) {
        let pose = Pose { rotation: q, translation: Vec3::from(t) };
        let (motor, point) = (Motor::from(pose), Point3::from(p));
        prop_assert!(motor.transform_point(point).distance(pose.transform_point(point)) < 1e-13);
        let plane = Plane::through(point, Vec3::new(1.0, 2.0, -2.0)).unwrap();
        let (normal, offset) = motor.transform_plane(plane.normal(), plane.offset());
        prop_assert!((normal - pose.transform_vector(plane.normal())).magnitude() < 1e-14);
        prop_assert!((normal.dot(pose.transform_point(point).to_vec()) - offset).abs() < 1e-13);
        let line = motor.transform_line(Line::through(point, Vec3::new(0.6, 0.0, 0.8)));
        let there = Line::through(pose.transform_point(point), pose.transform_vector(Vec3::new(0.6, 0.0, 0.8)));
        prop_assert!((line.direction - there.direction).magnitude() < 1e-14);
        prop_assert!((line.moment - there.moment).magnitude() < 1e-13);
        let (back, other) = (Pose::from(motor.inverse()), pose.inverse());
        prop_assert!((back.translation - other.translation).magnitude() < 1e-13);
        let screw = Motor::exp(motor.log(), 1.0);
        prop_assert!(screw.transform_point(point).distance(pose.transform_point(point)) < 1e-12);
    }

    #[test]
    fn poses_matrices_and_scaled_poses_agree(
        q in rotation(), t in [-9.0..9.0_f64, -9.0..9.0, -9.0..9.0],
        p in [-9.0..9.0_f64, -9.0..9.0, -9.0..9.0],
    ) {
        let parent = Pose { rotation: q, translation: Vec3::from(t) };
        let local = Pose { rotation: q * q, translation: Vec3::new(1.0, 2.0, 3.0) };
        let (world, point) = (parent * local, Point3::from(p));
        let at = world.transform_point(point);
        // Three unit quaternions and two products of them: each is up to 2 epsilons too long, and lengths
        // grow by four times that at a half turn, there and back, with some roundings besides.
        let lengths = point.to_vec().magnitude() + local.translation.magnitude() + parent.translation.magnitude();
        let bound = 100.0 * f64::EPSILON * lengths;
        prop_assert!(at.distance(parent.transform_point(local.transform_point(point))) < bound);
        let matrix = parent.matrix() * local.matrix();
        prop_assert!(at.distance(matrix.transform_point(point)) < bound);
        prop_assert!(point.distance(world.inverse_transform_point(at)) < bound);
        prop_assert!(point.distance(world.inverse().transform_point(at)) < bound);
        let scaled = parent.scaled(2.0).concat(&local.scaled(3.0)).transform_point(point);
        let by_hand = parent.transform_point(local.transform_point(point * 3.0) * 2.0);
        prop_assert!(scaled.distance(by_hand) < 1e-12);
    }

    #[test]
    fn slerp_turns_steadily_and_the_short_way(p in rotation(), q in rotation(), part in 0.0..1.0) {
        let all = AxisAngle::from(p.conjugate() * q).angle();
        let some = AxisAngle::from(p.conjugate() * slerp(p, q, part)).angle();
        prop_assert!((some - all * part).abs() < 1e-9, "{some} of {all} at {part}");
        prop_assert!(apart(slerp(p, q, 0.0), p) <= 4.0);
        prop_assert!(apart(slerp(p, q, 1.0), q) <= 4.0);
    }
}

#[test]
fn yaw_pitch_and_roll_are_what_a_pilot_means_by_them() {
    let nose = |angles| Quat::from(angles) * -Vec3::unit_z();
    let level = YawPitchRoll { yaw: 0.0, pitch: 0.0, roll: 0.0 };
    let near = |a: Vec3<f64>, b: Vec3<f64>| (a - b).magnitude() < 1e-15;
    assert!(near(nose(YawPitchRoll { yaw: f64::FRAC_PI_2(), ..level }), -Vec3::unit_x()), "left");
    assert!(near(nose(YawPitchRoll { pitch: f64::FRAC_PI_2(), ..level }), Vec3::unit_y()), "up");
    let rolled = Quat::from(YawPitchRoll { roll: f64::FRAC_PI_2(), ..level });
    assert!(near(rolled * Vec3::unit_y(), -Vec3::unit_x()), "counterclockwise, seen from behind");
}

#[test]
fn straight_up_and_down_there_is_no_roll() {
    for sign in [1.0_f64, -1.0] {
        for (yaw, roll) in [(0.3, 0.0), (0.3, 0.9), (-2.0, 3.0)] {
            let locked = YawPitchRoll { yaw, pitch: sign * f64::FRAC_PI_2(), roll };
            let YawPitchRoll { yaw: both, pitch, roll: none } = Quat::from(locked).into();
            assert_eq!(none, 0.0);
            assert!((pitch - locked.pitch).abs() < 1e-15);
            let turn = both - (yaw - sign * roll);
            let off = turn - (turn / f64::TAU()).round() * f64::TAU();
            assert!(off.abs() < 1e-14, "{both} for {yaw} and {roll}");
        }
    }
}

#[test]
fn what_looks_somewhere_keeps_its_head_up() {
    for forward in [[1.0, 0.0, 0.0], [0.3, -0.9, 2.0], [1e-20, 0.0, 1e-20], [3e30, 4e30, 0.0]] {
        let forward = Vec3::from(forward);
        let look = LookAt::new(forward, Vec3::unit_y()).unwrap();
        let rotation = Quat::<f64>::from(look);
        let unit = forward / forward.magnitude();
        assert!((rotation * -Vec3::unit_z() - unit).magnitude() < 1e-15);
        assert!((rotation * Vec3::unit_x()).y.abs() < 1e-15, "its shoulders are level");
        assert!((rotation * Vec3::unit_y()).y > 0.0);
    }
    for (forward, head) in [(1.0, 1.0), (-1.0, -1.0)] {
        let look = LookAt::new(Vec3::unit_y() * forward, Vec3::unit_y()).unwrap();
        assert_eq!(look.up(), Vec3::unit_z() * head, "straight up and down");
    }
    let zero = Vec3::new(0.0, 0.0, 0.0);
    assert_eq!(
        LookAt::new(zero, Vec3::unit_y()).unwrap_err().to_string(),
        "forward must have length 1, but has length 0"
    );
    assert!(AxisAngle::new(zero, 1.0).is_err());
    assert!(AxisAngle::new(Vec3::unit_x(), f64::NAN).is_err());
}
