"""Readers of surface files: each turns its file into control points with local knots."""
