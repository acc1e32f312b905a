"""Opens the links of a stage to robots and other programs; each kind of link has its own folder.

In: bytes. Out: commands to the layers, and answers. Imports base to layers.
"""
