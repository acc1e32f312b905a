"""Driver of boards that read lines of text, described by a template.

In: goals in rad. Out: lines made from the template. Imports base to boards.
"""
