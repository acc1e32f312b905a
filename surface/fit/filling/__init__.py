"""Fill in the shapes that a mesh lacks from another head; those that it has stay its own.

In: a mesh with some shapes, and a head. Out: the mesh with further shapes. Imports base to dcp, readers, head, check,
fit.source, fit.transfer.
"""
