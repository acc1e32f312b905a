"""Names of shapes in the vocabularies of many makers, and shapes by ARKit's names made of a mesh's own.

In: names of shapes, meshes. Out: what names mean, meshes with ARKit's shapes, notes. Imports the rest of fit.source.
"""
