"""Real hardware before it acts: what a bus carries, whether a head is as its file says, end stops, files of a service.

In: robot files and ports. Out: tables, reports, files. Imports base to tools; only preflight and the search for end
stops move a servo.
"""
