"""Find eyes of every kind in a mesh, seat lids on them, and determine their colours.

In: a mesh, its pieces and shapes; parts of a head. Out: centres, radius and openings; lids that follow and shut.
Imports base to dcp, head, fit.source, fit.points.
"""
