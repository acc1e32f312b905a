"""What all families share: one port with many servos, limits before every goal, a sure stop, a switch.

In: goals in rad and a family's hooks. Out: goals within limits, states. Imports base to port.
"""
