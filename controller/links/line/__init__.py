"""The line protocol: words and commands, a conversation, the serial port that holds it, scripts, simulated hosts.

In: bytes. Out: commands to the layers, and answers. Imports base to layers.
"""
