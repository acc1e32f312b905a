"""Read meshes, name their shapes, find their frame, and chart their islands over (u, v).

In: files or arrays of triangles. Out: meshes in the head's frame, with charts. Imports base to dcp, readers, head.
"""
