"""Reads recorded faces and voices: takes of Live Link Face, speech, recordings of omote.

In: files and sound. Out: values of parameters over time. Imports base to links.
"""
