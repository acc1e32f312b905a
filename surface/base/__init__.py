"""Foundations of the surface room: errors, progress callbacks, checks of arguments, compilation of kernels.

In: arguments of callers. Out: checked arrays, errors that say what to do. Imports nothing of the surface.
"""
