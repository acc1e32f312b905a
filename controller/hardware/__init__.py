"""Tools for real hardware: measuring buses, checking a head against its robot file, end stops, files for a service.

In: robot files and ports. Out: tables, reports, files. Imports base to tools; only preflight and the search for end
stops move a servo.
"""
