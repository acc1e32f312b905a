"""Find a head in a mesh and put it where cameras, gaze and light expect it: unit, axes, landmarks, a cut at the neck.

In: vertices, faces and shapes of a file. Out: the transformation to head space, the mesh there. Imports base, head and
the mesh, names and islands of fit.source.
"""
