"""From control points to triangles: quad tree, slits, trim loops, watertight tessellation.

In: a table of control points and a domain. Out: a mesh with the lists of control points by cell. Imports base, spline.
"""
