//! Picking by the mouse with taw's own camera.

use bevy::ecs::system::SystemParam;
use bevy::prelude::*;
use taw::frame::{Camera as TawCamera, Pose, Ray};
use taw::math::{Quat as TawQuat, Vec3 as TawVec3};

/// The window and the camera that looks at the scene.
#[derive(SystemParam)]
pub struct Pointer<'w, 's> {
    window: Query<'w, 's, &'static Window>,
    camera: Query<'w, 's, (&'static GlobalTransform, &'static Projection), With<Camera3d>>,
}

impl Pointer<'_, '_> {
    /// The ray from the eye to all that is under the mouse, if it is over the window.
    #[must_use]
    pub fn ray(&self) -> Option<Ray<f32>> {
        let window = self.window.single().ok()?;
        let at = window.cursor_position()?;
        let (eye, Projection::Perspective(lens)) = self.camera.single().ok()? else { return None };
        let translation = eye.translation();
        let [x, y, z, w] = eye.rotation().to_array();
        let pose = Pose {
            rotation: TawQuat::new(w, x, y, z),
            translation: TawVec3::new(translation.x, translation.y, translation.z),
        };
        let size = window.size();
        let camera = TawCamera::new(pose, lens.fov, size.x / size.y, [lens.near, lens.far]).ok()?;
        // From −1 at the left and at the bottom to 1.
        let (across, up) = (2.0 * at.x / size.x - 1.0, 1.0 - 2.0 * at.y / size.y);
        Some(camera.ray([across, up].into()))
    }

    /// Ray to all that is under the mouse, in Bevy's types.
    #[must_use]
    pub fn bevy_ray(&self) -> Option<Ray3d> {
        let Ray { origin, direction } = self.ray()?;
        let direction = Dir3::from_xyz(direction.x, direction.y, direction.z).ok()?;
        Some(Ray3d::new(Vec3::new(origin.x, origin.y, origin.z), direction))
    }
}
