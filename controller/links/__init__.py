"""Ways in from robots and other programs: the line protocol, its session and port, simulated hosts.

In: bytes. Out: commands to the layers, and answers. Imports base to layers.
"""
