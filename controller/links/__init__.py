"""Opens the links of a stage to robots and other programs; each kind of link has a folder of its own.

In: bytes. Out: commands to the layers, and answers. Imports base to layers.
"""
