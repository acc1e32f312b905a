"""Recorded faces and voices: Live Link Face takes, speech, recordings of one's own.

In: files and sound. Out: values of parameters over time. Imports base to links.
"""
