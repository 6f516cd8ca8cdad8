use cgmath::InnerSpace;

use crate::math::{Mat3, Quat, Scalar};

/// Rotation matrix: its columns are the images of the axes.
#[must_use]
pub fn matrix_of_rotation<S: Scalar>(rotation: Quat<S>) -> Mat3<S> {
    rotation.into()
}

/// The rotation of a matrix whose columns are right-handed perpendicular unit vectors.
///
/// Computed from the largest of the four components, so that nothing small is divided by (Shepperd,
/// *Quaternion from rotation matrix*, 1978).
#[must_use]
pub fn rotation_of_matrix<S: Scalar>(matrix: &Mat3<S>) -> Quat<S> {
    let [x, y, z] = [matrix.x, matrix.y, matrix.z];
    let one = S::one();
    // Four times the squares of the components.
    let squares = [
        one + x.x + y.y + z.z,
        one + x.x - y.y - z.z,
        one - x.x + y.y - z.z,
        one - x.x - y.y + z.z,
    ];
    let products = [
        // Four times the products of the component in this place with all of them.
        [squares[0], y.z - z.y, z.x - x.z, x.y - y.x],
        [y.z - z.y, squares[1], x.y + y.x, z.x + x.z],
        [z.x - x.z, x.y + y.x, squares[2], y.z + z.y],
        [x.y - y.x, z.x + x.z, y.z + z.y, squares[3]],
    ];
    let largest = (1..4).fold(0, |most, i| if squares[i] > squares[most] { i } else { most });
    let [s, i, j, k] = products[largest];
    Quat::new(s, i, j, k).normalize()
}
