//! What a thing is. Shapes are plain values; whether two of them touch is a
//! question for [`contact`](crate::contact).

mod plane;
mod sphere;

pub use plane::Plane;
pub use sphere::Sphere;
