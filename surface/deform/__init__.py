"""Meshes that follow their control points: influence lists and the differential update, Eq. (2).

In: a table of control points and its mesh, then changes. Out: vertices and normals. Imports base, spline, mesh.
"""
