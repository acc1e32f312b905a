"""A simulated wire: how long bytes take, who hears and answers, and what faults do to it.

In: bytes and times. Out: replies and when they are due. Imports base, packets.
"""
