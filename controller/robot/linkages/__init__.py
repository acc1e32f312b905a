"""Linkages: servos that move one thing together, so that no angle of one belongs to one parameter.

In: values of a linkage's inputs, degrees and millimetres. Out: angles of its servos. A kind is a module
``kinds/KIND_linkage.py`` that nothing else names. Imports controller.robot.terms and base.
"""
