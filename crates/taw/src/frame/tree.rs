use slotmap::{SlotMap, new_key_type};

use super::Pose;
use crate::Error;
use crate::math::Scalar;

new_key_type! {
    /// Identifies a node of a [`Tree`].
    pub struct NodeId;
}

/// A transform hierarchy: each node has a pose in the frame of its parent, or in the world if it is
/// a root.
#[derive(Clone, Debug, Default)]
pub struct Tree<S> {
    nodes: SlotMap<NodeId, FrameNode<S>>,
}

/// Frame in the tree: its pose in its parent, and the frames in it.
#[derive(Clone, Debug)]
struct FrameNode<S> {
    local: Pose<S>,
    parent: Option<NodeId>,
    children: Vec<NodeId>,
}

impl<S: Scalar> Tree<S> {
    /// Adds a node under a parent, or as a root.
    ///
    /// # Errors
    /// [`Error::NoSuchNode`] for the parent; for the pose as [`Pose::validated`].
    pub fn insert(&mut self, parent: Option<NodeId>, local: Pose<S>) -> Result<NodeId, Error> {
        let local = local.validated()?;
        if let Some(parent) = parent {
            self.node(parent)?;
        }
        let id = self.nodes.insert(FrameNode { local, parent, children: Vec::new() });
        self.attach(id, parent);
        Ok(id)
    }

    /// Removes a node and its descendants.
    ///
    /// # Errors
    /// [`Error::NoSuchNode`].
    pub fn remove(&mut self, id: NodeId) -> Result<(), Error> {
        self.node(id)?;
        self.detach(id);
        let mut to_remove = vec![id];
        while let Some(id) = to_remove.pop() {
            if let Some(node) = self.nodes.remove(id) {
                to_remove.extend(node.children);
            }
        }
        Ok(())
    }

    /// Local pose, in the frame of the parent.
    ///
    /// # Errors
    /// [`Error::NoSuchNode`].
    pub fn local(&self, id: NodeId) -> Result<Pose<S>, Error> {
        Ok(self.node(id)?.local)
    }

    /// Sets the local pose of a node; its descendants follow.
    ///
    /// # Errors
    /// [`Error::NoSuchNode`]; for the pose as [`Pose::validated`].
    pub fn set_local(&mut self, id: NodeId, local: Pose<S>) -> Result<(), Error> {
        self.node(id)?;
        self.nodes[id].local = local.validated()?;
        Ok(())
    }

    /// World pose.
    ///
    /// # Errors
    /// [`Error::NoSuchNode`].
    pub fn world(&self, id: NodeId) -> Result<Pose<S>, Error> {
        let mut node = self.node(id)?;
        let mut pose = node.local;
        while let Some(parent) = node.parent {
            node = self.node(parent)?;
            pose = node.local * pose;
        }
        Ok(pose)
    }

    /// Parent of a node.
    ///
    /// # Errors
    /// [`Error::NoSuchNode`].
    pub fn parent(&self, id: NodeId) -> Result<Option<NodeId>, Error> {
        Ok(self.node(id)?.parent)
    }

    /// Children of a node, in the order of attachment.
    ///
    /// # Errors
    /// [`Error::NoSuchNode`].
    pub fn children(&self, id: NodeId) -> Result<&[NodeId], Error> {
        Ok(&self.node(id)?.children)
    }

    /// Attaches a node to another parent, or makes it a root, and keeps its world pose.
    ///
    /// # Errors
    /// [`Error::NoSuchNode`], or [`Error::Cycle`] if the new parent is a descendant of the node;
    /// [`Error::NotFinite`] if the pose in the frame of the new parent is not finite.
    pub fn set_parent(&mut self, id: NodeId, parent: Option<NodeId>) -> Result<(), Error> {
        let pose = self.world(id)?;
        let mut above = parent;
        while let Some(ancestor) = above {
            if ancestor == id {
                return Err(Error::Cycle(id));
            }
            above = self.node(ancestor)?.parent;
        }
        let local = match parent {
            Some(parent) => self.world(parent)?.inverse() * pose,
            None => pose,
        }
        .validated()?;
        self.detach(id);
        self.attach(id, parent);
        self.nodes[id].local = local;
        Ok(())
    }

    fn node(&self, id: NodeId) -> Result<&FrameNode<S>, Error> {
        self.nodes.get(id).ok_or(Error::NoSuchNode(id))
    }

    fn detach(&mut self, id: NodeId) {
        if let Some(parent) = self.nodes[id].parent.take() {
            self.nodes[parent].children.retain(|child| *child != id);
        }
    }

    fn attach(&mut self, id: NodeId, parent: Option<NodeId>) {
        self.nodes[id].parent = parent;
        if let Some(parent) = parent {
            self.nodes[parent].children.push(id);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::AxisAngle;
    use crate::math::{Point3, Vec3};
    use cgmath::MetricSpace;

    fn pose(x: f64, angle: f64) -> Pose<f64> {
        let rotation = AxisAngle::new(Vec3::new(1.0, 2.0, 3.0), angle).unwrap().into();
        Pose { rotation, translation: Vec3::new(x, 2.0 * x, -1.0) }
    }

    #[test]
    fn what_is_carried_moves_along_and_stays_where_it_is_put_down() {
        let mut tree = Tree::default();
        let cart = tree.insert(None, pose(1.0, 0.5)).unwrap();
        let crane = tree.insert(Some(cart), pose(2.0, 1.0)).unwrap();
        let load = tree.insert(Some(crane), pose(3.0, -0.7)).unwrap();
        let ship = tree.insert(None, pose(-40.0, 2.0)).unwrap();
        let chained = pose(1.0, 0.5) * pose(2.0, 1.0) * pose(3.0, -0.7);
        let point = Point3::new(0.3, 0.4, 0.5);
        let at = |tree: &Tree<f64>| tree.world(load).unwrap().transform_point(point);
        assert!(at(&tree).distance(chained.transform_point(point)) < 1e-14);

        let before = at(&tree);
        tree.set_parent(load, Some(ship)).unwrap();
        assert!(at(&tree).distance(before) < 1e-13, "handed over, it has not moved");
        assert_eq!(tree.children(crane).unwrap(), []);
        assert_eq!(tree.children(ship).unwrap(), [load]);
        tree.set_local(ship, pose(-50.0, 2.0)).unwrap();
        assert!(at(&tree).distance(before) > 9.0, "it sails");
        let before = at(&tree);
        tree.set_parent(load, None).unwrap();
        assert!(at(&tree).distance(before) < 1e-13);
        assert_eq!(tree.parent(load).unwrap(), None);
    }

    #[test]
    fn a_circle_is_refused_and_nothing_changes() {
        let mut tree = Tree::default();
        let a = tree.insert(None, pose(1.0, 0.1)).unwrap();
        let b = tree.insert(Some(a), pose(2.0, 0.2)).unwrap();
        let c = tree.insert(Some(b), pose(3.0, 0.3)).unwrap();
        for id in [a, b, c] {
            assert_eq!(tree.set_parent(a, Some(id)), Err(Error::Cycle(a)));
        }
        assert_eq!(tree.parent(c), Ok(Some(b)));
        tree.remove(b).unwrap();
        assert_eq!(tree.world(c), Err(Error::NoSuchNode(c)), "it went with what carried it");
        assert_eq!(tree.children(a), Ok(&[][..]));
        assert_eq!(tree.insert(Some(b), pose(0.0, 0.0)), Err(Error::NoSuchNode(b)));
    }
}
