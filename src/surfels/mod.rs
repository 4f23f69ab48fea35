//! From points and meshes to surfels.
