"""Pose a head: parameters to control points, contacts and seams, and the vertices that follow.

In: a head's data and values of parameters. Out: vertices and normals of all parts. Imports base to dcp, head.model.
"""
