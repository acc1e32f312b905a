"""What a picture is of: camera, light, what the renderer asks of a head's parts, which openings are seen.

In: settings and parts. Out: matrices, bounds and states, without OpenGL. Imports base and head.
"""
