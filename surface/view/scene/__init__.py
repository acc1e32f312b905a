"""The scene of a picture: camera, lights, buffers of a head's parts, openings of lids and lips, adaptive sampling.

In: settings and parts. Out: matrices, bounds and states, without OpenGL. Imports base and head.
"""
