"""A simulated wire: the time bytes take, the base class of devices on it, and its faults.

In: bytes and times. Out: replies and when they are due. Imports base, packets.
"""
