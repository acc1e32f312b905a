"""glTF 2.0 files: their containers and compressed views, and the meshes, names and materials in them.

In: a .glb, .vrm or .gltf file. Out: a mesh with its shapes, pieces and colours. Imports base and the mesh
data of readers.
"""
