//! Parts that the examples share: the window, a picture of it on request, and a camera
//! that orbits, with picking by the mouse.
//!
//! No physics and no game is in here.

mod camera;
mod pointer;
mod window;

pub use camera::{OrbitCameraPlugin, orbit_camera, orbit_camera_at};
pub use pointer::Pointer;
pub use window::{ExamplePlugins, Picture, assets};
