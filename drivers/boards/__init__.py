"""What boards of hobby servos share: the base driver, pulses for angles, ordered questions and answers.

In: goals in rad. Out: pulses in microseconds. Imports base to core.
"""
