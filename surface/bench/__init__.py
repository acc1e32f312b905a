"""What the engine costs, against other programs and against the memory's limit.

In: nothing, or a surface. Out: tables of figures. Imports any room of the surface.
"""
