"""Dynamixel servos: Protocol 2.0, Protocol 1.0, and both on one wire.

In: goals in rad. Out: sync writes, and states from sync or fast reads. Imports base to protocol1.
"""
