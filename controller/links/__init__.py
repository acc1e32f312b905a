"""Ways in from robots and other programs: opening what a stage names, each kind of link in a folder of its own.

In: bytes. Out: commands to the layers, and answers. Imports base to layers.
"""
