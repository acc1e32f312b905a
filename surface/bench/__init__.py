"""Benchmarks of the surface engine against reference implementations and the speed of memory.

In: nothing, or a surface. Out: tables of times and ratios. Imports any room of the surface.
"""
