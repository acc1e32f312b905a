"""The process that holds links, layers, limits and buses, and the wires to it.

In: a stage and orders. Out: parameters in a mailbox, goals on buses. Imports base to stage.
"""
