"""Lay the textures of a mesh's skin out anew over the (u, v) of the head that is made from it.

In: a mesh with its materials, and the islands of the head's parts. Out: one picture for the head.
Imports base to dcp, head, fit.source.
"""
