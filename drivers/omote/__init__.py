"""Driver of heads that take omote's own line protocol, as an Arduino with the sketch of docs/boards.md.

In: goals in rad. Out: lines, and the answers to them. Imports base to boards.
"""
