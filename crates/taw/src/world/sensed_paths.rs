//! Paths of marbles and bodies past sensors within a substep.

use cgmath::{One, Zero};

use super::sensors::SensorSpace;
use super::{ColliderId, MarbleId, Marbles};
use crate::body::{Bodies, BodyId};
use crate::broad::CollisionLayers;
use crate::frame::Pose;
use crate::math::{Point3, Quat, Scalar, Vec3};
use crate::shape::{Aabb3, Shape};

/// Marbles or bodies, by row.
pub(super) trait SensedRows<S: Scalar> {
    type Id: Copy + Ord + Into<ColliderId>;

    fn count(&self) -> usize;

    /// Number of removals so far, each of which may move other rows.
    fn removals(&self) -> u64;

    fn id_of_row(&self, row: usize) -> Option<Self::Id>;

    fn layers_of_row(&self, row: usize) -> CollisionLayers;

    /// Center of mass.
    fn center(&self, row: usize) -> Point3<S>;

    /// Distance of the surface from the center, at most, in metres.
    fn reach(&self, row: usize) -> S;

    fn shape_of_row(&self, row: usize) -> Shape<S>;

    /// Displacement between two places in metres.
    fn displacement(&self, from: Point3<S>, to: Point3<S>) -> Vec3<S> {
        to - from
    }
}

impl<S: Scalar> SensedRows<S> for Marbles<S> {
    type Id = MarbleId;

    fn count(&self) -> usize {
        self.len()
    }

    fn removals(&self) -> u64 {
        self.removals()
    }

    fn id_of_row(&self, row: usize) -> Option<MarbleId> {
        self.id(row)
    }

    fn layers_of_row(&self, row: usize) -> CollisionLayers {
        self.layers_of_row(row)
    }

    fn center(&self, row: usize) -> Point3<S> {
        self.position()[row]
    }

    fn reach(&self, row: usize) -> S {
        self.radius()[row] + self.half_length(row)
    }

    fn shape_of_row(&self, row: usize) -> Shape<S> {
        self.shape_of_row(row)
    }

    fn displacement(&self, from: Point3<S>, to: Point3<S>) -> Vec3<S> {
        self.period.minimum_image(to - from)
    }
}

impl<S: Scalar> SensedRows<S> for Bodies<S> {
    type Id = BodyId;

    fn count(&self) -> usize {
        self.len()
    }

    fn removals(&self) -> u64 {
        self.removals()
    }

    fn id_of_row(&self, row: usize) -> Option<BodyId> {
        self.id(row)
    }

    fn layers_of_row(&self, row: usize) -> CollisionLayers {
        self.states[row].body.layers
    }

    fn center(&self, row: usize) -> Point3<S> {
        self.states[row].world_center()
    }

    fn reach(&self, row: usize) -> S {
        S::from_f64(self.states[row].reach)
    }

    fn shape_of_row(&self, row: usize) -> Shape<S> {
        self.states[row].world_shape()
    }
}

/// Centers at the beginning of a substep, by row, and the number of removals then.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct StartCenters<S> {
    centers: Vec<Point3<S>>,
    removals: u64,
}

impl<S: Scalar> StartCenters<S> {
    pub fn store(&mut self, rows: &impl SensedRows<S>) {
        self.centers.clear();
        self.centers.extend((0..rows.count()).map(|row| rows.center(row)));
        self.removals = rows.removals();
    }

    /// Forgets them if rows have others now.
    pub fn clear_stale(&mut self, rows: &impl SensedRows<S>) {
        if self.removals != rows.removals() {
            self.clear();
        }
    }

    pub fn clear(&mut self) {
        self.centers.clear();
    }
}

/// Path of a marble or body in a substep, in the frame of a sensor: that of the world at the end of the step.
struct SensedPath<S> {
    /// Shape at its end.
    end: Shape<S>,
    /// In metres.
    displacement: Vec3<S>,
}

impl<S: Scalar> SensedPath<S> {
    /// Shape at its beginning, in the orientation at the end.
    fn start(&self) -> Shape<S> {
        self.end.transformed(Pose { rotation: Quat::one(), translation: -self.displacement })
    }
}

/// Updates who is inside of a sensor after a substep of `dt` seconds, `rest` seconds before the end of the step.
/// Tells who entered (true) and left (false), and the fraction of the substep before that.
pub(super) fn sense<S: Scalar, R: SensedRows<S>>(
    space: &SensorSpace<S>,
    (rows, start): (&R, &StartCenters<S>),
    inside: &mut Vec<R::Id>,
    [rest, dt]: [S; 2],
    mut tell: impl FnMut(ColliderId, bool, S),
) {
    let before = std::mem::take(inside);
    let mut left = Vec::new();
    for (id, path) in paths(rows, start, space, [rest, dt]) {
        let was_inside = before.binary_search(&id).is_ok();
        let is_inside = space.shape.overlaps(&path.end);
        let enters = || space.shape.cast_shape(&path.start(), path.displacement);
        let leaves = || {
            let back = space.shape.cast_shape(&path.end, -path.displacement);
            back.map(|back| S::one() - back)
        };
        match (was_inside, is_inside) {
            (true, true) => {}
            // Who was put inside is there from the beginning.
            (false, true) => tell(id.into(), true, enters().unwrap_or(S::zero())),
            (true, false) => {
                left.push(id);
                tell(id.into(), false, leaves().unwrap_or(S::zero()));
            }
            // Who only reaches the surface does not leave it again.
            (false, false) => {
                if let Some(entry) = enters()
                    && let Some(exit) = leaves().filter(|exit| *exit > entry)
                {
                    tell(id.into(), true, entry);
                    tell(id.into(), false, exit);
                }
            }
        }
        if is_inside {
            inside.push(id);
        }
    }
    inside.sort_unstable();
    for id in before {
        if inside.binary_search(&id).is_err() && !left.contains(&id) {
            tell(id.into(), false, S::zero()); // it was put elsewhere, or is gone
        }
    }
}

/// Marbles or bodies whose paths may touch a sensor, in a substep of `dt` seconds, `rest` seconds before the
/// end of the step.
fn paths<'a, S: Scalar, R: SensedRows<S>>(
    rows: &'a R,
    start: &'a StartCenters<S>,
    space: &SensorSpace<S>,
    [rest, dt]: [S; 2],
) -> impl Iterator<Item = (R::Id, SensedPath<S>)> + use<'a, S, R> {
    let (bounds, layers) = (space.shape.bounding_box(), space.layers);
    let frame = |time: S| space.motion.map(|motion| motion.pose_before(time).inverse());
    let [at_start, at_end] = [frame(rest + dt), frame(rest)];
    (0..rows.count()).filter_map(move |row| {
        if !rows.layers_of_row(row).interacts_with(layers) {
            return None;
        }
        let to = rows.center(row);
        let moved = start.centers.get(row).map_or_else(Vec3::zero, |at| rows.displacement(*at, to));
        let from = to - moved;
        let place = |frame: Option<Pose<S>>, point: Point3<S>| {
            frame.map_or(point, |frame| frame.transform_point(point))
        };
        let (from, to) = (place(at_start, from), place(at_end, to));
        if bounds.is_some_and(|it| !swept_sphere_overlaps([from, to], rows.reach(row), &it)) {
            return None;
        }
        let shape = rows.shape_of_row(row);
        let end = at_end.map_or_else(|| shape.clone(), |frame| shape.transformed(frame));
        Some((rows.id_of_row(row)?, SensedPath { end, displacement: to - from }))
    })
}

/// Tests if the box around the path of a sphere overlaps another one.
fn swept_sphere_overlaps<S: Scalar>(
    [from, to]: [Point3<S>; 2],
    radius: S,
    bounds: &Aabb3<S>,
) -> bool {
    (0..3).all(|axis| {
        from[axis].min(to[axis]) - radius <= bounds.max[axis]
            && from[axis].max(to[axis]) + radius >= bounds.min[axis]
    })
}
