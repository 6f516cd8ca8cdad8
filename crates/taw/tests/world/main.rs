//! Tests in one program, since each program compiles the core anew.

#[path = "../common/any_body.rs"]
mod any_body;
#[path = "../common/draw.rs"]
mod draw;

mod apply;
mod body_queries;
mod body_sensors;
mod conveyors;
mod equality;
mod ignored;
mod layers;
mod lifts;
mod moving_walls;
mod one_way;
mod overflowing_forces;
mod period;
mod queries;
mod removal;
mod scene;
mod sensors;
mod sleep;
mod swept;
mod walls;
