use slotmap::{SlotMap, new_key_type};

use super::Pose;
use crate::Error;
use crate::math::Scalar;

new_key_type! {
    /// Names a node of a [`Tree`].
    pub struct NodeId;
}

/// Things that carry each other: each node has a pose in the frame of its parent, or in
/// the world if it has none.
#[derive(Clone, Debug, Default)]
pub struct Tree<S> {
    nodes: SlotMap<NodeId, Node<S>>,
}

#[derive(Clone, Debug)]
struct Node<S> {
    local: Pose<S>,
    parent: Option<NodeId>,
    children: Vec<NodeId>,
}

impl<S: Scalar> Tree<S> {
    /// Adds a node under another one, or under the world.
    ///
    /// # Errors
    /// [`Error::NoSuchNode`] for the parent; for the pose as [`Pose::checked`].
    pub fn insert(&mut self, parent: Option<NodeId>, local: Pose<S>) -> Result<NodeId, Error> {
        let local = local.checked()?;
        if let Some(parent) = parent {
            self.node(parent)?;
        }
        let id = self.nodes.insert(Node { local, parent, children: Vec::new() });
        self.adopt(id, parent);
        Ok(id)
    }

    /// Takes out a node and all that it carries.
    ///
    /// # Errors
    /// [`Error::NoSuchNode`].
    pub fn remove(&mut self, id: NodeId) -> Result<(), Error> {
        self.node(id)?;
        self.orphan(id);
        let mut doomed = vec![id];
        while let Some(id) = doomed.pop() {
            if let Some(node) = self.nodes.remove(id) {
                doomed.extend(node.children);
            }
        }
        Ok(())
    }

    /// The pose in the frame of the parent.
    ///
    /// # Errors
    /// [`Error::NoSuchNode`].
    pub fn local(&self, id: NodeId) -> Result<Pose<S>, Error> {
        Ok(self.node(id)?.local)
    }

    /// Moves a node, and with it all that it carries.
    ///
    /// # Errors
    /// [`Error::NoSuchNode`]; for the pose as [`Pose::checked`].
    pub fn set_local(&mut self, id: NodeId, local: Pose<S>) -> Result<(), Error> {
        self.node(id)?;
        self.nodes[id].local = local.checked()?;
        Ok(())
    }

    /// The pose in the world.
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

    /// What carries a node.
    ///
    /// # Errors
    /// [`Error::NoSuchNode`].
    pub fn parent(&self, id: NodeId) -> Result<Option<NodeId>, Error> {
        Ok(self.node(id)?.parent)
    }

    /// What a node carries, in the order in which it came to.
    ///
    /// # Errors
    /// [`Error::NoSuchNode`].
    pub fn children(&self, id: NodeId) -> Result<&[NodeId], Error> {
        Ok(&self.node(id)?.children)
    }

    /// Hands a node over to another parent, or to the world, without moving it there.
    ///
    /// # Errors
    /// [`Error::NoSuchNode`], or [`Error::CarriesItself`] if the node carries that parent;
    /// [`Error::NotFinite`] if the pose in the frame of the new parent is not finite.
    pub fn set_parent(&mut self, id: NodeId, parent: Option<NodeId>) -> Result<(), Error> {
        let pose = self.world(id)?;
        let mut above = parent;
        while let Some(ancestor) = above {
            if ancestor == id {
                return Err(Error::CarriesItself(id));
            }
            above = self.node(ancestor)?.parent;
        }
        let local = match parent {
            Some(parent) => self.world(parent)?.inverse() * pose,
            None => pose,
        }
        .checked()?;
        self.orphan(id);
        self.adopt(id, parent);
        self.nodes[id].local = local;
        Ok(())
    }

    fn node(&self, id: NodeId) -> Result<&Node<S>, Error> {
        self.nodes.get(id).ok_or(Error::NoSuchNode(id))
    }

    fn orphan(&mut self, id: NodeId) {
        if let Some(parent) = self.nodes[id].parent.take() {
            self.nodes[parent].children.retain(|child| *child != id);
        }
    }

    fn adopt(&mut self, id: NodeId, parent: Option<NodeId>) {
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
        let at = |tree: &Tree<f64>| tree.world(load).unwrap().point(point);
        assert!(at(&tree).distance(chained.point(point)) < 1e-14);

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
            assert_eq!(tree.set_parent(a, Some(id)), Err(Error::CarriesItself(a)));
        }
        assert_eq!(tree.parent(c), Ok(Some(b)));
        tree.remove(b).unwrap();
        assert_eq!(tree.world(c), Err(Error::NoSuchNode(c)), "it went with what carried it");
        assert_eq!(tree.children(a), Ok(&[][..]));
        assert_eq!(tree.insert(Some(b), pose(0.0, 0.0)), Err(Error::NoSuchNode(b)));
    }
}
