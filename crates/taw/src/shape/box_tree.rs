use smallvec::SmallVec;

use super::{Aabb, Box3};
use crate::math::{Point3, Scalar};

/// Things by their bounding boxes, halved again and again, so that few are looked at to
/// find those in one place.
#[derive(Clone, Debug, PartialEq)]
pub struct BoxTree<S> {
    nodes: Vec<Node<S>>,
    /// The things, leaf by leaf.
    items: Vec<u32>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Node<S> {
    bounds: Box3<S>,
    /// Of a leaf, where its things begin; else the number of its second child. The first
    /// one follows it.
    next: u32,
    /// How many things; zero if it has children.
    count: u32,
}

impl<S> Default for BoxTree<S> {
    fn default() -> Self {
        Self { nodes: Vec::new(), items: Vec::new() }
    }
}

/// A leaf has no more things than this.
const LEAF: usize = 4;

impl<S: Scalar> BoxTree<S> {
    /// A tree of things that are named by their places in this list.
    #[must_use]
    pub fn new(boxes: &[Box3<S>]) -> Self {
        let mut tree = Self { nodes: Vec::new(), items: (0..boxes.len() as u32).collect() };
        if !boxes.is_empty() {
            tree.build(boxes, 0, boxes.len());
        }
        tree
    }

    fn build(&mut self, boxes: &[Box3<S>], from: usize, to: usize) {
        let of = |item: u32| boxes[item as usize];
        let first = of(self.items[from]);
        let bounds = self.items[from..to].iter().fold(first, |all, i| all.union(&of(*i)));
        let node = self.nodes.len();
        let leaf = Node { bounds, next: from as u32, count: (to - from) as u32 };
        self.nodes.push(leaf);
        if to - from <= LEAF {
            return;
        }
        // Halved across the axis along which the middles are spread most.
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

    /// Takes new boxes for the same things: the tree keeps its form, which is good as long as
    /// they stay about where they were.
    pub fn refit(&mut self, boxes: &[Box3<S>]) {
        // Children come after their parents.
        for number in (0..self.nodes.len()).rev() {
            let Node { next, count, .. } = self.nodes[number];
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

    /// Names all things whose boxes may have a point in common with this one, and some more.
    pub fn near(&self, bounds: &Box3<S>, name: impl FnMut(u32)) {
        self.visit(|node| node.overlaps(bounds), name);
    }

    /// Names all things whose boxes a line may go through, between these parts of the way
    /// from a point along a motion, and some more.
    pub fn along(&self, from: Point3<S>, motion: cgmath::Vector3<S>, name: impl FnMut(u32)) {
        let crosses = |bounds: &Box3<S>| {
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
            // With room for rounding.
            into <= out * (S::one() + S::epsilon() * S::constant(8.0))
        };
        self.visit(crosses, name);
    }

    /// Names all things whose boxes may be within `reach` metres of a point, and some more,
    /// the nearer ones about first. The answer to each is how far is still of interest.
    pub fn around(&self, point: Point3<S>, mut reach: S, mut name: impl FnMut(u32) -> S) {
        let gap = |number: u32| {
            let bounds = self.nodes.get(number as usize).map(|node| node.bounds);
            bounds.map_or(S::infinity(), |bounds| bounds.gap(point))
        };
        // With room for rounding.
        let room = S::one() + S::epsilon() * S::constant(64.0);
        let mut open = SmallVec::<[(S, u32); 64]>::new();
        open.push((gap(0), 0));
        while let Some((far, number)) = open.pop() {
            if far.is_nan() || far > reach * room {
                continue;
            }
            let Some(node) = self.nodes.get(number as usize) else { continue };
            if node.count > 0 {
                let from = node.next as usize;
                for item in &self.items[from..from + node.count as usize] {
                    reach = name(*item).min(reach);
                }
            } else {
                let (first, second) = ((gap(number + 1), number + 1), (gap(node.next), node.next));
                // The nearer one is opened first.
                open.extend(if first.0 <= second.0 { [second, first] } else { [first, second] });
            }
        }
    }

    fn visit(&self, enters: impl Fn(&Box3<S>) -> bool, mut name: impl FnMut(u32)) {
        let mut open = SmallVec::<[u32; 64]>::from_slice(&[0]);
        while let Some(number) = open.pop() {
            let Some(node) = self.nodes.get(number as usize) else { continue };
            if !enters(&node.bounds) {
                continue;
            }
            if node.count > 0 {
                let from = node.next as usize;
                self.items[from..from + node.count as usize].iter().for_each(|i| name(*i));
            } else {
                open.extend([node.next, number + 1]);
            }
        }
    }

    /// The box around all.
    #[must_use]
    pub fn bounds(&self) -> Option<Box3<S>> {
        self.nodes.first().map(|node| node.bounds)
    }
}
