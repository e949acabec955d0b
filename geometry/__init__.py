"""Shapes and motion of the machine, meshes and CAD files."""
