"""Bytes of servo protocols: packets of Dynamixel Protocol 2.0 and 1.0, made and found in a stream.

In: bytes. Out: packets, and what was no packet. Imports base.
"""
