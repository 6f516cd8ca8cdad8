//! What the balls of a swarm meet in a world.

use cgmath::InnerSpace;

use super::touch::{Near, drop_seams, parts_near};
use super::walls::{Part, Walls};
use crate::math::{Point3, Scalar, Vec3, cast_point, cast_vector};
use crate::response::Material;
use crate::shape::{Aabb, Sphere};
use crate::swarm::Surroundings;

impl<S: Scalar> Surroundings for Walls<S> {
    fn planes(&self, name: &mut dyn FnMut(u32, Vec3<f32>, f32)) {
        for (wall, plane) in Walls::planes(self) {
            let normal: Vec3<f32> = cast_vector(plane.normal());
            name(wall, normal.normalize(), plane.offset().as_f64() as f32);
        }
    }

    fn has_shapes(&self) -> bool {
        !self.are_planes()
    }

    fn near(&self, low: [f32; 3], high: [f32; 3]) -> bool {
        let bounds = Aabb { min: cast_point(low.into()), max: cast_point(high.into()) };
        let mut any = false;
        Walls::near(self, &bounds, |_| any = true);
        any
    }

    fn shapes_at(
        &self,
        &[x, y, z, radius]: &[f32; 4],
        reach: f32,
        name: &mut dyn FnMut([u32; 2], Vec3<f32>, f32),
    ) {
        let number = |x: f32| S::constant(f64::from(x));
        let center = cast_point(Point3::new(x, y, z));
        let sphere = Sphere { center, radius: number(radius) };
        let mut near = Vec::new();
        parts_near(self, &sphere, number(reach), &mut near);
        if near.len() > 1 {
            drop_seams(self, &sphere, &mut near);
        }
        for Near { part: Part { wall, part }, nearest } in near {
            let normal: Vec3<f32> = cast_vector(nearest.normal);
            name([wall, part], normal, nearest.distance.as_f64() as f32);
        }
    }

    fn surface_velocity(&self, wall: u32, point: Point3<f32>) -> Vec3<f32> {
        cast_vector(crate::response::Walls::surface_velocity(self, wall as usize, cast_point(point)))
    }

    fn material(&self, wall: u32) -> Option<Material<f32>> {
        self.material_of_row(wall as usize).map(Material::cast)
    }
}
