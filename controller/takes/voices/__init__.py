"""Turns the sound of a voice into samples, features and mouth shapes.

In: bytes of sound. Out: samples, weights of visemes. Imports base, vocabulary.
"""
