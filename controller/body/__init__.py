"""The control process (body), which runs links, layers, motion limits and buses, and the pipe and mailbox to it.

In: a stage and orders. Out: parameters in a mailbox, goals on buses. Imports base to stage.
"""
