"""What boards of hobby servos share: pulses for angles, moves that nobody measures.

In: goals in rad. Out: pulses in microseconds. Imports base to core.
"""
