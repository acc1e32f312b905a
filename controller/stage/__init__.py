"""Stages, which are files that tie together the head, links, layers and robots of a run; and the dry run of a stage.

In: a stage's file. Out: checked settings and plans. Imports base to robot.
"""
