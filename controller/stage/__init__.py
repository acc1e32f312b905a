"""Stages: which head, links, layers and robots belong together, and what of that would be sent.

In: a stage's file. Out: checked settings and plans. Imports base to robot.
"""
