//! What the examples share: the window, a picture of it on request, and a camera
//! that orbits.
//!
//! No physics and no game is in here.

mod camera;
mod window;

pub use camera::{OrbitCameraPlugin, orbit_camera, orbit_camera_at};
pub use window::{ExamplePlugins, Picture};
