"""How far a fitted head is from the mesh that it was made from, in every shape and both ways.

In: a mesh, a head. Out: distances, where the greatest are, folders and colours of reports on them. Imports base, head,
check, fit.source, fit.points.
"""
