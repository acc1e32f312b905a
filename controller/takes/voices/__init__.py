"""Turns the sound of voices into samples, features and shapes of the mouth.

In: bytes of sound. Out: samples, weights of visemes. Imports base, vocabulary.
"""
