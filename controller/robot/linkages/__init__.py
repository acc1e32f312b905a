"""Linkages: servos that move one part together, so that the angle of each depends on several parameters.

In: values of a linkage's inputs, degrees and millimetres. Out: angles of its servos. A kind is a module
``kinds/KIND_linkage.py`` that nothing else names. Imports controller.robot.terms and base.
"""
