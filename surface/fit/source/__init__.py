"""What a mesh is: reading it, naming its shapes, its frame, its islands and their charts over (u, v).

In: files or arrays of triangles. Out: meshes in the head's frame, with charts. Imports base to dcp, readers, head.
"""
