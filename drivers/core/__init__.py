"""What all families of servos and boards share: one port, target limits, safe stop, registry, dead man's switch.

In: goals in rad and a family's hooks. Out: goals within limits, states. Imports base to port.
"""
