"""Generates idle motion: what a face does without commands, and along with its own speech.

In: settings of ``configs/life``, a seed, time, how loud the face speaks. Out: values that are added to the face.
:class:`controller.layers.idle.motion.IdleMotion` joins the other modules, each of one behaviour. Every behaviour draws
from its own seeded numbers, and its events follow each other in time and not in ticks: the rate of ticks does not
change them. Imports base to vocabulary.
"""
