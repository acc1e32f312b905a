"""What drivers of servos with registers share, whatever their protocol; a family says only what differs.

In: goals in rad, a family's packets. Out: registers by short name, servos brought up where they stand, states, and
who keeps silent. Imports base to core.
"""
