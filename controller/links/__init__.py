"""Opens the links (connections to robots and other programs) of a stage; each kind of link has its own folder.

In: bytes. Out: commands to the layers, and answers. Imports base to layers.
"""
