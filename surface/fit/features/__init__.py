"""Make a head of fitted surfaces: eyeballs, teeth, hair, seams, contacts, wrinkles, rigs.

In: a mesh, its charts and nets. Out: the parts of a head. Imports base to dcp, head, fit.source, fit.points, fit.eyes.
"""
