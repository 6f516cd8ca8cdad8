use smallvec::SmallVec;

use super::{Aabb, Aabb3};
use crate::math::{Point3, Scalar};

/// Bounding volume hierarchy: a binary tree of bounding boxes, for queries of items by place.
#[derive(Clone, Debug, PartialEq, Default)]
pub struct Bvh<S> {
    nodes: Vec<BvhNode<S>>,
    /// Items, leaf by leaf.
    items: Vec<u32>,
}

/// Node of the hierarchy: a box, and the nodes or items in it.
#[derive(Clone, Copy, Debug, PartialEq)]
struct BvhNode<S> {
    bounds: Aabb3<S>,
    /// First item of a leaf; else the index of the second child. The first child follows the node.
    next: u32,
    /// Number of items; zero for an inner node.
    count: u32,
}

/// Maximum number of items per leaf.
const MAX_LEAF_ITEMS: usize = 4;

impl<S: Scalar> Bvh<S> {
    /// Builds a tree over items that are identified by their index in the list.
    #[must_use]
    pub fn new(boxes: &[Aabb3<S>]) -> Self {
        let mut tree = Self { nodes: Vec::new(), items: (0..boxes.len() as u32).collect() };
        if !boxes.is_empty() {
            tree.build(boxes, 0, boxes.len());
        }
        tree
    }

    fn build(&mut self, boxes: &[Aabb3<S>], from: usize, to: usize) {
        let of = |item: u32| boxes[item as usize];
        let first = of(self.items[from]);
        let bounds = self.items[from..to].iter().fold(first, |all, i| all.union(&of(*i)));
        let node = self.nodes.len();
        let leaf = BvhNode { bounds, next: from as u32, count: (to - from) as u32 };
        self.nodes.push(leaf);
        if to - from <= MAX_LEAF_ITEMS {
            return;
        }
        // Median split across the axis along which the centers are spread most.
        let point = |item: u32| of(item).center();
        let start = Aabb { min: point(self.items[from]), max: point(self.items[from]) };
        let spread = self.items[from..to]
            .iter()
            .fold(start, |all, i| all.union(&Aabb { min: point(*i), max: point(*i) }));
        let size = spread.max - spread.min;
        let axis = (1..3).fold(0, |most, i| if size[i] > size[most] { i } else { most });
        let middle = usize::midpoint(from, to);
        self.items[from..to].select_nth_unstable_by(middle - from, |s, t| {
            let (x, y) = (point(*s)[axis], point(*t)[axis]);
            x.partial_cmp(&y).unwrap_or(std::cmp::Ordering::Equal).then(s.cmp(t))
        });
        self.build(boxes, from, middle);
        self.nodes[node].next = self.nodes.len() as u32;
        self.nodes[node].count = 0;
        self.build(boxes, middle, to);
    }

    /// Refits the tree to new boxes of the same items: its topology stays, which is good as long as
    /// items stay about where they were.
    pub fn refit(&mut self, boxes: &[Aabb3<S>]) {
        // Children come after their parents.
        for number in (0..self.nodes.len()).rev() {
            let BvhNode { next, count, .. } = self.nodes[number];
            let around = if count > 0 {
                let from = next as usize;
                let items = self.items[from..from + count as usize].iter();
                let bounds = items.filter_map(|item| boxes.get(*item as usize).copied());
                bounds.reduce(|all, next| all.union(&next))
            } else {
                Some(self.nodes[number + 1].bounds.union(&self.nodes[next as usize].bounds))
            };
            if let Some(around) = around {
                self.nodes[number].bounds = around;
            }
        }
    }

    /// Visits all items whose boxes may overlap a box, and some more.
    pub fn for_each_in_box(&self, bounds: &Aabb3<S>, visit: impl FnMut(u32)) {
        self.visit(|node| node.overlaps(bounds), visit);
    }

    /// Visits all items whose boxes may cross the segment from a point along a motion, and some
    /// more.
    pub fn for_each_on_segment(
        &self,
        from: Point3<S>,
        motion: cgmath::Vector3<S>,
        visit: impl FnMut(u32),
    ) {
        let crosses = |bounds: &Aabb3<S>| {
            let (mut into, mut out) = (S::zero(), S::one());
            for axis in 0..3 {
                let (low, high) = (bounds.min[axis] - from[axis], bounds.max[axis] - from[axis]);
                if motion[axis] == S::zero() {
                    if low > S::zero() || high < S::zero() {
                        return false;
                    }
                } else {
                    let (s, t) = (low / motion[axis], high / motion[axis]);
                    into = into.max(s.min(t));
                    out = out.min(s.max(t));
                }
            }
            // With a tolerance for rounding.
            into <= out * (S::one() + S::epsilon() * S::from_f64(8.0))
        };
        self.visit(crosses, visit);
    }

    /// Visits all items whose boxes may be within `reach` metres of a point, and some more, roughly
    /// nearest first. `visit` returns the reach from then on.
    pub fn for_each_near(&self, point: Point3<S>, mut reach: S, mut visit: impl FnMut(u32) -> S) {
        let gap = |number: u32| {
            let bounds = self.nodes.get(number as usize).map(|node| node.bounds);
            bounds.map_or(S::infinity(), |bounds| bounds.distance_to_point(point))
        };
        // With a tolerance for rounding.
        let tolerance = S::one() + S::epsilon() * S::from_f64(64.0);
        let mut open = SmallVec::<[(S, u32); 64]>::new();
        open.push((gap(0), 0));
        while let Some((far, number)) = open.pop() {
            if far.is_nan() || far > reach * tolerance {
                continue;
            }
            let Some(node) = self.nodes.get(number as usize) else { continue };
            if node.count > 0 {
                let from = node.next as usize;
                for item in &self.items[from..from + node.count as usize] {
                    reach = visit(*item).min(reach);
                }
            } else {
                let (first, second) = ((gap(number + 1), number + 1), (gap(node.next), node.next));
                // The nearer one is visited first.
                open.extend(if first.0 <= second.0 { [second, first] } else { [first, second] });
            }
        }
    }

    fn visit(&self, enters: impl Fn(&Aabb3<S>) -> bool, mut visit: impl FnMut(u32)) {
        let mut open = SmallVec::<[u32; 64]>::from_slice(&[0]);
        while let Some(number) = open.pop() {
            let Some(node) = self.nodes.get(number as usize) else { continue };
            if !enters(&node.bounds) {
                continue;
            }
            if node.count > 0 {
                let from = node.next as usize;
                self.items[from..from + node.count as usize].iter().for_each(|i| visit(*i));
            } else {
                open.extend([node.next, number + 1]);
            }
        }
    }

    /// Bounding box of all items.
    #[must_use]
    pub fn bounds(&self) -> Option<Aabb3<S>> {
        self.nodes.first().map(|node| node.bounds)
    }
}
