"""Generates idle motion: what a face does without commands, and what accompanies its own speech.

In: settings of ``configs/life``, a seed, time, and the loudness of the face's speech. Out: values that are added to the
face. :class:`controller.layers.idle.motion.IdleMotion` joins the other modules, each of which has one behaviour. Every
behaviour has its own seeded random numbers and schedules its events by time, so that the tick rate does not change
them. Imports base to vocabulary.
"""
