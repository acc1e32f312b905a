"""PLY files: their rows, and the meshes that scanners and MeshLab write in them.

In: a .ply file. Out: a mesh in its unit and axes. Imports base and the mesh data of readers.
"""
