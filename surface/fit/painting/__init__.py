"""Lay textures of a mesh's skin and eyes, or the colours of a scan, out anew over the (u, v) of the head made from it.

In: a mesh with its materials and the islands of the head's parts, or a head and the colours of a scan. Out: one picture
for the head. Imports base to dcp, head, fit.source, fit.eyes.
"""
