"""Benchmarks of the surface engine against other programs and against the memory's speed.

In: nothing, or a surface. Out: tables of figures. Imports any room of the surface.
"""
